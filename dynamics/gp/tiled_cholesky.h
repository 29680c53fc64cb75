// SPDX-License-Identifier: Apache-2.0
//
// Cholesky factor and inverse of large matrices in tiles of fixed size, shared by workers: the same
// bytes on any number of threads, at the speed of dpotrf (tests/bench/gp_bench.cpp).
#pragma once

#include "dynamics/gp/workers.h"

namespace kinescope::gp {

/// Lower Cholesky factor in place. The strict upper triangle becomes zero. Returns 0, or the
/// 1-based row whose pivot is not positive.
[[nodiscard]] Eigen::Index tiled_cholesky(Workers& workers, Block a);

/// Inverse of a lower triangle in place; its strict upper triangle must be zero. Needs a panel of
/// rows x 256 beside it.
void tiled_invert_lower(Workers& workers, Block l);

}  // namespace kinescope::gp
