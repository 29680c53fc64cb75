// SPDX-License-Identifier: Apache-2.0
//
// A LeRobot dataset in place of a recording's folder or a log: it says what the files say that it
// was made of.
#include <numbers>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "calib/vision/video.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/core/file.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/dataset_writer.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using DatasetDocument = nlohmann::json;

const std::string kTopCamera = "observation.images.top";

fs::path sample_of_datasets() {
  return fs::path(KINESCOPE_SOURCE_DIR) / "sample_videos/scara4_none";
}

std::vector<float> in_degrees(const Eigen::VectorXd& row) {
  std::vector<float> out;
  for (const double value : row)
    out.push_back(static_cast<float>(value * 180.0 / std::numbers::pi));
  return out;
}

/// The sample as LeRobot logs it: a row a frame, in degrees, commands a tenth of a second ahead.
/// The frames of all episodes together are the video's.
truth::DatasetFields fields_of_sample(const std::string& version, int episodes) {
  const JointLog log = read_joint_log(sample_of_datasets() / "joints.csv");
  truth::DatasetFields fields;
  fields.version = version;
  fields.cameras = {kTopCamera};
  fields.width = 1280;
  fields.height = 720;
  for (const std::string& channel : log.channels) fields.joints.push_back(channel + ".pos");
  constexpr int kFrames = 324;  // of 330: the commands end with the log
  for (int e = 0; e < episodes; ++e) {
    truth::DatasetEpisode episode;
    for (int frame = e * kFrames / episodes; frame < (e + 1) * kFrames / episodes; ++frame) {
      const double t = frame / 30.0;
      episode.state.push_back(in_degrees(resample(log, {t}).row(0)));
      episode.action.push_back(in_degrees(resample(log, {t + 0.1}).row(0)));
    }
    fields.episodes.push_back(std::move(episode));
  }
  return fields;
}

/// A dataset with the files that a recording needs in it.
fs::path sample_dataset(const RecordingFolder& folder, const truth::DatasetFields& fields) {
  const fs::path path = folder.path() / "scara";
  truth::write_dataset(path, fields);
  const fs::path video = truth::video_of_dataset(path, fields, kTopCamera, 0);
  fs::create_directories(video.parent_path());
  fs::copy(sample_of_datasets() / "video.mp4", video);
  for (const char* name : {"tags.yaml", "camera.yaml"})
    fs::copy(sample_of_datasets() / name, path / name);
  return path;
}

/// Joints of the same kinds at the same places; the two logs are not of the same rows.
void expect_the_samples_robot(const fs::path& run) {
  const KinematicTree learned = read_urdf(run / "robot.urdf");
  const KinematicTree truth = read_urdf(sample_of_datasets() / "truth.urdf");
  std::vector<JointType> kinds, expected;
  for (const Joint& joint : learned.joints)
    if (joint.type != JointType::kFixed) kinds.push_back(joint.type);
  for (const Joint& joint : truth.joints)
    if (joint.type != JointType::kFixed) expected.push_back(joint.type);
  EXPECT_EQ(kinds, expected);
  const auto calibration = DatasetDocument::parse(read_text_file(run / "calibration.json"));
  EXPECT_LT(calibration.at("held_out_rms").get<double>(), 0.08) << "px, of the sample's own 0.04";
}

