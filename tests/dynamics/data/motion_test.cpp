// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/motion.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/data/statistics.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/core/gzip.h"
#include "kinematics/log/channel_table.h"
#include "tests/dynamics/data/log_world.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

LogWorldOptions usual() {
  return {.duration_s = 20.0, .position_noise = 2e-5, .velocity_noise = 1e-3, .torque_noise = 0.02};
}

TorqueData read(const LogWorldOptions& world, const TorqueDataOptions& options = {},
                const std::string& name = "motion.csv") {
  const LogWorld made = make_log_world(world);
  return read_torque_data({write_log(name, made.csv())}, made.joints, options);
}

/// Largest over the joints of rms error / rms of the exact signal: q, dq, ddq.
Eigen::Vector3d errors(const LogWorldOptions& world, const TorqueSamples& samples) {
  Eigen::Vector3d worst = Eigen::Vector3d::Zero();
  for (int j = 0; j < 3; ++j) {
    Eigen::Vector3d error = Eigen::Vector3d::Zero();
    Eigen::Vector3d size = Eigen::Vector3d::Zero();
    for (Eigen::Index k = 0; k < samples.size(); ++k) {
      const Eigen::Vector3d exact = exact_motion(world, j, samples.t_s(k));
      const Eigen::Vector3d found(samples.q(k, j), samples.dq(k, j), samples.ddq(k, j));
      error += (found - exact).cwiseAbs2();
      size += exact.cwiseAbs2();
    }
    worst = worst.cwiseMax((error.cwiseQuotient(size)).cwiseSqrt());
  }
  return worst;
}

// Relative errors of q, dq, ddq from 2e-5 rad of noise at 200 Hz and motion up to 1 Hz. The Coulomb
// friction of the torques asks for a cut-off of some 40 Hz, which is what the accelerations pay
// for.
const Eigen::Vector3d kAccuracy(5e-4, 5e-3, 5e-2);

TEST(Motion, IsAccurateByBothFiltersFromAllSources) {
  for (const LowPass filter : {LowPass::kSmoothingSpline, LowPass::kButterworth}) {
    for (const MotionSource source : {MotionSource::kPosition, MotionSource::kVelocity}) {
      TorqueDataOptions options;
      options.motion.filter = filter;
      options.motion.source = source;
      const TorqueData data = read(usual(), options);
      const Eigen::Vector3d found = errors(usual(), data.samples);
      EXPECT_TRUE((found.array() < kAccuracy.array()).all())
          << to_string(filter) << " " << to_string(source) << ": " << found.transpose();
      EXPECT_EQ(data.source, source);
    }
  }
}

TEST(Motion, StatesItsCutOffRateAndEnds) {
  const TorqueData data = read(usual());
  EXPECT_GT(data.cutoff.cutoff_hz, 1.0);
  const double edge_s = 1.0 / data.cutoff.cutoff_hz;
  EXPECT_GE(data.samples.t_s(0), edge_s - 1e-9);
  EXPECT_LE(data.samples.t_s(data.samples.size() - 1), 20.0 - edge_s + 1e-9);
  EXPECT_NEAR(data.samples.t_s(1) - data.samples.t_s(0), 1.0 / data.rate_hz, 1e-9);
  EXPECT_GE(data.rate_hz, 5.0 * data.cutoff.cutoff_hz);
  EXPECT_NEAR(data.log_rate_hz, 200.0, 1e-6);
  EXPECT_EQ(data.samples.joint_names, (std::vector<std::string>{"joint1", "joint2", "joint3"}));
}

TEST(Motion, TakesUnevenStampsWithDropOuts) {
  const LogWorldOptions options = usual();
  LogWorld world = make_log_world(options);
  std::vector<Eigen::Index> kept;
  for (Eigen::Index r = 0; r < world.rows.rows(); ++r) {
    if (r % 17 > 3) kept.push_back(r);
  }
  world.rows = Eigen::MatrixXd(world.rows(kept, Eigen::all));
  const TorqueData data = read_torque_data({write_log("uneven.csv", world.csv())}, world.joints);
  const Eigen::Vector3d found = errors(options, data.samples);
  EXPECT_TRUE((found.array() < kAccuracy.array()).all()) << found.transpose();
}

