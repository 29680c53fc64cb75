// SPDX-License-Identifier: Apache-2.0
//
// Search and learner: cost falls, a stopped run goes on to the same bits, bad input is refused.
#include <cmath>

#include <gtest/gtest.h>

#include "dynamics/policy/adam.h"
#include "kinematics/core/error.h"
#include "tests/dynamics/policy/cart_pole.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

LearnerOptions small() {
  LearnerOptions out;
  out.model.starts = 1;
  out.model.threads = 1;
  out.policy.basis_count = 21;
  out.improve.particles = 24;
  out.improve.threads = 1;
  out.improve.max_steps = 30;
  out.first_max_steps = 40;
  out.promise_particles = 48;
  out.trials = 2;
  out.starts = 2;
  out.start_steps = 10;
  return out;
}

PolicyTask short_task() {
  PolicyTask out = cart_pole_task();
  out.steps = 20;
  return out;
}

RbfPolicy never(int) {
  ADD_FAILURE() << "no policy needs to be drawn anew";
  return random_policy(21);
}

TEST(Learner, LowersTheCostAndIsTheSameAgain) {
  const CartPole plant;
  const LearnerState first = learn(plant, short_task(), small(), {.seed = 3});
  ASSERT_EQ(first.trials.size(), 3U);
  ASSERT_EQ(first.records.size(), 2U);
  EXPECT_EQ(first.records[1].samples.size(), 2U);
  EXPECT_TRUE(first.records[0].paid_truth.has_value());
  const double exploration = rollout_cost(short_task().cost, first.trials[0].truth);
  EXPECT_LT(value_of(first.records[1].paid_truth), 0.9 * exploration);
  LearnerOptions threads = small();
  threads.improve.threads = 3;
  threads.model.threads = 2;
  const LearnerState again = learn(plant, short_task(), threads, {.seed = 3});
  EXPECT_TRUE(first.policies.back() == again.policies.back());
  EXPECT_EQ(first.trials.back().truth, again.trials.back().truth);
  EXPECT_EQ(first.records.back().promised, again.records.back().promised);
  const LearnerState other = learn(plant, short_task(), small(), {.seed = 4});
  EXPECT_FALSE(first.policies.back() == other.policies.back());
}

TEST(Learner, GoesOnFromWhatWasSavedToTheSameBits) {
  const CartPole plant;
  LearnerHooks hooks;
  hooks.save_period = 7;
  std::vector<LearnerState> saved;
  hooks.save = [&](const LearnerState& s) { saved.push_back(s); };
  const LearnerState whole = learn(plant, short_task(), small(), {.seed = 5}, hooks);
  ASSERT_GT(saved.size(), 10U);
  for (std::size_t k = 0; k < saved.size(); k += 4) {
    const LearnerState rest = learn(plant, short_task(), small(), saved[k]);
    EXPECT_TRUE(rest.policies.back() == whole.policies.back()) << k;
    EXPECT_EQ(rest.trials.back().truth, whole.trials.back().truth) << k;
  }
}

TEST(Learner, StopsWhenAskedAndGoesOn) {
  const CartPole plant;
  const LearnerState whole = learn(plant, short_task(), small(), {.seed = 5});
  for (const LearnerStage stage : {LearnerStage::kStarting, LearnerStage::kSearching}) {
    const int stop_at = stage == LearnerStage::kStarting ? 6 : 17;
    std::stop_source stop;
    LearnerHooks hooks;
    hooks.stop = stop.get_token();
    hooks.progress = [&](const LearnerProgress& p) {
      if (p.trial == 2 && p.search.step == stop_at && p.stage == stage) stop.request_stop();
    };
    const LearnerState stopped = learn(plant, short_task(), small(), {.seed = 5}, hooks);
    ASSERT_EQ(stopped.trials.size(), 2U);
    EXPECT_EQ(value_of(stopped.search).step, stop_at);
    const LearnerState rest = learn(plant, short_task(), small(), stopped);
    EXPECT_TRUE(rest.policies.back() == whole.policies.back());
  }
}

