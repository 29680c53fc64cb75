// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/blas_kernels.h"

#include <gtest/gtest.h>

namespace kinescope {
namespace {

TEST(BlasKernels, AreThoseOfTheProcessorWhereOpenBlasTookItsOldestOnes) {
  EXPECT_EQ(better_blas_kernels("Prescott", {.avx2 = true, .avx512 = true}), "SkylakeX");
  EXPECT_EQ(better_blas_kernels("Prescott", {.avx2 = true}), "Haswell");
  EXPECT_EQ(better_blas_kernels("Prescott", {}), "") << "a processor of that age";
  EXPECT_EQ(better_blas_kernels("Zen", {.avx2 = true, .avx512 = true}), "") << "its own choice";
}

}  // namespace
}  // namespace kinescope
