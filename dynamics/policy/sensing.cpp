// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/sensing.h"

#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

SensingOptions without_noise(SensingOptions options) {
  options.noise_sigma.resize(0);
  return options;
}

}  // namespace

void check_sensing(const SensingOptions& options, const StateLayout& layout) {
  const Eigen::VectorXd& sigma = options.noise_sigma;
  if (sigma.size() != 0 && sigma.size() != layout.state_count()) {
    throw bad_request("sensing", fmt::format("{} standard deviations of noise", sigma.size()),
                      fmt::format("give {}, one a state", layout.state_count()));
  }
  if (!(sigma.array() >= 0.0).all() || !sigma.allFinite()) {
    throw bad_request("sensing", "a standard deviation of noise is below 0 or not finite",
                      "give 0 or more");
  }
  for (const double cutoff : {options.position_cutoff_hz, options.speed_cutoff_hz}) {
    if (!(cutoff >= 0.0) || !std::isfinite(cutoff)) {
      throw bad_request("sensing", fmt::format("a cut-off of {} Hz", cutoff),
                        "give one above 0, or 0 for none");
    }
  }
}

double low_pass_memory(double cutoff_hz, double step_s) {
  return cutoff_hz > 0.0 ? std::exp(-2.0 * std::numbers::pi * cutoff_hz * step_s) : 0.0;
}

ParticleFilter::ParticleFilter(const StateLayout& layout, const SensingOptions& options, Index rows)
    : layout_(layout),
      options_(options),
      position_memory_(low_pass_memory(options.position_cutoff_hz, layout.step_s)),
      speed_memory_(low_pass_memory(options.speed_cutoff_hz, layout.step_s)),
      last_(rows, layout.position_count()),
      position_(rows, layout.position_count()),
      speed_(rows, layout.position_count()) {}

void ParticleFilter::start() { started_ = false; }

void ParticleFilter::step(const TrueStates& states, const Eigen::MatrixXd& normals,
                          SeenStates& seen) {
  const Index positions = layout_.position_count();
  seen.values = states.values;
  if (noisy()) seen.values += normals * options_.noise_sigma.asDiagonal();
  auto position = seen.values.leftCols(positions);
  auto speed = seen.values.rightCols(positions);
  const bool positions_only = options_.sensing == Sensing::kPositionsOnly;
  if (positions_only && started_) {
    speed = (position - last_) / layout_.step_s;
  } else if (positions_only) {
    speed.setZero();
  }
  last_ = position;
  if (started_) {
    position = position_memory_ * position_ + (1.0 - position_memory_) * position;
    speed = speed_memory_ * speed_ + (1.0 - speed_memory_) * speed;
  }
  position_ = position;
  speed_ = speed;
  started_ = true;
}

// From here on the memory holds the pullbacks to itself.
void ParticleFilter::start_pullback() {
  last_.setZero();
  position_.setZero();
  speed_.setZero();
}

void ParticleFilter::pullback(const ConstBlock& d_seen, bool first_step, Block d_states) {
  const Index positions = layout_.position_count();
  const bool positions_only = options_.sensing == Sensing::kPositionsOnly;
  position_ += d_seen.leftCols(positions);
  speed_ += d_seen.rightCols(positions);
  const double position_share = first_step ? 1.0 : 1.0 - position_memory_;
  const double speed_share = first_step ? 1.0 : 1.0 - speed_memory_;
  d_states.leftCols(positions) += position_share * position_ + last_;
  last_.setZero();
  if (!positions_only) {
    d_states.rightCols(positions) += speed_share * speed_;
  } else if (!first_step) {
    last_ = -speed_share / layout_.step_s * speed_;
    d_states.leftCols(positions) -= last_;
  }
  position_ *= position_memory_;
  speed_ *= speed_memory_;
}

OnlineFilter::OnlineFilter(const StateLayout& layout, SensingOptions options)
    : filter_(layout, without_noise(std::move(options)), 1) {}

Eigen::VectorXd OnlineFilter::step(const Eigen::VectorXd& measured) {
  measured_.values = measured.transpose();
  filter_.step(measured_, {}, seen_);
  return seen_.values.row(0).transpose();
}

}  // namespace kinescope::policy
