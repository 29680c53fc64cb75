// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/held_out.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "calib/bundle/folds.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope::hand_eye {
namespace {

double log_determinant(const CholeskyFactor& factor) {
  return 2.0 * factor.lower().diagonal().array().log().sum();
}

// Of a frame under parameters known to the information `seen`: normal with both.
double log_density_of(const FrameRows& rows, const Noise& noise, const Eigen::MatrixXd& seen) {
  const WhiteRows w = white(rows, noise);
  const Eigen::VectorXd s = unit_scale(seen);
  const Eigen::MatrixXd J = w.jacobian * s.asDiagonal();
  const Eigen::MatrixXd before = s.asDiagonal() * seen * s.asDiagonal();
  const CholeskyFactor prior(before);
  const CholeskyFactor posterior(before + J.transpose() * J);
  const Eigen::VectorXd g = J.transpose() * w.residual;
  const double squared = w.residual.squaredNorm() - g.dot(posterior.solve(g));
  const double volume = w.log_determinant + log_determinant(posterior) - log_determinant(prior);
  const auto n = static_cast<double>(w.residual.size());
  return -0.5 * (squared + volume + n * std::log(2.0 * std::numbers::pi));
}

}  // namespace

ClosedLoop closed_loop(const Frame& frame, const FrameRows& rows) {
  ClosedLoop out;
  double corners = 0.0;
  const Vector6d flange = flange_error(rows, {}).error;
  for (std::size_t s = 0; s < frame.sightings.size(); ++s) {
    const bundle::SightingError& error = rows.errors[s];
    const Vector6d d = rows.predicted[s].by_flange * flange;
    out.m += d.tail<3>().squaredNorm();
    out.rad += d.head<3>().squaredNorm();
    const bundle::Sighting& sighting = frame.sightings[s];
    if (sighting.kind != MeasurementKind::kCorners) continue;
    out.px += error.residual.squaredNorm() * sighting.sigma * sighting.sigma;
    corners += static_cast<double>(sighting.corners_px.size());
  }
  const auto n = static_cast<double>(frame.sightings.size());
  out.m = std::sqrt(out.m / n);
  out.rad = std::sqrt(out.rad / n);
  out.px = corners > 0.0 ? std::sqrt(out.px / corners) : 0.0;
  return out;
}

std::vector<int> folds_of(const Data& data, const PoseLog& log, int folds) {
  Eigen::MatrixXd features(static_cast<Eigen::Index>(data.frames.size()), 6);
  std::optional<Eigen::Quaterniond> first;
  for (std::size_t f = 0; f < data.frames.size(); ++f) {
    const auto at = pose_at(log, data.frames[f].time_s);
    KINESCOPE_CHECK(at.has_value(), "a frame has a pose in the log");
    if (!first) first = at->pose.rotation;
    features.row(static_cast<Eigen::Index>(f))
        << log_rotation(first->conjugate() * at->pose.rotation).transpose(),
        at->pose.translation.transpose();
  }
  return bundle::assign_folds(features, folds);
}

std::vector<HeldOutFrame> hold_out(const Model& model, const Fit& fit,
                                   const std::vector<int>& fold) {
  std::vector<HeldOutFrame> out(model.data().frames.size());
  const int folds = fold.empty() ? 0 : *std::ranges::max_element(fold) + 1;
  for (int k = 0; k < folds; ++k) {
    std::vector<std::size_t> train;
    for (const std::size_t f : fit.used)
      if (fold[f] != k) train.push_back(f);
    const Solved solved = solve(model, fit.state, fit.noise, train, false);
    if (!solved.converged) continue;
    Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(model.parameters(), model.parameters());
    for (const std::size_t f : train) {
      const auto rows = rows_of(model, solved.state, model.data().frames[f]);
      if (!rows) continue;
      const WhiteRows w = white(*rows, fit.noise);
      seen += w.jacobian.transpose() * w.jacobian;
    }
    if (!covariance_of(seen)) continue;
    for (const std::size_t f : fit.used) {
      if (fold[f] != k) continue;
      const auto rows = rows_of(model, solved.state, model.data().frames[f]);
      if (!rows) continue;
      out[f] = {true, closed_loop(model.data().frames[f], *rows),
                log_density_of(*rows, fit.noise, seen)};
    }
  }
  return out;
}

}  // namespace kinescope::hand_eye
