// SPDX-License-Identifier: Apache-2.0
//
// What a command did not write it neither replaces nor removes, and no input is written over: the
// rule by itself, and every command that writes.
#include "app/io/output_folder.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/poses_of_arm.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

const std::string kForeign = "somebody else's\n";
constexpr auto kRefused = ExitCode::kBadRequest;

class OwnFiles : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    return read_text_file(folder_.path() / name);
  }
  [[nodiscard]] bool exists(const std::string& name) const {
    return fs::exists(folder_.path() / name);
  }
  [[nodiscard]] OutputFolder out(const std::string& command, bool force = false) const {
    return {path("out"), {command, {"a.txt", "b.txt"}, {path("read.txt")}, force}};
  }
  [[nodiscard]] std::string refusal(const std::string& command, bool force = false) const {
    return folder_.refusal_of([&] { static_cast<void>(out(command, force)); }, kRefused);
  }

  RecordingFolder folder_;
};

TEST_F(OwnFiles, AreReplacedAndRemoved) {
  const OutputFolder first = out("run");
  first.write("a.txt", "one");
  first.write("b.txt", "one");
  const OutputFolder second = out("run");
  second.write("a.txt", "two");
  second.remove("b.txt");
  EXPECT_EQ(text("out/a.txt"), "two");
  EXPECT_FALSE(exists("out/b.txt"));
  EXPECT_EQ(second.own_products(), std::set<std::string>{"a.txt"});
  // What was removed is the command's no more.
  folder_.write("out/b.txt", kForeign);
  EXPECT_EQ(refusal("run").find("out/b.txt: would be replaced, and kinescope run did not write it"),
            0U)
      << refusal("run");
}

TEST_F(OwnFiles, AreThoseOfOneCommand) {
  out("run").write("a.txt", "of the run");
  EXPECT_NE(refusal("dynamics").find("kinescope run wrote it"), std::string::npos);
  const OutputFolder forced = out("dynamics", true);
  forced.remove("a.txt");
  EXPECT_TRUE(exists("out/a.txt")) << "force replaces, and removes nothing";
  forced.write("a.txt", "of dynamics");
  EXPECT_NE(refusal("run").find("kinescope dynamics wrote it"), std::string::npos);
}

TEST_F(OwnFiles, AreNeverAnInput) {
  folder_.write("read.txt", kForeign);
  fs::create_directories(folder_.path() / "out");
  fs::create_hard_link(folder_.path() / "read.txt", folder_.path() / "out/b.txt");
  for (const bool force : {false, true}) {
    EXPECT_EQ(refusal("run", force).find("out/b.txt: is an input"), 0U) << refusal("run", force);
  }
}

TEST_F(OwnFiles, AreWhatARunSaysAndNoMore) {
  const nlohmann::json products{"robot.urdf", "thesis.tex", "../report.html", 3, nullptr};
  const auto own = [&](const nlohmann::json& run) {
    folder_.write("out/run.json", run.dump());
    return out("run").own_products();
  };
  EXPECT_EQ(own({{"schema", "kinescope.run"}, {"products", products}}),
            std::set<std::string>{"robot.urdf"});
  for (const nlohmann::json& run :
       {nlohmann::json{{"products", products}}, nlohmann::json(products), nlohmann::json(nullptr),
        nlohmann::json{{"schema", "kinescope.trace"}, {"products", products}}}) {
    EXPECT_TRUE(own(run).empty()) << run;
  }
}

// A list that was written by hand names files of its own folder, and no others.
TEST_F(OwnFiles, AreInTheirFolder) {
  out("export").write("a.txt", "one");
  folder_.write("victim.txt", kForeign);
  folder_.write("out/.kinescope_products", "export ../victim.txt\nexport " +
                                               (folder_.path() / "victim.txt").string() +
                                               "\nexport ..\nexport a.txt\n");
  const OutputFolder again = out("export");
  EXPECT_EQ(again.own_products(), std::set<std::string>{"a.txt"});
  again.remove("../victim.txt");
  EXPECT_TRUE(exists("victim.txt"));
}

// A run that is cut off leaves no run.json, and goes on in its own folder.
TEST_F(OwnFiles, StayOwnWithoutTheRunThatNamesThem) {
  const nlohmann::json run{{"schema", "kinescope.run"}, {"products", {"robot.urdf", "thesis.tex"}}};
  folder_.write("out/run.json", run.dump());
  out("run").list_own_products();
  fs::remove(folder_.path() / "out/run.json");
  EXPECT_EQ(out("run").own_products(), std::set<std::string>{"robot.urdf"});
}

