// SPDX-License-Identifier: Apache-2.0
//
// Each kind of damage once, done to a sound log: the right finding with its place and remedy, and
// only it.
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamics/data/splits.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/error.h"
#include "kinematics/core/gzip.h"
#include "tests/dynamics/data/log_world.h"

namespace kinescope {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

struct Looked {
  TorqueLogReport report;

  [[nodiscard]] std::vector<LogFinding> of(LogFault fault) const {
    return findings_of(report.findings, fault);
  }
  /// The first of a kind; an empty one where there is none, which no expectation fits.
  [[nodiscard]] LogFinding first(LogFault fault) const {
    const std::vector<LogFinding> found = of(fault);
    return found.empty() ? LogFinding{} : found.front();
  }
  /// Findings that ask for attention, as text.
  [[nodiscard]] std::string loud() const {
    std::string text;
    for (const LogFinding& finding : report.findings) {
      if (finding.weight != FaultWeight::kNote) text += std::string(to_string(finding.fault)) + " ";
    }
    return text;
  }
};

Looked look(const LogWorld& world, const TorqueDataOptions& options = {}) {
  return {look_at_torque_log({write_log("damaged.csv", world.csv())}, world.joints, options)};
}

std::string refusal(const LogWorld& world) {
  return refusal_of([&] {
    static_cast<void>(read_torque_data({write_log("damaged.csv", world.csv())}, world.joints));
  });
}

LogWorldOptions usual_noise() {
  return {.position_noise = 2e-5, .velocity_noise = 1e-3, .torque_noise = 0.02};
}

/// "/.../damaged.csv:17" ends with ":17".
void expect_line(const LogFinding& finding, std::size_t line) {
  const std::string end = "damaged.csv:" + std::to_string(line);
  EXPECT_TRUE(finding.place.ends_with(end)) << finding.place << " is not " << end;
  EXPECT_FALSE(finding.remedy.empty());
}

// The header is line 1, row 0 is line 2.
constexpr std::size_t kFirstLine = 2;

TEST(DamagedLog, ASoundLogHasNothingToSay) {
  const Looked looked = look(make_log_world(usual_noise()));
  EXPECT_TRUE(looked.report.findings.empty()) << to_line(looked.report.findings.front());
  EXPECT_EQ(looked.report.log.rows(), looked.report.rows_read);
}

TEST(DamagedLog, EmptyAndInfiniteCells) {
  LogWorld world = make_log_world(usual_noise());
  world.rows(100, world.column("q2")) = std::nan("");
  world.rows(101, world.column("tau3")) = HUGE_VAL;
  world.rows(102, world.column("tau3")) = 1e282;
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "not_a_number infinite ");
  expect_line(looked.first(LogFault::kNotANumber), kFirstLine + 100);
  EXPECT_EQ(looked.first(LogFault::kNotANumber).channel, "q2");
  expect_line(looked.first(LogFault::kInfinite), kFirstLine + 101);
  EXPECT_EQ(looked.first(LogFault::kInfinite).value, 2.0);
  EXPECT_EQ(looked.report.log.rows(), world.rows.rows() - 3);
}

TEST(DamagedLog, LargeNumbersInOtherColumnsAreNumbers) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.col(0) = 1.7e15 + 1e6 * world.rows.col(0).array();
  world.header[0] = "stamp_us";
  std::string text = world.csv();
  const Looked looked = {look_at_torque_log({write_log("damaged.csv", text)}, world.joints, {})};
  EXPECT_TRUE(looked.of(LogFault::kInfinite).empty());
}

TEST(DamagedLog, MostlyEmptyIsRefused) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.col(world.column("q2")).head(1500).setConstant(std::nan(""));
  EXPECT_NE(refusal(world).find("of 2001 rows hold numbers"), std::string::npos);
}

TEST(DamagedLog, RepeatedStamps) {
  LogWorld world = make_log_world(usual_noise());
  world.rows(200, 0) = world.rows(199, 0);
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "repeated_stamps ");
  expect_line(looked.first(LogFault::kRepeatedStamps), kFirstLine + 200);
}

