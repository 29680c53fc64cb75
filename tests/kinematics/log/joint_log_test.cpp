// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/joint_log.h"

#include <cmath>
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

std::string refusal(std::string_view text, const std::vector<std::string>& torques = {}) {
  try {
    static_cast<void>(parse_joint_log(text, "joints.csv", torques));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    return error.what();
  }
  return "accepted";
}

/// A log of y(t) at uneven times in [0, 2].
template <typename Function>
JointLog sampled(Function y, int samples, double unevenness) {
  Rng rng = Rng::from_name("JointLog.sampled");
  JointLog log;
  log.channels = {"a"};
  log.values.resize(samples, 1);
  for (int i = 0; i < samples; ++i) {
    const double step = 2.0 / (samples - 1);
    log.times_s.push_back(step * (i + unevenness * rng.uniform(-0.4, 0.4)));
    log.values(i, 0) = y(log.times_s.back());
  }
  return log;
}

TEST(JointLog, KeepsChannelsAndLeavesTorquesOut) {
  const JointLog log =
      parse_joint_log("b,t,tau1,current,a\n1,0,9,7,2\n3,0.5,9,7,4\n", "j", {"current"});
  EXPECT_EQ(log.channels, (std::vector<std::string>{"b", "a"}));
  EXPECT_EQ(log.times_s, (std::vector<double>{0.0, 0.5}));
  EXPECT_EQ(log.values(1, 0), 3.0);
  EXPECT_EQ(log.values(1, 1), 4.0);
  EXPECT_EQ(log.channel("a"), 1);
  EXPECT_EQ(log.channel("tau1"), std::nullopt);
}

TEST(JointLog, RefusesWithLineAndRemedy) {
  EXPECT_EQ(
      refusal("t,a\n0,1\n0.1,2\n0.1,3\n0.1,4\n"),
      "joints.csv:4: time 0.100000 s does not come after 0.100000 s (sort the rows by time and "
      "remove repeated stamps)");
  EXPECT_NE(refusal("t,a\n0,1\n-1,2\n").find("joints.csv:3:"), std::string::npos);
  EXPECT_NE(refusal("t,a\n0,1\n1,nan\n").find("joints.csv:3: column 'a' holds 'nan'"),
            std::string::npos);
  EXPECT_NE(refusal("t,a\nnan,1\n").find("joints.csv:2: column 't' holds 'nan'"),
            std::string::npos);
  EXPECT_NE(refusal("clock,a\n0,1\n").find("no column 't'"), std::string::npos);
  EXPECT_NE(refusal("t,tau1\n0,1\n").find("no joint channel"), std::string::npos);
  EXPECT_NE(refusal("t,x\n0,1\n", {"x"}).find("no joint channel"), std::string::npos);
  EXPECT_NE(refusal("t,a,a\n0,1,2\n").find("two columns"), std::string::npos);
  EXPECT_NE(refusal("t a b\n0 1\n").find("separated by ' '"), std::string::npos);
  EXPECT_NE(refusal("").find("is empty"), std::string::npos);
}

TEST(JointLog, TakesTheTimeUnderItsUsualNames) {
  for (const char* name : {"t", "T", "time", "Time", "stamp", "timestamp"}) {
    const JointLog log = parse_joint_log(std::string("a,") + name + "\n1,0\n2,0.1\n", "j");
    EXPECT_EQ(log.time_column, name);
    EXPECT_EQ(log.channels, std::vector<std::string>{"a"});
    EXPECT_EQ(log.times_s, (std::vector<double>{0.0, 0.1}));
  }
  const JointLog log = parse_joint_log("time,t\n1,0\n2,0.1\n", "j");
  EXPECT_EQ(log.time_column, "t");
  EXPECT_EQ(log.channels, std::vector<std::string>{"time"});
}

