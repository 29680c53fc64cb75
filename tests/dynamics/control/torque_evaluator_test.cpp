// SPDX-License-Identifier: Apache-2.0
//
// What a controller links to: the numbers of `kinescope predict`, without allocation, lock or
// exception.
#include "dynamics/control/torque_evaluator.h"

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>

#include <gtest/gtest.h>

#include "app/io/torque_model_file.h"
#include "dynamics/control/kinescope_torque.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/dynamics/control/count_calls.h"
#include "tests/truth/temporary_path.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

constexpr int kJoints = 3;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

using Values = std::array<double, kJoints>;

struct Sample {
  Values q, dq, ddq;
};

Values row(const Eigen::MatrixXd& table, Eigen::Index i) {
  Values out;
  for (int j = 0; j < kJoints; ++j) out[static_cast<std::size_t>(j)] = table(i, j);
  return out;
}

std::string name_of(const testing::TestParamInfo<TorqueModelKind>& test) {
  return std::string(to_string(test.param));
}

// A model file of a robot with a slide, and a log to ask it about.
class Controller : public testing::TestWithParam<TorqueModelKind> {
 protected:
  Controller() {
    Rng rng = Rng::from_name("torque evaluator");
    const RandomRobot robot = random_robot({.joints = kJoints, .prismatic_share = 0.4}, rng);
    const DynamicModel model = random_masses(robot.tree, {}, rng);
    log_ = torque_log_of(model, {.samples = 400, .rate_hz = 50.0, .noise = 0.01, .trajectories = 6},
                         rng);
    TorqueModelOptions options;
    options.samples = 150;
    options.hyperparameter_samples = 80;
    options.starts = 1;
    options.inducing_points = 30;
    options.keep_saved = true;
    file_.version = "test";
    file_.model = *fit_torque_model(GetParam(), model, log_, options).saved;
    write(torque_model_json(file_));
  }

  void write(std::string_view text) const { write_file_atomically(path_, text); }
  [[nodiscard]] std::string path() const { return path_.string(); }
  [[nodiscard]] Sample sample(Eigen::Index i) const {
    return {row(log_.q, i), row(log_.dq, i), row(log_.ddq, i)};
  }

  std::filesystem::path path_ =
      truth::temporary_path("torque_evaluator_" + std::string(to_string(GetParam())));
  TorqueSamples log_;
  TorqueModelFile file_;
};

INSTANTIATE_TEST_SUITE_P(, Controller,
                         testing::Values(TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                         TorqueModelKind::kGip, TorqueModelKind::kSemiParametric),
                         name_of);

TEST_P(Controller, GivesTheBitsOfPredict) {
  const TorqueModelFile read = read_torque_model(path());
  const TorquePrediction expected = predict_torque(read.model, log_.q, log_.dq, log_.ddq);
  TorqueEvaluator evaluator{std::filesystem::path(path())};
  ASSERT_EQ(evaluator.joints(), kJoints);
  EXPECT_EQ(evaluator.kind(), to_string(GetParam()));
  EXPECT_EQ(evaluator.torque_unit(), "Nm");
  EXPECT_EQ(evaluator.joint_name(0), read.model.rigid.bodies[0].joint);
  EXPECT_TRUE(evaluator.joint_name(kJoints).empty());
  Values torque{}, same{}, half_90{}, half_95{};
  for (Eigen::Index i = 0; i < log_.size(); ++i) {
    const Sample at = sample(i);
    ASSERT_EQ(evaluator.mean(at.q, at.dq, at.ddq, torque), TorqueStatus::kDone);
    ASSERT_EQ(evaluator.mean_and_band(at.q, at.dq, at.ddq, same, half_90), TorqueStatus::kDone);
    ASSERT_EQ(evaluator.mean_and_band(at.q, at.dq, at.ddq, same, half_95, TorqueBand::k95),
              TorqueStatus::kDone);
    for (std::size_t j = 0; j < kJoints; ++j) {
      const auto column = static_cast<Eigen::Index>(j);
      EXPECT_EQ(torque[j], expected.mean(i, column));
      EXPECT_EQ(same[j], torque[j]);
      EXPECT_EQ(half_90[j], read.model.bands.width_90(column) * expected.sigma(i, column));
      EXPECT_EQ(half_95[j], read.model.bands.width_95(column) * expected.sigma(i, column));
    }
  }
}

