// SPDX-License-Identifier: Apache-2.0
//
// `kinescope experiment` in small: products, the page against its table,
// refusals.
#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/experiments/experiments.h"
#include "dynamics/experiments/scara.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/experiments/experiment_page.h"
#include "tests/app/io/check_products.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

std::vector<std::string> small(const std::string& name, const std::filesystem::path& folder,
                               const std::string& threads) {
  return {"experiment",       name,    "--runs",   "4",
          "--samples",        "150",   "--starts", "1",
          "--search-samples", "75",    "--models", "gip,rbf,parametric",
          "--threads",        threads, "-o",       folder.string(),
          "--quiet"};
}

const Experiment& experiment_named(std::string_view name) {
  return *std::ranges::find(all_experiments(), name, &Experiment::name);
}

TEST(Experiment, ThePageShowsTheTable) {
  const std::filesystem::path folder = truth::temporary_path("scara_experiment");
  std::vector<std::string> words = small("scara", folder, "2");
  words.insert(words.end(), {"--tilt", "2", "--shift", "0.01"});
  const Outcome outcome = run(words);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const ProductCheck check = check_products(folder);
  if (check.done) {
    EXPECT_TRUE(check.passed) << check.words;
  }
  const std::string page = read_text_file(folder / "experiment.html");
  int compared = 0;
  for (const auto& row : read_csv_rows(read_text_file(folder / "spread.csv"))) {
    if (row.at("Joint") == "all joints") continue;
    const auto drawn = medians_drawn(drawing(page, "Error of " + row.at("Joint")));
    ASSERT_TRUE(drawn.contains(row.at("Model"))) << row.at("Joint");
    const double median = std::stod(row.at("median"));
    constexpr double kPixel = 0.05;  // relative: ten decades on 380 px, to a tenth of a px
    EXPECT_NEAR(drawn.at(row.at("Model")) / median, 1.0, kPixel) << row.at("Joint");
    ++compared;
  }
  EXPECT_EQ(compared, 3 * 4);
  EXPECT_EQ(page.find("<script"), std::string::npos);
}

TEST(Experiment, ThreadsChangeNothing) {
  const std::filesystem::path one = truth::temporary_path("one_thread");
  const std::filesystem::path two = truth::temporary_path("two_threads");
  ASSERT_EQ(run(small("efficiency", one, "1")).code, 0);
  ASSERT_EQ(run(small("efficiency", two, "2")).code, 0);
  for (const char* table : {"medians.csv", "spread.csv", "runs.csv"}) {
    EXPECT_EQ(read_text_file(one / table), read_text_file(two / table)) << table;
  }
}

TEST(Experiment, EveryTableOfTheOthersIsWrittenAndValid) {
  const std::filesystem::path folder = truth::temporary_path("others");
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"barrett", "--samples", "150"},
        std::vector<std::string>{"contact", "--runs", "1", "--seconds", "5", "--samples", "8000"},
        std::vector<std::string>{"control", "--runs", "1", "--seconds", "12", "--joints", "4"},
        std::vector<std::string>{"ur10", "--samples", "200", "--models",
                                 "rbf,rbf_inducing,parametric", "--inducing", "50", "--starts", "1",
                                 "--search-samples", "60"},
        std::vector<std::string>{"panda", "--runs", "1", "--joints", "2,3", "--models",
                                 "rbf,parametric", "--starts", "1", "--search-samples", "60"}}) {
    std::vector<std::string> command{"experiment"};
    command.insert(command.end(), words.begin(), words.end());
    const std::filesystem::path out = folder / words.front();
    command.insert(command.end(), {"-o", out.string(), "--quiet"});
    const Outcome outcome = run(command);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const ProductCheck check = check_products(out);
    if (check.done) {
      EXPECT_TRUE(check.passed) << check.words;
    }
    for (const std::string_view table : experiment_named(words.front()).tables) {
      EXPECT_TRUE(std::filesystem::exists(out / (std::string(table) + ".csv"))) << table;
    }
  }
}

