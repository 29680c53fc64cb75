// SPDX-License-Identifier: Apache-2.0
//
// A bag in place of a recording's folder or a log: it says what the files say that it was made of.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "app/io/products.h"
#include "calib/camera/camera_file.h"
#include "calib/vision/video.h"
#include "dynamics/data/torque_data.h"
#include "kinematics/log/channel_table.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/bag_writer.h"
#include "tests/truth/camera_world.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using Document = nlohmann::json;

constexpr std::int64_t kStartNs = 1'700'000'000'000'000'000;
constexpr std::int64_t kTravelNs = 2'000'000;  // from a stamp to the recorder
const std::string kJointStates = "sensor_msgs/msg/JointState";

std::int64_t stamp_ns(double time_s) {
  return kStartNs + static_cast<std::int64_t>(std::llround(1e9 * time_s));
}

truth::CameraInfoFields fields_of(const CameraModel& camera) {
  truth::CameraInfoFields out;
  out.width = camera.width;
  out.height = camera.height;
  out.fx = camera.fx;
  out.fy = camera.fy;
  out.cx = camera.cx;
  out.cy = camera.cy;
  out.d.assign(camera.distortion.begin(), camera.distortion.begin() + 5);
  return out;
}

void write_joints(truth::BagWriter& bag, const JointLog& log) {
  for (Eigen::Index row = 0; row < log.values.rows(); ++row) {
    const std::int64_t stamp = stamp_ns(log.times_s[static_cast<std::size_t>(row)]);
    const Eigen::VectorXd values = log.values.row(row);
    bag.write("/joint_states", kJointStates, stamp + kTravelNs,
              truth::joint_state(stamp, log.channels, {values.begin(), values.end()}));
  }
}

Document calibration_of(const fs::path& run) {
  return Document::parse(read_text_file(run / "calibration.json"));
}

/// What a run on the same numbers says again. Stamps of a bag count from its first message.
void expect_same_robot(const fs::path& one, const fs::path& other) {
  const Document a = calibration_of(one);
  const Document b = calibration_of(other);
  EXPECT_NEAR(a.at("held_out_rms").get<double>(), b.at("held_out_rms").get<double>(),
              1e-4 * b.at("held_out_rms").get<double>());
  const KinematicTree learned = read_urdf(one / "robot.urdf");
  const KinematicTree expected = read_urdf(other / "robot.urdf");
  ASSERT_EQ(learned.joints.size(), expected.joints.size());
  for (std::size_t j = 0; j < learned.joints.size(); ++j) {
    EXPECT_EQ(learned.joints[j].type, expected.joints[j].type);
    EXPECT_LT((learned.joints[j].T_parent_joint.translation -
               expected.joints[j].T_parent_joint.translation)
                  .norm(),
              1e-4);
  }
}

