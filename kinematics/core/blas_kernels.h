// SPDX-License-Identifier: Apache-2.0
//
// OpenBLAS chooses its kernels by the processor's name when it is loaded, and for one that is newer
// than itself those of 2004 (SSE3): little more than half the speed of Gaussian processes. What it
// is told to take (OPENBLAS_CORETYPE) has to stand in the environment before.
#pragma once

#include <string_view>

namespace kinescope {

/// What this processor can do.
struct VectorUnits {
  bool avx2 = false;    ///< and FMA
  bool avx512 = false;  ///< F, BW, CD, DQ, VL
};

/// The kernels to take where OpenBLAS took `chosen`; empty: those.
[[nodiscard]] std::string_view better_blas_kernels(std::string_view chosen, VectorUnits units);

/// Starts this program anew with better kernels, where there are some and the user chose none;
/// returns where it need not or cannot.
void take_better_blas_kernels(char** arguments);

}  // namespace kinescope