TEST(DamagedLog, AFewLateRowsAreLeftOutAndShuffledRowsRefused) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.row(300).swap(world.rows.row(301));
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "stamps_go_back ");
  expect_line(looked.first(LogFault::kStampsGoBack), kFirstLine + 301);
  LogWorld reversed = make_log_world(usual_noise());
  reversed.rows = reversed.rows.colwise().reverse().eval();
  EXPECT_NE(refusal(reversed).find("(sort the rows by time)"), std::string::npos);
}

TEST(DamagedLog, AClockThatStartsAgainBeginsATrajectory) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::MatrixXd once = world.rows;
  world.rows.resize(2 * once.rows(), once.cols());
  world.rows << once, once;
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "");
  expect_line(looked.first(LogFault::kStampsGoBack),
              kFirstLine + static_cast<std::size_t>(once.rows()));
  EXPECT_EQ(looked.report.log.bounds().size(), 3U);
}

TEST(DamagedLog, GapsAreFoundAndLongOnesSplit) {
  LogWorld world = make_log_world(usual_noise());
  Eigen::MatrixXd kept(world.rows.rows() - 103, world.rows.cols());
  kept << world.rows.topRows(500), world.rows.middleRows(503, 497), world.rows.bottomRows(901);
  world.rows = kept;
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "gap ");
  const LogFinding gap = looked.first(LogFault::kGap);
  expect_line(gap, kFirstLine + 997);
  EXPECT_NEAR(gap.value, 0.505, 1e-9);
  EXPECT_EQ(looked.report.log.bounds().size(), 3U)
      << "one split: 20 ms are bridged, 505 ms are not";
}

TEST(DamagedLog, StaleRows) {
  LogWorld world = make_log_world(usual_noise());
  for (Eigen::Index r = 0; r < world.rows.rows(); ++r) {
    const double t = world.rows(r, 0);
    world.rows.row(r) = world.rows.row(r - r % 4);
    world.rows(r, 0) = t;
  }
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "stale_rows ");
  const LogFinding stale = looked.first(LogFault::kStaleRows);
  EXPECT_NEAR(stale.share, 0.75, 0.01);
  EXPECT_EQ(stale.value, 4.0);
  expect_line(stale, kFirstLine + 1);
  EXPECT_NE(stale.remedy.find("about 50 times a second"), std::string::npos);
}

TEST(DamagedLog, ARobotAtRestIsNotStale) {
  LogWorld world = make_log_world({});
  const Eigen::Index rest = 400;
  Eigen::MatrixXd rows(world.rows.rows() + rest, world.rows.cols());
  rows << world.rows.row(0).replicate(rest, 1), world.rows;
  rows.col(0) =
      Eigen::VectorXd::LinSpaced(rows.rows(), 0.0, 0.005 * static_cast<double>(rows.rows() - 1));
  world.rows = rows;
  const Looked looked = look(world);
  EXPECT_TRUE(looked.of(LogFault::kStaleRows).empty());
  EXPECT_EQ(looked.report.log.rows(), rows.rows());
}

TEST(DamagedLog, Spikes) {
  LogWorld world = make_log_world(usual_noise());
  world.rows(700, world.column("tau1")) += 80.0;
  world.rows(900, world.column("q1")) -= 3.0;
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "spike spike ");
  expect_line(looked.first(LogFault::kSpike), kFirstLine + 900);
  ASSERT_EQ(looked.of(LogFault::kSpike).size(), 2U);
  expect_line(looked.of(LogFault::kSpike)[1], kFirstLine + 700);
}

