// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/barrett.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/experiments/quartiles.h"
#include "dynamics/gp/leave_out.h"
#include "dynamics/gp/robust.h"
#include "dynamics/identify/model_features.h"
#include "dynamics/identify/payload.h"
#include "dynamics/models/support_vectors.h"
#include "kinematics/core/rng.h"

namespace kinescope::experiments {
namespace {

using Vector = Eigen::VectorXd;

constexpr int kFolds = 10;
constexpr double kTrimmedShare = 0.1;
constexpr double kMiddle_rad = 1.3;  // of all motions
constexpr double kGravitySpeed_rad_s = 0.4;
constexpr double kGravityReach_rad = 0.7;  // about the middle, where the motions are that fast
constexpr double kProfileSpeed_rad_s = 0.8;
constexpr int kProfilePoints = 33;

double rms(const Vector& error) {
  return error.norm() / std::sqrt(static_cast<double>(error.size()));
}

gp::Dataset dataset_of(const TorqueSamples& samples) {
  return {motion_inputs(samples.q, samples.dq, samples.ddq), samples.torque, {}, {}};
}

// Variance 1 of standardised torques.
gp::GpModel model_of(const gp::Dataset& data, const GridPoint& at) {
  gp::GpModel model = gp::make_model(
      gp::rbf(gp::first_columns(3), gp::LengthScales::kOneEach, gp::Amplitude::kUnit),
      at.noise * at.noise, gp::standardise(data));
  const Eigen::Vector3d scales(at.length, at.speed, at.length);
  model.kernel = model.kernel.with_log_values(scales.array().log().matrix());
  return model;
}

Vector mean_at(const gp::FittedGp& fitted, const Vector& q, const Vector& dq, const Vector& ddq) {
  return gp::predict(fitted, motion_inputs(q, dq, ddq), {.variance = false}).mean;
}

// Each sample in a chunk by lot: neighbours in time are on both sides.
std::vector<int> random_chunks(Eigen::Index samples, std::uint64_t seed) {
  Rng rng = Rng::from_name("barrett chunks", seed);
  std::vector<int> out;
  for (Eigen::Index i = 0; i < samples; ++i) out.push_back(static_cast<int>(i % kFolds));
  for (std::size_t i = out.size(); i-- > 1;) {
    std::swap(out[i], out[static_cast<std::size_t>(rng.index(static_cast<int>(i) + 1))]);
  }
  return out;
}

std::vector<GridPoint> try_grid(const gp::Dataset& data, std::uint64_t seed, int threads,
                                const Progress& progress) {
  static constexpr std::array kLengths = {0.5, 1.0, 2.0, 5.0};
  static constexpr std::array kSpeeds = {0.05, 0.1, 0.2, 0.5, 1.0, 3.0};
  static constexpr std::array kNoises = {0.02, 0.05, 0.1, 0.2};
  const std::vector<int> chunks = random_chunks(data.samples(), seed);
  const std::vector<int> blocks = gp::consecutive_folds(data.samples(), kFolds);
  std::vector<GridPoint> out;
  for (const double speed : kSpeeds) {
    for (const double length : kLengths) {
      for (const double noise : kNoises)
        out.push_back({.length = length, .speed = speed, .noise = noise});
    }
  }
  const int all = static_cast<int>(out.size());
  for (int k = 0; k < all; ++k) {
    report_progress(progress, "cross-validation", k, all);
    GridPoint& point = out[static_cast<std::size_t>(k)];
    const gp::FittedGp fitted = gp::fit(model_of(data, point), data, {.threads = threads});
    point.chunk_rms = rms(gp::leave_out(fitted, data, chunks, threads).residual);
    point.block_rms = rms(gp::leave_out(fitted, data, blocks, threads).residual);
  }
  report_progress(progress, "cross-validation", all, all);
  return out;
}

struct Unseen {
  BarrettLog log;
  [[nodiscard]] double error(const gp::FittedGp& fitted) const {
    const TorqueSamples& at = log.measured;
    return rms(mean_at(fitted, at.q, at.dq, at.ddq) - log.clean);
  }
};

Unseen unseen_motion(const BarrettOptions& options) {
  BarrettOptions other = options;
  ++other.seed;
  return {barrett_log({{kMiddle_rad, 0.95, 0.9}}, 200, other)};
}

GridChoice choose(const std::vector<GridPoint>& grid, double GridPoint::* error,
                  const gp::Dataset& data, const Unseen& unseen, int threads) {
  GridChoice out{*std::ranges::min_element(grid, {}, error), 0.0, 0.0};
  out.claimed_rms = out.point.*error;
  out.unseen_rms = unseen.error(gp::fit(model_of(data, out.point), data, {.threads = threads}));
  return out;
}

BarrettFit judged(std::string name, const gp::FittedGp& fitted, const gp::Dataset& used,
                  const gp::Dataset& all, const Unseen& unseen, int threads) {
  BarrettFit out{std::move(name),
                 0.0,
                 kNotMeasured,
                 unseen.error(fitted),
                 static_cast<int>(used.samples()),
                 {}};
  out.in_sample_rms =
      rms(used.targets - gp::predict(fitted, used.inputs, {.variance = false}).mean);
  out.at_log = gp::predict(fitted, all.inputs, {.variance = false}).mean;
  // Of Student's noise only in its own units of weight.
  if (used.noise_scale.size() == 0)
    out.left_out_rms = rms(gp::leave_one_out(fitted, used, threads).residual);
  return out;
}

BarrettFit by_support_vectors(const BarrettLog& log, const Unseen& unseen) {
  const FittedTorqueModel fitted = models::fit_support_vectors(log.measured);
  const auto at = [&](const TorqueSamples& samples) {
    return Vector(fitted.predict(samples.q, samples.dq, samples.ddq).mean);
  };
  BarrettFit out{"support vectors", 0.0, kNotMeasured, 0.0, static_cast<int>(log.measured.size()),
                 at(log.measured)};
  out.in_sample_rms = rms(log.measured.torque - out.at_log);
  out.unseen_rms = rms(at(unseen.log.measured) - unseen.log.clean);
  return out;
}

std::vector<FrictionPoint> friction_profile(const gp::FittedGp& fitted,
                                            const BarrettOptions& options) {
  const Vector dq = Vector::LinSpaced(kProfilePoints, -kProfileSpeed_rad_s, kProfileSpeed_rad_s);
  const Vector q = Vector::Constant(dq.size(), kMiddle_rad);
  const Vector still = Vector::Zero(dq.size());
  const Vector odd = 0.5 * (mean_at(fitted, q, dq, still) - mean_at(fitted, q, -dq, still));
  std::vector<FrictionPoint> out;
  for (Eigen::Index i = 0; i < dq.size(); ++i) {
    out.push_back({dq[i], odd[i], wam_friction(dq[i], options)});
  }
  return out;
}

// F_m over q at a fixed velocity and zero acceleration.
Vector even_part(const gp::FittedGp& fitted, const Vector& q) {
  const Vector dq = Vector::Constant(q.size(), kGravitySpeed_rad_s);
  const Vector still = Vector::Zero(q.size());
  return 0.5 * (mean_at(fitted, q, dq, still) + mean_at(fitted, q, -dq, still));
}

Vector places() {
  return Vector::LinSpaced(kProfilePoints, kMiddle_rad - kGravityReach_rad,
                           kMiddle_rad + kGravityReach_rad);
}

Vector gravity_at(double sensor_kg, const Vector& q) {
  const Vector still = Vector::Zero(q.size());
  return wam_torque(wam_arm(sensor_kg), q, still, still);
}

std::vector<GravityPoint> gravity_of(const gp::FittedGp& fitted, const BarrettOptions& options) {
  const Vector q = places();
  const Vector even = even_part(fitted, q);
  const Vector truth = gravity_at(options.sensor_kg, q);
  const Vector without = gravity_at(0.0, q);
  std::vector<GravityPoint> out;
  for (Eigen::Index i = 0; i < q.size(); ++i) out.push_back({q[i], even[i], truth[i], without[i]});
  return out;
}

// Least squares of what F_m holds beyond the arm's own gravity on that of 1 kg at the sensor.
double mass_of(const gp::FittedGp& fitted) {
  const Vector q = places();
  const Vector own = gravity_at(0.0, q);
  const Vector of_one_kg = gravity_at(1.0, q) - own;
  return of_one_kg.dot(even_part(fitted, q) - own) / of_one_kg.squaredNorm();
}

// Block jackknife: neighbouring samples err alike.
SensorMass weigh(const gp::FittedGp& fitted, const gp::Dataset& used, int threads) {
  const std::vector<int> blocks = gp::consecutive_folds(used.samples(), kFolds);
  Vector masses(kFolds);
  for (int b = 0; b < kFolds; ++b) {
    std::vector<Eigen::Index> kept;
    for (Eigen::Index i = 0; i < used.samples(); ++i) {
      if (blocks[static_cast<std::size_t>(i)] != b) kept.push_back(i);
    }
    masses[b] = mass_of(gp::fit(fitted.model, gp::subset(used, kept), {.threads = threads}));
  }
  SensorMass out{.kg = mass_of(fitted)};
  out.sigma_kg =
      std::sqrt((kFolds - 1.0) / kFolds * (masses.array() - masses.mean()).square().sum());
  const double half = student_point(kFolds - 1) * out.sigma_kg;
  out.lower_kg = out.kg - half;
  out.upper_kg = out.kg + half;
  return out;
}

std::vector<Eigen::Index> all_but(const std::vector<Eigen::Index>& removed, Eigen::Index samples) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index i = 0; i < samples; ++i) {
    if (!std::ranges::binary_search(removed, i)) out.push_back(i);
  }
  return out;
}

}  // namespace