TEST(Motion, FiltersTheTorqueAlike) {
  // A torque that is proportional to the position stays so.
  LogWorld world = make_log_world(usual());
  for (int j = 1; j <= 3; ++j) {
    world.rows.col(world.column("tau" + std::to_string(j))) =
        7.0 * world.rows.col(world.column("q" + std::to_string(j)));
  }
  const TorqueData data = read_torque_data({write_log("alike.csv", world.csv())}, world.joints);
  EXPECT_LT((data.samples.torque - 7.0 * data.samples.q).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(Motion, KeepsTrajectoriesApartAndNamesShortOnes) {
  LogWorldOptions options = usual();
  const LogWorld first = make_log_world(options);
  options.name = "second";
  const LogWorld second = make_log_world(options);
  LogWorld brief = second;
  brief.rows = Eigen::MatrixXd(second.rows.topRows(20));
  const TorqueData data =
      read_torque_data({write_log("first.csv", first.csv()), write_log("brief.csv", brief.csv()),
                        write_log("second.csv", second.csv())},
                       first.joints);
  EXPECT_EQ(data.samples.trajectory.maxCoeff(), 1);
  EXPECT_EQ(data.samples.trajectory_names, (std::vector<std::string>{"first.csv", "second.csv"}));
  ASSERT_EQ(findings_of(data.findings, LogFault::kTooShort).size(), 1U);
  EXPECT_NE(findings_of(data.findings, LogFault::kTooShort)[0].what.find("brief.csv"),
            std::string::npos);
}

TEST(Motion, AJointThatHoldsStillIsAtRestExactly) {
  const LogWorld made = make_log_world(usual());
  TorqueLogReport report = read_checked_log({write_log("still.csv", made.csv())}, made.joints, {});
  report.log.q.col(1).setConstant(0.3);
  report.log.dq.resize(report.log.rows(), 0);
  for (const LowPass filter : {LowPass::kSmoothingSpline, LowPass::kButterworth}) {
    const TorqueSamples samples = filtered_data(report, {.filter = filter}).samples;
    EXPECT_TRUE((samples.q.col(1).array() == 0.3).all());
    EXPECT_TRUE(samples.dq.col(1).isZero(0.0));
    EXPECT_TRUE(samples.ddq.col(1).isZero(0.0));
    EXPECT_GT(samples.ddq.col(0).norm(), 0.0);
  }
}

TEST(Motion, WithoutAFilterTheRowsAreTheSamples) {
  LogWorld world = make_log_world(usual());
  TorqueDataOptions options;
  options.motion.filter = LowPass::kNone;
  const auto path = write_log("raw.csv", world.csv());
  EXPECT_NE(refusal_of([&] {
              static_cast<void>(read_torque_data({path}, world.joints, options));
            }).find("must hold accelerations"),
            std::string::npos);
  world.header.insert(world.header.end(), {"ddq1", "ddq2", "ddq3"});
  Eigen::MatrixXd rows(world.rows.rows(), world.rows.cols() + 3);
  rows << world.rows, world.ddq;
  world.rows = rows;
  const TorqueData data =
      read_torque_data({write_log("raw.csv", world.csv())}, world.joints, options);
  EXPECT_EQ(data.samples.size(), world.rows.rows());
  EXPECT_NEAR(data.samples.ddq(17, 1), world.ddq(17, 1), 1e-6);
}

TEST(Motion, RefusesWhatCannotBe) {
  const LogWorld world = make_log_world(usual());
  const auto path = write_log("refused.csv", world.csv());
  const auto with = [&](const MotionOptions& motion) {
    TorqueDataOptions options;
    options.motion = motion;
    return refusal_of([&] { static_cast<void>(read_torque_data({path}, world.joints, options)); });
  };
  EXPECT_NE(with({.cutoff_hz = 150.0}).find("not below half the log's rate"), std::string::npos);
  EXPECT_NE(with({.cutoff_hz = -1.0}).find("must not be negative"), std::string::npos);
  EXPECT_NE(with({.cutoff_hz = 0.01}).find("no trajectory is long enough"), std::string::npos);
  EXPECT_NE(with({.source = MotionSource::kLogged}).find("no usable"), std::string::npos);
  LogWorld still = world;
  for (int j = 1; j <= 3; ++j) {
    still.rows.col(still.column("q" + std::to_string(j))).array() *= 1e-9;
    still.rows.col(still.column("dq" + std::to_string(j))).array() *= 1e-9;
  }
  EXPECT_NE(
      refusal_of([&] {
        static_cast<void>(read_torque_data({write_log("still.csv", still.csv())}, still.joints));
      }).find("no joint moves clear of the noise"),
      std::string::npos);
}

TEST(Motion, IsTheSameFromPlainAndPackedFiles) {
  const LogWorld world = make_log_world(usual());
  const TorqueData plain = read_torque_data({write_log("same.csv", world.csv())}, world.joints);
  const TorqueData packed =
      read_torque_data({write_log("same.csv.gz", gzip(world.csv()))}, world.joints);
  EXPECT_EQ(plain.samples.ddq, packed.samples.ddq);
  EXPECT_EQ(plain.samples.torque, packed.samples.torque);
}

/// The simulated logs: q quantised to 4.8e-5 rad (1e-6 m), dq with 1e-3 rad/s of noise, exact ddq
/// beside.
TEST(Motion, MeetsTheTruthOfTheSimulatedLogs) {
  const auto root = shared_data("synthetic_dynamics");
  if (!root) GTEST_SKIP() << "shared/data/synthetic_dynamics is not on this machine";
  for (const char* name : {"scara4_none", "scara4_stribeck_ripple", "ur6_contact",
                           "wam7_coulomb_viscous", "wam7_payload"}) {
    const TorqueData data = read_torque_data({*root / name / "log_test.csv.gz"}, {});
    const ChannelTable truth = read_channel_table(*root / name / "truth_log_test.csv.gz");
    const Eigen::VectorXd t = truth.values.col(*truth.column("t"));
    const double step_s = t(1) - t(0);
    for (Eigen::Index j = 0; j < data.samples.joints(); ++j) {
      const Eigen::VectorXd exact = truth.values.col(*truth.column("ddq" + std::to_string(j + 1)));
      double error = 0.0;
      double size = 0.0;
      for (Eigen::Index k = 0; k < data.samples.size(); ++k) {
        const auto row = static_cast<Eigen::Index>(std::lround(data.samples.t_s(k) / step_s));
        ASSERT_NEAR(t(row), data.samples.t_s(k), 1e-6);
        error += std::pow(data.samples.ddq(k, j) - exact(row), 2);
        size += exact(row) * exact(row);
      }
      const double relative = std::sqrt(error / size);
      // Where friction sets the cut-off (tens of Hz), the quantised positions cost up to 7 %.
      const bool friction = data.cutoff.cutoff_hz > 12.0;
      EXPECT_LT(relative, friction ? 0.08 : 0.004) << name << " joint " << j + 1;
      EXPECT_LT(std::abs(std::log2(data.cutoff.expected_error(j) / relative)), 1.0)
          << name << " joint " << j + 1;
    }
  }
}

}  // namespace
}  // namespace kinescope
