// SPDX-License-Identifier: Apache-2.0
//
// Systems of the user's own: the YAML file, and what its program may do wrong.
#include <chrono>
#include <cmath>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "app/io/line_program.h"
#include "app/io/policy_system_file.h"
#include "app/io/program_system.h"
#include "dynamics/policy/systems/library.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using policy::PolicyProblem;
using policy::Trial;

const policy::Controller kStill = [](const Eigen::VectorXd&, int) {
  return Eigen::VectorXd(Eigen::VectorXd::Zero(1));
};

// Long enough for a shell to start on a busy machine.
constexpr double kSoon_s = 1.0;

struct Outcome {
  ExitCode code = ExitCode::kDone;
  std::string words;
};

template <typename Act>
Outcome outcome_of(const Act& act) {
  try {
    act();
  } catch (const Error& error) {
    return {error.code(), error.what()};
  }
  return {};
}

// A program of three steps that is a line of the shell.
ProgramSystem shell_system(const std::string& script, double timeout_s = 5.0) {
  policy::StateLayout layout{.positions = {"angle"},
                             .is_angle = {true},
                             .inputs = {"torque"},
                             .input_limit = Eigen::VectorXd::Constant(1, 2.0),
                             .step_s = 0.1};
  return {layout, {}, {.words = {"sh", "-c", script}, .folder = {}, .timeout_s = timeout_s}};
}

Outcome rollout_of(const std::string& script, double timeout_s = 5.0) {
  const ProgramSystem system = shell_system(script, timeout_s);
  return outcome_of([&] { (void)system.run(kStill, 3, 1, 0); });
}

void expect(const Outcome& outcome, ExitCode code, const std::string& words) {
  EXPECT_EQ(outcome.code, code) << outcome.words;
  EXPECT_NE(outcome.words.find(words), std::string::npos) << outcome.words;
}

TEST(ProgramSystem, PassesStatesAndInputsBothWays) {
  // Every state is the input before it, or what the program was called with.
  const ProgramSystem system = shell_system(
      "read names; echo angle_speed,angle; echo $5,$3; "
      "for k in 1 2 3; do read u; echo $u,0; done; echo; echo angle,angle_speed; "
      "for k in 1 2 3 4; do echo 0.$k,9; done");
  const policy::Controller controller = [](const Eigen::VectorXd& seen, int step) {
    return Eigen::VectorXd(Eigen::VectorXd::Constant(1, step == 0 ? 0.25 * seen[0] : 7.0));
  };
  const Trial trial = system.run(controller, 3, 5, 2);
  ASSERT_EQ(trial.seen.rows(), 4);
  // sh -c SCRIPT --steps 3 --trial 2 --seed 5: $0 is --steps.
  EXPECT_DOUBLE_EQ(trial.seen(0, 0), 2.0);
  EXPECT_DOUBLE_EQ(trial.seen(0, 1), 5.0);
  EXPECT_DOUBLE_EQ(trial.seen(1, 1), 0.5);
  EXPECT_DOUBLE_EQ(trial.inputs(1, 0), 2.0) << "within the limit";
  EXPECT_DOUBLE_EQ(trial.seen(2, 1), 2.0);
  EXPECT_DOUBLE_EQ(trial.smoothed(3, 0), 0.4);
  EXPECT_DOUBLE_EQ(trial.smoothed(3, 1), 9.0);
  EXPECT_EQ(trial.truth.size(), 0);
}

TEST(ProgramSystem, AnglesGoOnAfterAWholeTurn) {
  const ProgramSystem system = shell_system(
      "echo angle,angle_speed; echo 3,0; echo -3.1,0; echo -2.9,0; echo 3.1,0; cat >/dev/null");
  const Trial trial = system.run(kStill, 3, 1, 0);
  EXPECT_NEAR(trial.seen(1, 0), 2.0 * M_PI - 3.1, 1e-12);
  EXPECT_NEAR(trial.seen(2, 0), 2.0 * M_PI - 2.9, 1e-12);
  EXPECT_NEAR(trial.seen(3, 0), 3.1, 1e-12);
}