// A blow of two rows, which several joints feel; one reading that fails, or a packet of zeros.
TEST(DamagedLog, ABlowIsNoSpike) {
  const auto with_jump = [](double tau1, double tau2, double q1) {
    LogWorld world = make_log_world(usual_noise());
    for (const Eigen::Index row : {700, 701}) {
      world.rows(row, world.column("tau1")) += tau1;
      world.rows(row, world.column("tau2")) += tau2;
    }
    world.rows(700, world.column("q1")) += q1;
    return world;
  };
  EXPECT_EQ(look(with_jump(80.0, -50.0, 0.0)).loud(), "");
  EXPECT_EQ(look(with_jump(80.0, 0.0, 0.0)).loud(), "spike ");
  EXPECT_EQ(look(with_jump(80.0, -50.0, 3.0)).of(LogFault::kSpike).front().channel, "q1");
  LogWorld dropped = make_log_world(usual_noise());
  for (const char* column : {"tau1", "tau2"}) dropped.rows(700, dropped.column(column)) = -200.0;
  EXPECT_EQ(look(dropped).loud(), "spike spike ");
}

/// Every row with a probability of 5 % any value of the channel's range; how many are.
Eigen::Index make_wild(LogWorld& world, const char* channel) {
  constexpr double kShare = 0.05;
  const Eigen::Index column = world.column(channel);
  const double low = world.rows.col(column).minCoeff();
  const double high = world.rows.col(column).maxCoeff();
  Rng rng = Rng::from_name(channel);
  Eigen::Index wild = 0;
  for (Eigen::Index row = 0; row < world.rows.rows(); ++row) {
    if (rng.uniform(0.0, 1.0) >= kShare) continue;
    world.rows(row, column) = rng.uniform(low, high);
    ++wild;
  }
  return wild;
}

TEST(DamagedLog, WildReadingsAreRejectedAndNoOthers) {
  for (const char* channel : {"tau1", "q1"}) {
    LogWorld world = make_log_world(usual_noise());
    const auto wild = static_cast<double>(make_wild(world, channel));
    const Looked looked = look(world);
    const std::vector<LogFinding> found = looked.of(LogFault::kSpike);
    ASSERT_EQ(found.size(), 1U) << channel;
    EXPECT_EQ(found[0].channel, channel);
    EXPECT_GT(found[0].value, 0.8 * wild) << "the others are near the truth";
    EXPECT_LT(found[0].value, 1.3 * wild);
  }
}

TEST(DamagedLog, WildVelocitiesAreDerivedInstead) {
  LogWorld world = make_log_world(usual_noise());
  make_wild(world, "dq2");
  const Looked looked = look(world);
  EXPECT_TRUE(looked.of(LogFault::kSpike).empty());
  EXPECT_EQ(looked.report.log.dq.cols(), 0);
}

TEST(DamagedLog, WrappedAnglesAreUnwrapped) {
  const LogWorld sound = make_log_world(usual_noise());
  LogWorld world = sound;
  const Eigen::Index q = world.column("q1");
  const double turn = 2.0 * std::numbers::pi;
  world.rows.col(q) = sound.rows.col(q).unaryExpr([&](double x) { return x < 0.0 ? x + turn : x; });
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "");
  EXPECT_EQ(looked.of(LogFault::kWrapped).size(), 1U);
  const double shift = looked.report.log.q(0, 0) - sound.rows(0, q);
  EXPECT_LT(
      (looked.report.log.q.col(0) - sound.rows.col(q)).array().abs().maxCoeff() - std::abs(shift),
      1e-6);
}

TEST(DamagedLog, DegreesForRadians) {
  LogWorld world = make_log_world(usual_noise());
  for (const char* name : {"q1", "q2"}) world.rows.col(world.column(name)) *= kDegrees;
  EXPECT_NE(refusal(world).find("dynamics: {position_unit: [deg]}"), std::string::npos);
  LogWorld velocity = make_log_world(usual_noise());
  velocity.rows.col(velocity.column("dq1")) *= kDegrees;
  EXPECT_NE(refusal(velocity).find("'q1' and 'dq1' differ by 1/57.3"), std::string::npos);
  // Declared, it is read without a word.
  TorqueDataOptions options;
  options.mapping.position_unit = {"deg", "deg", "m"};
  EXPECT_EQ(look(world, options).loud(), "");
}

TEST(DamagedLog, DegreesEverywhereAreSeenByTheirSize) {
  LogWorld world = make_log_world(usual_noise());
  for (const char* name : {"q1", "q2", "dq1", "dq2"})
    world.rows.col(world.column(name)) *= kDegrees;
  EXPECT_NE(refusal(world).find("is it in degrees?"), std::string::npos);
}