TEST(BagRecording, OfDetectionsIsARecordingOfCorners) {
  const truth::World world = truth::make_world({.frames = 300, .link_length_m = 0.2});
  TagObservations seen;
  seen.times_s = world.measurements.times_s;
  seen.width = world.camera.width;
  seen.height = world.camera.height;
  seen.observations = world.measurements.corners;
  const RecordingFolder folder;
  const std::string tags = "default_size: 0.05\n";
  folder.write("files/corners.csv", observations_csv(seen))
      .write("files/camera.yaml", write_camera_info(world.camera))
      .write("files/tags.yaml", tags)
      .write("camera.yaml", write_camera_info(world.camera))  // the bag's is of rectified images
      .write("tags.yaml", tags);
  std::string joints = "t," + fmt::format("{}", fmt::join(world.log.channels, ",")) + "\n";
  for (Eigen::Index row = 0; row < world.log.values.rows(); ++row) {
    const Eigen::VectorXd values = world.log.values.row(row);
    joints += fmt::format("{},{}\n", world.log.times_s[static_cast<std::size_t>(row)],
                          fmt::join(values.begin(), values.end(), ","));
  }
  folder.write("files/joints.csv", joints);

  const fs::path path = folder.path() / "robot.mcap";
  truth::BagWriter bag(path);
  write_joints(bag, world.log);
  bag.write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", stamp_ns(0.0),
            truth::camera_info(stamp_ns(0.0), fields_of(world.camera)));
  std::size_t next = 0;
  for (std::size_t frame = 0; frame < seen.times_s.size(); ++frame) {
    std::vector<truth::DetectionFields> found;
    for (; next < seen.observations.size() &&
           seen.observations[next].frame == static_cast<int>(frame);
         ++next) {
      const TagObservation& tag = seen.observations[next];
      truth::DetectionFields fields{"36h11", tag.id.value, {}};
      for (std::size_t corner = 0; corner < 4; ++corner) {  // from the edge of the first pixel
        fields.corners[corner] = {tag.corners_px[corner].x() + 0.5,
                                  tag.corners_px[corner].y() + 0.5};
      }
      found.push_back(fields);
    }
    const std::int64_t stamp = stamp_ns(seen.times_s[frame]);
    bag.write("/detections", "apriltag_msgs/msg/AprilTagDetectionArray", stamp + kTravelNs,
              truth::tag_detections(stamp, found));
  }
  bag.finish();

  const std::string from_bag = (folder.path() / "from_bag").string();
  const std::string from_files = (folder.path() / "from_files").string();
  ASSERT_EQ(run({"run", path.string(), "--output", from_bag, "--quiet"}).code, 0);
  ASSERT_EQ(
      run({"run", (folder.path() / "files").string(), "--output", from_files, "--quiet"}).code, 0);
  expect_same_robot(from_bag, from_files);
  EXPECT_EQ(Document::parse(read_text_file(folder.path() / "from_bag/run.json")).at("recording"),
            "robot");

  const Outcome inspected = run({"inspect", path.string()});
  EXPECT_EQ(inspected.code, 0) << inspected.err;
  EXPECT_NE(inspected.out.find("recorded 2.0 ms after its stamp"), std::string::npos)
      << inspected.out;
  EXPECT_NE(inspected.out.find("verdict   ready to run"), std::string::npos) << inspected.out;
}

TEST(BagRecording, OfImagesIsARecordingOfAVideo) {
  const fs::path sample = fs::path(KINESCOPE_SOURCE_DIR) / "sample_videos/scara4_none";
  const RecordingFolder folder;
  fs::create_directories(folder.path() / "robot");
  fs::copy(sample / "tags.yaml", folder.path() / "robot/tags.yaml");
  truth::BagWriter bag(folder.path() / "robot/recording.mcap");
  write_joints(bag, read_joint_log(sample / "joints.csv"));
  bag.write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", stamp_ns(0.0),
            truth::camera_info(stamp_ns(0.0), fields_of(read_camera(sample / "camera.yaml"))));
  const auto video = open_video(sample / "video.mp4");
  while (const auto frame = video->next()) {
    const ImageView view = frame->image.view();
    const std::int64_t stamp = stamp_ns(frame->time_s);
    const std::string_view pixels(reinterpret_cast<const char*>(view.data),  // NOLINT
                                  frame->image.pixels.size());
    bag.write("/camera/image_raw", "sensor_msgs/msg/Image", stamp + kTravelNs,
              truth::image(stamp, view.width, view.height, "mono8",
                           static_cast<std::uint32_t>(view.stride), pixels));
  }
  bag.finish();
  const std::string from_bag = (folder.path() / "from_bag").string();
  const std::string from_files = (folder.path() / "from_files").string();
  const Outcome first = run(
      {"run", (folder.path() / "robot").string(), "--output", from_bag, "--quiet", "--no-trace"});
  ASSERT_EQ(first.code, 0) << first.err;
  ASSERT_EQ(run({"run", sample.string(), "--output", from_files, "--quiet", "--no-trace"}).code, 0);
  expect_same_robot(from_bag, from_files);

  // What was found in the images is kept, and found again.
  EXPECT_TRUE(fs::exists(fs::path(from_bag) / "observations.csv"));
  const Document before = calibration_of(from_bag);
  ASSERT_EQ(run({"run", (folder.path() / "robot").string(), "--output", from_bag, "--quiet",
                 "--no-trace"})
                .code,
            0);
  EXPECT_EQ(calibration_of(from_bag), before);

  // Log and images are read from one file: what is wrong with it is said once.
  const fs::path file = folder.path() / "robot/recording.mcap";
  fs::resize_file(file, fs::file_size(file) * 3 / 4);
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"inspect", (folder.path() / "robot").string(), "--quiet"},
        {"run", (folder.path() / "robot").string(), "--output", from_bag + "_cut", "--quiet",
         "--no-trace"}}) {
    const Outcome cut = run(command);
    const std::string said = cut.out + cut.err;
    const std::size_t first_at = said.find("the file ends early, inside of");
    ASSERT_NE(first_at, std::string::npos) << said;
    EXPECT_EQ(said.find("the file ends early, inside of", first_at + 1), std::string::npos) << said;
  }
}

