// SPDX-License-Identifier: Apache-2.0
#include "app/explain/fit_nominal.h"

#include <array>
#include <set>
#include <utility>

namespace kinescope {
namespace {

using enum FreeGeometry;
constexpr std::array kLevels{kPlacement, kOffsets, kGeometry};

struct TracedLevel {
  std::size_t row = 0;  // of the fits compared
  TracedCalibration whole;
};

}  // namespace

NominalFit fit_nominal(
    const Measurements& measurements, std::optional<FreeGeometry> only,
    const std::function<Calibration(FreeGeometry)>& calibrated,
    const std::function<TracedCalibration(FreeGeometry, const Calibration&)>& traced) {
  std::vector<Calibration> plain;
  std::vector<LevelFit> fits;
  for (const FreeGeometry free : kLevels) plain.push_back(calibrated(free));
  for (std::size_t k = 0; k < plain.size(); ++k) fits.push_back({kLevels[k], 0, &plain[k]});
  std::set<std::size_t> levels = {static_cast<std::size_t>(only.value_or(kGeometry))};
  if (!only) levels.insert(best_level(fits, measurements));
  std::vector<TracedLevel> wholes;
  wholes.reserve(levels.size());  // fits refer to them
  std::vector<LevelFit> rivals;
  for (const std::size_t level : levels) {
    wholes.push_back({level, traced(kLevels[level], plain[level])});
    TracedLevel& added = wholes.back();
    if (!added.whole.effects.empty()) {
      added.row = fits.size();
      fits.push_back(
          {kLevels[level], static_cast<int>(added.whole.effects.size()), &added.whole.calibration});
    }
    rivals.push_back(fits[added.row]);
  }
  TracedLevel& best = wholes[best_level(rivals, measurements)];
  std::vector<FreedomLevel> compared = compare_levels(fits, best.row, measurements);
  return {std::move(best.whole), std::move(compared)};
}

}  // namespace kinescope