TEST(DamagedLog, MillimetresForMetres) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.col(world.column("q3")) *= 1000.0;
  EXPECT_NE(refusal(world).find("mm"), std::string::npos);
}

TEST(DamagedLog, MillisecondsForSeconds) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.col(0) *= 1000.0;
  EXPECT_NE(refusal(world).find("are the stamps in ms?"), std::string::npos);
  EXPECT_NE(refusal(world).find("{time_unit: ms}"), std::string::npos);
  // Without velocities, the rate alone says it.
  LogWorld bare = world;
  bare.header = {"t", "q1", "q2", "q3", "x1", "x2", "x3", "tau1", "tau2", "tau3"};
  EXPECT_NE(refusal(bare).find("one row in 5 s: are the stamps in ms?"), std::string::npos);
  TorqueDataOptions options;
  options.mapping.time_unit = "ms";
  EXPECT_EQ(look(world, options).loud(), "");
}

TEST(DamagedLog, VelocityOfTheWrongSizeSignLagOrJoint) {
  LogWorld scaled = make_log_world(usual_noise());
  scaled.rows.col(scaled.column("dq2")) *= 0.5;
  EXPECT_EQ(look(scaled).loud(), "velocity_scale ");
  EXPECT_NEAR(look(scaled).first(LogFault::kVelocityScale).value, 2.0, 0.02);
  EXPECT_EQ(look(scaled).report.log.dq.cols(), 0) << "derived instead";
  LogWorld negative = make_log_world(usual_noise());
  negative.rows.col(negative.column("dq1")) *= -1.0;
  EXPECT_NEAR(look(negative).first(LogFault::kVelocityScale).value, -1.0, 0.02);
  LogWorldOptions late = usual_noise();
  late.velocity_lag_s = 0.02;
  const Looked lagging = look(make_log_world(late));
  ASSERT_EQ(lagging.of(LogFault::kVelocityLag).size(), 3U);
  constexpr double kLagError = 1e-3;  // s; a fifth of a step
  for (const LogFinding& lag : lagging.of(LogFault::kVelocityLag))
    EXPECT_NEAR(lag.value, 0.02, kLagError);
  LogWorld other = make_log_world(usual_noise());
  other.rows.col(other.column("dq1")).swap(other.rows.col(other.column("dq2")));
  EXPECT_EQ(look(other).loud(), "velocity_mismatch velocity_mismatch ");
}

TEST(DamagedLog, AccelerationsThatAreNone) {
  LogWorld world = make_log_world(usual_noise());
  world.header.insert(world.header.end(), {"ddq1", "ddq2", "ddq3"});
  Eigen::MatrixXd rows(world.rows.rows(), world.rows.cols() + 3);
  rows << world.rows, world.ddq;
  world.rows = rows;
  EXPECT_EQ(look(world).loud(), "");
  EXPECT_EQ(look(world).report.log.ddq.cols(), 3);
  world.rows.col(world.column("ddq2")) *= 3.0;
  EXPECT_EQ(look(world).loud(), "acceleration ");
  EXPECT_EQ(look(world).report.log.ddq.cols(), 0);
  world.rows.rightCols(3).setZero();
  EXPECT_EQ(look(world).loud(), "constant constant constant ");
  EXPECT_EQ(look(world).report.log.ddq.cols(), 0);
}

TEST(DamagedLog, ConstantTorque) {
  LogWorld world = make_log_world(usual_noise());
  world.rows.col(world.column("tau2")).setConstant(3.3);  // no sum of powers of two
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "constant ");
  EXPECT_EQ(looked.first(LogFault::kConstant).channel, "tau2");
}

TEST(DamagedLog, TorquesThatNobodyMeasured) {
  LogWorld world = make_log_world(usual_noise());
  for (const char* column : {"tau1", "tau2", "tau3"}) {
    world.rows.col(world.column(column)).setZero();
  }
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "constant constant constant constant ");
  EXPECT_THROW(throw_refusals(looked.report.findings), Error);
}

