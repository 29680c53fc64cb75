// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/torque_robots.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "dynamics/experiments/reference_arms.h"
#include "kinematics/core/error.h"
#include "tests/experiments/real_logs.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
constexpr double kTurn = 2.0 * std::numbers::pi;

Eigen::VectorXd column(const ChannelTable& table, const std::string& name) {
  const auto index = table.column(name);
  KINESCOPE_CHECK(index.has_value(), "the set has the columns of its README");
  return table.values.col(*index);
}

/// Positions and torques of one motion; velocities are derived.
TorqueLog log_of(const std::string& name, Eigen::VectorXd t_s, Eigen::MatrixXd q,
                 Eigen::MatrixXd torque) {
  TorqueLog log;
  log.sources = {name};
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    log.joints.push_back({.name = fmt::format("joint{}", j + 1)});
  }
  log.t_s = std::move(t_s);
  log.q = std::move(q);
  log.torque = std::move(torque);
  log.trajectory = Eigen::VectorXi::Zero(log.rows());
  log.trajectory_names = {name};
  log.source.assign(static_cast<std::size_t>(log.rows()), 0);
  log.lines.assign(static_cast<std::size_t>(log.rows()), 0);
  return log;
}

void unwrap(Eigen::Ref<Eigen::VectorXd> angle) {
  for (Eigen::Index t = 1; t < angle.size(); ++t) {
    angle[t] -= kTurn * std::round((angle[t] - angle[t - 1]) / kTurn);
  }
}

}  // namespace

TorqueLog rows_between(const TorqueLog& log, double from_s, double to_s) {
  std::vector<char> keep(static_cast<std::size_t>(log.rows()), 0);
  for (Eigen::Index t = 0; t < log.rows(); ++t) {
    keep[static_cast<std::size_t>(t)] = log.t_s[t] >= from_s && log.t_s[t] <= to_s ? 1 : 0;
  }
  return keep_rows(log, keep);
}

TorqueLog ur10e_log(const fs::path& folder, const std::string& file) {
  Eigen::VectorXd gains(6);
  gains << 14.87, 13.26, 11.13, 10.62, 11.03, 11.47;
  TorqueLog log = read_log(folder / file, 6, "i");
  log.torque = (log.torque * gains.asDiagonal()).eval();
  return log;
}

TorqueLog ur10e_steady_log(const fs::path& folder, const std::string& file) {
  constexpr double kStart_s = 3.8;
  const TorqueLog log = ur10e_log(folder, file);
  return rows_between(log, kStart_s, log.t_s[log.rows() - 1] - kStart_s);
}

TorqueLog tx40_log(const fs::path& folder) {
  const ChannelTable table = read_channel_table(folder / "tx40_motor.csv.gz");
  const Eigen::MatrixXd taum = columns(table, "taum", 6);
  Eigen::VectorXd gears(6);
  gears << 32, 32, 45, -48, 45, 32;
  Eigen::MatrixXd q = columns(table, "qm", 6) * gears.cwiseInverse().asDiagonal();
  q.col(5) -= q.col(4);
  q.col(1).array() -= kQuarterTurn;
  q.col(2).array() += kQuarterTurn;
  Eigen::MatrixXd torque = taum * gears.asDiagonal();
  torque.col(4) += gears[5] * taum.col(5);
  return log_of("tx40", column(table, "t"), std::move(q), std::move(torque));
}

TorqueLog panda_log(const fs::path& folder) {
  return read_log(folder / "exciting_traj.csv.gz", 7, "tau");
}

TorqueLog rokae_log(const fs::path& folder) { return read_log(folder / "ident.csv", 7, "tau"); }

TorqueLog lwr4_log(const fs::path& folder, int run) {
  return read_log(folder / fmt::format("measurements_{}.csv", run), 7, "tau");
}

DynamicModel lone_joint() { return dh_arm({{0, 0, 0}}); }

TorqueLog franka_log(const fs::path& folder, const std::string& file, int joint) {
  const ChannelTable table = read_channel_table(folder / file);
  return log_of(file, column(table, "t"), column(table, fmt::format("q{}", joint)),
                column(table, fmt::format("tau_friction{}", joint)));
}