// Images that are named, or a film beside the bag, take nothing of what else the bag holds.
TEST(BagRecording, BesideANamedVideoHasTheLogAndTheCamera) {
  const fs::path sample = fs::path(KINESCOPE_SOURCE_DIR) / "sample_videos/scara4_none";
  const RecordingFolder folder;
  folder.write("tags.yaml", read_text_file(sample / "tags.yaml"));
  const fs::path path = folder.path() / "recording.mcap";
  truth::BagWriter bag(path);
  write_joints(bag, read_joint_log(sample / "joints.csv"));
  bag.write("/camera/camera_info", "sensor_msgs/msg/CameraInfo", stamp_ns(0.0),
            truth::camera_info(stamp_ns(0.0), fields_of(read_camera(sample / "camera.yaml"))));
  bag.write("/tool", "geometry_msgs/msg/PoseStamped", stamp_ns(0.0), std::string(64, '\0'));
  bag.write("/camera/image_raw", "sensor_msgs/msg/Image", stamp_ns(0.0) + kTravelNs,
            truth::image(stamp_ns(0.0), 2, 1, "mono8", 2, "ab"));
  bag.finish();

  RecordingPaths paths = folder.paths();
  for (const std::string& topic : {std::string(), std::string(":/camera/image_raw")}) {
    paths.video = path.string() + topic;
    const Recording named = read_recording(paths);
    EXPECT_EQ(named.log.channels.size(), 4U) << topic;
    EXPECT_TRUE(named.camera) << topic;
    EXPECT_TRUE(named.warnings.empty()) << topic;
  }
  paths.video.reset();
  folder.write("video.mp4", "x");
  const Recording beside = read_recording(paths);
  EXPECT_EQ(beside.video.filename(), "video.mp4");
  EXPECT_EQ(beside.log.channels.size(), 4U);
  EXPECT_TRUE(beside.camera);
  EXPECT_NE(std::ranges::find(beside.files, path), beside.files.end()) << "`inspect` lists it";
  folder.write("joints.csv", read_text_file(sample / "joints.csv"));
  folder.write("camera.yaml", read_text_file(sample / "camera.yaml"));
  const Recording replaced = read_recording(paths);
  EXPECT_EQ(replaced.log.source, (folder.path() / "joints.csv").string());
  ASSERT_EQ(replaced.warnings.size(), 1U);
  EXPECT_NE(replaced.warnings[0].find("recording.mcap is not used"), std::string::npos);
}

TEST(BagRecording, PosesWithoutJointsAreAskedFor) {
  const RecordingFolder folder;
  folder.write("tags.yaml", "default_size: 0.05\n");
  truth::BagWriter bag(folder.path() / "recording.mcap");
  bag.write("/tcp_pose", "geometry_msgs/msg/PoseStamped", stamp_ns(0.0), std::string(64, '\0'));
  bag.write("/camera/image_raw", "sensor_msgs/msg/Image", stamp_ns(0.0) + kTravelNs,
            truth::image(stamp_ns(0.0), 2, 1, "mono8", 2, "ab"));
  bag.finish();
  const std::vector<std::string> warnings = read_recording(folder.paths()).warnings;
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("/tcp_pose is not read"), std::string::npos) << warnings[0];
}