TEST(DamagedLog, ClippedTorque) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::Index tau = world.column("tau1");
  const double limit = 0.6 * world.rows.col(tau).maxCoeff();
  world.rows.col(tau) = world.rows.col(tau).cwiseMin(limit);
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "clipped ");
  EXPECT_NEAR(looked.first(LogFault::kClipped).value, limit, 1e-6);
}

/// Rows of a joint's torque that are marked as missing.
Eigen::Index missing(const Looked& looked, Eigen::Index joint) {
  const MissingTorque& marks = looked.report.log.torque_missing;
  return marks.size() == 0 ? 0 : marks.col(joint).count();
}

TEST(DamagedLog, ReadingsAtALimitAreLeftOut) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::Index tau = world.column("tau1");
  const Eigen::VectorXd truth = world.rows.col(tau);
  const double limit = 0.6 * truth.maxCoeff();
  world.rows.col(tau) = truth.cwiseMin(limit);
  const Looked looked = look(world);
  const LogFinding found = looked.first(LogFault::kClipped);
  EXPECT_NE(found.remedy.find("left out"), std::string::npos) << found.remedy;
  const TorqueLog& log = looked.report.log;
  for (Eigen::Index row = 0; row < log.rows(); ++row)
    ASSERT_EQ(log.is_missing(row, 0), truth(row) >= limit) << row;
  EXPECT_EQ(missing(looked, 1) + missing(looked, 2), 0);
  // So are the samples beside them, whose low-pass reaches there.
  const TorqueSamples samples =
      filtered_data(looked.report, {.cutoff_hz = 10.0, .rate_hz = 100.0}).samples;
  ASSERT_EQ(samples.torque_missing.rows(), samples.size());
  for (Eigen::Index k = 0; k < samples.size(); ++k) {
    bool near = false;
    for (Eigen::Index row = 0; row < log.rows(); ++row)
      near = near || (log.is_missing(row, 0) && std::abs(log.t_s(row) - samples.t_s(k)) < 0.09);
    EXPECT_TRUE(!near || samples.is_missing(k, 0)) << samples.t_s(k);
    EXPECT_FALSE(samples.is_missing(k, 1));
  }
  const std::vector<Eigen::Index> kept = measured_rows(samples);
  EXPECT_GT(std::ssize(kept), samples.size() / 3);
  EXPECT_LT(samples.torque.col(0)(kept).maxCoeff(), limit);
}

TEST(DamagedLog, ATorqueThatFreezesIsLeftOut) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::Index tau = world.column("tau2");
  world.rows.col(tau).segment(800, 300).setConstant(world.rows(800, tau));
  world.rows.col(tau).segment(1500, 60).setConstant(world.rows(1500, tau));
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "frozen ");
  const LogFinding found = looked.first(LogFault::kFrozen);
  EXPECT_EQ(found.channel, "tau2");
  EXPECT_NEAR(found.value, 1.495, 1e-9);
  EXPECT_NE(found.what.find("from 4.00 to 5.50 s while"), std::string::npos) << found.what;
  EXPECT_NE(found.what.find("1 times more"), std::string::npos) << found.what;
  expect_line(found, kFirstLine + 800);
  EXPECT_EQ(missing(looked, 1), 360);
  EXPECT_EQ(missing(looked, 0) + missing(looked, 2), 0);
  const TorqueLog& log = looked.report.log;
  EXPECT_NEAR(log.torque(950, 1), 0.5 * (log.torque(799, 1) + log.torque(1100, 1)), 0.05);
}

TEST(DamagedLog, ReadingsInADeadZoneAreLeftOut) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::Index tau = world.column("tau2");
  const Eigen::VectorXd truth = world.rows.col(tau);
  const double band = 0.15 * truth.cwiseAbs().maxCoeff();
  world.rows.col(tau) = (truth.array().abs() < band).select(0.0, truth);
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "dead_zone ");
  const LogFinding found = looked.first(LogFault::kDeadZone);
  EXPECT_EQ(found.channel, "tau2");
  EXPECT_NEAR(found.value, band, 0.05 * band);
  EXPECT_EQ(missing(looked, 1), (truth.array().abs() < band).count());
}

