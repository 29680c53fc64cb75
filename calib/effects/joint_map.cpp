// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/joint_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "calib/effects/observed_range.h"
#include "calib/effects/smooth_basis.h"

namespace kinescope::effects {

CameraEffect joint_map(const Suspect& s) {
  // Down to the shortest wave that the values can follow.
  constexpr double kFinest = 64.0;
  CameraEffect out = effect(
      s, "joint_map", fmt::format("the error of {} repeats with its value", s.name), {}, s.unit);
  const double low = s.value.minCoeff();
  const double high = s.value.maxCoeff();
  const double range = high - low;
  const double finest = std::max(range / kFinest, s.step);
  out.candidate.scan.push_back(range);
  while (out.candidate.scan.back() >= std::numbers::sqrt2 * finest) {
    out.candidate.scan.push_back(out.candidate.scan.back() / std::numbers::sqrt2);
  }
  out.candidate.scan_name = "smooth over";
  out.candidate.scan_unit = s.unit;
  out.candidate.curve_over = "value of " + s.name;
  out.candidate.contains = {
      {"gear_error", s.name}, {"eccentricity", s.name}, {"encoder_scale", s.name}};
  out.candidate.check = "encoder, gear, cable drag: what turns with the joint";
  out.candidate.record = fmt::format("move {} slowly over its range", s.name);
  out.corrections = [s, low, high](double length) {
    const Eigen::MatrixXd shares = SmoothBasis(low, high, length).at(s.value);
    std::vector<Correction> corrections;
    for (Eigen::Index k = 0; k < shares.cols(); ++k) {
      corrections.push_back(
          turn(s, fmt::format("map, {} of length {:.3g}", k, length), s.unit, shares.col(k)));
    }
    return corrections;
  };
  out.table = [low, high](double length, const Eigen::MatrixXd& covariance,
                          Eigen::MatrixXd& shares) {
    // Lengths: straight lines between the points miss a draw of the process by 1.3 % of its spread
    // (rms, half-way), and as far as it reaches. Farther than it fades it is of no use.
    constexpr double kStep = 0.25;
    constexpr double kReach = 3.0;
    const double reach = std::min(kReach * length, kFadeShare * (high - low));
    const auto steps =
        static_cast<Eigen::Index>(std::ceil((high - low + 2.0 * reach) / (kStep * length)));
    ErrorTable table;
    table.value = Eigen::VectorXd::LinSpaced(steps + 1, low - reach, high + reach);
    shares = SmoothBasis(low, high, length).at(table.value);
    shares.row(0).setZero();
    shares.row(steps).setZero();
    table.sigma =
        (shares * covariance).cwiseProduct(shares).rowwise().sum().cwiseMax(0.0).cwiseSqrt();
    return table;
  };
  return out;
}

}  // namespace kinescope::effects
