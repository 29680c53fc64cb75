// SPDX-License-Identifier: Apache-2.0
//
// Measured logs of others, each with the traps that its description names. Skipped where they are
// absent.
#include <algorithm>

#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/log/channel_table.h"
#include "tests/dynamics/data/log_world.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

class MeasuredLog : public testing::Test {
 protected:
  void SetUp() override {
    const auto root = shared_data("dynamics");
    if (!root) GTEST_SKIP() << "shared/data/dynamics is not on this machine";
    root_ = *root;
  }

  TorqueLogReport look(const std::string& file, const LogMapping& mapping = {}) const {
    TorqueDataOptions options;
    options.mapping = mapping;
    return look_at_torque_log({root_ / file}, {}, options);
  }

  TorqueData read(const std::vector<std::string>& files, const LogMapping& mapping = {}) const {
    TorqueDataOptions options;
    options.mapping = mapping;
    std::vector<std::filesystem::path> paths;
    for (const std::string& file : files) paths.push_back(root_ / file);
    return read_torque_data(paths, {}, options);
  }

  std::filesystem::path root_;
};

std::vector<LogFinding> of(const TorqueLogReport& report, LogFault fault) {
  return findings_of(report.findings, fault);
}

bool has(const std::vector<LogFinding>& findings, LogFault fault) {
  return !findings_of(findings, fault).empty();
}

TEST_F(MeasuredLog, Ur10eCurrentsAreSound) {
  const TorqueData data =
      read({"ur10e_innopolis/ident_12harm_50s.csv", "ur10e_innopolis/ident_15harm_50s_unloaded.csv",
            "ur10e_innopolis/ident_15harm_50s_loaded.csv"});
  EXPECT_EQ(data.samples.torque_unit, "A");
  EXPECT_EQ(data.samples.joints(), 6);
  EXPECT_EQ(data.samples.trajectory.maxCoeff(), 2);
  EXPECT_FALSE(has(data.findings, LogFault::kVelocityMismatch));
  EXPECT_FALSE(has(data.findings, LogFault::kUnit));
  // The loaded run follows the path of the unloaded one.
  EXPECT_EQ(repeated_paths(data.samples), (std::vector<int>{0, 1, 1}));
}

TEST_F(MeasuredLog, Tx40IsMotorSideAtFiveKilohertz) {
  LogMapping mapping;
  mapping.position = {"qm*"};
  mapping.torque = {"taum*"};
  const std::string refused =
      refusal_of([&] { static_cast<void>(read({"tx40_staubli/tx40_motor.csv.gz"}, mapping)); });
  EXPECT_NE(refused.find("for motor angles give position_factor"), std::string::npos) << refused;
  mapping.position_factor = {1 / 32.0, 1 / 32.0, 1 / 45.0, -1 / 48.0, 1 / 45.0, 1 / 32.0};
  const TorqueData data = read({"tx40_staubli/tx40_motor.csv.gz"}, mapping);
  EXPECT_NEAR(data.log_rate_hz, 5000.0, 1.0);
  EXPECT_GT(data.cutoff.cutoff_hz, 5.0);
}

TEST_F(MeasuredLog, PandaHasDropOutsStaleRowsAndLateVelocities) {
  const TorqueLogReport report = look("panda_gaz2019/exciting_traj.csv.gz");
  ASSERT_EQ(of(report, LogFault::kGap).size(), 1U);
  EXPECT_NEAR(of(report, LogFault::kGap)[0].value, 0.0088, 0.0002);
  EXPECT_NEAR(of(report, LogFault::kStaleRows)[0].share, 0.055, 0.01);
  ASSERT_EQ(of(report, LogFault::kVelocityLag).size(), 7U);
  EXPECT_NEAR(of(report, LogFault::kVelocityLag)[0].value, 0.0054, 0.001);
}

TEST_F(MeasuredLog, RokaeAccelerationsAreNotTheDerivative) {
  const TorqueLogReport report = look("rokae_ar5/ident.csv");
  EXPECT_EQ(of(report, LogFault::kAcceleration).size(), 7U);
  EXPECT_EQ(report.log.ddq.cols(), 0);
}

