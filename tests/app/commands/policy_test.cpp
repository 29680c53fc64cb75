// SPDX-License-Identifier: Apache-2.0
//
// `kinescope policy`, on searches far too small to learn anything: what is written, that it goes on
// where it was cut off, and what it refuses.
#include <chrono>
#include <csignal>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/commands/policy_seeds.h"
#include "app/io/policy_files.h"
#include "dynamics/policy/systems/library.h"
#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

class PolicyCommand : public testing::Test {
 protected:
  void SetUp() override {
    const testing::TestInfo* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = truth::temporary_path(std::string("policy_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }

  [[nodiscard]] fs::path in(const std::string& name) const { return folder_ / name; }

  /// The command on a system with few of everything.
  [[nodiscard]] Words small(const std::string& system, const std::string& output,
                            const Words& more = {}, const std::string& steps = "12") const {
    Words out{"policy", system,           "--particles", "8",        "--basis-functions",
              "10",     "--search-steps", steps,         "--output", in(output).string(),
              "--quiet"};
    out.insert(out.end(), more.begin(), more.end());
    return out;
  }

  [[nodiscard]] std::string text_of(const std::string& name) const {
    return read_text_file(in(name));
  }

  fs::path folder_;
};

TEST_F(PolicyCommand, WritesWhatItLearned) {
  const Outcome outcome = run(small("cartpole", "out", {"--trials", "2"}));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("Last trial: promised "), std::string::npos) << outcome.out;
  const ProductCheck check = check_products(in("out"));
  EXPECT_TRUE(check.passed || !check.done) << check.words;
  for (const char* name :
       {"policy.json", "policy_state.json", "policy_search.json", "velocity_model.json"}) {
    if (check.done) {
      EXPECT_NE(check.words.find(std::string(name) + ": valid"), std::string::npos) << check.words;
    }
  }
  const CsvTable trial = read_csv(in("out/trial_2.csv"));
  EXPECT_EQ(trial.rows.size(), 61U);
  for (const char* column : {"t", "cart", "pole_speed", "force", "cart_true", "pole_p05"}) {
    EXPECT_TRUE(trial.column(column).has_value()) << column;
  }
  EXPECT_FALSE(read_csv(in("out/trial_0.csv")).column("pole_p05").has_value()) << "explored";
}

TEST_F(PolicyCommand, ThePageIsWholeWithoutScripts) {
  ASSERT_EQ(run(small("furuta", "out", {"--trials", "1"})).code, 0);
  const std::string page = text_of("out/policy.html");
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_EQ(page.find("http://"), std::string::npos);
  EXPECT_EQ(page.find("https://"), std::string::npos);
  for (const char* part :
       {"Motion in the last trial", "attributeName=\"points\"", "attributeName=\"cx\"",
        "particles, median and 90 %", "promised", "Inputs as applied", "How to reproduce"}) {
    EXPECT_NE(page.find(part), std::string::npos) << part;
  }
  // What moves is not printed.
  EXPECT_NE(page.find(".cursor, .moving { display: none"), std::string::npos);
}

// The policy of the file is what ran in the trial: fed with what it saw, it gives those inputs.
TEST_F(PolicyCommand, ThePolicyFileIsThePolicyOfTheTrial) {
  ASSERT_EQ(run(small("cartpole", "out", {"--trials", "2", "--sensing", "positions"})).code, 0);
  const PolicyFile file = read_policy_file(in("out/policy.json"));
  EXPECT_EQ(file.sensing.sensing, policy::Sensing::kPositionsOnly);
  EXPECT_GT(file.sensing.speed_cutoff_hz, 0.0);
  const CsvTable trial = read_csv(in(fmt::format("out/trial_{}.csv", file.trial)));
  EXPECT_TRUE(trial.column("cart_smoothed").has_value());
  const policy::Controller controller = policy::controller_of(file.policy, file.layout);
  for (std::size_t row = 0; row + 1 < trial.rows.size(); ++row) {
    Eigen::VectorXd seen(4);
    int next = 0;
    for (const char* column : {"cart", "pole", "cart_speed", "pole_speed"}) {
      seen[next++] = trial.number(row, trial.require_column(column));
    }
    EXPECT_EQ(controller(seen, static_cast<int>(row))[0],
              trial.number(row, trial.require_column("force")));
  }
}

// The same first trial; then a model that learns from what was seen.
TEST_F(PolicyCommand, PlainDoesNotKnowItsSensors) {
  const Words positions{"--trials", "1", "--sensing", "positions"};
  Words plain = positions;
  plain.emplace_back("--plain");
  ASSERT_EQ(run(small("cartpole", "pms", positions)).code, 0);
  ASSERT_EQ(run(small("cartpole", "plain", plain)).code, 0);
  const CsvTable known = read_csv(in("pms/trial_0.csv"));
  const CsvTable unknown = read_csv(in("plain/trial_0.csv"));
  EXPECT_TRUE(known.column("pole_speed_smoothed").has_value());
  EXPECT_FALSE(unknown.column("pole_speed_smoothed").has_value());
  const std::size_t speed = known.require_column("pole_speed");
  EXPECT_EQ(known.rows[20][speed], unknown.rows[20][unknown.require_column("pole_speed")]);
  EXPECT_NE(text_of("pms/velocity_model.json"), text_of("plain/velocity_model.json"));
}

TEST_F(PolicyCommand, ThreadsChangeNothing) {
  ASSERT_EQ(run(small("cartpole", "one", {"--trials", "1", "--threads", "1"})).code, 0);
  ASSERT_EQ(run(small("cartpole", "two", {"--trials", "1", "--threads", "3"})).code, 0);
  EXPECT_EQ(text_of("one/policy_state.json"), text_of("two/policy_state.json"));
}

TEST_F(PolicyCommand, GoesOnWithMoreTrials) {
  ASSERT_EQ(run(small("cartpole", "whole", {"--trials", "2"})).code, 0);
  ASSERT_EQ(run(small("cartpole", "parts", {"--trials", "1"})).code, 0);
  ASSERT_EQ(run(small("cartpole", "parts", {"--trials", "2"})).code, 0);
  for (const char* name : {"policy_state.json", "policy.json", "trial_2.csv"}) {
    EXPECT_EQ(text_of(std::string("whole/") + name), text_of(std::string("parts/") + name)) << name;
  }
  // Again: nothing is left to do.
  const std::string before = text_of("parts/policy_state.json");
  ASSERT_EQ(run(small("cartpole", "parts", {"--trials", "2"})).code, 0);
  EXPECT_EQ(text_of("parts/policy_state.json"), before);
}

// The program as a process of its own: all of a comparison, for its BLAS may use other kernels.
pid_t start_process(const Words& words) {
  const pid_t child = ::fork();
  if (child != 0) return child;
  std::vector<char*> arguments{const_cast<char*>("kinescope")};
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  if (::freopen("/dev/null", "w", stdout) == nullptr) ::_exit(127);
  ::execv(KINESCOPE_PROGRAM, arguments.data());
  ::_exit(127);
}

int status_of(pid_t child) {
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return status;
}

TEST_F(PolicyCommand, GoesOnAfterAKill) {
  const Words words = small("cartpole", "cut", {"--trials", "2"}, "300");
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_EQ(status_of(start_process(small("cartpole", "whole", {"--trials", "2"}, "300"))), 0);
  const auto duration = std::chrono::steady_clock::now() - begin;
  int killed = 0;
  for (const double share : {0.3, 0.6, 0.9}) {
    const pid_t child = start_process(words);
    std::this_thread::sleep_for(share * duration);
    ::kill(child, SIGKILL);
    killed += WIFSIGNALED(status_of(child)) ? 1 : 0;
  }
  EXPECT_GT(killed, 0);
  ASSERT_EQ(status_of(start_process(words)), 0);
  for (const char* name : {"policy_state.json", "policy.json", "trial_1.csv", "trial_2.csv"}) {
    EXPECT_EQ(text_of(std::string("whole/") + name), text_of(std::string("cut/") + name)) << name;
  }
}

// Wilson 1927; values of R's prop.test(correct = FALSE).
TEST(ShareInterval, IsWilsons) {
  EXPECT_NEAR(share_interval(0, 50).lower, 0.0, 1e-12);
  EXPECT_NEAR(share_interval(0, 50).upper, 0.07135, 1e-5);
  EXPECT_NEAR(share_interval(39, 50).lower, 0.64758, 1e-5);
  EXPECT_NEAR(share_interval(39, 50).upper, 0.87246, 1e-5);
  EXPECT_NEAR(share_interval(50, 50).upper, 1.0, 1e-12);
}

TEST_F(PolicyCommand, SeedsOfSeveralMachinesAreOneTable) {
  const auto seeds = [&](const std::string& range, const std::string& output) {
    return run(small("cartpole", output, {"--trials", "1", "--seeds", range})).code;
  };
  ASSERT_EQ(seeds("1..2", "here"), 0);
  ASSERT_EQ(seeds("7..7", "there"), 0);
  fs::rename(in("there/seed_7"), in("here/seed_7"));
  const std::string before = text_of("here/seed_1/policy_state.json");
  ASSERT_EQ(seeds("1..1", "here"), 0);
  EXPECT_EQ(text_of("here/seed_1/policy_state.json"), before) << "done already";
  const CsvTable table = read_csv(in("here/success.csv"));
  ASSERT_EQ(table.rows.size(), 1U);
  EXPECT_EQ(table.number(0, table.require_column("seeds")), 3.0);
  EXPECT_EQ(read_csv(in("here/seeds.csv")).rows.size(), 3U);
  const ProductCheck check = check_products(in("here"));
  EXPECT_TRUE(check.passed || !check.done) << check.words;
  // The same as the seed alone.
  ASSERT_EQ(run(small("cartpole", "alone", {"--trials", "1", "--seed", "2"})).code, 0);
  EXPECT_EQ(text_of("alone/policy_state.json"), text_of("here/seed_2/policy_state.json"));
  ASSERT_EQ(run(small("furuta", "here/seed_9", {"--trials", "1", "--seed", "9"})).code, 0);
  expect_refusal(small("cartpole", "here", {"--trials", "1", "--seeds", "1..1"}),
                 ExitCode::kBadInput, "seed_9/policy_state.json: is of a search with another");
  EXPECT_EQ(seeds("3..1", "here"), 2);
}

TEST_F(PolicyCommand, RefusesWhatItWouldSpoil) {
  ASSERT_EQ(run(small("cartpole", "out", {"--trials", "1"})).code, 0);
  const std::string before = text_of("out/policy_state.json");
  expect_refusal(small("cartpole", "out", {"--seed", "2"}), ExitCode::kBadRequest,
                 "is of a search with another seed");
  expect_refusal(small("furuta", "out"), ExitCode::kBadRequest, "out/policy_state.json: ");
  EXPECT_EQ(text_of("out/policy_state.json"), before);
  write_file_atomically(in("out/policy_state.json"), before.substr(0, before.size() / 2));
  expect_refusal(small("cartpole", "out", {"--trials", "1"}), ExitCode::kBadInput, "is no JSON");
  ASSERT_EQ(run(small("cartpole", "out", {"--trials", "1", "--force"})).code, 0);
  EXPECT_EQ(text_of("out/policy_state.json"), before);
  fs::create_directories(in("theirs"));
  write_file_atomically(in("theirs/policy.html"), "mine");
  expect_refusal(small("cartpole", "theirs"), ExitCode::kBadRequest, "policy.html");
  EXPECT_EQ(text_of("theirs/policy.html"), "mine");
}

TEST_F(PolicyCommand, RefusesWhatMakesNoSense) {
  expect_refusal(small("cartpol", "out"), ExitCode::kBadRequest, "cartpole");
  expect_refusal(small("none.yaml", "out"), ExitCode::kBadInput, "none.yaml");
  expect_refusal(small("ball_plate", "out", {"--kernel", "semi_parametric"}), ExitCode::kBadRequest,
                 "nothing is known of the physics");
  expect_refusal(small("cartpole", "out", {"--plain"}), ExitCode::kBadRequest,
                 "--plain: changes nothing");
  EXPECT_EQ(run(small("cartpole", "out", {"--kernel", "rbf"})).code, 2);
  EXPECT_EQ(run(small("cartpole", "out", {"--particles", "0"})).code, 2);
  EXPECT_FALSE(fs::exists(in("out")));
}

// A program that drives well until a file says otherwise.
class OwnSystem : public PolicyCommand {
 protected:
  void SetUp() override {
    PolicyCommand::SetUp();
    write_file_atomically(in("system.yaml"),
                          "program: [python3, system.py]\nstep: 0.1\nhorizon: 1\ntimeout: 5\n"
                          "positions:\n  x: {target: 1, length_scale: 1, tolerance: 0.5}\n"
                          "inputs:\n  u: {limit: 1}\n");
    write_file_atomically(in("broken"), "none");
    // A mass of 1 kg; the file `broken` names trial and step at which it fails.
    write_file_atomically(in("system.py"),
                          "import sys\n"
                          "x = v = 0.0\n"
                          "sys.stdin.readline()\n"
                          "print('x,x_speed')\n"
                          "print(x, v, sep=',', flush=True)\n"
                          "for k, row in enumerate(sys.stdin):\n"
                          "    if open('broken').read().split() == [sys.argv[4], str(k)]:\n"
                          "        sys.exit('lost contact')\n"
                          "    v += 0.1 * float(row)\n"
                          "    x += 0.1 * v\n"
                          "    print(x, v, sep=',', flush=True)\n");
  }
};

TEST_F(OwnSystem, KeepsWhatItLearnedBeforeTheProgramFailed) {
  const Words words = small(in("system.yaml").string(), "out", {"--trials", "2"});
  write_file_atomically(in("broken"), "2 3");
  const std::string line = expect_refusal(words, ExitCode::kUndetermined, "lost contact");
  EXPECT_NE(line.find("ended with exit code 1 before its state 5 of 11"), std::string::npos);
  EXPECT_TRUE(fs::exists(in("out/trial_1.csv")));
  EXPECT_FALSE(fs::exists(in("out/trial_2.csv")));
  EXPECT_TRUE(fs::exists(in("out/policy.json")));
  const std::string first = text_of("out/trial_1.csv");
  write_file_atomically(in("broken"), "none");
  const Outcome again = run(words);
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(text_of("out/trial_1.csv"), first);
  EXPECT_TRUE(fs::exists(in("out/trial_2.csv")));
}

TEST_F(OwnSystem, SaysItsOwnSensing) {
  const std::string file = in("system.yaml").string();
  expect_refusal(small(file, "out", {"--sensing", "full"}), ExitCode::kBadRequest, "--sensing");
  expect_refusal(small(file, "out", {"--kernel", "semi_parametric"}), ExitCode::kBadRequest,
                 "nothing is known of the physics");
}

}  // namespace
}  // namespace kinescope
