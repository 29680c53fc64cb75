// SPDX-License-Identifier: Apache-2.0
//
// Debian's Ceres names ATLAS, which wins the BLAS symbols unless OpenBLAS stands before it on the
// link line.
#include <cstdio>
#include <string>

#include <dlfcn.h>
#include <gtest/gtest.h>

#include "calib/bundle/calibrate.h"

extern "C" void dgemm_();

namespace kinescope {
namespace {

std::string needed_libraries(const std::string& program) {
  std::string text;
  FILE* pipe = ::popen(("ldd '" + program + "'").c_str(), "r");
  if (pipe == nullptr) return text;
  char line[512];
  while (std::fgets(line, sizeof line, pipe) != nullptr) text += line;
  ::pclose(pipe);
  return text;
}

TEST(Blas, MatrixProductsGoToOpenBlas) {
  // Something of the room that links Ceres, so that its libraries are on this program's link line
  // too.
  ASSERT_GT(CalibrateOptions{}.max_iterations, 0);
  Dl_info info{};
  ASSERT_NE(::dladdr(reinterpret_cast<void*>(&dgemm_), &info), 0);
  EXPECT_NE(std::string(info.dli_fname).find("openblas"), std::string::npos) << info.dli_fname;
}

TEST(Blas, TheProgramNeedsNoAtlas) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "ldd cannot run a program with the address sanitizer in it";
#endif
  const std::string libraries = needed_libraries(KINESCOPE_PROGRAM);
  EXPECT_NE(libraries.find("libopenblas"), std::string::npos) << libraries;
  EXPECT_EQ(libraries.find("atlas"), std::string::npos) << libraries;
  EXPECT_EQ(libraries.find("f77blas"), std::string::npos) << libraries;
}

}  // namespace
}  // namespace kinescope