// What repeats values by its nature.
TEST(DamagedLog, SoundTorquesThatRepeatStay) {
  const auto changed = [](const char* column, const auto& change) {
    LogWorld world = make_log_world(usual_noise());
    const Eigen::Index c = world.column(column);
    for (Eigen::Index r = 0; r < world.rows.rows(); ++r)
      world.rows(r, c) = change(world.rows, r, c);
    return world;
  };
  const auto expect_all_kept = [](const LogWorld& world, const char* what) {
    const Looked looked = look(world);
    EXPECT_EQ(looked.report.log.torque_missing.size(), 0) << what << ": " << looked.loud();
    for (const LogFault fault : {LogFault::kFrozen, LogFault::kDeadZone, LogFault::kClipped})
      EXPECT_TRUE(looked.of(fault).empty()) << what;
  };
  using Rows = Eigen::MatrixXd;
  for (const double step : {0.02, 0.1, 0.5, 2.0}) {
    const auto rounded = [step](const Rows& rows, Eigen::Index r, Eigen::Index c) {
      return step * std::round(rows(r, c) / step);
    };
    for (const char* column : {"tau1", "tau2", "tau3"})
      expect_all_kept(changed(column, rounded), "a quantised torque");
  }
  for (const Eigen::Index rows_held : {2, 4, 20, 40}) {
    const auto held = [rows_held](const Rows& rows, Eigen::Index r, Eigen::Index c) {
      return rows(r - r % rows_held, c);
    };
    expect_all_kept(changed("tau1", held), "a torque that is held from sample to sample");
    expect_all_kept(changed("tau2", held), "a torque that is held from sample to sample");
  }
  expect_all_kept(changed("tau1", [](const Rows&, Eigen::Index, Eigen::Index) { return 0.0; }),
                  "a column of zeros");
  // Zero now and then, as drivers publish that have missed a reading.
  expect_all_kept(changed("tau1", [](const Rows& rows, Eigen::Index r,
                                     Eigen::Index c) { return r % 41 < 5 ? 0.0 : rows(r, c); }),
                  "readings that were missed");
  // Rests for a while, exactly; then a torque that is exactly the same is no news.
  LogWorld rests = make_log_world(usual_noise());
  for (const char* column : {"q2", "tau2"}) {
    const Eigen::Index c = rests.column(column);
    rests.rows.col(c).segment(600, 600).setConstant(rests.rows(600, c));
  }
  rests.rows.col(rests.column("dq2")).segment(600, 600).setZero();
  expect_all_kept(rests, "a joint at rest");
  // Switched off while it comes to rest, as at the end of a program.
  LogWorld stops = make_log_world(usual_noise());
  for (const char* column : {"q2", "tau2"}) {
    const Eigen::Index c = stops.column(column);
    stops.rows.col(c).tail(600).setConstant(column[0] == 'q' ? stops.rows(1400, c) : 0.0);
  }
  stops.rows.col(stops.column("tau2")).segment(1380, 21).setZero();
  stops.rows.col(stops.column("dq2")).tail(600).setZero();
  expect_all_kept(stops, "a joint that comes to rest");
  // Torques in steps, as some drives are commanded, between others that change.
  expect_all_kept(changed("tau1",
                          [](const Rows& rows, Eigen::Index r, Eigen::Index c) {
                            return r % 400 < 200 ? 3.0 + static_cast<double>(r / 400) : rows(r, c);
                          }),
                  "torques in steps");
}

