// SPDX-License-Identifier: Apache-2.0
//
// `kinescope export` of a run: paths, Denavit-Hartenberg tables, recordings for viewers.
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/bags/bag.h"
#include "kinematics/core/csv.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/filmed_robot.h"
#include "tests/truth/recorded_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kSamePath = 1e-9;  // m, and of quaternions

KinematicTree exported_arm() {
  truth::FilmedRobotOptions options;
  options.seed = 3;
  KinematicTree out = truth::draw_filmed_robot(options).tree;
  out.joints.resize(3);
  out.links.resize(4);
  for (Joint& joint : out.joints) joint.channel = joint.name;
  return out;
}

struct TumPose {
  double t = 0.0;
  Eigen::Vector3d translation;
  Eigen::Quaterniond rotation;
};

// A reader of its own: words between blanks, '#' begins a comment.
std::vector<TumPose> read_tum(const fs::path& path) {
  std::vector<TumPose> out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    std::vector<double> v;
    for (double value = 0.0; words >> value;) v.push_back(value);
    EXPECT_EQ(v.size(), 8U) << line;
    if (v.size() != 8) return {};
    out.push_back({v[0], {v[1], v[2], v[3]}, Eigen::Quaterniond(v[7], v[4], v[5], v[6])});
  }
  return out;
}

double difference(const Pose& pose, const TumPose& read) {
  const Eigen::Vector4d q = pose.rotation.coeffs(), r = read.rotation.coeffs();
  return std::max((pose.translation - read.translation).norm(),
                  std::min((q - r).norm(), (q + r).norm()));
}

// One run for all tests; its folder is copied where a test damages it.
class Export : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    truth::WorldOptions options;
    options.seed = 1;
    options.robot = exported_arm();
    options.frames = 120;
    options.sigma_px = 0.03;
    truth::write_world(truth::make_world(options), root() / "arm");
    const Outcome made = run(
        {"run", (root() / "arm").string(), "-o", run_folder().string(), "--no-trace", "--quiet"});
    ASSERT_EQ(made.code, 0) << made.err;
  }
  static fs::path root() { return truth::temporary_path("exported"); }
  static fs::path run_folder() { return root() / "arm_run"; }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  [[nodiscard]] std::string copied_run() const {
    fs::copy(run_folder(), folder_.path() / "copy", fs::copy_options::recursive);
    return path("copy");
  }
  static json exported(std::vector<std::string> words) {
    words.insert(words.begin(), {"export", run_folder().string(), "--json", "--quiet"});
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return json::parse(outcome.out, nullptr, false);
  }

  RecordingFolder folder_;
};

TEST_F(Export, JointValuesAreWhereTheRobotStood) {
  const CsvTable values = read_csv(run_folder() / "joint_values.csv");
  EXPECT_EQ(values.header, (std::vector<std::string>{"t", "q1", "q2", "q3"}));
  EXPECT_EQ(values.rows.size(), 120U);
}

TEST_F(Export, PathsAreTheForwardKinematicsOfTheUrdf) {
  const json told = exported({"--tum", path("tum")}).at("tum");
  EXPECT_EQ(told.at("frame"), "base");
  const KinematicTree tree = read_urdf(run_folder() / "robot.urdf");
  const CsvTable values = read_csv(run_folder() / "joint_values.csv");
  ASSERT_EQ(told.at("paths").size(), tree.links.size() - 1);
  for (std::size_t link = 1; link < tree.links.size(); ++link) {
    const json& one = told.at("paths").at(tree.links[link].name);
    const auto poses = read_tum(folder_.path() / "tum" / one.at("file").get<std::string>());
    ASSERT_EQ(poses.size(), values.rows.size());
    for (std::size_t row = 0; row < poses.size(); ++row) {
      Eigen::VectorXd q(3);
      for (std::size_t j = 0; j < 3; ++j)
        q[static_cast<Eigen::Index>(j)] =
            values.number(row, values.require_column(tree.joints[j].name));
      EXPECT_EQ(poses[row].t, values.number(row, 0));
      EXPECT_LT(difference(forward_kinematics(tree, q)[link], poses[row]), kSamePath);
      if (row > 0) {
        EXPECT_GT(poses[row].rotation.dot(poses[row - 1].rotation), 0.0);
      }
    }
  }
  const std::string text = read_text_file(folder_.path() / "tum/link1.tum");
  EXPECT_NE(text.find("# timestamp: s, of the recording's frames on the camera's clock"),
            std::string::npos);
}