TEST(JointLog, LeavesOutWhatIsNoChannelWithAWarning) {
  const JointLog log =
      parse_joint_log("t,a,mode,temp,spare,tau1\n0,1,AUTO,nan,,5\n0.1,2,AUTO,nan,,5\n", "j");
  EXPECT_EQ(log.channels, std::vector<std::string>{"a"});
  EXPECT_EQ(log.left_out, (std::vector<std::string>{"mode", "temp", "spare"}));
  EXPECT_EQ(log.torque_columns, std::vector<std::string>{"tau1"});
  ASSERT_EQ(log.warnings.size(), 3U);
  EXPECT_EQ(log.warnings[0], "j: column 'mode' holds no number and is left out");
  EXPECT_EQ(log.values(1, 0), 2.0);
  EXPECT_NE(refusal("t,mode\n0,AUTO\n").find("no joint channel"), std::string::npos);
  EXPECT_NE(refusal("t,a\n0,1\n1,2 deg\n").find("joints.csv:3: column 'a' holds '2 deg'"),
            std::string::npos);
}

TEST(JointLog, LeavesOutRepeatedRowsAndTheFirstBlankOnes) {
  const JointLog log =
      parse_joint_log("t,a,b\n0,,\n0.1,1,\n0.2,1,nan\n0.3,2,5\n0.3,2,5\n0.4,3,6\n", "j");
  EXPECT_EQ(log.times_s, (std::vector<double>{0.3, 0.4}));
  ASSERT_EQ(log.values.rows(), 2);
  EXPECT_EQ(log.values(1, 1), 6.0);
  ASSERT_EQ(log.warnings.size(), 2U);
  EXPECT_EQ(log.warnings[0], "j: the first 3 rows, in which a channel is blank, are left out");
  EXPECT_EQ(log.warnings[1], "j: 1 rows repeat the row before and are left out");
  EXPECT_NE(refusal("t,a,b\n0,1,1\n1,,1\n").find("joints.csv:3: column 'a' holds ''"),
            std::string::npos);
  EXPECT_NE(refusal("t,a,b\n0,1,\n1,,1\n").find("joints.csv:2: column 'b' holds ''"),
            std::string::npos);
}

/// A log of 40 rows at 0, 0.1, .. s with some lines (counted from 2) written otherwise.
std::string forty_rows(const std::map<std::size_t, std::string>& otherwise) {
  std::string text = "t,a\n";
  for (std::size_t line = 2; line < 42; ++line) {
    const auto other = otherwise.find(line);
    text += other != otherwise.end()
                ? other->second
                : fmt::format("{:.1f},{}", 0.1 * static_cast<double>(line - 2), line);
    text += "\n";
  }
  return text;
}

TEST(JointLog, LeavesOutAFewBadRows) {
  const std::map<std::string, std::string> bad = {
      {"1.0,nan", "column 'a' holds 'nan', not a finite number"},
      {"1.0,-inf", "column 'a' holds '-inf', not a finite number"},
      {"1.0,ERR (7)", "column 'a' holds 'ERR (7)', not a finite number"},
      {"1.0,", "column 'a' holds '', not a finite number"},
      {",12", "column 't' holds '', not a finite number"},
      {"1.0", "1 cells where the header has 2"},
      {"1.0,12,3", "3 cells where the header has 2"},
      {"0.9,12", "time 0.900000 s does not come after 0.900000 s"},
      {"0.1,12", "time 0.100000 s does not come after 0.900000 s"},
      {"1e9,12", "time 1000000000.000000 s does not come before 1.100000 s"}};
  for (const auto& [row, complaint] : bad) {
    const JointLog log = parse_joint_log(forty_rows({{12, row}}), "j");
    ASSERT_EQ(log.size(), 39U) << row;
    EXPECT_EQ(log.values.rows(), 39) << row;
    EXPECT_EQ(log.values(10, 0), 13.0) << row;
    EXPECT_EQ(log.times_s[10], 1.1) << row;
    EXPECT_EQ(log.warnings, std::vector<std::string>{"j:12: " + complaint + ": left out"});
  }
}