TEST(ProgramSystem, SaysWhatTheProgramDid) {
  const std::string head = "echo angle,angle_speed; ";
  expect(rollout_of(head + "echo 0,0; sleep 60", kSoon_s), ExitCode::kUndetermined,
         "wrote no state 2 of 4 within 1 s");
  expect(rollout_of("sleep 60", kSoon_s), ExitCode::kUndetermined, "wrote no columns within 1 s");
  expect(rollout_of(head + "echo 0,0; echo no motor >&2; exit 3"), ExitCode::kUndetermined,
         "ended with exit code 3 before its state 2 of 4: no motor");
  expect(rollout_of(head + "echo 0,0; kill -SEGV $$"), ExitCode::kUndetermined,
         "was ended by signal 11");
  expect(rollout_of(head + "echo 0,nan"), ExitCode::kUndetermined,
         "angle_speed is 'nan' in its state 1 of 4");
  expect(rollout_of(head + "echo 0,fast"), ExitCode::kUndetermined, "'fast'");
  expect(rollout_of(head + "echo 0"), ExitCode::kBadInput, "its state 1 of 4 is '0'");
  expect(rollout_of("echo angle,speed; cat"), ExitCode::kBadInput,
         "its columns are angle,speed (let it write angle,angle_speed first)");
  const std::string good = head + "for k in 1 2 3 4; do echo 0,0; done; ";
  EXPECT_EQ(rollout_of(good).code, ExitCode::kDone);
  expect(rollout_of(good + "exit 2"), ExitCode::kUndetermined, "exit code 2 after its rollout");
  expect(rollout_of(good + "echo angle,angle_speed; echo 1,1"), ExitCode::kUndetermined,
         "before its smoothed state 2 of 4");
  expect(rollout_of(good + "sleep 60", kSoon_s), ExitCode::kUndetermined, "no end of its output");
  const Outcome none = outcome_of(
      [] { LineProgram({"./no_such_program"}, truth::temporary_path("x").parent_path(), 1.0); });
  expect(none, ExitCode::kBadInput, "./no_such_program: cannot be started: No such file");
}

/// A process that is neither gone nor waiting to be reaped.
bool sleeps(pid_t pid) {
  try {
    return read_text_file(fmt::format("/proc/{}/stat", pid)).find(") Z") == std::string::npos;
  } catch (const Error&) {
    return false;
  }
}

// A program that hangs is ended, with what it started, and does not hold anybody up.
TEST(ProgramSystem, LeavesNoProgramBehind) {
  const fs::path pid_file = truth::temporary_path("pid");
  const auto before = std::chrono::steady_clock::now();
  const Outcome outcome =
      rollout_of(fmt::format("sleep 61 & echo $! > '{}'; wait", pid_file.string()), kSoon_s);
  EXPECT_EQ(outcome.code, ExitCode::kUndetermined);
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(5));
  const pid_t pid = std::stoi(read_text_file(pid_file));
  // Its new parent may take a while to notice; then it is no longer a `sleep`.
  for (int k = 0; k < 200 && sleeps(pid); ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_FALSE(sleeps(pid));
}

