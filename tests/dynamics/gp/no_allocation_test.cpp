// SPDX-License-Identifier: Apache-2.0
//
// A controller asks for torques a thousand times a second: after the first call the predictor must
// not touch the heap. malloc itself is counted, since Eigen and the standard library both end
// there.
#include <atomic>
#include <cstddef>

#include <gtest/gtest.h>

#include "dynamics/gp/robot_kernels.h"
#include "dynamics/gp/sparse.h"
#include "tests/dynamics/gp/gp_samples.h"

#if defined(__SANITIZE_ADDRESS__) || !defined(__GLIBC__)
#define KINESCOPE_CANNOT_COUNT
#else
namespace {
std::atomic<long> allocations = 0;
}
extern "C" {
void* __libc_malloc(std::size_t size);  // NOLINT(bugprone-reserved-identifier): glibc's name
void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
}
#endif

namespace kinescope::gp {
namespace {

#ifdef KINESCOPE_CANNOT_COUNT
TEST(Predictor, AllocatesNothing) { GTEST_SKIP() << "malloc cannot be counted here"; }
#else

long allocations_of(const FittedGp& fitted, const Eigen::MatrixXd& x) {
  Predictor predictor(fitted);
  (void)predictor.mean(x.row(0).transpose());
  (void)predictor.variance();
  const Eigen::VectorXd second = x.row(1).transpose();
  const long before = allocations;
  (void)predictor.mean(second);
  (void)predictor.variance();
  return allocations - before;
}

TEST(Predictor, TheCounterCounts) {
  const long before = allocations;
  const Eigen::VectorXd vector = Eigen::VectorXd::Zero(100);
  EXPECT_EQ(vector.sum(), 0.0);
  EXPECT_GT(allocations, before);
}

TEST(Predictor, AllocatesNothing) {
  Rng rng = Rng::from_name("no allocation");
  const Dataset data = smooth_data(rng, 400, 6, 0.1);
  const Eigen::MatrixXd x = random_matrix(rng, 2, 6);
  for (const Kernel& kernel :
       {rbf(first_columns(6)), rbf(first_columns(3)) + linear(first_columns(6)),
        gip({JointKind::kRevolute, JointKind::kPrismatic})}) {
    const GpModel model = make_model(kernel, 0.05, standardise(data));
    EXPECT_EQ(allocations_of(fit(model, data, {.route = Route::kDense}), x), 0);
    const Eigen::MatrixXd inducing = choose_inducing(model, data, {.count = 50});
    EXPECT_EQ(allocations_of(fit_sparse(model, data, inducing), x), 0);
  }
}

#endif

}  // namespace
}  // namespace kinescope::gp
