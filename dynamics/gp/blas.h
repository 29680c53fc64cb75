// SPDX-License-Identifier: Apache-2.0
//
// The few BLAS and LAPACK calls of this room, on column-major blocks. Every call runs on one thread
// (`SingleThreadedBlas`): OpenBLAS cuts a product by its number of threads and so changes the last
// bits; here the work is cut into tiles of fixed size that workers share, so that results have the
// same bytes on any number of threads.
#pragma once

#include <string>

#include <Eigen/Core>

#include "kinematics/core/single_threaded_blas.h"

namespace kinescope::gp {

using Block = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
using ConstBlock = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

/// c = alpha * a * b' + beta * c.
void product_transposed(double alpha, const ConstBlock& a, const ConstBlock& b, double beta,
                        Block c);
/// c = alpha * a * b + beta * c.
void product(double alpha, const ConstBlock& a, const ConstBlock& b, double beta, Block c);
/// c = alpha * a' * b + beta * c.
void transposed_product(double alpha, const ConstBlock& a, const ConstBlock& b, double beta,
                        Block c);
/// Lower triangle of c = alpha * a * a' + beta * c.
void add_square(double alpha, const ConstBlock& a, double beta, Block c);

/// b = l^-1 b, with l lower triangular (only its lower triangle is read).
void solve_lower(const ConstBlock& l, Block b);
/// b = l'^-1 b.
void solve_lower_transposed(const ConstBlock& l, Block b);
/// b = b l'^-1.
void solve_lower_transposed_right(const ConstBlock& l, Block b);
/// b = b l^-1.
void solve_lower_right(const ConstBlock& l, Block b);

/// Cholesky factor in place (lower triangle). Returns 0, or the 1-based row whose pivot is not
/// positive.
[[nodiscard]] int cholesky(Block a);
/// Inverse of a lower triangle in place.
void invert_lower(Block l);
/// QR in place: the upper triangle of the first min(rows, columns) rows becomes R, with a
/// diagonal >= 0; the rest is undefined.
void upper_of_qr(Eigen::MatrixXd& a);

/// What OpenBLAS runs on ("Haswell", "SkylakeX").
[[nodiscard]] std::string blas_core();

}  // namespace kinescope::gp