TorqueLog kinova_log(const fs::path& folder) {
  constexpr double kRate_hz = 999.0, kTorqueConstant = 7.6, kStart_s = 0.7;
  std::vector<TorqueLog> runs;
  for (const char* speed :
       {"0.03", "0.05", "0.09", "0.10", "0.30", "0.50", "0.70", "0.90", "1.30", "1.50"}) {
    const ChannelTable table =
        read_channel_table(folder / fmt::format("const_velocity_{}.csv", speed));
    Eigen::VectorXd q = column(table, "q");
    unwrap(q);
    const Eigen::VectorXd t_s = Eigen::VectorXd::LinSpaced(
        table.rows(), 0.0, static_cast<double>(table.rows() - 1) / kRate_hz);
    const TorqueLog run =
        log_of(fmt::format("{} rad/s", speed), t_s, q, kTorqueConstant * column(table, "i_meas"));
    runs.push_back(rows_between(run, kStart_s, t_s[t_s.size() - 1]));
  }
  return join(runs);
}

DynamicModel pendulum() { return dh_arm({{0, kQuarterTurn, 0}}); }

PendulumLog pendulum_log(const fs::path& folder, const std::string& servo, double mass_kg,
                         double length_m) {
  // Duty per rad of error, and beyond the error at which the servo's gain falls.
  constexpr double kGain = 0.164, kKnee_rad = 0.158, kGainBeyond = 0.038;
  constexpr double kColdest_c = 10.0, kHottest_c = 100.0;
  const ChannelTable runs = read_channel_table(folder / (servo + "_runs.csv"));
  const ChannelTable table = read_channel_table(folder / (servo + ".csv.gz"));
  const Eigen::VectorXd run = column(table, "run"), t_s = column(table, "t");
  const Eigen::VectorXd q = column(table, "q"), goal = column(table, "q_goal");
  const Eigen::VectorXd temperature_c = column(table, "temp_C");
  const Eigen::VectorXd holds = column(table, "torque_enable");
  const Eigen::VectorXd number = column(runs, "run"), mass = column(runs, "mass_kg"),
                        length = column(runs, "arm_length_m"), gain = column(runs, "kp");
  std::vector<TorqueLog> logs;
  std::vector<double> temperatures;
  for (Eigen::Index r = 0; r < runs.rows(); ++r) {
    if (std::abs(mass[r] - mass_kg) > 1e-6 || std::abs(length[r] - length_m) > 1e-6) continue;
    std::vector<Eigen::Index> rows;
    bool dropped = false;
    for (Eigen::Index t = 0; t < table.rows(); ++t) {
      if (run[t] != number[r]) continue;
      rows.push_back(t);
      dropped = dropped || holds[t] == 0.0;
    }
    if (dropped) continue;
    const Eigen::ArrayXd error = (goal(rows) - q(rows)).array();
    const Eigen::ArrayXd size = error.abs();
    const Eigen::VectorXd duty =
        gain[r] * error.sign() *
        (kGain * size.min(kKnee_rad) + kGainBeyond * (size - kKnee_rad).max(0.0));
    logs.push_back(log_of(fmt::format("run {}", number[r]), t_s(rows), q(rows), duty));
    for (const Eigen::Index t : rows) {
      const bool read = temperature_c[t] > kColdest_c && temperature_c[t] < kHottest_c;
      temperatures.push_back(read || temperatures.empty() ? temperature_c[t] : temperatures.back());
    }
  }
  PendulumLog out{join(logs), Eigen::VectorXd(std::ssize(temperatures))};
  out.log.torque_unit = "A";  // no torque, and its gain is not known
  std::ranges::copy(temperatures, out.temperature_c.begin());
  return out;
}

Eigen::VectorXd at_samples(const TorqueLog& log, const Eigen::VectorXd& rows,
                           const TorqueSamples& samples) {
  Eigen::VectorXd out(samples.size());
  Eigen::Index at = 0;
  for (Eigen::Index s = 0; s < samples.size(); ++s) {
    while (at + 1 < log.rows() &&
           (log.trajectory[at] < samples.trajectory[s] ||
            (log.trajectory[at] == samples.trajectory[s] && log.t_s[at] < samples.t_s[s]))) {
      ++at;
    }
    out[s] = rows[at];
  }
  return out;
}

}  // namespace kinescope
