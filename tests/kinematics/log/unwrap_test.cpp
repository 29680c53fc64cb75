// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/unwrap.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "kinematics/core/rng.h"
#include "kinematics/log/joint_log.h"

namespace kinescope {
namespace {

using Signal = std::function<double(double)>;

std::vector<double> times(double rate_hz, double duration_s = 20.0) {
  std::vector<double> out;
  for (int i = 0; i < static_cast<int>(duration_s * rate_hz); ++i) out.push_back(i / rate_hz);
  return out;
}

Eigen::VectorXd sampled(const std::vector<double>& times_s, const Signal& signal) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(times_s.size()));
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    out[static_cast<Eigen::Index>(i)] = signal(times_s[i]);
  }
  return out;
}

double wrapped(double value, double lower, double period) {
  return value - period * std::floor((value - lower) / period);
}

/// To and fro over 1.2 turns with two frequencies, in turns.
double sway(double t) { return 0.4 * std::sin(0.7 * t) + 0.2 * std::sin(1.9 * t + 1.0); }

double largest_step(const Eigen::VectorXd& values) {
  return (values.tail(values.size() - 1) - values.head(values.size() - 1)).cwiseAbs().maxCoeff();
}

struct Encoder {
  const char* name;
  double period;
  double lower;
  double rate_hz;
  double noise;  ///< standard deviation, of a period
  bool whole;
};

void PrintTo(const Encoder& encoder, std::ostream* out) { *out << encoder.name; }

class Wraps : public testing::TestWithParam<Encoder> {};

TEST_P(Wraps, AreTakenOutAndTheRestKeepsItsValues) {
  const Encoder& e = GetParam();
  for (const double start : {0.0, 0.25, 0.5, 0.9}) {
    Rng rng = Rng::from_name(fmt::format("Wraps.{}.{}", e.name, start));
    const std::vector<double> t = times(e.rate_hz);
    const Eigen::VectorXd truth = sampled(t, [&](double s) {
      const double value = e.period * (sway(s) + start + e.noise * rng.normal());
      return e.whole ? std::floor(value) : value;
    });
    const Eigen::VectorXd logged =
        truth.unaryExpr([&](double v) { return wrapped(v, e.lower, e.period); });
    if (largest_step(logged) < 0.5 * e.period) continue;  // this one does not cross the border
    const auto found = unwrap(t, logged);
    ASSERT_TRUE(found) << start;
    EXPECT_NEAR(found->period, e.period, 2e-4 * e.period);
    const double turn = found->values[0] - truth[0];
    EXPECT_NEAR(turn, e.period * std::round(turn / e.period), 1e-9 * e.period);
    EXPECT_LT((found->values - truth).cwiseAbs().maxCoeff() - std::abs(turn), 1e-3 * e.period);
    EXPECT_EQ(found->values[0], logged[0]);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Encoders, Wraps,
    testing::Values(Encoder{"radians", 2.0 * std::numbers::pi, -std::numbers::pi, 100.0, 0.0,
                            false},
                    Encoder{"radians_from_zero", 2.0 * std::numbers::pi, 0.0, 1000.0, 1e-4, false},
                    Encoder{"degrees", 360.0, 0.0, 100.0, 0.0, false},
                    Encoder{"degrees_at_video_rate", 360.0, -180.0, 30.0, 0.0, false},
                    Encoder{"degrees_at_10_hz", 360.0, 0.0, 10.0, 0.0, false},
                    Encoder{"degrees_at_5_hz", 360.0, 0.0, 5.0, 0.0, false},
                    Encoder{"whole_degrees", 360.0, 0.0, 50.0, 0.0, true},
                    Encoder{"ticks_12_bit", 4096.0, 0.0, 100.0, 0.0, true},
                    Encoder{"ticks_12_bit_noisy", 4096.0, 0.0, 200.0, 5e-4, true},
                    Encoder{"ticks_10_bit", 1024.0, 0.0, 50.0, 0.0, true},
                    Encoder{"ticks_16_bit_signed", 65536.0, -32768.0, 100.0, 1e-5, true},
                    Encoder{"turns", 1.0, 0.0, 100.0, 0.0, false},
                    Encoder{"tenths_of_degrees", 3600.0, 0.0, 100.0, 0.0, true}),
    [](const auto& encoder) { return std::string(encoder.param.name); });

TEST(Unwrap, SteadySpinAndLateReadings) {
  const std::vector<double> t = times(100.0);
  const auto spin = unwrap(t, sampled(t, [](double s) { return wrapped(80.0 * s, 0.0, 360.0); }));
  ASSERT_TRUE(spin);
  EXPECT_EQ(spin->jumps, 4);
  EXPECT_NEAR(spin->values[1999], 80.0 * 19.99, 1e-9);
  // A sensor that is read at a quarter of the log's rate repeats its values.
  const auto held = unwrap(t, sampled(t, [](double s) {
                             return wrapped(360.0 * sway(std::floor(25.0 * s) / 25.0), 0.0, 360.0);
                           }));
  ASSERT_TRUE(held);
  EXPECT_LT(largest_step(held->values), 30.0);
}

TEST(Unwrap, ASensorAtRestOnTheBorder) {
  Rng rng = Rng::from_name("Unwrap.rest");
  const std::vector<double> t = times(100.0);
  const auto found = unwrap(t, sampled(t, [&](double s) {
                              const double moved =
                                  s < 8.0 ? 0.0 : 300.0 * (1.0 - std::cos(s - 8.0));
                              return wrapped(std::floor(moved + rng.normal()), 0.0, 4096.0);
                            }));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->period, 4096.0);
  EXPECT_LT(largest_step(found->values), 20.0);
}