class PolicyFile {
 public:
  explicit PolicyFile(const std::string& text) : path_(truth::temporary_path("system.yaml")) {
    write_file_atomically(path_, text);
  }
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

constexpr const char* kPositions =
    "positions:\n  cart: {target: 0, length_scale: 1, start: [-1, 1]}\n"
    "  pole: {angle: true, target: 3.1, length_scale: 3, tolerance: 0.2, speed: {noise: 0.5}}\n";

std::string file_text(const std::string& changed = "", const std::string& with = "") {
  std::string out = std::string("program: [sh, x.sh]\nstep: 0.05\nhorizon: 3\n") + kPositions +
                    "inputs:\n  force: {limit: 10}\n";
  if (!changed.empty()) {
    const std::size_t at = out.find(changed);
    EXPECT_NE(at, std::string::npos) << changed;
    out.replace(at, changed.size(), with);
  }
  return out;
}

TEST(PolicySystemFile, IsRead) {
  const PolicyProblem problem = read_policy_problem(PolicyFile(file_text()).path());
  const policy::StateLayout& layout = problem.system->layout();
  EXPECT_EQ(problem.name, "system");
  EXPECT_EQ(layout.positions, (std::vector<std::string>{"cart", "pole"}));
  EXPECT_EQ(layout.is_angle, (std::vector<bool>{false, true}));
  EXPECT_EQ(problem.task.steps, 60);
  ASSERT_EQ(problem.task.start.means.rows(), 2);
  EXPECT_EQ(problem.task.start.means(0, 0), -1.0);
  EXPECT_EQ(problem.task.start.means(1, 0), 1.0);
  EXPECT_EQ(problem.task.start.means(1, 1), 0.0);
  ASSERT_EQ(problem.task.cost.terms.size(), 2U);
  EXPECT_EQ(problem.task.cost.terms[1],
            (policy::CostTerm{1, 3.1, 3.0, policy::CostError::kCircular}));
  EXPECT_EQ(problem.tolerance[1], 0.2);
  EXPECT_FALSE(std::isfinite(problem.tolerance[0]));
  EXPECT_EQ(problem.task.sensing.noise_sigma[3], 0.5);
  EXPECT_EQ(problem.task.sensing.sensing, policy::Sensing::kFullState);
}

TEST(PolicySystemFile, SaysWhereItIsWrong) {
  const auto refused = [](const std::string& changed, const std::string& with,
                          const std::string& words) {
    const PolicyFile file(file_text(changed, with));
    const Outcome outcome = outcome_of([&] { (void)read_policy_problem(file.path()); });
    expect(outcome, ExitCode::kBadInput, words);
  };
  refused("limit: 10", "limit: -10", "system.yaml:8: inputs.force.limit is -10, not above zero");
  refused("limit: 10", "limit: .nan", "not a finite number");
  refused("{limit: 10}", "{limits: 10}", "limit");
  refused("  force: {limit: 10}\n", "  {}\n", "inputs is empty");
  refused("step: 0.05", "step: 50", "is 50 s (give it in s, not in ms)");
  refused("horizon: 3", "horizon: 0.01", "horizon holds 0 steps of 0.05 s");
  refused("length_scale: 1", "length_scale: 0", "length_scale is 0, not above zero");
  refused("target: 0, length_scale: 1, ", "target: 0, ", "has half a cost");
  refused("target: 0, length_scale: 1", "target: 0, length_scale: 1, error: circular",
          "of what is no angle");
  refused("start: [-1, 1]}\n", "start: [-1, 1]}\n  other: {start: [1, 2, 3]}\n",
          "has 2 starts, another position 3");
  refused("tolerance: 0.2", "tolerance: -1", "tolerance is -1");
  refused("step: 0.05", "step: 0.05\nsensing: some", "sensing is 'some' (write full or positions)");
  refused("step: 0.05", "step: 0.05\nsensing: positions\nspeed_cutoff_hz: 10",
          "stay below half the rate, 10 Hz");
  refused("program: [sh, x.sh]\n", "", "program");
  refused("  cart:", "  the cart:", "names no column");
  refused("horizon: 3", "horizon: 3\nhorizonn: 3", "did you mean 'horizon'");
}

// The example is the cart-pole of the library, in another language.
TEST(PolicySystemFile, ExampleMovesAsTheLibrary) {
  const fs::path folder = fs::path(KINESCOPE_SOURCE_DIR) / "app/examples/policy";
  const PolicyProblem example = read_policy_problem(folder / "cart_pole.yaml");
  const PolicyProblem library = policy::problem_named("cartpole", policy::Sensing::kFullState);
  EXPECT_EQ(example.system->layout().positions, library.system->layout().positions);
  EXPECT_EQ(example.task.steps, library.task.steps);
  const policy::Controller pushes = [](const Eigen::VectorXd&, int step) {
    return Eigen::VectorXd(Eigen::VectorXd::Constant(1, step % 20 < 10 ? 8.0 : -8.0));
  };
  const Trial theirs = example.system->run(pushes, 20, 1, 0);
  const Trial ours = library.system->run(pushes, 20, 1, 0);
  EXPECT_EQ(theirs.inputs, ours.inputs);
  // Starts and noise of 0.01 are drawn apart.
  EXPECT_LT((theirs.seen - ours.seen).lpNorm<Eigen::Infinity>(), 0.3);
  EXPECT_GT(ours.seen.row(10)[2], 2.0) << "the pushes move it";
  EXPECT_EQ(theirs.seen, example.system->run(pushes, 20, 1, 0).seen);
  EXPECT_NE(theirs.seen, example.system->run(pushes, 20, 1, 1).seen);
}

}  // namespace
}  // namespace kinescope