TEST_F(OwnFiles, ASingleFileIsNewOrForced) {
  folder_.write("read.txt", kForeign).write("there.txt", kForeign);
  const auto refusal = [&](const std::string& name, bool force) {
    return folder_.refusal_of(
        [&] { require_new_file(path(name), "--output", {path("read.txt")}, force); }, kRefused);
  };
  EXPECT_EQ(refusal("new.txt", false), "accepted");
  EXPECT_EQ(refusal("there.txt", true), "accepted");
  EXPECT_EQ(refusal("there.txt", false).find("there.txt: is there already"), 0U);
  out("run").write("a.txt", "");
  for (const bool force : {false, true}) {
    EXPECT_EQ(refusal("read.txt", force).find("read.txt: is an input"), 0U);
    EXPECT_NE(refusal("out/../read.txt", force).find("is an input"), std::string::npos);
    EXPECT_EQ(refusal("out/a.txt", force).find("out/a.txt: is a product of kinescope run"), 0U);
    EXPECT_EQ(refusal("out", force).find("out: is a folder"), 0U);
  }
}

// ---- The commands ----

// A recording that run accepts, and a torque log of another robot.
class OwnFilesOfCommands : public OwnFiles {
 protected:
  OwnFilesOfCommands() {
    RecordingOptions few;
    few.frames = 200;
    recording_ = arm("own files", few, 2).recording;
    film("rec", recording_);
    Rng rng = Rng::from_name("own files");
    const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
    const DynamicModel model = random_masses(robot.tree, {.every_direction = false}, rng);
    folder_.write("log.csv", torque_log_csv(torque_log_of(model, {.samples = 600}, rng)))
        .write("robot.urdf", write_urdf(model));
  }
  void film(const std::string& name, const RobotRecording& recording) const {
    folder_.write(name + "/poses.csv", tracks_csv(recording.tracks))
        .write(name + "/joints.csv", joints_csv(recording.log));
  }
  [[nodiscard]] std::vector<std::string> words(const std::string& command,
                                               const std::string& output,
                                               const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all{command, command == "run" ? path("rec") : path("log.csv")};
    if (command != "run") all.insert(all.end(), {"--robot", path("robot.urdf")});
    if (command == "run") all.emplace_back("--no-trace");
    all.insert(all.end(), {"--output", path(output), "--quiet"});
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  RobotRecording recording_;
};

struct ForeignFile {
  const char* command;
  const char* name;
};

TEST_F(OwnFilesOfCommands, ForeignFilesStay) {
  for (const auto& [command, name] :
       std::initializer_list<ForeignFile>{{"run", "report.html"},
                                          {"run", "robot.urdf"},
                                          {"run", "tracks.csv"},
                                          {"run", "structure.json"},
                                          {"run", "observations.csv"},
                                          {"run", "observations.json"},
                                          {"run", "failed_report.html"},
                                          {"run", "run.json"},
                                          {"run", "trace.json"},
                                          {"dynamics", "dynamics.html"},
                                          {"dynamics", "dynamics.json"},
                                          {"dynamics", "trace.json"},
                                          {"dynamics", "robot_traced.urdf"},
                                          {"dynamics", "torque_compensated.csv"},
                                          {"contact", "contact.html"},
                                          {"contact", "contacts.csv"}}) {
    const std::string folder = std::string(command) + "_" + name;
    folder_.write(folder + "/" + name, kForeign);
    const std::string line =
        expect_refusal(words(command, folder), kRefused, folder + "/" + name + ": would be");
    EXPECT_NE(line.find("--output, or replace it with --force"), std::string::npos) << line;
    EXPECT_EQ(text(folder + "/" + name), kForeign);
    EXPECT_EQ(std::distance(fs::directory_iterator(path(folder)), fs::directory_iterator()), 1)
        << "before any work: " << folder;
  }
}

TEST_F(OwnFilesOfCommands, ForceReplacesAndRemovesNothingElse) {
  for (const char* name : {"report.html", "failed_report.html", "thesis.tex", "dynamics.html"}) {
    folder_.write(std::string("out/") + name, kForeign);
  }
  folder_.write("out/run.json", R"({"products": ["thesis.tex"]})");
  EXPECT_EQ(run(words("run", "out", {"--force"})).code, 0);
  EXPECT_NE(text("out/report.html"), kForeign);
  for (const char* name : {"failed_report.html", "thesis.tex", "dynamics.html"}) {
    EXPECT_EQ(text(std::string("out/") + name), kForeign) << name;
  }
}

TEST_F(OwnFilesOfCommands, ARunsTraceIsNotATorqueLogs) {
  folder_.write("out/run.json", R"({"schema": "kinescope.run", "products": ["trace.json"]})")
      .write("out/trace.json", "of the run");
  expect_refusal(words("dynamics", "out"), kRefused, "kinescope run wrote it");
  EXPECT_EQ(run(words("dynamics", "out", {"--no-trace", "--model", "parametric"})).code, 0);
  EXPECT_EQ(text("out/trace.json"), "of the run");
}

TEST_F(OwnFilesOfCommands, NoRunIntoARecording) {
  fs::create_directory_symlink(folder_.path() / "rec", folder_.path() / "link");
  folder_.write("logs/other.csv", text("rec/joints.csv"));
  const std::string before = text("rec/joints.csv");
  for (const char* output : {"rec", "rec/", "link", "rec/none/..", "rec/../link/."}) {
    expect_refusal(words("run", output), kRefused, "is the recording's own folder");
    expect_refusal(words("run", output, {"--force"}), kRefused, "is the recording's own folder");
  }
  expect_refusal(words("run", "logs", {"--joints", path("logs/other.csv")}), kRefused,
                 "holds the input other.csv");
  EXPECT_EQ(std::distance(fs::directory_iterator(path("rec")), fs::directory_iterator()), 2);
  EXPECT_EQ(run(words("run", "rec/out")).code, 0);
  EXPECT_EQ(text("rec/joints.csv"), before);
}

// The same one renamed, or with other settings, is run again; another one is not.
TEST_F(OwnFilesOfCommands, TheRunOfAnotherRecordingStays) {
  ASSERT_EQ(run(words("run", "out")).code, 0);
  const std::string urdf = text("out/robot.urdf");
  folder_.write("rec/recording.yaml", "name: arm\n");
  EXPECT_EQ(run(words("run", "out")).code, 0);
  fs::rename(path("rec"), path("renamed"));
  std::vector<std::string> other = words("run", "out");
  other[1] = path("renamed");
  EXPECT_EQ(run(other).code, 0);

  RecordingOptions few;
  few.frames = 200;
  film("another", arm("another robot", few, 2).recording);
  folder_.write("another/recording.yaml", "name: arm\n");
  const std::string answer = text("out/robot.urdf");
  other[1] = path("another");
  const std::string line = expect_refusal(other, kRefused, "the run of another recording, renamed");
  EXPECT_NE(line.find("--force"), std::string::npos) << line;
  EXPECT_EQ(text("out/robot.urdf"), answer);
  other.emplace_back("--force");
  EXPECT_EQ(run(other).code, 0);
  EXPECT_NE(text("out/robot.urdf"), answer);
}

TEST_F(OwnFilesOfCommands, ARecordingThatChangedIsNotTraced) {
  std::vector<std::string> first = words("run", "out");
  ASSERT_EQ(run(first).code, 0);
  const std::vector<std::string> again{"trace", path("out"), "--quiet"};
  const auto refused = [&](const std::string& part) {
    const std::string line = expect_refusal(again, ExitCode::kBadInput, part);
    EXPECT_NE(line.find("run the recording again"), std::string::npos) << line;
  };
  const std::string joints = text("rec/joints.csv");
  folder_.write("rec/joints.csv", joints + "\n");
  refused("joints.csv: has changed since the run in");
  folder_.write("rec/joints.csv", joints).write("rec/recording.yaml", "name: arm\n");
  refused("recording.yaml: was not there for the run in");
  folder_.remove("rec/recording.yaml");
  EXPECT_NE(run(again).code, static_cast<int>(ExitCode::kBadInput));
}

TEST_F(OwnFilesOfCommands, NoCommandWritesOverItsInput) {
  folder_.write("model.json", kForeign).write("images/1.png", kForeign);
  const std::vector<std::string> board{"--board", "chessboard", "--columns", "9",
                                       "--rows",  "6",          "--square",  "0.025"};
  const auto camera = [&](const std::string& output) {
    std::vector<std::string> all{"camera", path("images"), "--output", path(output), "--force"};
    all.insert(all.end(), board.begin(), board.end());
    return all;
  };
  for (const char* input : {"log.csv", "model.json"}) {
    expect_refusal({"predict", path("log.csv"), "--model", path("model.json"), "--output",
                    path(input), "--force"},
                   kRefused, "is an input");
  }
  for (const char* input : {"log.csv", "robot.urdf"}) {
    expect_refusal(words("dynamics", "out", {"--save-model", path(input), "--force"}), kRefused,
                   "is an input");
  }
  expect_refusal(words("dynamics", "out", {"--save-model", path("out/dynamics.json")}), kRefused,
                 "is the place of another product");
  expect_refusal(camera("images/1.png"), kRefused, "is an input");
  EXPECT_EQ(text("images/1.png"), kForeign);
}

TEST_F(OwnFilesOfCommands, AFileThatIsThereIsNotReplaced) {
  folder_.write("there", kForeign).write("model.json", "{}").write("images/1.png", kForeign);
  for (const std::vector<std::string>& all :
       {std::vector<std::string>{"predict", path("log.csv"), "--model", path("model.json"),
                                 "--output", path("there")},
        words("dynamics", "out", {"--save-model", path("there")}),
        std::vector<std::string>{"camera", path("images"), "--output", path("there"), "--board",
                                 "chessboard", "--columns", "9", "--rows", "6", "--square",
                                 "0.025"}}) {
    expect_refusal(all, kRefused, "there: is there already");
    EXPECT_EQ(text("there"), kForeign);
  }
}

}  // namespace
}  // namespace kinescope