TEST(BagRecording, OfTorquesIsATorqueLog) {
  Rng rng = Rng::from_name("torques in a bag");
  const RandomRobot robot = random_robot({.joints = 2, .prismatic_share = 0.0}, rng);
  const DynamicModel model = random_masses(robot.tree, {.every_direction = false}, rng);
  TorqueSamples samples = torque_log_of(model, {.samples = 1500, .trajectories = 1}, rng);
  samples.ddq.resize(0, 0);
  const RecordingFolder folder;
  folder.write("log.csv", torque_log_csv(samples)).write("robot.urdf", write_urdf(model));
  truth::BagWriter bag(folder.path() / "log.mcap");
  std::vector<std::string> names;
  for (const WantedJoint& joint : wanted_joints(model.tree)) names.push_back(joint.name);
  const auto row_of = [](const Eigen::MatrixXd& values, Eigen::Index row) {
    const Eigen::VectorXd out = values.row(row);
    return std::vector<double>(out.begin(), out.end());
  };
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    const std::int64_t stamp = stamp_ns(samples.t_s[row]);
    bag.write("/joint_states", kJointStates, stamp + kTravelNs,
              truth::joint_state(stamp, names, row_of(samples.q, row), row_of(samples.dq, row),
                                 row_of(samples.torque, row)));
  }
  bag.finish();
  const auto score = [&](const std::string& log, const std::string& output) {
    const Outcome outcome =
        run({"dynamics", (folder.path() / log).string(), "--robot",
             (folder.path() / "robot.urdf").string(), "--model", "parametric", "--no-trace",
             "--output", (folder.path() / output).string(), "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Document::parse(read_text_file(folder.path() / output / "dynamics.json"))
        .at("models")[0]
        .at("nmse_percent")
        .get<std::vector<double>>();
  };
  const std::vector<double> from_bag = score("log.mcap", "from_bag");
  const std::vector<double> from_table = score("log.csv", "from_table");
  ASSERT_EQ(from_bag.size(), from_table.size());
  for (std::size_t j = 0; j < from_bag.size(); ++j)
    EXPECT_NEAR(from_bag[j], from_table[j], 1e-3 * from_table[j]);

  const Outcome inspected = run({"inspect", (folder.path() / "log.mcap").string(), "--json"});
  EXPECT_EQ(inspected.code, 0) << inspected.err;
  EXPECT_EQ(Document::parse(inspected.out).at("topics")[0].at("messages"), 1500);
  expect_refusal({"run", (folder.path() / "log.mcap").string()}, ExitCode::kBadInput,
                 "log.mcap: no images: it holds /joint_states (sensor_msgs/JointState, 1500");
}

TEST(BagRecording, WhatCannotBeReadIsNamedWithItsTopics) {
  const RecordingFolder folder;
  const std::string path = (folder.path() / "chat.mcap").string();
  truth::BagWriter bag(path);
  truth::CdrWriter hello;
  bag.write("/chatter", "std_msgs/msg/String", kStartNs, hello.string("hello").data());
  bag.finish();
  expect_refusal({"run", path}, ExitCode::kBadInput,
                 "no images: it holds /chatter (std_msgs/String, 1 message)");
  const Outcome inspected = run({"inspect", path});
  EXPECT_EQ(inspected.code, 3);
  EXPECT_NE(inspected.err.find("holds neither joint states nor images"), std::string::npos);
  expect_refusal({"run", (folder.path() / "none.mcap").string()}, ExitCode::kBadInput,
                 "no such file");
}

TEST(BagRecording, IsNotWrittenOver) {
  const RecordingFolder folder;
  const std::string path = (folder.path() / "motion.mcap").string();
  truth::BagWriter bag(path);
  bag.write("/joint_states", kJointStates, kStartNs,
            truth::joint_state(kStartNs, {"joint1"}, {0.0}));
  bag.finish();
  const std::string before = read_text_file(path);
  folder.write("robot.urdf", "<robot name='r'><link name='base'/></robot>");
  expect_refusal({"simulate", (folder.path() / "robot.urdf").string(), "--trajectory",
                  path + ":/joint_states", "-o", path, "--force"},
                 ExitCode::kBadRequest, "is an input, and would be written over");
  EXPECT_EQ(read_text_file(path), before);
}

}  // namespace
}  // namespace kinescope