TEST_P(Controller, AllocatesAndLocksNothing) {
  TorqueEvaluator evaluator{std::filesystem::path(path())};
  std::vector<Sample> samples;
  for (Eigen::Index i = 0; i < log_.size(); ++i) samples.push_back(sample(i));
  samples.push_back({{kNaN, 0.0, 0.0}, {}, {}});  // refused without one, too
  Values torque{}, half_width{};
  int done = 0;
  const test::Calls before = test::calls();
  for (int repetition = 0; repetition < 5; ++repetition) {
    for (const Sample& at : samples) {
      const bool mean = evaluator.mean(at.q, at.dq, at.ddq, torque) == TorqueStatus::kDone;
      const bool band =
          evaluator.mean_and_band(at.q, at.dq, at.ddq, torque, half_width) == TorqueStatus::kDone;
      if (mean && band) ++done;
    }
  }
  const test::Calls after = test::calls();
  EXPECT_EQ(done, 5 * log_.size());
  EXPECT_EQ(after.allocations, before.allocations);
  EXPECT_EQ(after.locks, before.locks);
}

TEST_P(Controller, LeavesTheOutputsOfWhatItRefuses) {
  TorqueEvaluator evaluator{std::filesystem::path(path())};
  const Sample at = sample(7);
  const Values untouched{11.0, 12.0, 13.0};
  Values torque = untouched;
  Values half_width = untouched;
  for (const double wrong : {kNaN, kInfinity, -kInfinity}) {
    Sample bad = at;
    bad.dq[1] = wrong;
    EXPECT_EQ(evaluator.mean_and_band(bad.q, bad.dq, bad.ddq, torque, half_width),
              TorqueStatus::kNotFinite);
  }
  const std::span<const double> two(at.q.data(), 2);
  EXPECT_EQ(evaluator.mean(two, at.dq, at.ddq, torque), TorqueStatus::kBadArgument);
  EXPECT_EQ(evaluator.mean(at.q, at.dq, at.ddq, std::span(torque).first(2)),
            TorqueStatus::kBadArgument);
  EXPECT_EQ(evaluator.mean_and_band(at.q, at.dq, at.ddq, torque, {}), TorqueStatus::kBadArgument);
  EXPECT_EQ(torque, untouched);
  EXPECT_EQ(half_width, untouched);
}

// Numbers that overflow inside are refused, or have a torque and no band: never NaN, never a sure
// 0.
TEST_P(Controller, AbsurdMotionIsNeverSure) {
  TorqueEvaluator evaluator{std::filesystem::path(path())};
  for (const double huge : {1e60, 1e100, 1e160, 1e300}) {
    Values torque{}, half_width{};
    const Values q{0.1, 0.2, 0.3}, rates{huge, huge, -huge};
    const TorqueStatus status = evaluator.mean_and_band(q, rates, rates, torque, half_width);
    if (status != TorqueStatus::kDone) continue;
    for (std::size_t j = 0; j < kJoints; ++j) {
      EXPECT_TRUE(std::isfinite(torque[j])) << huge;
      EXPECT_GT(half_width[j], 0.0) << huge;
    }
  }
}

