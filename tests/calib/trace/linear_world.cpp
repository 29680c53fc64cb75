// SPDX-License-Identifier: Apache-2.0
#include "tests/calib/trace/linear_world.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/QR>

#include "kinematics/core/rng.h"

namespace kinescope::truth {
namespace {

constexpr Eigen::Index kJoints = 2;
constexpr Eigen::Index kRows = 4;  // an instant
constexpr double kStep = 1.0 / 30.0;

Eigen::VectorXd smooth_motion(const Eigen::VectorXd& time_s, Rng& rng) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(time_s.size());
  for (int k = 0; k < 4; ++k) {
    const double omega = 2.0 * std::numbers::pi * rng.uniform(0.1, 0.5);
    const double phase = rng.uniform(0.0, 6.0);
    const double amplitude = rng.uniform(0.6, 1.4);
    for (Eigen::Index i = 0; i < time_s.size(); ++i) {
      out[i] += amplitude * std::sin(omega * time_s[i] + phase);
    }
  }
  return out;
}

Eigen::VectorXd direction_of(const Eigen::VectorXd& q) {
  Eigen::VectorXd out(q.size());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const double rise = i + 1 < q.size() ? q[i + 1] - q[i] : q[i] - q[i - 1];
    out[i] = rise > 0.0 ? 1.0 : -1.0;
  }
  return out;
}

Candidate simple(const std::string& effect, Eigen::Index joint, int parameters) {
  Candidate out;
  out.id = {effect, "joint" + std::to_string(joint + 1)};
  out.words = effect + " of " + out.id.place;
  out.record = "record " + effect;
  out.size_unit = "rad";
  for (int k = 0; k < parameters; ++k) out.parameters.push_back({"p" + std::to_string(k), "rad"});
  out.size_weights = Eigen::VectorXd::Ones(parameters);
  return out;
}

}  // namespace

LinearWorld::LinearWorld(const LinearWorldOptions& options, const std::vector<Injected>& injected)
    : options_(options) {
  Rng rng(options.seed);
  const Eigen::Index n = options.instants;
  time_s_ = Eigen::VectorXd::LinSpaced(n, 0.0, kStep * static_cast<double>(n - 1));
  q_.resize(n, kJoints);
  for (Eigen::Index j = 0; j < kJoints; ++j) q_.col(j) = smooth_motion(time_s_, rng);
  if (options.together) q_.col(1) = q_.col(0);
  // Each row answers to each joint in its own way, slowly changing with the posture.
  gains_ = Eigen::MatrixXd::Zero(n * kRows, kJoints + 2);
  place_.resize(n * kRows, 2);
  for (Eigen::Index row = 0; row < gains_.rows(); ++row) {
    for (Eigen::Index j = 0; j < kJoints; ++j) {
      const double angle = static_cast<double>(row % kRows) + static_cast<double>(j);
      gains_(row, j) = std::cos(angle + 0.5 * q_(row / kRows, 1 - j)) + 0.2;
    }
    // Two rows are a corner's coordinates.
    const Eigen::Index corner_index = row % kRows / 2;
    const auto corner = static_cast<double>(corner_index);
    gains_(row, kJoints + row % 2) = 1.0;
    place_.row(row) << q_(row / kRows, 0) + corner, 0.7 * q_(row / kRows, 1) - 0.5 * corner;
  }
  observed_ = Eigen::VectorXd::Zero(n * kRows);
  for (const Injected& effect : injected) {
    if (effect.shape == "field") {
      for (Eigen::Index row = 0; row < observed_.size(); ++row) {
        observed_[row] += effect.size * shape_of_field(place_.row(row))[row % 2];
      }
      continue;
    }
    const Eigen::VectorXd change = share(effect);
    for (Eigen::Index row = 0; row < observed_.size(); ++row) {
      observed_[row] += effect.size * change[row / kRows] * gains_(row, effect.joint);
    }
  }
  if (options.noise_seed) rng = Rng(*options.noise_seed);
  Eigen::VectorXd memory = Eigen::VectorXd::Zero(kRows);
  const double fresh = std::sqrt(1.0 - options.noise_memory * options.noise_memory);
  for (Eigen::Index row = 0; row < observed_.size(); ++row) {
    double& m = memory[row % kRows];
    m = row < kRows ? rng.normal() : options.noise_memory * m + fresh * rng.normal();
    observed_[row] += options.noise * m;
  }
}