TEST(Experiment, OfTheUr10BothTestsAreInTableAndPage) {
  const std::filesystem::path folder = truth::temporary_path("ur10_experiment");
  const Outcome outcome = run({"experiment", "ur10", "--samples", "200", "--models",
                               "parametric,rbf,rbf_inducing", "--inducing", "40", "--starts", "1",
                               "--search-samples", "60", "-o", folder.string(), "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = read_text_file(folder / "experiment.html");
  const CsvRows rows = read_csv_rows(read_text_file(folder / "medians.csv"));
  ASSERT_EQ(rows.size(), 2U * 3U);
  for (const auto& row : rows) {
    EXPECT_NE(page.find("Test: " + row.at("Test")), std::string::npos);
    // Geometry is known, and the springs are stiff: what is left is below the noise.
    if (row.at("Model") == "parametric") {
      EXPECT_LT(std::stod(row.at("all joints")), 3.0) << row.at("Test");
    }
  }
  EXPECT_NE(rows.front().at("all joints"), rows.back().at("all joints"));
  EXPECT_NE(page.find("rbf from all samples errs by"), std::string::npos);
}

// The first of mpirun's processes writes what one process would.
TEST(Experiment, OverSeveralProcesses) {
  if (!KINESCOPE_WITH_SCALAPACK) GTEST_SKIP() << "built without ScaLAPACK (KINESCOPE_SCALAPACK)";
  if (std::system("command -v mpirun > /dev/null") != 0) {
    GTEST_SKIP() << "mpirun is not installed (openmpi-bin)";
  }
  const std::filesystem::path folder = truth::temporary_path("processes");
  const auto table = [&](const std::string& before, const std::string& name) {
    const std::string command = before + KINESCOPE_PROGRAM +
                                " experiment ur10 --samples 600 --models rbf --starts 1 "
                                "--search-samples 60 --threads 1 --quiet -o " +
                                (folder / name).string();
    EXPECT_EQ(std::system((command + " > /dev/null").c_str()), 0) << command;
    return read_csv_rows(read_text_file(folder / name / "medians.csv"));
  };
  std::filesystem::create_directories(folder);
  const CsvRows one = table("", "one");
  const CsvRows two = table("mpirun --oversubscribe --allow-run-as-root -n 2 ", "two");
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    EXPECT_NEAR(std::stod(two[k].at("all joints")) / std::stod(one[k].at("all joints")), 1.0, 1e-7);
  }
}

TEST(Experiment, OnALogOfOnesOwn) {
  const experiments::ComparisonCase one =
      experiments::scara_case({}, 0, {.samples = 1200, .test_samples = 10});
  const RecordingFolder folder;
  folder.write("robot.urdf", write_urdf(one.believed)).write("log.csv", torque_log_csv(one.train));
  const std::filesystem::path out = folder.path() / "out";
  for (const char* name : {"scara", "efficiency", "ur10"}) {
    const Outcome outcome =
        run({"experiment", name, "--log", (folder.path() / "log.csv").string(), "--robot",
             (folder.path() / "robot.urdf").string(), "--runs", "2", "--models", "parametric,rbf",
             "--search-samples", "60", "--starts", "1", "-o", out.string(), "--quiet"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto rows = read_csv_rows(read_text_file(out / "medians.csv"));
    ASSERT_GE(rows.size(), 2U);
    const auto& most = rows[rows.size() - 2];  // of most samples
    ASSERT_EQ(most.at("Model"), "parametric");
    EXPECT_LT(std::stod(most.at("all joints")), 1.0);  // noise of 1 %: 0.01 %, and filters
    const auto document = nlohmann::json::parse(read_text_file(out / "experiment.json"));
    EXPECT_EQ(document.at("inputs").size(), 2U);
  }
}

TEST(Experiment, Refusals) {
  const ExitCode code = ExitCode::kBadRequest;
  expect_refusal({"experiment"}, code, "NAME");
  expect_refusal({"experiment", "scra"}, code, "did you mean 'scara'?");
  expect_refusal({"experiment", "scara", "--models", "gipp"}, code, "did you mean 'gip'?");
  expect_refusal({"experiment", "efficiency", "--tilt", "2"}, code,
                 "--tilt: is no option of the experiment efficiency");
  expect_refusal({"experiment", "control", "--joints", "3"}, code, "give 4 to 7");
  expect_refusal({"experiment", "ur10", "--samples", "1000000", "--models", "model_based,rbf"},
                 code, "rbf: the kernel matrix of 1000000 samples needs 8000.0 GB");
  expect_refusal({"experiment", "ur10", "--noise", "0.1"}, code,
                 "--noise: is no option of the experiment ur10");
  expect_refusal({"experiment", "panda", "--inducing", "50"}, code,
                 "--inducing: is no option of the experiment panda");
  expect_refusal({"experiment", "scara", "--seconds", "20"}, code,
                 "--seconds: is no option of the experiment scara");
  expect_refusal({"experiment", "scara", "--tilt", "1,2", "--shift", "0.01"}, code,
                 "1 of them, and 2 of --tilt");
  expect_refusal({"experiment", "scara", "--robot", "arm.urdf"}, code, "a robot without its log");
  expect_refusal({"experiment", "scara", "--log", "a.csv", "--robot", "arm.urdf", "--tilt", "1"},
                 code, "--tilt: is of the experiment's worlds");
}

}  // namespace
}  // namespace kinescope