TEST_F(MeasuredLog, DvrkMasterRepeatsRowsAndPatientSideRepeatsItsPath) {
  const TorqueLogReport master = look("dvrk/mtm_traj1.csv");
  EXPECT_NEAR(of(master, LogFault::kStaleRows)[0].share, 0.14, 0.02);
  const TorqueData data = read({"dvrk/psm_traj1_noload.csv", "dvrk/psm_traj1_105g_parallel.csv",
                                "dvrk/psm_traj1half_105g_parallel.csv", "dvrk/psm_trajA.csv"});
  const std::vector<int> repeats = repeated_paths(data.samples);
  EXPECT_EQ(std::ranges::count(repeats, 0), 4) << "one commanded path, also at half speed";
  LogMapping mapping;
  mapping.rate_hz = 200.0;
  EXPECT_EQ(look("dvrk/mtm_joint4_slow_sweep.csv", mapping).log.columns(), 1);
}

TEST_F(MeasuredLog, KukaFilesAreOnePath) {
  const TorqueData data = read({"kuka_lwr4/measurements_1.csv", "kuka_lwr4/measurements_2.csv"});
  EXPECT_EQ(repeated_paths(data.samples), (std::vector<int>{0, 0}));
  EXPECT_EQ(data.source, MotionSource::kLogged);
}

TEST_F(MeasuredLog, SchunkHasSeventyTrajectories) {
  const TorqueLogReport report = look("schunk_6dof/schunk_rec1_70.csv.gz");
  EXPECT_EQ(report.log.trajectory.maxCoeff(), 69);
  EXPECT_EQ(report.log.trajectory_names.front(), "1");
  const TorqueData data = read({"schunk_6dof/schunk_rec1_70.csv.gz"});
  EXPECT_GT(data.samples.trajectory.maxCoeff(), 50);
}

TEST_F(MeasuredLog, IiwaAndSarcosHaveNoClock) {
  const TorqueLogReport iiwa = look("iiwa14_lasa/iiwa14_samples.csv");
  ASSERT_EQ(of(iiwa, LogFault::kNoClock).size(), 1U);
  EXPECT_NEAR(of(iiwa, LogFault::kNoClock)[0].value, 50.0, 0.5);
  const TorqueLogReport sarcos = look("sarcos_test/sarcos_inv_test.csv");
  ASSERT_EQ(of(sarcos, LogFault::kNoClock).size(), 1U);
  EXPECT_NEAR(of(sarcos, LogFault::kNoClock)[0].value, 10.0, 0.5) << "every tenth row of 100 Hz";
}

TEST_F(MeasuredLog, FrankaAccelerationsAreZeroThroughout) {
  LogMapping mapping;
  mapping.torque = {"tau_friction*"};
  const TorqueLogReport franka =
      look("franka_fairino_friction/franka_case3_high_joint2.csv.gz", mapping);
  ASSERT_EQ(of(franka, LogFault::kConstant).size(), 1U);
  EXPECT_EQ(of(franka, LogFault::kConstant)[0].channel, "ddq2");
  EXPECT_EQ(franka.log.ddq.cols(), 0);
  EXPECT_FALSE(of(franka, LogFault::kGap).empty());
  EXPECT_FALSE(of(franka, LogFault::kInfinite).empty()) << "a diverging published prediction";
  const TorqueLogReport fairino =
      look("franka_fairino_friction/fairino_line_slow_joint3.csv.gz", mapping);
  EXPECT_EQ(fairino.log.columns(), 1);
}

TEST_F(MeasuredLog, FeetechHasRunsRepeatsAndUnsignedCurrent) {
  const TorqueLogReport report = look("feetech_pendulum/sts3250.csv.gz");
  EXPECT_EQ(report.rows_read, 230400);
  EXPECT_GE(report.log.trajectory.maxCoeff(), 383);
  EXPECT_FALSE(of(report, LogFault::kStaleRows).empty());
  EXPECT_EQ(report.log.torque_unit, "A");
  EXPECT_GE(report.log.torque.minCoeff(), 0.0);
}

TEST_F(MeasuredLog, KinovaWrapsAndHoldsAnInfinity) {
  LogMapping mapping;
  mapping.rate_hz = 999.0;
  const TorqueLogReport fast = look("kinova_gen3_joint7/const_velocity_1.50.csv", mapping);
  ASSERT_EQ(of(fast, LogFault::kWrapped).size(), 1U);
  EXPECT_TRUE(of(fast, LogFault::kWrapped)[0].place.ends_with(":219"));
  EXPECT_EQ(fast.log.torque_columns.front(), "tau_sensor");
  const TorqueLogReport slow = look("kinova_gen3_joint7/const_velocity_0.03.csv", mapping);
  ASSERT_EQ(of(slow, LogFault::kInfinite).size(), 1U);
  EXPECT_TRUE(of(slow, LogFault::kInfinite)[0].place.ends_with(":2"));
}

