// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/suspect.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "kinematics/core/median.h"

namespace kinescope::effects {
namespace {

double sampling_step(const Eigen::VectorXd& value, bool postures) {
  std::vector<double> values(value.begin(), value.end());
  if (postures) std::ranges::sort(values);
  // Encoders at rest tremble.
  const double least = postures ? 1e-3 * (values.back() - values.front()) : -1.0;
  std::vector<double> steps;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = std::abs(values[i] - values[i - 1]);
    if (step > least) steps.push_back(step);
  }
  return steps.empty() ? 0.0 : median_of(std::move(steps));
}

}  // namespace

Suspect suspect(const EffectWorld& world, int joint) {
  const Joint& j = world.tree.joints[static_cast<std::size_t>(joint)];
  Suspect out;
  out.joint = joint;
  out.name = j.name;
  out.turns = j.type == JointType::kRevolute;
  out.unit = out.turns ? "rad" : "m";
  (out.turns ? out.axis.head<3>() : out.axis.tail<3>()) = j.axis;
  out.value = world.frames.value.col(joint);
  out.step = sampling_step(out.value, world.postures);
  return out;
}

Correction turn(const Suspect& s, std::string name, std::string unit, Eigen::VectorXd share) {
  Correction out;
  out.name = s.name + " " + std::move(name);
  out.block = s.name;
  out.unit = std::move(unit);
  out.index = s.joint;
  out.direction = s.axis;
  out.share = std::move(share);
  return out;
}

CameraEffect effect(const Suspect& s, std::string name, std::string words,
                    std::vector<EffectParameter> parameters, std::string size_unit) {
  CameraEffect out;
  Candidate& c = out.candidate;
  c.id = {std::move(name), s.name};
  c.words = std::move(words);
  c.size_weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(parameters.size()));
  c.parameters = std::move(parameters);
  c.size_unit = std::move(size_unit);
  if (const double limit = largest_size(c.size_unit); std::isfinite(limit)) {
    c.possible = [limit](const Eigen::VectorXd& theta) { return theta.norm() < limit; };
  }
  return out;
}

std::function<bool(const Eigen::VectorXd&)> as_the_log_shows(double size) {
  constexpr double kOfSize = 0.5;
  return
      [size](const Eigen::VectorXd& shown) { return std::abs(shown[0] - size) < kOfSize * size; };
}

double largest_size(const std::string& unit) {
  if (unit == "rad") return 0.2;
  if (unit == "m") return 0.05;
  return unit.empty() ? 0.25 : std::numeric_limits<double>::infinity();
}

}  // namespace kinescope::effects
