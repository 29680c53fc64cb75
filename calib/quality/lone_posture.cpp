// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/lone_posture.h"

#include <algorithm>
#include <cstddef>
#include <map>

namespace kinescope {
namespace {

double held_out_square(const Calibration& calibration, const SightingResidual& sighting) {
  if (calibration.kind != MeasurementKind::kCorners)
    return sighting.held_out_displacement.tail<3>().squaredNorm();
  double sum = 0.0;
  for (const Eigen::Vector2d& corner : sighting.held_out_px) sum += corner.squaredNorm();
  return sum;
}

ErrorRow errors_of(Calibration calibration, int frame, bool of_it) {
  std::erase_if(calibration.residuals, [&](const SightingResidual& sighting) {
    return (sighting.frame == frame) != of_it;
  });
  return summarise_errors(calibration).all;
}

}  // namespace

std::optional<LonePosture> lone_posture(const Calibration& calibration) {
  constexpr std::size_t kFewestFrames = 8;  // of fewer each stands alone
  std::map<int, double> squares;
  double sum = 0.0;
  for (const SightingResidual& sighting : calibration.residuals) {
    if (!sighting.used) continue;
    const double square = held_out_square(calibration, sighting);
    squares[sighting.frame] += square;
    sum += square;
  }
  if (calibration.folds < 2 || squares.size() < kFewestFrames) return std::nullopt;
  const auto most = std::ranges::max_element(squares, {}, &std::pair<const int, double>::second);
  if (!(most->second > 0.5 * sum)) return std::nullopt;
  return LonePosture{calibration.times_s[static_cast<std::size_t>(most->first)],
                     errors_of(calibration, most->first, true),
                     errors_of(calibration, most->first, false)};
}

}  // namespace kinescope