TEST(Learner, RefusesAStateOfAnotherRun) {
  const CartPole plant;
  LearnerOptions options = small();
  options.trials = 1;
  LearnerState state = learn(plant, short_task(), options, {.seed = 5});
  const auto refused = [&](const LearnerState& s, const LearnerOptions& o, int steps) {
    PolicyTask task = short_task();
    task.steps = steps;
    try {
      static_cast<void>(learn(plant, task, o, s));
    } catch (const Error& e) {
      return e.code() == ExitCode::kBadRequest;
    }
    return false;
  };
  EXPECT_FALSE(refused(state, options, 20));
  EXPECT_TRUE(refused(state, options, 21));
  LearnerOptions two = options;
  two.explorations = 2;
  EXPECT_TRUE(refused(state, two, 20));
  two = options;
  two.starts = 0;
  EXPECT_TRUE(refused(state, two, 20));
  options.trials = 2;
  LearnerState damaged = state;
  damaged.trials[0].seen(3, 1) = std::nan("");
  EXPECT_TRUE(refused(damaged, options, 20));
  damaged = state;
  damaged.model_trials = 2;
  value_of(damaged.model).processes[0].inputs(0, 0) = std::nan("");
  EXPECT_TRUE(refused(damaged, options, 20));
  value_of(damaged.model).processes.pop_back();
  EXPECT_TRUE(refused(damaged, options, 20));
}

TEST(Improve, RefusesACostThatNeverChanges) {
  const VelocityModel model = random_model(VelocityKernel::kSquaredExponential, 10);
  PolicyTask task = random_task(5);
  task.cost.terms = {{0, 1e4, 1.0, CostError::kDifference}};
  const ImproveOptions options = small().improve;
  try {
    static_cast<void>(
        improve(model, task, begin_search(random_policy(21), options, 1), never, options));
    FAIL() << "no error";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::kUndetermined);
    EXPECT_NE(std::string(e.what()).find("it is 1 for every particle"), std::string::npos);
  }
}

// A kernel of a huge polynomial throws the particles to where numbers end.
TEST(Improve, DrawsAPolicyAnewWhereTheCostIsNotFiniteAndGivesUp) {
  VelocityModel model = random_model(VelocityKernel::kPolynomial2, 10);
  model.processes[0].targets.setConstant(1e200);
  const PolicyTask task = random_task(6);
  ImproveOptions options = small().improve;
  options.max_resamples = 2;
  int drawn = 0;
  const Improvement out = improve(
      model, task, begin_search(random_policy(21), options, 1),
      [&](int redraw) {
        return random_policy(21, static_cast<std::uint64_t>(100 + ++drawn + redraw));
      },
      options);
  EXPECT_EQ(out.status, SearchStatus::kFailed);
  EXPECT_EQ(drawn, 3);
  EXPECT_EQ(out.search.resamples, 9);
  EXPECT_EQ(out.search.step, 0);
}

TEST(Improve, RefusesOptionsOutOfRange) {
  const auto refused = [](auto change) {
    ImproveOptions options;
    change(options);
    try {
      check_options(options);
    } catch (const Error& e) {
      return e.code() == ExitCode::kBadRequest;
    }
    return false;
  };
  const double nan = std::nan("");
  EXPECT_NO_THROW(check_options({}));
  EXPECT_TRUE(refused([](auto& o) { o.particles = 1; }));
  EXPECT_TRUE(refused([](auto& o) { o.max_steps = 0; }));
  EXPECT_TRUE(refused([&](auto& o) { o.learning_rate = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.learning_rate = 1e-4; }));
  EXPECT_TRUE(refused([&](auto& o) { o.min_learning_rate = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.dropout = 1.0; }));
  EXPECT_TRUE(refused([&](auto& o) { o.dropout_decrement = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.change_memory = 1.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.change_ratio = -1.0; }));
  EXPECT_TRUE(refused([](auto& o) { o.patience = 0; }));
  EXPECT_TRUE(refused([&](auto& o) { o.gradient_limit = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.max_resamples = -1; }));
}

TEST(StepSize, IsHalvedWithTheDropoutUntilTheSmallest) {
  ImproveOptions options;
  options.patience = 5;
  SearchState search = begin_search(random_policy(3), options, 1);
  std::vector<double> rates;
  bool done = false;
  for (int k = 0; k < 100 && !done; ++k) {
    done = note_cost(3.0 + 0.1 * (k % 2), options, search);
    if (rates.empty() || rates.back() != search.learning_rate)
      rates.push_back(search.learning_rate);
  }
  EXPECT_TRUE(done);
  EXPECT_EQ(rates, (std::vector<double>{0.01, 0.005, 0.0025}));
  EXPECT_EQ(search.dropout, 0.0);
  SearchState falling = begin_search(random_policy(3), options, 1);
  for (int k = 0; k < 100; ++k) EXPECT_FALSE(note_cost(100.0 - k, options, falling));
  EXPECT_EQ(falling.learning_rate, 0.01);
}