TEST_P(Controller, SpeaksC) {
  char error[200] = "none";
  const std::unique_ptr<kinescope_torque_model, decltype(&kinescope_torque_free)> model(
      kinescope_torque_load(path().c_str(), error, sizeof error), kinescope_torque_free);
  ASSERT_NE(model, nullptr) << error;
  EXPECT_EQ(kinescope_torque_joints(model.get()), kJoints);
  EXPECT_STREQ(kinescope_torque_unit(model.get()), "Nm");
  EXPECT_EQ(kinescope_torque_joint_name(model.get(), 1), file_.model.rigid.bodies[1].joint);
  EXPECT_EQ(kinescope_torque_joint_name(model.get(), kJoints), nullptr);
  EXPECT_EQ(kinescope_torque_traced(model.get()), 0);
  TorqueEvaluator evaluator{std::filesystem::path(path())};
  const Sample at = sample(20);
  Values torque{}, half_width{}, expected{}, expected_half{};
  ASSERT_EQ(evaluator.mean_and_band(at.q, at.dq, at.ddq, expected, expected_half, TorqueBand::k95),
            TorqueStatus::kDone);
  const auto band = [&](double* out, int percent) {
    return kinescope_torque_mean_and_band(model.get(), at.q.data(), at.dq.data(), at.ddq.data(),
                                          torque.data(), out, percent);
  };
  const test::Calls before = test::calls();
  const int done = band(half_width.data(), 95);
  EXPECT_EQ(test::calls().allocations, before.allocations);
  EXPECT_EQ(done, KINESCOPE_TORQUE_DONE);
  EXPECT_EQ(torque, expected);
  EXPECT_EQ(half_width, expected_half);
  torque = {};
  EXPECT_EQ(
      kinescope_torque_mean(model.get(), at.q.data(), at.dq.data(), at.ddq.data(), torque.data()),
      KINESCOPE_TORQUE_DONE);
  EXPECT_EQ(torque, expected);
  EXPECT_EQ(band(half_width.data(), 99), KINESCOPE_TORQUE_BAD_ARGUMENT);
  EXPECT_EQ(band(nullptr, 90), KINESCOPE_TORQUE_BAD_ARGUMENT);
}

using LoadedController = Controller;
INSTANTIATE_TEST_SUITE_P(, LoadedController, testing::Values(TorqueModelKind::kParametric),
                         name_of);

TEST_P(LoadedController, BadFilesAreOneLineInAnyBuffer) {
  write(R"({"schema": "kinescope.torque_model", "schema_version": 1})");
  const std::string bad = path();
  EXPECT_THROW(TorqueEvaluator{std::filesystem::path(bad)}, Error);
  char error[400];
  ASSERT_EQ(kinescope_torque_load(bad.c_str(), error, sizeof error), nullptr);
  const std::string line = error;
  EXPECT_NE(line.find(bad), std::string::npos) << line;
  EXPECT_NE(line.find("is missing"), std::string::npos) << line;
  EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  ASSERT_EQ(kinescope_torque_load("no such file", error, 8), nullptr);
  EXPECT_EQ(std::string(error), "no such");
  EXPECT_EQ(kinescope_torque_load(bad.c_str(), nullptr, 0), nullptr);
  EXPECT_EQ(kinescope_torque_load(nullptr, error, sizeof error), nullptr);
  kinescope_torque_free(nullptr);
}

TEST_P(LoadedController, SaysThatTracedEffectsAreNotInIt) {
  SavedTrace trace;
  trace.corrected.base.rigid = file_.model.rigid;
  trace.corrected.base.widths = trace.corrected.base.viscous = trace.corrected.base.coulomb =
      Eigen::VectorXd::Ones(kJoints);
  trace.corrected.travels.resize(kJoints);
  trace.sigma = Eigen::VectorXd::Ones(kJoints);
  file_.traced = trace;
  write(torque_model_json(file_));
  EXPECT_TRUE(TorqueEvaluator{std::filesystem::path(path())}.traced());
}

TEST(CountCalls, SeesEigenNewAndMutex) {
  const test::Calls before = test::calls();
  const volatile Eigen::Index size = 20;
  const Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  const long by_eigen = test::calls().allocations - before.allocations;
  const auto value = std::make_unique<std::array<double, 40>>();
  const long by_new = test::calls().allocations - before.allocations - by_eigen;
  std::mutex mutex;
  const std::scoped_lock lock(mutex);
  EXPECT_GE(by_eigen, 1) << matrix.size();
  EXPECT_GE(by_new, 1) << value.get();
  EXPECT_EQ(test::calls().locks, before.locks + 1);
}

}  // namespace
}  // namespace kinescope
