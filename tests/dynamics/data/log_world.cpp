// SPDX-License-Identifier: Apache-2.0
#include "tests/dynamics/data/log_world.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/core/rng.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

constexpr int kWaves = 4;
constexpr int kJoints = 3;

double torque_of(int joint, const Eigen::Vector3d& m) {
  constexpr double kInertia[] = {1.2, 0.6, 3.0};
  constexpr double kCoulomb[] = {0.8, 0.4, 2.0};
  constexpr double kViscous[] = {0.5, 0.3, 4.0};
  const double gravity = joint == 0   ? 9.0 * std::sin(m(0))
                         : joint == 1 ? 3.0 * std::cos(m(0))
                                      : 20.0;
  return kInertia[joint] * m(2) + gravity + kCoulomb[joint] * std::tanh(m(1) / 0.01) +
         kViscous[joint] * m(1);
}

}  // namespace

Eigen::Vector3d exact_motion(const LogWorldOptions& options, int joint, double t_s) {
  Rng rng = Rng::from_name(options.name, static_cast<std::uint64_t>(joint));
  const double size = joint == 2 && options.prismatic ? 0.08 : 0.5;
  Eigen::Vector3d out = Eigen::Vector3d::Zero();
  for (int k = 0; k < kWaves; ++k) {
    // The first wave is slow, the last one at the highest frequency.
    const double hz = options.highest_hz * (k + 1.0) / kWaves * rng.uniform(0.9, 1.0);
    const double w = 2.0 * std::numbers::pi * hz;
    const double phase = rng.uniform(0.0, 2.0 * std::numbers::pi);
    const double a = size / (k + 1.0);
    out += a * Eigen::Vector3d(std::sin(w * t_s + phase), w * std::cos(w * t_s + phase),
                               -w * w * std::sin(w * t_s + phase));
  }
  return out;
}

LogWorld make_log_world(const LogWorldOptions& options) {
  LogWorld world;
  world.header = {"t", "q1", "q2", "q3", "dq1", "dq2", "dq3", "tau1", "tau2", "tau3"};
  world.joints = {{"joint1", false}, {"joint2", false}, {"joint3", options.prismatic}};
  const auto rows =
      static_cast<Eigen::Index>(std::lround(options.duration_s * options.rate_hz)) + 1;
  world.rows.resize(rows, 1 + 3 * kJoints);
  world.ddq.resize(rows, kJoints);
  Rng noise = Rng::from_name(options.name + ".noise");
  for (Eigen::Index r = 0; r < rows; ++r) {
    const double t = static_cast<double>(r) / options.rate_hz;
    world.rows(r, 0) = t;
    for (int j = 0; j < kJoints; ++j) {
      const Eigen::Vector3d now = exact_motion(options, j, t);
      const double dq = exact_motion(options, j, t - options.velocity_lag_s)(1);
      const double tau = torque_of(j, exact_motion(options, j, t - options.torque_lag_s));
      world.rows(r, 1 + j) = now(0) + noise.normal(options.position_noise);
      world.rows(r, 1 + kJoints + j) = dq + noise.normal(options.velocity_noise);
      world.rows(r, 1 + 2 * kJoints + j) = tau + noise.normal(options.torque_noise);
      world.ddq(r, j) = now(2);
    }
  }
  return world;
}

Eigen::Index LogWorld::column(const std::string& name) const {
  return std::ranges::find(header, name) - header.begin();
}

std::string LogWorld::csv() const {
  std::string text = fmt::format("{}\n", fmt::join(header, ","));
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    for (Eigen::Index c = 0; c < rows.cols(); ++c) {
      text += fmt::format("{}{:.9g}", c > 0 ? "," : "", rows(r, c));
    }
    text += '\n';
  }
  return text;
}

std::filesystem::path write_log(const std::string& name, const std::string& text) {
  const std::filesystem::path folder = truth::temporary_path("logs");
  std::filesystem::create_directories(folder);
  write_file_atomically(folder / name, text);
  return folder / name;
}

std::string refusal_of(const std::function<void()>& function) {
  try {
    function();
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace kinescope