TEST(JointLog, SumsSeveralBadRowsUp) {
  const std::string text = forty_rows({{30, "2.8,nan"}, {12, "1.0,"}, {41, "3."}});
  EXPECT_EQ(parse_joint_log(text, "j").warnings,
            std::vector<std::string>{"j: 3 of 40 rows are left out, the first: j:12: column 'a' "
                                     "holds '', not a finite number"});
}

TEST(JointLog, RefusesManyBadRows) {
  EXPECT_NE(refusal(forty_rows({{12, "1.0,"}, {15, "x"}, {16, "x"}, {17, "1,nan"}}))
                .find("joints.csv:12: column 'a' holds ''"),
            std::string::npos)
      << "four of forty";
  EXPECT_NE(refusal("t,a\n0,1\n1,x\n2,3\n3,\n").find("joints.csv:3:"), std::string::npos)
      << "half of them";
}

TEST(JointLog, UnitsInBracketsAreNoPartOfANameAndThatOfTheTimeIsUsed) {
  const JointLog log =
      parse_joint_log("t [ms];ch0 [rad];tau_0 [Nm];i [A]\n0;1,5;7;1\n100;2;7;1\n", "j", {"i [A]"});
  EXPECT_EQ(log.channels, std::vector<std::string>{"ch0"});
  EXPECT_EQ(log.channel("ch0 [rad]"), 0);
  EXPECT_EQ(log.torque_columns, (std::vector<std::string>{"tau_0", "i"}));
  EXPECT_EQ(log.time_column, "t [ms]");
  EXPECT_EQ(log.times_s, (std::vector<double>{0.0, 0.1}));
  EXPECT_EQ(log.values(0, 0), 1.5);
}

TEST(Interpolation, IsExactOnParabolasBetweenEvenOrUnevenSamples) {
  // Slopes from a parabola through three points make the cubic exact for degree 2 away from the
  // ends.
  const auto y = [](double t) { return 1.0 - 2.0 * t + 3.0 * t * t; };
  const auto rate = [](double t) { return -2.0 + 6.0 * t; };
  constexpr double kExact = 1e-12;  // rounding, steps of 0.05 in the divisor
  for (const double unevenness : {0.0, 1.0}) {
    const JointLog log = sampled(y, 41, unevenness);
    for (double t = 0.2; t < 1.8; t += 0.0137) {
      const auto found = interpolate(log, 0, t);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->value, y(t), kExact);
      EXPECT_NEAR(found->rate, rate(t), 100 * kExact);
    }
  }
}

TEST(Interpolation, ErrorFallsWithTheCubeOfTheStep) {
  // Three-point slopes are of second order, so the cubic Hermite is of third order between samples.
  const auto y = [](double t) { return std::sin(3.0 * t); };
  const auto worst = [&](int samples) {
    const JointLog log = sampled(y, samples, 0.0);
    double error = 0.0;
    for (double t = 0.3; t < 1.7; t += 0.001) {
      error = std::max(error, std::abs(interpolate(log, 0, t)->value - y(t)));
    }
    return error;
  };
  const double ratio = worst(41) / worst(81);
  EXPECT_GT(ratio, 6.5);
  EXPECT_LT(worst(81), 2e-5);
}

TEST(Interpolation, HitsSamplesAndIsSmooth) {
  const JointLog log = sampled([](double t) { return std::sin(5.0 * t); }, 21, 1.0);
  for (std::size_t i = 1; i + 1 < log.size(); ++i) {
    EXPECT_EQ(interpolate(log, 0, log.times_s[i])->value,
              log.values(static_cast<Eigen::Index>(i), 0));
    constexpr double kBeside = 1e-9;
    const auto before = interpolate(log, 0, log.times_s[i] - kBeside);
    const auto after = interpolate(log, 0, log.times_s[i] + kBeside);
    EXPECT_NEAR(before->value, after->value, 1e-7);
    EXPECT_NEAR(before->rate, after->rate, 1e-5);
    EXPECT_NEAR(interpolate(log, 0, log.times_s[i])->rate, after->rate, 1e-5);
  }
}