TEST_F(Export, InTheCamerasFrameTheBaseHasAPathToo) {
  const json told = exported({"--tum", path("tum"), "--tum-frame", "camera"}).at("tum");
  EXPECT_EQ(told.at("frame"), "camera");
  const json calibration = json::parse(read_text_file(run_folder() / "calibration.json"));
  const auto base = read_tum(folder_.path() / "tum/base.tum");
  ASSERT_EQ(base.size(), 120U);
  const json& place = calibration.at("T_camera_base").at("translation_m");
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_NEAR(base[7].translation[static_cast<Eigen::Index>(i)], place[i].get<double>(), 1e-12);
}

TEST_F(Export, AFolderOfPathsIsReplacedByItsOwnCommandAlone) {
  static_cast<void>(exported({"--tum", path("tum"), "--tum-frame", "camera"}));
  EXPECT_TRUE(fs::exists(path("tum/base.tum")));
  folder_.write("tum/notes.txt", "mine");
  static_cast<void>(exported({"--tum", path("tum")}));
  EXPECT_FALSE(fs::exists(path("tum/base.tum"))) << "of the earlier export";
  EXPECT_TRUE(fs::exists(path("tum/notes.txt")));
  folder_.write("mine/link1.tum", "mine");
  const std::string source = run_folder().string();
  expect_refusal({"export", source, "--tum", path("mine")}, ExitCode::kBadRequest, "link1.tum");
  EXPECT_EQ(read_text_file(path("mine/link1.tum")), "mine");
  static_cast<void>(exported({"--tum", path("mine"), "--force"}));
  EXPECT_NE(read_text_file(path("mine/link1.tum")), "mine");
  expect_refusal({"export", source, "--tum", source}, ExitCode::kBadRequest, "holds the input");
}

TEST_F(Export, FilesAreNotReplacedUnasked) {
  const std::string source = run_folder().string();
  for (const char* option : {"--dh", "--mcap"}) {
    folder_.write("mine", "mine");
    expect_refusal({"export", source, option, path("mine")}, ExitCode::kBadRequest,
                   "is there already");
    expect_refusal({"export", source, option, (run_folder() / "joint_values.csv").string()},
                   ExitCode::kBadRequest, "joint_values.csv");
    static_cast<void>(exported({option, path("mine"), "--force"}));
    EXPECT_NE(read_text_file(path("mine")), "mine");
  }
  expect_refusal({"export", source, "--dh", path("same"), "--mcap", path("same")},
                 ExitCode::kBadRequest, "is named twice");
  EXPECT_FALSE(fs::exists(path("same")));
}

TEST_F(Export, ATableHasTheUncertaintiesOfTheRun) {
  const json told = exported({"--dh", path("dh.csv")}).at("dh");
  EXPECT_EQ(told.at("convention"), "modified");
  ASSERT_EQ(told.at("chains").size(), 1U);
  const CsvTable table = read_csv(path("dh.csv"));
  ASSERT_EQ(table.rows.size(), 5U) << "base, three joints, tool";
  EXPECT_EQ(table.rows[0][table.require_column("type")], "base");
  EXPECT_EQ(table.rows[4][table.require_column("type")], "tool");
  const auto expanded = table.optional_number(2, table.require_column("U_alpha"));
  ASSERT_TRUE(expanded);
  EXPECT_GT(*expanded, 1e-6);
  EXPECT_LT(*expanded, 1e-2);
  EXPECT_FALSE(table.optional_number(1, table.require_column("U_a"))) << "0 by construction";
  EXPECT_TRUE(table.optional_number(0, table.require_column("U_position")));
  const std::string text = read_text_file(path("dh.csv"));
  EXPECT_NE(text.find("T_i-1_i = Tx(a) Rx(alpha) Ry(beta) Rz(theta) Tz(d)"), std::string::npos);
  const json standard =
      exported({"--dh", path("s.csv"), "--dh-convention", "standard", "--tip", "link2"}).at("dh");
  EXPECT_EQ(standard.at("chains")[0].at("rows").size(), 2U);
  // The same numbers, a row higher.
  EXPECT_EQ(standard.at("chains")[0].at("rows")[0].at("a"),
            told.at("chains")[0].at("rows")[1].at("a"));
}

