// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/blas_kernels.h"

#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include <cblas.h>
#include <unistd.h>

namespace kinescope {
namespace {

constexpr const char* kVariable = "OPENBLAS_CORETYPE";

VectorUnits vector_units() {
#if defined(__x86_64__)
  return {.avx2 = __builtin_cpu_supports("x86-64-v3") != 0,
          .avx512 = __builtin_cpu_supports("x86-64-v4") != 0};
#else
  return {};
#endif
}

}  // namespace

std::string_view better_blas_kernels(std::string_view chosen, VectorUnits units) {
  if (chosen != "Prescott") return "";
  if (units.avx512) return "SkylakeX";
  return units.avx2 ? "Haswell" : "";
}

void take_better_blas_kernels(char** arguments) {
  if (std::getenv(kVariable) != nullptr) return;
  const std::string kernels(better_blas_kernels(openblas_get_corename(), vector_units()));
  if (kernels.empty() || setenv(kVariable, kernels.c_str(), 0) != 0) return;
  // By its path: by the link the process would be named "exe".
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) execv(program.c_str(), arguments);
}

}  // namespace kinescope