TEST(Interpolation, RateIsTheDerivativeOfTheValue) {
  const JointLog log = sampled([](double t) { return std::sin(5.0 * t); }, 21, 1.0);
  constexpr double kStep = 1e-6;
  for (double t = 0.11; t < 1.9; t += 0.0731) {
    const double numeric =
        (interpolate(log, 0, t + kStep)->value - interpolate(log, 0, t - kStep)->value) /
        (2.0 * kStep);
    EXPECT_NEAR(interpolate(log, 0, t)->rate, numeric, 1e-6);
  }
}

TEST(Interpolation, GivesNothingOutsideAndInGaps) {
  JointLog log;
  log.channels = {"a"};
  log.times_s = {1.0, 1.1, 2.0};
  log.values = Eigen::Vector3d(1, 2, 3);
  EXPECT_FALSE(interpolate(log, 0, 0.999));
  EXPECT_FALSE(interpolate(log, 0, 2.001));
  EXPECT_TRUE(interpolate(log, 0, 1.0));
  EXPECT_TRUE(interpolate(log, 0, 2.0));
  EXPECT_FALSE(interpolate(log, 0, 1.5)) << "a gap of 0.9 s";
  EXPECT_TRUE(interpolate(log, 0, 1.5, 1.0));
  EXPECT_FALSE(interpolate(JointLog{}, 0, 1.0));
}

TEST(Interpolation, ASingleSampleHasItsValueAndNoRate) {
  JointLog log;
  log.channels = {"a"};
  log.times_s = {3.0};
  log.values.resize(1, 1);
  log.values(0, 0) = 7.0;
  EXPECT_EQ(interpolate(log, 0, 3.0)->value, 7.0);
  EXPECT_EQ(interpolate(log, 0, 3.0)->rate, 0.0);
}

TEST(Resample, AddsTheOffsetToTheTimes) {
  JointLog log;
  log.channels = {"a", "b"};
  log.times_s = {0.0, 0.1, 0.2, 0.3};
  log.values.resize(4, 2);
  log.values << 0, 10, 1, 11, 2, 12, 3, 13;
  const Eigen::MatrixXd at = resample(log, {0.05, 0.15, 5.0}, 0.1);
  EXPECT_NEAR(at(0, 0), 1.5, 1e-12);
  EXPECT_NEAR(at(1, 1), 12.5, 1e-12);
  EXPECT_TRUE(at.row(2).array().isNaN().all());
  EXPECT_NEAR(resample_rates(log, {0.15}, 0.0)(0, 0), 10.0, 1e-9);
}

TEST(PostureLog, APostureWhoseRowIsMissingLeavesTheOthersPostures) {
  JointLog log;
  log.times_s = {0.0, 1.0, 3.0};
  log.values.resize(3, 1);
  log.values << 1, 2, 3;
  EXPECT_TRUE(is_posture_log(log, {0.0, 1.0, 2.0, 3.0}, {0}));
  EXPECT_FALSE(is_posture_log(log, {0.0, 0.5, 1.0, 1.5, 2.0, 2.5}, {0})) << "a film of a slow log";
  EXPECT_FALSE(is_stamp(log, 2.0));
}

TEST(PostureLog, WhenEveryTimeIsAStamp) {
  JointLog log;
  log.times_s = {0.0, 1.0, 2.0};
  log.values.resize(3, 1);
  log.values << 1, 2, 3;
  EXPECT_TRUE(is_posture_log(log, {2.0, 0.0}, {0}));
  EXPECT_FALSE(is_posture_log(log, {0.0, 0.5}, {0}));
  EXPECT_FALSE(is_posture_log(JointLog{}, {0.0}, {}));
}

// A log whose stamps are the frames', of one channel.
JointLog log_of(const std::vector<double>& values, double step_s) {
  JointLog log;
  log.channels = {"a"};
  log.values.resize(static_cast<Eigen::Index>(values.size()), 1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    log.times_s.push_back(static_cast<double>(i) * step_s);
    log.values(static_cast<Eigen::Index>(i), 0) = values[i];
  }
  return log;
}