TEST(DatasetRecording, OfOneEpisodeIsARecording) {
  const RecordingFolder folder;
  const fs::path path = sample_dataset(folder, fields_of_sample("v2.1", 1));
  const std::string run_folder = (folder.path() / "run").string();
  const Outcome outcome = run({"run", path.string(), "--output", run_folder, "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  expect_the_samples_robot(run_folder);
  EXPECT_NE(outcome.out.find("(a command beside its measured value, say): the latter are used"),
            std::string::npos)
      << outcome.out;
  EXPECT_NE(outcome.out.find("ch0_command is 100.0"), std::string::npos) << outcome.out;  // ms
  EXPECT_EQ(
      DatasetDocument::parse(read_text_file(fs::path(run_folder) / "run.json")).at("recording"),
      "scara");
}

TEST(DatasetRecording, OfSeveralEpisodesJoinsThem) {
  const RecordingFolder folder;
  const fs::path path = sample_dataset(folder, fields_of_sample("v3.0", 3));
  const Outcome inspected = run({"inspect", path.string()});
  EXPECT_EQ(inspected.code, 0) << inspected.err;
  for (const char* part :
       {"dataset   LeRobot v3.0, robot so101_follower, 324 frames, 30 frames/s",
        "episodes  0 to 2, of 3.6 to 3.6 s; all used, joined",
        "camera    observation.images.top: 720 x 1280 x 3 video",
        "324 frames from 0.000 to 12.767 s", "3 episodes with 324 frames are joined, 1 s apart",
        "channels 'ch0', 'ch1', 'ch2', 'ch3', 'ch0_command'", "verdict   ready to run"}) {
    EXPECT_NE(inspected.out.find(part), std::string::npos) << part << "\n" << inspected.out;
  }
  // That the episodes lie apart is no fault of a clock or a camera.
  for (const char* part : {"clock jumps", "the log has a gap", "frames are missing"})
    EXPECT_EQ(inspected.out.find(part), std::string::npos) << part << "\n" << inspected.out;
  const std::string run_folder = (folder.path() / "run").string();
  const Outcome outcome =
      run({"run", path.string(), "--output", run_folder, "--quiet", "--no-trace"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  expect_the_samples_robot(run_folder);
}

TEST(DatasetRecording, ShowsTheFramesOfItsEpisodes) {
  const RecordingFolder folder;
  const fs::path path = sample_dataset(folder, fields_of_sample("v3.0", 3));
  const auto whole = open_video(sample_of_datasets() / "video.mp4");
  std::vector<GreyImage> images;
  while (auto frame = whole->next()) images.push_back(std::move(frame->image));
  const auto expect_frames = [&](const std::string& choice, std::vector<std::size_t> episodes) {
    SCOPED_TRACE(choice);
    const auto video = open_video(path.string() + choice);
    EXPECT_EQ(video->info().frame_count, static_cast<int>(108 * episodes.size()));
    for (std::size_t e = 0; e < episodes.size(); ++e) {
      for (std::size_t k = 0; k < 108; ++k) {
        const auto frame = video->next();
        ASSERT_TRUE(frame);
        EXPECT_EQ(frame->index, static_cast<int>(108 * e + k));
        const double start_s = static_cast<double>(e) * (108.0 / 30.0 + 1.0);
        EXPECT_NEAR(frame->time_s, start_s + static_cast<double>(k) / 30.0, 1e-9);
        ASSERT_EQ(frame->image.pixels, images[108 * episodes[e] + k].pixels) << k;
      }
    }
    EXPECT_FALSE(video->next());
    EXPECT_TRUE(video->warnings().empty()) << video->warnings().front();
  };
  expect_frames("", {0, 1, 2});
  expect_frames(":2", {2});
  expect_frames(":" + kTopCamera + ":1-2", {1, 2});
}

TEST(DatasetRecording, WhatIsMissingIsNamed) {
  const RecordingFolder folder;
  truth::DatasetFields fields = fields_of_sample("v2.1", 2);
  const fs::path path = sample_dataset(folder, fields);
  expect_refusal({"run", path.string()}, ExitCode::kBadInput,
                 "episode_000001.mp4: no such video (copy the dataset again with its videos, or "
                 "name other episodes)");
  expect_refusal({"run", path.string() + ":5"}, ExitCode::kBadInput,
                 ":5: holds no frame: episodes are 0 to 1");
  expect_refusal({"run", path.string() + ":observation.images.front"}, ExitCode::kBadInput,
                 "no such camera (the dataset has observation.images.top)");
  // Files may stand beside the dataset.
  fs::rename(path / "tags.yaml", folder.path() / "tags.yaml");
  const Outcome inspected = run({"inspect", path.string() + ":0"});
  EXPECT_EQ(inspected.code, 0) << inspected.out;
  EXPECT_NE(inspected.out.find("tags.yaml"), std::string::npos);
  fs::remove(folder.path() / "tags.yaml");
  expect_refusal({"run", path.string() + ":0"}, ExitCode::kBadInput,
                 "scara/tags.yaml: no such file (write one with family");
  folder.write("tags.yaml", "default_size: 0.06\n");
  // A recording's folder may hold a dataset.
  folder.remove("poses.csv");
  expect_refusal({"run", folder.path().string()}, ExitCode::kBadInput,
                 "episode_000001.mp4: no such video");
  // A video that is cut off shows fewer frames, which is said.
  const fs::path video = truth::video_of_dataset(path, fields, kTopCamera, 0);
  write_file_atomically(video, "no video");
  expect_refusal({"run", path.string() + ":0"}, ExitCode::kBadInput,
                 "episode_000000.mp4: not a video");
}

TEST(DatasetRecording, OfTorquesIsATorqueLog) {
  Rng rng = Rng::from_name("torques in a dataset");
  const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
  const DynamicModel model = random_masses(robot.tree, {.every_direction = false}, rng);
  TorqueSamples samples = torque_log_of(model, {.samples = 1500, .trajectories = 1}, rng);
  samples.ddq.resize(0, 0);
  samples.dq.resize(0, 0);
  const RecordingFolder folder;
  folder.write("robot.urdf", write_urdf(model));
  truth::DatasetFields fields;
  for (const WantedJoint& joint : wanted_joints(model.tree))
    fields.joints.push_back(joint.name + ".pos");
  fields.frame_rate_hz = static_cast<int>(std::lround(1.0 / (samples.t_s[1] - samples.t_s[0])));
  fields.episodes.emplace_back();
  truth::DatasetEpisode& episode = fields.episodes.front();
  const auto row_of = [](const Eigen::MatrixXd& values, Eigen::Index row) {
    const Eigen::VectorXf out = values.row(row).cast<float>();
    return std::vector<float>(out.begin(), out.end());
  };
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    episode.state.push_back(row_of(samples.q, row));
    episode.action.push_back(row_of(samples.q, std::min(row + 2, samples.size() - 1)));
    episode.effort.push_back(row_of(samples.torque, row));
  }
  truth::write_dataset(folder.path() / "arm", fields);
  // Numbers of 32 bits, as the dataset has them.
  const auto rounded = [](Eigen::MatrixXd& values) {
    values = values.cast<float>().cast<double>().eval();
  };
  rounded(samples.q);
  rounded(samples.torque);
  folder.write("log.csv", torque_log_csv(samples));
  const auto score = [&](const std::string& log, const std::string& output) {
    const Outcome outcome =
        run({"dynamics", (folder.path() / log).string(), "--robot",
             (folder.path() / "robot.urdf").string(), "--model", "parametric", "--no-trace",
             "--output", (folder.path() / output).string(), "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return DatasetDocument::parse(read_text_file(folder.path() / output / "dynamics.json"))
        .at("models")[0]
        .at("nmse_percent")
        .get<std::vector<double>>();
  };
  const std::vector<double> from_dataset = score("arm", "from_dataset");
  const std::vector<double> from_table = score("log.csv", "from_table");
  ASSERT_EQ(from_dataset.size(), from_table.size());
  for (std::size_t j = 0; j < from_dataset.size(); ++j)
    EXPECT_NEAR(from_dataset[j], from_table[j], 1e-2 * from_table[j]);
  const Outcome inspected = run({"inspect", (folder.path() / "arm").string(), "--json"});
  EXPECT_EQ(inspected.code, 0) << inspected.err;
  EXPECT_EQ(DatasetDocument::parse(inspected.out).at("dataset").at("frames"), 1500);
  expect_refusal({"run", (folder.path() / "arm").string()}, ExitCode::kBadInput,
                 "arm: holds no video: its features are action, ");
}

}  // namespace
}  // namespace kinescope