Eigen::Vector2d LinearWorld::shape_of_field(const Eigen::Vector2d& place) {
  return {std::sin(1.3 * place.x()) * std::cos(1.2 * place.y()),
          std::cos(1.2 * place.x() + 0.8 * place.y())};
}

Eigen::VectorXd LinearWorld::share(const Injected& effect) const {
  const auto q = q_.col(effect.joint);
  const Eigen::VectorXd other = q_.col(kJoints - 1 - effect.joint);
  if (effect.shape == "scale") return q;
  if (effect.shape == "coupling") return other;
  if (effect.shape == "sine") return q.array().sin();
  if (effect.shape == "gear") return (effect.detail * q.array() + 0.7).sin();
  if (effect.shape == "direction") return direction_of(q);
  if (effect.shape == "step") return (time_s_.array() >= effect.detail).cast<double>();
  if (effect.shape == "drift") return 1.0 - (-time_s_.array() / effect.detail).exp();
  if (effect.shape == "weave") return (9.0 * q.array()).sin() * (7.0 * other.array()).sin();
  if (effect.shape == "wave_other") return (4.0 * other.array()).cos();
  return (5.0 * (other.array() - 0.2)).tanh();
}

std::vector<Candidate> LinearWorld::candidates() const {
  std::vector<Candidate> out;
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    const int carrier = static_cast<int>(j);
    const Eigen::VectorXd q = q_.col(j);
    const auto add = [&](Candidate candidate, auto columns) {
      candidate.columns = std::move(columns);
      out.push_back(std::move(candidate));
    };
    Candidate scale = simple("scale", j, 1);
    if (options_.scale_grows) {
      scale.possible = [](const Eigen::VectorXd& theta) { return theta[0] >= 0.0; };
    }
    add(scale, [=](double) { return std::vector<EffectColumn>{{carrier, q}}; });
    add(simple("sine", j, 2), [=](double) {
      return std::vector<EffectColumn>{{carrier, q.array().sin()}, {carrier, q.array().cos()}};
    });
    add(simple("direction", j, 1),
        [=](double) { return std::vector<EffectColumn>{{carrier, direction_of(q)}}; });
    Candidate gear = simple("gear", j, 2);
    for (double n = 3.0; n < 40.0; n += 0.5) gear.scan.push_back(n);
    add(gear, [=](double n) {
      return std::vector<EffectColumn>{{carrier, (n * q.array()).sin()},
                                       {carrier, (n * q.array()).cos()}};
    });
    Candidate step = simple("step", j, 1);
    for (double t = 1.5; t < time_s_[time_s_.size() - 1] - 1.5; t += 0.2) step.scan.push_back(t);
    const Eigen::VectorXd time = time_s_;
    add(step, [=](double t) {
      return std::vector<EffectColumn>{{carrier, (time.array() >= t).cast<double>()}};
    });
    add(simple("coupling", j, 1), [=, other = Eigen::VectorXd(q_.col(kJoints - 1 - j))](double) {
      return std::vector<EffectColumn>{{carrier, other}};
    });
  }
  if (options_.bends) {
    Candidate bend = simple("bend", 0, 1);
    bend.columns = [](double) { return std::vector<EffectColumn>{{0, {}}}; };
    out.push_back(std::move(bend));
  }
  if (options_.imitates) {
    Candidate imitation = simple("imitation", 0, 1);
    const Eigen::VectorXd shape =
        share({0, "tanh_other"}).array() + 0.25 * (2.1 * time_s_.array()).sin();
    imitation.columns = [shape](double) { return std::vector<EffectColumn>{{0, shape}}; };
    out.push_back(std::move(imitation));
  }
  if (options_.drifts) {
    Candidate drift = simple("drift", 0, 1);
    for (double tau_s = 2.0; tau_s <= 200.0; tau_s *= 1.2) drift.scan.push_back(tau_s);
    drift.columns = [time_s = time_s_](double tau_s) {
      return std::vector<EffectColumn>{{0, 1.0 - (-time_s.array() / tau_s).exp()}};
    };
    out.push_back(std::move(drift));
  }
  if (options_.other_is_small) {
    Candidate other = simple("tanh_other", 0, 1);
    other.floor = 1e3;
    other.columns = [shape = share({0, "tanh_other"})](double) {
      return std::vector<EffectColumn>{{0, shape}};
    };
    out.push_back(std::move(other));
  }
  if (options_.stands_in) {
    const Eigen::VectorXd weave = share({0, "weave"});
    const Eigen::VectorXd large = 2.0 * (2.1 * time_s_.array()).sin();
    const auto add = [&](const char* name, const Eigen::VectorXd& shape, double floor) {
      Candidate candidate = simple(name, 0, 1);
      candidate.floor = floor;
      candidate.columns = [shape](double) { return std::vector<EffectColumn>{{0, shape}}; };
      out.push_back(std::move(candidate));
    };
    add("weave", weave, 1e3);
    add("first_half", large + 0.5 * weave, 0.0);
    add("second_half", 0.5 * weave - large, 0.0);
  }
  return out;
}