bool at_rest(const JointLog& log) {
  std::vector<int> channels;
  for (int c = 0; c < log.values.cols(); ++c) channels.push_back(c);
  return is_posture_log(log, log.times_s, channels);
}

std::vector<double> waves(int count, double step_s) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i)
    values.push_back(std::sin(1.1 * i * step_s) + 0.4 * std::sin(2.7 * i * step_s));
  return values;
}

std::vector<double> by_lot(int count, int frames_each, double noise, std::string_view name) {
  Rng rng = Rng::from_name(name);
  std::vector<double> values;
  for (int i = 0; i < count; ++i) {
    const double value = rng.uniform(-1.0, 1.0);
    for (int k = 0; k < frames_each; ++k) values.push_back(value + rng.normal(noise));
  }
  return values;
}

TEST(PostureLog, AMotionWrittenOnceAFrameIsNone) {
  for (const double step_s : {1.0 / 30.0, 0.1, 0.3})
    EXPECT_FALSE(at_rest(log_of(waves(100, step_s), step_s))) << step_s;
  // Frames lost now and then, and a robot that stands for half of the time.
  Rng rng = Rng::from_name("frames lost");
  JointLog lossy = log_of(waves(200, 0.1), 0.1);
  for (std::size_t i = 0; i < lossy.size(); ++i) {
    lossy.times_s[i] =
        (i == 0 ? 0.0 : lossy.times_s[i - 1]) + (rng.uniform(0, 1) < 0.3 ? 0.2 : 0.1);
    const double t = std::min(lossy.times_s[i], 15.0);
    lossy.values(static_cast<Eigen::Index>(i), 0) = std::sin(t) + rng.normal(1e-3);
  }
  EXPECT_FALSE(at_rest(lossy));
}

TEST(PostureLog, OneChannelThatMovesIsEnough) {
  JointLog log = log_of(waves(100, 0.1), 0.1);
  log.channels = {"a", "idle", "noise"};
  log.values.conservativeResize(Eigen::NoChange, 3);
  log.values.col(1).setConstant(0.7);
  Rng rng = Rng::from_name("noise of an idle channel");
  for (Eigen::Index i = 0; i < log.values.rows(); ++i) log.values(i, 2) = rng.normal(1e-3);
  EXPECT_FALSE(at_rest(log));
  // What drives no joint does not count.
  EXPECT_TRUE(is_posture_log(log, log.times_s, {1, 2}));
}

TEST(PostureLog, PosturesByLotWhateverTheirStamps) {
  for (const double step_s : {1.0 / 30.0, 0.1, 1.0})
    EXPECT_TRUE(at_rest(log_of(by_lot(40, 1, 0.0, "postures"), step_s))) << step_s;
  EXPECT_TRUE(at_rest(log_of(by_lot(1, 1, 0.0, "one frame"), 0.1)));
}

TEST(PostureLog, StopsWithSeveralFramesEach) {
  EXPECT_TRUE(at_rest(log_of(by_lot(30, 5, 0.0, "stops"), 0.1)));
  EXPECT_TRUE(at_rest(log_of(by_lot(30, 2, 1e-4, "short stops"), 0.1)));
  // With the stamps of the stops, at which the robot still settles.
  JointLog log = log_of(by_lot(30, 8, 0.0, "settling"), 0.1);
  for (std::size_t i = 0; i < log.size(); ++i) {
    log.times_s[i] += 3.0 * static_cast<double>(i / 8);
    log.values(static_cast<Eigen::Index>(i), 0) +=
        2e-3 * std::exp(-0.5 * static_cast<double>(i % 8));
  }
  EXPECT_TRUE(at_rest(log));
}

TEST(PostureLog, ASweepInStepsOfWholeSeconds) {
  std::vector<double> values;
  for (int i = 0; i < 60; ++i) values.push_back(0.05 * i);
  EXPECT_TRUE(at_rest(log_of(values, 1.0)));
}

}  // namespace
}  // namespace kinescope
