// SPDX-License-Identifier: Apache-2.0
//
// Local parameters that are eliminated part by part leave what they leave as columns of the model.
#include "calib/trace/local_elimination.h"

#include <map>
#include <utility>

#include <gtest/gtest.h>

#include "calib/trace/held_out.h"
#include "calib/trace/score_test.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/rng.h"
#include "tests/calib/trace/linear_model.h"

namespace kinescope::trace {
namespace {

constexpr int kLocals = 3;  // of a stretch and fold

// Normal equations lose half of a double's digits, twice solved, and a ridge of 1e-11 stands on
// their scaled diagonal.
constexpr double kAlike = 1e-6;

struct TwoModels {
  Linearisation eliminated;  ///< its local parameters apart
  Linearisation whole;       ///< all of them columns
};

// Away from its solution; each local parameter bears on every third instant of one part.
TwoModels two_models() {
  TwoModels out;
  out.eliminated = linear_model();
  Linearisation& linear = out.eliminated;
  const Eigen::Index rows = linear.residual.size();
  const Partition partition = make_partition(linear);

  Rng rng = Rng::from_name("local elimination");
  std::map<std::pair<int, int>, int> first;
  std::vector<Eigen::Triplet<double>> local;
  for (Eigen::Index row = 0; row < rows; ++row) {
    const auto i = static_cast<std::size_t>(row / kRowsPerInstant);
    const auto number = static_cast<int>(first.size()) * kLocals;
    const int begin =
        first.try_emplace({partition.stretch[i], partition.fold[i]}, number).first->second;
    local.emplace_back(static_cast<int>(row), begin + static_cast<int>(i % kLocals), rng.normal());
  }
  const auto locals = static_cast<Eigen::Index>(first.size()) * kLocals;
  linear.local.resize(rows, locals);
  linear.local.setFromTriplets(local.begin(), local.end());
  linear.local_information = Eigen::VectorXd::Constant(locals, 0.7);
  linear.local_prediction = Eigen::VectorXd::Zero(rows);
  linear.local_residual = Eigen::VectorXd::Zero(rows);

  out.whole = linear;
  out.whole.local.resize(0, 0);
  out.whole.local_prediction.resize(0);
  out.whole.jacobian.resize(rows, kParameters + locals);
  out.whole.jacobian << Eigen::MatrixXd(linear.local), linear.jacobian;
  out.whole.prior = Eigen::MatrixXd::Zero(kParameters + locals, kParameters + locals);
  out.whole.prior.diagonal() << linear.local_information, linear.prior.diagonal();
  return out;
}

class LocalEliminationTest : public ::testing::Test {
 protected:
  const TwoModels models_ = two_models();
  const NormalSystem eliminated_{models_.eliminated, make_partition(models_.eliminated)};
  const NormalSystem whole_{models_.whole, make_partition(models_.eliminated)};
};

TEST_F(LocalEliminationTest, TheOtherParametersAndTheirCovarianceAreThose) {
  EXPECT_EQ(eliminated_.parameters(), kParameters);
  EXPECT_LT(relative(eliminated_.step(), whole_.step().tail(kParameters)), kAlike);
  EXPECT_LT(
      relative(eliminated_.inverse(), whole_.inverse().bottomRightCorner(kParameters, kParameters)),
      kAlike);
  EXPECT_LT(relative(jackknife_covariance(eliminated_, kParameters),
                     jackknife_covariance(whole_, kParameters)),
            kAlike);
}

TEST_F(LocalEliminationTest, AnEffectIsFoundAsBesideColumns) {
  const Score eliminated = jackknife_test(eliminated_, effect());
  const Score whole = jackknife_test(whole_, effect());
  EXPECT_EQ(eliminated.rank, whole.rank);
  EXPECT_LT(relative(eliminated.theta, whole.theta), kAlike);
  EXPECT_LT(relative(eliminated.covariance, whole.covariance), kAlike);
  EXPECT_NEAR(eliminated.gain, whole.gain, kAlike * whole.gain);
  EXPECT_NEAR(eliminated.rms, whole.rms, kAlike * whole.rms);
  const std::vector<double> gains = gains_of(eliminated_, {effect(), {effect()[0]}});
  EXPECT_NEAR(gains[0], gain_of(whole_, effect()), kAlike * gains[0]);
  EXPECT_NEAR(gains[1], gain_of(whole_, {effect()[0]}), kAlike * gains[0]);
}

// The rows as if their noise had what the local parameters add to it, whitened (Rao 1973, 4a.2);
// the carriers are the effect's columns.
Linearisation with_more_noise(const Linearisation& linear) {
  const Eigen::MatrixXd C(linear.local);
  const Eigen::MatrixXd noise =
      Eigen::MatrixXd::Identity(C.rows(), C.rows()) +
      C * linear.local_information.cwiseInverse().asDiagonal() * C.transpose();
  const SymmetricEigen eigen = symmetric_eigen(noise);
  const Eigen::MatrixXd W = eigen.vectors * eigen.values.cwiseSqrt().cwiseInverse().asDiagonal() *
                            eigen.vectors.transpose();
  Linearisation out = linear;
  out.local.resize(0, 0);
  out.local_prediction.resize(0);
  out.residual = W * linear.residual;
  out.jacobian = W * linear.jacobian;
  out.carriers = Eigen::MatrixXd(W * explicit_columns(linear, effect())).sparseView();
  return out;
}

TEST_F(LocalEliminationTest, AnEffectIsJudgedAsBesideMoreNoise) {
  const Linearisation noisy = with_more_noise(models_.eliminated);
  const NormalSystem system(noisy, make_partition(models_.eliminated));
  const Score eliminated = score_test(eliminated_, effect());
  const Score expected = score_test(system, {{0, {}}, {1, {}}});
  EXPECT_LT(relative(eliminated.theta, expected.theta), kAlike);
  EXPECT_LT(relative(eliminated.covariance, expected.covariance), kAlike);
  EXPECT_NEAR(eliminated.statistic, expected.statistic, kAlike * expected.statistic);
  EXPECT_NEAR(eliminated.gain, expected.gain, kAlike * expected.gain);
}

TEST_F(LocalEliminationTest, RowsThatAnEffectTouchesKeepTheSameSquares) {
  const Eigen::VectorXd theta = Eigen::Vector2d(0.3, -0.2);
  const Eigen::VectorXd delta = Eigen::Vector4d(0.1, 0.2, -0.3, 0.4);
  const std::vector<EffectColumn> everywhere{{0, {}}, {2, {}}};
  // The local parameters at their best beside these.
  const Eigen::VectorXd moved = eliminated_.moved_by(everywhere, theta);
  const Linearisation& whole = models_.whole;
  const Eigen::Index locals = whole.jacobian.cols() - kParameters;
  const Eigen::MatrixXd C = whole.jacobian.leftCols(locals);
  const Eigen::VectorXd left =
      whole.residual - moved - whole.jacobian.rightCols(kParameters) * delta;
  Eigen::MatrixXd normal = C.transpose() * C;
  normal.diagonal() += models_.eliminated.local_information;
  const Eigen::VectorXd best = solve_symmetric(normal, Eigen::VectorXd(C.transpose() * left));
  const NormalSystem::Touched touched = eliminated_.touched_after(delta, everywhere, theta);
  EXPECT_EQ(touched.rows, static_cast<double>(left.size()));
  EXPECT_NEAR(touched.squares, (left - C * best).squaredNorm(), kAlike * left.squaredNorm());
}

TEST_F(LocalEliminationTest, UnseenFoldsAreForetoldWithoutThem) {
  const HeldOutInstants eliminated = held_out_instants(eliminated_, effect());
  const HeldOutInstants whole = held_out_instants(whole_, effect());
  EXPECT_LT(relative(eliminated.whitened, whole.whitened), kAlike);
}

TEST_F(LocalEliminationTest, TheirFreedomIsWhatTheirPriorsLeaveThem) {
  const Linearisation& linear = models_.eliminated;
  const Eigen::MatrixXd C(linear.local);
  Eigen::MatrixXd normal = C.transpose() * C;
  Eigen::MatrixXd with_priors = normal;
  with_priors.diagonal() += linear.local_information;
  const double determined = solve_symmetric(with_priors, normal).trace();
  EXPECT_NEAR(eliminated_.spent(), kParameters + determined, kAlike * determined);
}

}  // namespace
}  // namespace kinescope::trace