TEST_F(MeasuredLog, Ur5IsInDegreesAndMillisecondsByName) {
  const TorqueLogReport report = look("ur5_contact/base_sweep_7degps_1.csv");
  EXPECT_NEAR(report.log.q(0, 0), -2.0935, 1e-3);
  EXPECT_NEAR(report.log.t_s(report.log.rows() - 1), 4.8, 0.1);
  EXPECT_TRUE(of(report, LogFault::kUnit).empty());
  // The same numbers under names that hide the units.
  LogMapping hidden;
  hidden.position_unit = {"rad"};
  hidden.time_unit = "s";
  EXPECT_GT(look("ur5_contact/base_sweep_7degps_1.csv", hidden).log.q.cwiseAbs().maxCoeff(), 100.0);
  const auto text = [&] {
    ChannelTable table = read_channel_table(root_ / "ur5_contact/base_sweep_7degps_1.csv");
    std::string csv = "t,q1,q2,q3,q4,q5,q6,i1,i2,i3,i4,i5,i6\n";
    for (Eigen::Index r = 0; r < table.rows(); ++r) {
      csv += std::to_string(table.values(r, 0));
      for (const Eigen::Index c : {1, 2, 3, 4, 5, 6, 13, 14, 15, 16, 17, 18}) {
        csv += "," + std::to_string(table.values(r, c));
      }
      csv += "\n";
    }
    return csv;
  }();
  const std::string refused =
      refusal_of([&] { static_cast<void>(read_torque_data({write_log("ur5.csv", text)}, {})); });
  EXPECT_NE(refused.find("is it in degrees?"), std::string::npos) << refused;
}

TEST_F(MeasuredLog, WamTorquesAreCommandsAndItsFirstRowIsStartUp) {
  const TorqueLogReport report = look("wam_2dof/wam_state_4.csv");
  EXPECT_EQ(of(report, LogFault::kCommanded).size(), 1U);
  const auto spikes = of(report, LogFault::kSpike);
  EXPECT_TRUE(
      std::ranges::any_of(spikes, [](const LogFinding& s) { return s.place.ends_with(":2"); }));
}

TEST_F(MeasuredLog, TiagoNamesItsJoints) {
  const std::vector<WantedJoint> joints = {{"torso_lift_joint", true}, {"arm_1_joint", false},
                                           {"arm_2_joint", false},     {"arm_3_joint", false},
                                           {"arm_4_joint", false},     {"arm_5_joint", false},
                                           {"arm_6_joint", false},     {"arm_7_joint", false}};
  const TorqueLogReport report =
      look_at_torque_log({root_ / "tiago_identification/tiago_dynamic.csv"}, joints);
  EXPECT_EQ(report.log.q_columns.front(), "q_torso_lift");
  EXPECT_EQ(report.log.torque_columns.back(), "effort_arm_7");
  EXPECT_TRUE(of(report, LogFault::kAssignment).empty());
  EXPECT_EQ(of(report, LogFault::kVelocityLag).size(), 8U)
      << "its driver filters velocities for 0.15 s and more";
}

TEST_F(MeasuredLog, AmD02RepeatsItsPositions) {
  const TorqueLogReport first = look("am_d02_arm/collect_joint1.csv");
  ASSERT_EQ(of(first, LogFault::kStaleRows).size(), 1U);
  EXPECT_GT(of(first, LogFault::kStaleRows)[0].share, 0.45);
  const TorqueLogReport third = look("am_d02_arm/collect_joint3.csv");
  ASSERT_FALSE(of(third, LogFault::kStaleRows).empty());
  EXPECT_GT(of(third, LogFault::kStaleRows)[0].share, 0.3) << "without its rests";
  EXPECT_FALSE(of(first, LogFault::kIrregularSteps).empty());
  const TorqueLogReport processed = look("am_d02_arm/collect_joint2_processed.csv.gz");
  EXPECT_FALSE(of(processed, LogFault::kStaleRows).empty());
}

TEST_F(MeasuredLog, WindowsAndCyclesAreRefusedForWantOfPositions) {
  for (const char* file :
       {"contact_windows_zhaw/windows_ur5.csv.gz", "ur3_cobotops/ur3_cobotops.csv.gz"}) {
    const std::string refused = refusal_of([&] { static_cast<void>(read({file})); });
    EXPECT_NE(refused.find("no joint positions among the columns"), std::string::npos) << refused;
  }
}

}  // namespace
}  // namespace kinescope
