// SPDX-License-Identifier: Apache-2.0
#include "calib/design/exchange.h"

#include <cmath>

#include <gtest/gtest.h>

#include "calib/design/information.h"
#include "calib/design/rivals.h"
#include "kinematics/core/rng.h"

namespace kinescope::design {
namespace {

// A line through points of a segment: the best designs are known.
DesignProblem line_problem(const std::vector<double>& places) {
  DesignProblem out;
  out.known = 1e-6 * Eigen::Matrix2d::Identity();
  for (const double x : places) {
    const Eigen::Vector2d row(1.0, x);
    out.candidates.emplace_back(row * row.transpose());
  }
  out.criterion = [](const Eigen::MatrixXd& information) {
    return variance_of(information, Eigen::Vector2d(0.0, 1.0));
  };
  return out;
}

// Of a slope: half of the measurements at either end (Fedorov 1972, section 2.3).
TEST(Exchange, MeasuresASlopeAtBothEnds) {
  const std::vector<double> places{-1.0, -0.5, 0.1, 0.4, 1.0};
  std::vector<std::size_t> chosen = choose_candidates(line_problem(places), 6);
  std::ranges::sort(chosen);
  EXPECT_EQ(chosen, (std::vector<std::size_t>{0, 0, 0, 4, 4, 4}));
}

TEST(Exchange, HeldOnesStayAndCount) {
  const std::vector<double> places{-1.0, 0.0, 1.0};
  std::vector<std::size_t> chosen = choose_candidates(line_problem(places), 2, {0, 0});
  EXPECT_EQ(chosen, (std::vector<std::size_t>{2, 2}));
}

// What is greatest is least with its sign turned.
TEST(Exchange, EndsWhereNothingIsBetterAlsoOfNegativeNumbers) {
  int asked = 0;
  DesignProblem problem = line_problem({-1.0, 1.0});
  problem.criterion = [&asked](const Eigen::MatrixXd& information) {
    ++asked;
    return -information.trace();
  };
  static_cast<void>(choose_candidates(problem, 2));
  // All candidates are alike: at first, for each of two, and once more to see that none is better.
  EXPECT_EQ(asked, 1 + 2 * 2 + 2 * 2);
}

TEST(Exchange, IsNoWorseThanAnyOtherChoiceOfAFewRandomOnes) {
  Rng rng(3);
  DesignProblem problem;
  problem.known = 0.1 * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d row = rng.normal3();
    problem.candidates.emplace_back(row * row.transpose());
  }
  problem.criterion = [](const Eigen::MatrixXd& information) {
    return variance_of(information, Eigen::Matrix3d::Identity());
  };
  const auto value = [&](const std::vector<std::size_t>& chosen) {
    Eigen::MatrixXd sum = problem.known;
    for (const std::size_t i : chosen) sum += problem.candidates[i];
    return problem.criterion(sum);
  };
  double best = 1e9;
  for (std::size_t a = 0; a < 12; ++a)
    for (std::size_t b = a; b < 12; ++b)
      for (std::size_t c = b; c < 12; ++c) best = std::min(best, value({a, b, c}));
  EXPECT_NEAR(value(choose_candidates(problem, 3)), best, 1e-12);
}

TEST(Information, OfTwoRecordingsAdds) {
  Rng rng(7);
  Eigen::MatrixXd J(9, 4);
  for (double& entry : J.reshaped()) entry = rng.normal();
  const Eigen::MatrixXd whole = information_of(J, 1.0);
  const Eigen::MatrixXd parts =
      information_of(J.topRows(5), 1.0) + information_of(J.bottomRows(4), 1.0);
  EXPECT_LT((whole - parts).norm(), 1e-12 * whole.norm());
  EXPECT_LT((covariance_of(whole) * whole - Eigen::Matrix4d::Identity()).norm(), 1e-10);
  EXPECT_NEAR(variance_of(2.0 * whole, Eigen::Matrix4d::Identity()),
              0.5 * covariance_of(whole).trace(), 1e-12);
  EXPECT_LT((information_of(J, 4.0) - 0.25 * whole).norm(), 1e-12 * whole.norm());
}

// Units that differ by ten powers of ten do not spoil the inverse.
TEST(Information, IsScaledBeforeItIsInverted) {
  const Eigen::Vector3d units(1e-8, 1.0, 1e6);
  Eigen::Matrix3d plain;
  plain << 2.0, 0.5, 0.1, 0.5, 1.0, 0.2, 0.1, 0.2, 3.0;
  const Eigen::MatrixXd scaled = units.asDiagonal() * plain * units.asDiagonal();
  const Eigen::MatrixXd back = units.asDiagonal() * covariance_of(scaled) * units.asDiagonal();
  EXPECT_LT((back - plain.inverse()).norm(), 1e-12);
}

// What a calibration did not determine at all has no variance in its covariance.
TEST(Information, OfNothingIsNoKnowledge) {
  Calibration calibration;
  calibration.tree.links = {{"base"}};
  calibration.parameters = {{"tag_1 shift x", "tag_1", "m", 0.0, 1e-3, 1e-3},
                            {"tag_1 shift y", "tag_1", "m", 0.0, 1e-3, 1e-3},
                            {"camera turn x", "camera", "rad", 0.0, 1e-3, 1e-3}};
  // x + y is known, x - y is not.
  calibration.covariance = Eigen::Matrix3d::Zero();
  calibration.covariance.topLeftCorner<2, 2>().setConstant(1e-6);
  const Eigen::MatrixXd information = known_information(calibration, calibration.parameters);
  const Eigen::Vector3d sum(1.0, 1.0, 0.0), difference(1.0, -1.0, 0.0);
  EXPECT_NEAR(sum.dot(information * sum), 1e6 + 2.0, 1.0);
  EXPECT_NEAR(difference.dot(information * difference), 2.0, 1e-3);
  EXPECT_DOUBLE_EQ(information(2, 2), 1.0);  // of a recording of its own
}

// Two columns at an angle: the rival leaves the sine of it (Atkinson and Fedorov 1975, eq. 2.2).
TEST(Rivals, AreAsFarApartAsTheAngleBetweenTheirColumns) {
  constexpr double kAngle = 0.3, kSize = 2.5;
  Eigen::MatrixXd J(3, 3);
  J.col(0) << 1.0, 0.0, 0.0;
  J.col(1) << std::cos(kAngle), std::sin(kAngle), 0.0;
  J.col(2) << 0.0, 0.0, 1.0;
  const std::vector<Parameter> parameters{{"believed", "effects", "", 0.0, {}, {}},
                                          {"other", "effects", "", 0.0, {}, {}},
                                          {"third", "effects", "", 0.0, {}, {}}};
  const Eigen::VectorXd values = Eigen::VectorXd::Constant(1, kSize);
  const RivalColumns columns = rival_columns(parameters, {"believed"}, values, {"third"});
  EXPECT_EQ(columns.nuisance, (std::vector<Eigen::Index>{1}));
  EXPECT_NEAR(sigmas_apart(J.transpose() * J, columns), kSize * std::sin(kAngle), 1e-8);
  J.col(1) = J.col(0);
  EXPECT_NEAR(sigmas_apart(J.transpose() * J, columns), 0.0, 1e-4);
}

}  // namespace
}  // namespace kinescope::design