TracedFit LinearWorld::fit(const std::vector<AddedEffect>& effects) const {
  TracedFit out;
  out.converged = options_.converges_with.empty() ||
                  std::ranges::any_of(effects, [&](const AddedEffect& effect) {
                    return effect.id.effect == options_.converges_with;
                  });
  if (!out.converged) out.reason = "iterations";
  out.candidates = candidates();
  Linearisation& linear = out.linear;
  linear.time_s = time_s_;
  linear.carriers = gains_.sparseView();
  linear.unit = Eigen::VectorXd::Constant(observed_.size(), options_.noise);
  linear.unit_name = "px";
  linear.fold.resize(static_cast<std::size_t>(options_.instants));
  for (int i = 0; i < options_.instants; ++i) {
    linear.first_row.push_back(i * kRows);
    linear.fold[static_cast<std::size_t>(i)] =
        (i * 3 * options_.folds / options_.instants) % options_.folds;
  }
  linear.first_row.push_back(options_.instants * kRows);
  const double memory = options_.noise_memory;
  linear.correlation_time_s = kStep * 0.5 * (1.0 + memory) / (1.0 - memory);
  if (options_.lasts_s) {
    linear.whitened_by_neighbours = true;
    linear.correlation_time_s = *options_.lasts_s;
  }

  std::vector<EffectColumn> columns{{0, {}}, {1, {}}};  // the joints' zeros
  for (const AddedEffect& effect : effects) {
    for (const Candidate& candidate : out.candidates) {
      if (candidate.id != effect.id) continue;
      for (EffectColumn& column : candidate.columns(effect.scan)) {
        if (effect.id.effect == "bend") column.share = share({0, "tanh_other"});
        if (effect.id.effect == "scale" && options_.scale_turns) column.share *= -1.0;
        columns.push_back(column);
      }
    }
  }
  linear.jacobian.resize(observed_.size(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    for (Eigen::Index row = 0; row < observed_.size(); ++row) {
      const double share = columns[c].share.size() == 0 ? 1.0 : columns[c].share[row / kRows];
      linear.jacobian(row, static_cast<Eigen::Index>(c)) =
          share * gains_(row, columns[c].carrier) / options_.noise;
    }
  }
  linear.carriers = linear.carriers / options_.noise;
  const Eigen::VectorXd whitened = observed_ / options_.noise;
  const Eigen::VectorXd solution =
      Eigen::MatrixXd(linear.jacobian).colPivHouseholderQr().solve(whitened);
  linear.residual = whitened - linear.jacobian * solution;
  Eigen::Index at = 2;
  for (const AddedEffect& effect : effects) {
    for (const Candidate& candidate : out.candidates) {
      if (candidate.id != effect.id) continue;
      const auto count = static_cast<Eigen::Index>(candidate.parameters.size());
      out.values.emplace_back(solution.segment(at, count));
      at += count;
    }
  }
  for (Eigen::Index j = 0; j < kJoints; ++j) {
    const std::string name = "joint" + std::to_string(j + 1);
    out.rest_places.push_back({name, "rad", static_cast<int>(j), 0.0, 0.0});
    out.covariates.push_back({"value of " + name, "rad", q_.col(j)});
    out.covariates.push_back({"direction of " + name, "", direction_of(q_.col(j))});
  }
  out.covariates.push_back({"time", "s", time_s_});
  out.rest_fields.push_back({"camera",
                             "px",
                             "place in the image",
                             "px",
                             place_,
                             {static_cast<int>(kJoints), static_cast<int>(kJoints) + 1},
                             0.0});
  return out;
}

}  // namespace kinescope::truth