BarrettResult run_barrett(const BarrettOptions& options, int threads, const Progress& progress) {
  BarrettResult out;
  out.log = barrett_log(wam_motions(), options.samples, options);
  const Unseen unseen = unseen_motion(options);
  const gp::Dataset data = dataset_of(out.log.measured);
  out.grid = try_grid(data, options.seed, threads, progress);
  out.by_chunks = choose(out.grid, &GridPoint::chunk_rms, data, unseen, threads);
  out.by_blocks = choose(out.grid, &GridPoint::block_rms, data, unseen, threads);

  const gp::FitOptions fit{.threads = threads};
  const gp::GpModel model = model_of(data, out.by_blocks.point);
  out.fits.push_back(judged("all samples", gp::fit(model, data, fit), data, data, unseen, threads));
  const gp::TrimmedFit trimmed = gp::fit_trimmed(model, data, {.share = kTrimmedShare, .fit = fit});
  const gp::Dataset kept = gp::subset(data, all_but(trimmed.removed, data.samples()));
  out.fits.push_back(judged("worst tenth out", trimmed.fitted, kept, data, unseen, threads));
  gp::Dataset weighted = data;
  const gp::RobustFit student = gp::fit_student(model, data, {.fit = fit});
  weighted.noise_scale = student.weight.cwiseInverse();
  out.fits.push_back(judged("Student's t", student.fitted, weighted, data, unseen, threads));
  report_progress(progress, "support vectors", 0, 1);
  out.fits.push_back(by_support_vectors(out.log, unseen));
  report_progress(progress, "support vectors", 1, 1);

  out.removed = static_cast<int>(trimmed.removed.size());
  for (const int row : out.log.wrong) {
    if (std::ranges::binary_search(trimmed.removed, Eigen::Index{row})) ++out.removed_wrong;
  }
  out.friction = friction_profile(trimmed.fitted, options);
  out.gravity_dq = kGravitySpeed_rad_s;
  out.gravity = gravity_of(trimmed.fitted, options);
  out.sensor = weigh(trimmed.fitted, kept, threads);
  return out;
}

}  // namespace kinescope::experiments
