// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/trace_camera_worlds.h"

#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>

namespace kinescope {

using truth::EffectWorldOptions;
using truth::InjectedEffect;
using truth::World;

EffectWorldOptions world_options(const TraceCase& of) {
  EffectWorldOptions options;
  options.seed = 7000 + static_cast<std::uint64_t>(of.seed);
  options.kind = of.kind;
  options.frames = of.frames;
  // Fewer frames show the same motion at a lower rate.
  options.frame_rate_hz = of.frames / 33.0;
  options.sigma_px = of.sigma_px;
  if (of.realistic) {
    options.correlated_share = 0.2;
    options.detector_bias_px = 0.02;
    options.encoder_step_rad = 2.0 * std::numbers::pi / 65536.0;
  }
  return options;
}

World world_with(const TraceCase& of, const std::vector<InjectedEffect>& effects) {
  EffectWorldOptions options = world_options(of);
  options.effects = effects;
  return truth::make_effect_world(options);
}

std::optional<InjectedEffect> pick_effect(std::string_view effect, double strength,
                                          const TraceCase& of) {
  const auto places = truth::weakest_effects(effect, truth::robot_of(world_options(of)));
  return one_of(places, strength,
                Rng::from_name(fmt::format("place of {} {}", effect, to_string(of.kind)),
                               static_cast<std::uint64_t>(of.seed)));
}

std::optional<InjectedEffect> one_of(const std::vector<InjectedEffect>& places, double strength,
                                     Rng rng) {
  if (places.empty()) return std::nullopt;
  InjectedEffect out = places[static_cast<std::size_t>(rng.index(static_cast<int>(places.size())))];
  out.size *= strength;
  return out;
}

std::string describe(const InjectedEffect& effect) {
  std::string out = fmt::format("{} {} {:.4g}", effect.effect, effect.place, effect.size);
  if (effect.detail != 0.0) out += fmt::format(" ({:.3g})", effect.detail);
  if (!effect.with.empty()) out += fmt::format(" with {}", effect.with);
  return out;
}

CalibrationStart start_of(const World& world, const TraceCase& of) {
  return truth::perturbed_start(world, 0.005, 0.001, static_cast<std::uint64_t>(of.seed));
}

namespace {

void as_a_tracker_sees(Measurements& measurements) {
  measurements.corners.clear();
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(kTrackerSigmaRad * kTrackerSigmaRad);
  covariance.diagonal().tail<3>().setConstant(kTrackerSigmaM * kTrackerSigmaM);
  for (PoseTrack& track : measurements.poses.tracks) {
    for (PoseSample& sample : track.samples) sample.covariance = covariance;
  }
}

}  // namespace

double visibility(const InjectedEffect& effect, const TraceCase& of) {
  EffectWorldOptions options = world_options(of);
  options.effects = {};
  return visibility(effect, options, of.sigma_px);
}

double visibility(const InjectedEffect& effect, const EffectWorldOptions& world, double sigma_px) {
  CalibrateOptions options;
  options.folds = 0;
  options.reject_sigma = 1e9;  // what an effect throws off is the effect
  options.estimate_time_offset = effect.place != "clock" && !world.poses;
  const auto calibrated = [&](const std::vector<InjectedEffect>& effects) {
    EffectWorldOptions with = world;
    with.effects = effects;
    World made = truth::make_effect_world(with);
    if (with.poses) as_a_tracker_sees(made.measurements);
    return calibrate(made.measurements, made.markers, made.log,
                     truth::perturbed_start(made, 0.005, 0.001, world.seed), options);
  };
  const Calibration clean = calibrated({});
  const Calibration with = calibrated({effect});
  std::map<std::pair<int, TagId>, const SightingResidual*> there;
  for (const SightingResidual& r : clean.residuals) {
    if (r.used) there[{r.frame, r.id}] = &r;
  }
  // Noise is the same in both: what differs is what the effect leaves.
  double sum = 0.0;
  for (const SightingResidual& r : with.residuals) {
    const auto twin = there.find({r.frame, r.id});
    if (!r.used || twin == there.end()) continue;
    const Vector6d moved = r.displacement - twin->second->displacement;
    if (world.poses) {
      sum += moved.head<3>().squaredNorm() / (kTrackerSigmaRad * kTrackerSigmaRad) +
             moved.tail<3>().squaredNorm() / (kTrackerSigmaM * kTrackerSigmaM);
    }
    for (std::size_t c = 0; c < r.corners_px.size(); ++c)
      sum += (r.corners_px[c] - twin->second->corners_px[c]).squaredNorm() / (sigma_px * sigma_px);
  }
  return std::sqrt(sum);
}

}  // namespace kinescope