TEST(DamagedLog, QuantisedAndHeldTorque) {
  LogWorld world = make_log_world(usual_noise());
  const Eigen::Index tau = world.column("tau1");
  world.rows.col(tau) = (world.rows.col(tau) / 0.5).array().round() * 0.5;
  const Looked coarse = look(world);
  EXPECT_EQ(coarse.loud(), "");
  ASSERT_EQ(coarse.of(LogFault::kQuantised).size(), 1U);
  EXPECT_NEAR(coarse.first(LogFault::kQuantised).value, 0.5, 1e-6);
  LogWorld held = make_log_world(usual_noise());
  for (Eigen::Index r = 0; r < held.rows.rows(); ++r) held.rows(r, tau) = held.rows(r - r % 4, tau);
  const Looked slow = look(held);
  EXPECT_EQ(slow.loud(), "");
  ASSERT_EQ(slow.of(LogFault::kHeld).size(), 1U);
  EXPECT_NEAR(slow.first(LogFault::kHeld).value, 0.02, 1e-4) << "renewed every 20 ms";
  // A joint that rests most of the time, its position and torque as they were.
  LogWorld rests = make_log_world(usual_noise());
  for (const char* column : {"q1", "tau1"}) {
    const Eigen::Index c = rests.column(column);
    rests.rows.col(c).tail(1500).setConstant(rests.rows(501, c));
  }
  rests.rows.col(rests.column("dq1")).tail(1500).setZero();
  EXPECT_TRUE(look(rests).of(LogFault::kHeld).empty());
}

TEST(DamagedLog, CommandsThatTheRobotFollowsLate) {
  const LogWorldOptions options = usual_noise();
  LogWorld world = make_log_world(options);
  world.header.insert(world.header.end(), {"q_cmd1", "q_cmd2", "q_cmd3"});
  Eigen::MatrixXd rows(world.rows.rows(), world.rows.cols() + 3);
  rows.leftCols(world.rows.cols()) = world.rows;
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    for (int j = 0; j < 3; ++j) {
      rows(r, world.rows.cols() + j) = exact_motion(options, j, world.rows(r, 0) + 0.03)(0);
    }
  }
  world.rows = rows;
  const Looked looked = look(world);
  ASSERT_EQ(looked.of(LogFault::kLag).size(), 1U);
  EXPECT_NEAR(looked.first(LogFault::kLag).value, 0.03, 1e-9);
}

TEST(DamagedLog, WithoutAClockTheVelocityTellsTheRate) {
  LogWorld world = make_log_world(usual_noise());
  world.header[0] = "row";
  const Looked looked = look(world);
  EXPECT_EQ(looked.loud(), "no_clock ");
  EXPECT_NEAR(looked.first(LogFault::kNoClock).value, 200.0, 2.0);
  world.header[4] = "a";
  world.header[5] = "b";
  world.header[6] = "c";
  EXPECT_NE(refusal(world).find("dynamics: {rate_hz: ..}"), std::string::npos);
  EXPECT_EQ(look(world).loud(), "no_clock ") << "no stamps that could be in ms, no rate to be slow";
}

TEST(DamagedLog, CutOffAndCorruptFilesNameTheLine) {
  const std::string text = make_log_world(usual_noise()).csv();
  const auto read = [&](const std::string& name, const std::string& bytes) {
    return refusal_of([&] { static_cast<void>(read_torque_data({write_log(name, bytes)}, {})); });
  };
  EXPECT_NE(read("cut.csv", text.substr(0, text.size() - 20)).find("cut.csv:2002:"),
            std::string::npos);
  const std::string packed = gzip(text);
  EXPECT_NE(read("cut.csv.gz", packed.substr(0, packed.size() / 2)).find("cut off"),
            std::string::npos);
  std::string flipped = packed;
  flipped[packed.size() / 2] = static_cast<char>(flipped[packed.size() / 2] ^ 0x10);
  EXPECT_NE(read("bad.csv.gz", flipped).find("gzip file is"), std::string::npos);
  EXPECT_NE(read("plain.csv.gz", text).find("is no gzip file"), std::string::npos);
  EXPECT_EQ(read("whole.csv.gz", packed), "accepted");
  EXPECT_NE(refusal_of([] {
              static_cast<void>(read_torque_data(std::vector<std::filesystem::path>{}, {}));
            }).find("no torque log"),
            std::string::npos);
}

}  // namespace
}  // namespace kinescope