TEST_F(Export, AUrdfHasATableWithoutUncertainties) {
  const std::string urdf = (run_folder() / "robot.urdf").string();
  const Outcome outcome = run({"export", urdf, "--dh", path("dh.csv"), "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const CsvTable table = read_csv(path("dh.csv"));
  EXPECT_FALSE(table.optional_number(2, table.require_column("U_alpha")));
  EXPECT_NE(read_text_file(path("dh.csv")).find("the robot comes from a URDF"), std::string::npos);
}

TEST_F(Export, ViewersGetFramesJointsAndResiduals) {
  const json told = exported({"--mcap", path("arm.mcap")}).at("mcap");
  const auto reader = bags::open(path("arm.mcap"));
  std::map<std::string, std::vector<json>> messages;
  std::int64_t last = 0;
  while (const auto message = reader->next()) {
    EXPECT_GE(message->received_ns, last);
    last = message->received_ns;
    messages[reader->topics()[message->topic].name].push_back(json::parse(message->data));
  }
  EXPECT_TRUE(reader->warnings().empty());
  for (const auto& [topic, one] : told.at("topics").items())
    EXPECT_EQ(messages[topic].size(), one.at("messages").get<std::size_t>()) << topic;
  for (const bags::Topic& topic : reader->topics()) EXPECT_EQ(topic.encoding_name, "json");
  ASSERT_EQ(messages["/tf"].size(), 120U);
  ASSERT_EQ(messages["/joint_values"].size(), 120U);
  const json& transforms = messages["/tf"][9].at("transforms");
  ASSERT_EQ(transforms.size(), 3U);
  EXPECT_EQ(transforms[0].at("parent_frame_id"), "base");
  const CsvTable values = read_csv(run_folder() / "joint_values.csv");
  EXPECT_EQ(messages["/joint_values"][9].at("values").at("q2"),
            values.number(9, values.require_column("q2")));
  EXPECT_GT(messages["/residuals"][9].at("frame").at("rms_px").get<double>(), 0.0);
  EXPECT_EQ(messages["/log"].back().at("message"), "effects were not looked for");
  static_cast<void>(exported({"--mcap", path("again.mcap")}));
  EXPECT_EQ(read_text_file(path("arm.mcap")), read_text_file(path("again.mcap")));
}

TEST_F(Export, RefusesNonsense) {
  const std::string source = run_folder().string();
  const std::string urdf = (run_folder() / "robot.urdf").string();
  expect_refusal({"export", source}, ExitCode::kBadRequest, "nothing is named");
  expect_refusal({"export", urdf, "--tum", path("t")}, ExitCode::kBadRequest, "no folder of a run");
  expect_refusal({"export", path("none"), "--tum", path("t")}, ExitCode::kBadInput,
                 "no such folder");
  expect_refusal({"export", path("none.urdf"), "--dh", path("t")}, ExitCode::kBadInput,
                 "none.urdf");
  expect_refusal({"export", source, "--dh", path("t"), "--tip", "link33"}, ExitCode::kBadRequest,
                 "link3");
  expect_refusal({"export", source, "--dh", path("t"), "--tip", "base"}, ExitCode::kBadRequest,
                 "no joint moves");
  expect_refusal({"export", source, "--tip", "link3", "--mcap", path("t")}, ExitCode::kBadRequest,
                 "--dh");
  expect_refusal({"export", source, "--dh", path("t"), "--dh-convention", "craig"},
                 ExitCode::kBadRequest, "craig");
  expect_refusal({"export", source, "--tum", path("t"), "--dh", path("t/link1.tum")},
                 ExitCode::kBadRequest, "is named twice");
  expect_refusal({"export", source, "--tum", path("t"), "--dh", path("t")}, ExitCode::kBadRequest,
                 "is named twice");
  expect_refusal({"export", source, "--tum", path("t"), "--dh", path("no/x.csv")},
                 ExitCode::kBadRequest, "there is no folder");
  EXPECT_FALSE(fs::exists(path("t")));
}

TEST_F(Export, RefusesADamagedRun) {
  const std::string copy = copied_run();
  const auto refused = [&](const std::string& values, const std::string& part) {
    folder_.write("copy/joint_values.csv", values);
    expect_refusal({"export", copy, "--tum", path("t")}, ExitCode::kBadInput, part);
  };
  refused("t,q1,q2\n0,1,2\n", "3 joints");
  refused("t,q1,q2,q3\n0,1,2,x\n", "joint_values.csv:2");
  refused("t,q1,q2,q3\n1,1,2,3\n0,1,2,3\n", "t does not increase");
  refused("t,q1,q2,q3\n", "no row");
  folder_.remove("copy/joint_values.csv");
  expect_refusal({"export", copy, "--mcap", path("t")}, ExitCode::kBadInput,
                 "holds no joint_values.csv");
  EXPECT_FALSE(fs::exists(path("t")));
}

}  // namespace
}  // namespace kinescope