TEST(Unwrap, RealMovesStay) {
  Rng rng = Rng::from_name("Unwrap.moves");
  const std::vector<double> t = times(100.0);
  // Grippers and valves that switch over their whole range within a sample.
  for (const double full : {255.0, 256.0, 1023.0, 4095.0, 4096.0, 65535.0, 360.0, 1.0, 100.0}) {
    const auto toggle = [&](double s) { return std::fmod(s, 5.0) < 2.5 ? 0.0 : full; };
    EXPECT_FALSE(unwrap(t, sampled(t, [&](double s) { return toggle(10.0 * s); }))) << full;
    EXPECT_FALSE(unwrap(t, sampled(t, toggle))) << full;
    EXPECT_FALSE(
        unwrap(t, sampled(t, [&](double s) { return toggle(s) + 1e-4 * full * rng.normal(); })))
        << full;
  }
  // Postures, each at its own place of a full turn.
  EXPECT_FALSE(unwrap(t, sampled(t, [&](double) { return rng.uniform(-3.14, 3.14); })));
  // Stops a third of a turn apart, reached within a sample.
  EXPECT_FALSE(
      unwrap(t, sampled(t, [](double s) { return 120.0 * std::fmod(std::floor(s), 3.0); })));
  // A fast move over most of a turn, and one bad reading.
  EXPECT_FALSE(unwrap(t, sampled(t, [](double s) {
                        return 3.0 * std::tanh(40.0 * (s - 10.0)) + 0.1 * std::sin(s);
                      })));
  EXPECT_FALSE(unwrap(t, sampled(t, [](double s) { return s == 5.0 ? 359.0 : 20.0 * sway(s); })));
  // Readings out of nowhere against the motion, each the same way as far as the last one.
  EXPECT_FALSE(unwrap(t, sampled(t, [](double s) {
                        return 0.5 * s + (s == 5.0 || s == 9.0 || s == 14.0 ? -30.0 : 0.0);
                      })));
  // A motion that stays within its turn.
  EXPECT_FALSE(unwrap(t, sampled(t, [](double s) { return 2.0 * std::numbers::pi * sway(s); })));
}

TEST(Unwrap, TheReaderNamesChannelAndJump) {
  std::string text = "t,a,b\n";
  for (int i = 0; i < 400; ++i) {
    const double angle = 350.0 + 0.1 * i;
    text += fmt::format("{},{:.3f},{}\n", 0.01 * i, wrapped(angle, 0.0, 360.0), 0.01 * i);
  }
  const JointLog log = parse_joint_log(text, "joints.csv");
  EXPECT_NEAR(log.values(399, 0), 389.9, 1e-9);
  ASSERT_EQ(log.warnings.size(), 1U);
  EXPECT_EQ(log.warnings[0],
            "joints.csv: channel 'a' starts again at the end of its range (1 jumps, the first from "
            "359.9 to 0 at t = 0.990 s): it is unwrapped, with a period of 360");
  // Between the samples of the jump, too, there is a posture of the robot.
  const auto between = interpolate(log, 0, 0.995);
  ASSERT_TRUE(between);
  EXPECT_NEAR(between->value, 359.95, 1e-6);
}

}  // namespace
}  // namespace kinescope
