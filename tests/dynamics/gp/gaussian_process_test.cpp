// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/gaussian_process.h"

#include <gtest/gtest.h>

#include "dynamics/gp/likelihood.h"
#include "dynamics/gp/robot_kernels.h"
#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {
TEST(X, Y) {}
}  // namespace
}  // namespace kinescope::gp