TEST(Gradient, IsShortenedToItsRunningLength) {
  SearchState search = begin_search(random_policy(3), {}, 1);
  Eigen::VectorXd gradient = Eigen::VectorXd::Constant(4, 0.5);
  limit_gradient(10.0, gradient, search);
  EXPECT_EQ(gradient.norm(), 1.0);
  gradient *= 1e6;
  limit_gradient(10.0, gradient, search);
  EXPECT_NEAR(gradient.norm(), 10.0, 1e-12);
  gradient.setConstant(1e6);
  limit_gradient(0.0, gradient, search);
  EXPECT_EQ(gradient[0], 1e6);
}

TEST(RbfPolicy, OfOneStateIsThatOfParticles) {
  const VelocityModel model = random_model(VelocityKernel::kSquaredExponential, 10);
  const RbfPolicy policy = random_policy(9);
  const ParticleRollout rollout = roll_out(model, random_task(4), policy, 11, 3, 1);
  ASSERT_EQ(rollout.states.size(), 5U);
  EXPECT_EQ(rollout.costs.rows(), 11);
  for (std::size_t t = 0; t < 4; ++t) {
    for (Eigen::Index i = 0; i < 11; ++i) {
      const Eigen::VectorXd x = rollout.states[t].row(i);
      EXPECT_NEAR(policy_input(policy, model.layout, x)[0], rollout.inputs[t](i, 0), 1e-12);
      EXPECT_LT(std::abs(rollout.inputs[t](i, 0)), 10.0);
    }
  }
  EXPECT_NEAR(rollout.mean_cost(), rollout.costs.sum() / 11.0, 1e-12);
}

TEST(Task, RefusesWhatContradictsItself) {
  const StateLayout layout = cart_pole_layout();
  const auto refused = [&](auto change) {
    PolicyTask task = cart_pole_task();
    change(task);
    try {
      check_task(task, layout);
    } catch (const Error& e) {
      return e.code() == ExitCode::kBadRequest;
    }
    return false;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& t) { t.cost.terms.clear(); }));
  EXPECT_TRUE(refused([](auto& t) { t.cost.terms[0].state = 4; }));
  EXPECT_TRUE(refused([](auto& t) { t.cost.terms[0].length_scale = 0.0; }));
  EXPECT_TRUE(refused([](auto& t) { t.cost.terms[0].target = std::nan(""); }));
  EXPECT_TRUE(refused([](auto& t) { t.cost.terms[0].error = CostError::kCircular; }));
  EXPECT_TRUE(refused([](auto& t) { t.start.means.resize(0, 4); }));
  EXPECT_TRUE(refused([](auto& t) { t.start.sigma[1] = -1.0; }));
  EXPECT_TRUE(refused([](auto& t) { t.steps = 0; }));
  EXPECT_TRUE(refused([](auto& t) { t.sensing.speed_cutoff_hz = -1.0; }));
  EXPECT_TRUE(refused([](auto& t) { t.sensing.noise_sigma = Eigen::VectorXd::Ones(3); }));
}

TEST(RbfPolicy, RefusesAnotherRobotsPolicyAndBadNumbers) {
  const StateLayout layout = cart_pole_layout();
  const auto refused = [&](auto change) {
    RbfPolicy policy = random_policy(4);
    change(policy);
    try {
      check_policy(policy, layout);
    } catch (const Error& e) {
      return e.code() == ExitCode::kBadRequest;
    }
    return false;
  };
  EXPECT_FALSE(refused([](auto&) {}));
  EXPECT_TRUE(refused([](auto& p) { p.centres.resize(4, 6); }));
  EXPECT_TRUE(refused([](auto& p) { p.weights(0, 0) = std::nan(""); }));
  EXPECT_TRUE(refused([](auto& p) { p.length_scales[2] = 0.0; }));
  const Eigen::MatrixXd states = Eigen::MatrixXd::Zero(2, 4);
  EXPECT_THROW(static_cast<void>(draw_policy(layout, {.basis_count = 0}, states, 1)), Error);
  EXPECT_THROW(static_cast<void>(draw_policy(layout, {}, states.leftCols(3), 1)), Error);
  EXPECT_TRUE(draw_policy(layout, {}, states, 1) == draw_policy(layout, {}, states, 1));
}

}  // namespace
}  // namespace kinescope::policy
