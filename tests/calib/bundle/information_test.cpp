// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/information.h"

#include <array>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace kinescope::bundle {
namespace {

constexpr double kRounding = 1e-10;  // of matrices of some 1

// Seven parameters, of which 1, 3 and 4 bear on a few frames each.
ParameterPlaces some_local() {
  return {{1, 3, 4},
          {0, 2, 5, 6},
          {0, 0, 1, 1, 2, 2, 3},
          {false, true, false, true, true, false, false}};
}

std::vector<FrameRows> random_frames() {
  std::mt19937 random(7);
  std::normal_distribution<double> gauss;
  std::vector<FrameRows> out;
  for (int frame = 0; frame < 12; ++frame) {
    const Eigen::Index local = std::array{1, 3, 4}[static_cast<std::size_t>(frame / 4)];
    FrameRows rows;
    for (const Eigen::Index column : {0, 1, 2, 3, 4, 5, 6})
      if (!some_local().is_local[static_cast<std::size_t>(column)] || column == local)
        rows.shown.push_back(column);
    rows.J = Eigen::MatrixXd::NullaryExpr(4, std::ssize(rows.shown), [&] { return gauss(random); });
    rows.r = Eigen::VectorXd::Zero(4);
    out.push_back(std::move(rows));
  }
  return out;
}

Eigen::SparseMatrix<double> priors() {
  Eigen::SparseMatrix<double> out(7, 7);
  const std::vector<Eigen::Triplet<double>> entries{
      {1, 1, 4.0}, {3, 3, 5.0}, {4, 4, 6.0}, {5, 5, 2.0}, {6, 6, 3.0}, {5, 6, 0.5}, {6, 5, 0.5}};
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

Eigen::MatrixXd dense_information() {
  Eigen::MatrixXd out = priors();
  for (const FrameRows& rows : random_frames()) out += rows.dense(7).transpose() * rows.dense(7);
  return out;
}

Information information(const ParameterPlaces& places) {
  Information out(places);
  for (const FrameRows& rows : random_frames()) out.add(rows);
  out.add(priors(), [](Eigen::Index, Eigen::Index) { return true; });
  return out;
}

TEST(Information, GivesRowsOfTheInverseOfTheWhole) {
  const ParameterPlaces places = some_local();
  std::vector<bool> unseen(places.other.size(), false);
  const Eigen::MatrixXd rows = information(places).covariance_rows(unseen);
  const Eigen::MatrixXd whole = dense_information().inverse();
  EXPECT_TRUE(rows.isApprox(whole(places.other, Eigen::all), kRounding)) << rows << "\n\n" << whole;
  EXPECT_EQ(unseen, std::vector<bool>(places.other.size(), false));
}

TEST(Information, OfTheOthersIsTheInverseOfTheirCovariance) {
  const ParameterPlaces places = some_local();
  const Eigen::MatrixXd whole = dense_information().inverse();
  EXPECT_TRUE(information(places).reduced().isApprox(
      Eigen::MatrixXd(whole(places.other, places.other)).inverse(), kRounding));
}

TEST(Information, AddsThePriorsThatAreMeant) {
  const ParameterPlaces places{
      {}, {0, 1, 2, 3, 4, 5, 6}, {0, 1, 2, 3, 4, 5, 6}, std::vector<bool>(7, false)};
  Information meant(places);
  meant.add(priors(), [](Eigen::Index i, Eigen::Index j) { return i < 5 && j < 5; });
  Eigen::MatrixXd expected = priors();
  expected.bottomRightCorner<2, 2>().setZero();
  EXPECT_TRUE(meant.reduced().isApprox(expected));
  meant.add(priors(), [](Eigen::Index i, Eigen::Index j) { return i >= 5 || j >= 5; });
  EXPECT_TRUE(meant.reduced().isApprox(Eigen::MatrixXd(priors())));
}

TEST(Information, MarksWhatNothingShows) {
  const ParameterPlaces places{{}, {0, 1, 2}, {0, 1, 2}, std::vector<bool>(3, false)};
  Information one(places);
  one.add(FrameRows{{0, 2}, Eigen::Matrix2d::Identity(), Eigen::Vector2d::Zero()});
  std::vector<bool> unseen(3, false);
  const Eigen::MatrixXd rows = one.covariance_rows(unseen);
  EXPECT_EQ(unseen, (std::vector<bool>{false, true, false}));
  EXPECT_TRUE(rows.isApprox(Eigen::MatrixXd(Eigen::Vector3d(1.0, 0.0, 1.0).asDiagonal())));
}

}  // namespace
}  // namespace kinescope::bundle
