// SPDX-License-Identifier: Apache-2.0
#include "calib/quality/freedom_levels.h"

#include <array>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "calib/quality/predictive_score.h"

namespace kinescope {
namespace {

using Sightings = std::set<std::pair<int, TagId>>;

Sightings used_by(const Calibration& calibration) {
  Sightings out;
  for (const SightingResidual& residual : calibration.residuals)
    if (residual.used) out.emplace(residual.frame, residual.id);
  return out;
}

// Every model's errors at the same sightings, whichever it rejected itself.
ErrorRow errors_at(const Sightings& sightings, Calibration calibration) {
  for (SightingResidual& residual : calibration.residuals)
    residual.used = sightings.contains({residual.frame, residual.id});
  return summarise_errors(calibration).all;
}

bool says_something(const LevelFit& fit) {
  return fit.calibration->status == CalibrationStatus::kConverged && fit.calibration->folds > 1;
}

}  // namespace

std::size_t best_level(const std::vector<LevelFit>& fits, const Measurements& measurements) {
  std::size_t best = fits.size() - 1;
  for (std::size_t k = fits.size(); k-- > 0;) {
    if (!says_something(fits[k])) continue;
    if (!says_something(fits[best]) ||
        log_odds(predictive_score(*fits[k].calibration, measurements),
                 predictive_score(*fits[best].calibration, measurements)) > 0.0) {
      best = k;
    }
  }
  return best;
}

std::vector<FreedomLevel> compare_levels(const std::vector<LevelFit>& fits, std::size_t exported,
                                         const Measurements& measurements) {
  const Calibration& chosen = *fits[exported].calibration;
  const Sightings sightings = used_by(chosen);
  const PredictiveScore score = predictive_score(chosen, measurements);
  std::vector<FreedomLevel> out;
  for (std::size_t k = 0; k < fits.size(); ++k) {
    const Calibration& calibration = *fits[k].calibration;
    out.push_back({fits[k].free, fits[k].effects, calibration.status,
                   errors_at(sightings, calibration),
                   log_odds(predictive_score(calibration, measurements), score), k == exported});
  }
  return out;
}

std::string words_of(const FreedomLevel& level) {
  constexpr std::array<std::string_view, 3> kFree = {"only placed", "joint zeros free",
                                                     "geometry free"};
  const std::string_view free = kFree[static_cast<std::size_t>(level.free)];
  if (level.effects == 0) return std::string(free);
  return fmt::format("{} and {} effect{}", free, level.effects, level.effects == 1 ? "" : "s");
}

}  // namespace kinescope
