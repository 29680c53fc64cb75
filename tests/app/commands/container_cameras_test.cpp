// SPDX-License-Identifier: Apache-2.0
//
// Several cameras of one bag or dataset, named behind it.
#include "app/io/container_cameras.h"

#include <filesystem>
#include <map>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "calib/camera/camera_file.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/bag_writer.h"
#include "tests/truth/dataset_writer.h"
#include "tests/truth/rig_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Names = std::vector<std::string>;

constexpr std::int64_t kFirstNs = 1'700'000'000'000'000'000;
constexpr double kBefore = 1.0;  // s; stamps of a rig begin below zero

std::int64_t rig_stamp_ns(double time_s) {
  return kFirstNs + static_cast<std::int64_t>(std::llround(1e9 * (time_s + kBefore)));
}

truth::RigOptions rig_before_scara() {
  truth::RigOptions out;
  out.robot.seed = 7001;
  out.robot.kind = truth::RobotKind::kScara;
  out.robot.duration_s = 12.0;
  out.robot.tag_size_m = 0.06;
  out.robot.scale = 1.5;
  out.robot.distance_m = 1.6;
  out.cameras = {{.name = "front", .clock_s = 0.05},
                 {.name = "left", .azimuth_rad = 0.5, .clock_s = -0.3, .rate_hz = 25.0}};
  return out;
}

void write_log(truth::BagWriter& bag, const JointLog& log) {
  for (Eigen::Index row = 0; row < log.values.rows(); ++row) {
    const std::int64_t stamp = rig_stamp_ns(log.times_s[static_cast<std::size_t>(row)]);
    const Eigen::VectorXd values = log.values.row(row);
    bag.write("/joint_states", "sensor_msgs/msg/JointState", stamp,
              truth::joint_state(stamp, log.channels, {values.begin(), values.end()}));
  }
}

void write_detections(truth::BagWriter& bag, const std::string& topic,
                      const Measurements& measurements) {
  std::size_t next = 0;
  for (std::size_t frame = 0; frame < measurements.times_s.size(); ++frame) {
    std::vector<truth::DetectionFields> found;
    for (; next < measurements.corners.size() &&
           measurements.corners[next].frame == static_cast<int>(frame);
         ++next) {
      const TagObservation& tag = measurements.corners[next];
      truth::DetectionFields fields{"36h11", tag.id.value, {}};
      for (std::size_t corner = 0; corner < 4; ++corner)  // from the edge of the first pixel
        fields.corners[corner] = {tag.corners_px[corner].x() + 0.5,
                                  tag.corners_px[corner].y() + 0.5};
      found.push_back(fields);
    }
    const std::int64_t stamp = rig_stamp_ns(measurements.times_s[frame]);
    bag.write(topic, "apriltag_msgs/msg/AprilTagDetectionArray", stamp,
              truth::tag_detections(stamp, found));
  }
}

// What a run says of each camera: sightings used, and the error at unseen postures.
struct CameraSaid {
  int used = 0;
  double held_out_px = 0.0;
};

std::map<std::string, CameraSaid> cameras_of(const fs::path& run_folder) {
  const json result = json::parse(read_text_file(run_folder / "result.json"));
  std::map<std::string, CameraSaid> out;
  for (const json& camera : result.at("calibration").at("cameras"))
    out[camera.at("name").get<std::string>()] = {camera.at("sightings_used").get<int>(),
                                                 camera.at("held_out_px").get<double>()};
  return out;
}

TEST(ContainerCameras, OfABagAreThoseOfAFolder) {
  const RecordingFolder folder;
  const truth::RigOptions options = rig_before_scara();
  const std::vector<truth::World> worlds = truth::make_rig_worlds(options);
  truth::write_rig(worlds, options, folder.path() / "files");
  const fs::path path = folder.path() / "rig.mcap";
  truth::BagWriter bag(path);
  write_log(bag, worlds.front().log);
  write_detections(bag, "/rig/front/detections", worlds[0].measurements);
  write_detections(bag, "/rig/left/detections", worlds[1].measurements);
  bag.finish();
  for (const char* name : {"tags.yaml", "camera_front.yaml", "camera_left.yaml"})
    fs::copy(folder.path() / "files" / name, folder.path() / name);

  expect_refusal({"run", path.string()}, ExitCode::kBadInput,
                 "rig.mcap:/rig/front/detections,/rig/left/detections");
  const std::string both = path.string() + ":/rig/left/detections,/rig/front/detections";
  const Outcome from_bag = run(
      {"run", both, "--no-trace", "--quiet", "--output", (folder.path() / "from_bag").string()});
  ASSERT_EQ(from_bag.code, 0) << from_bag.err;
  const Outcome from_files = run({"run", (folder.path() / "files").string(), "--no-trace",
                                  "--quiet", "--output", (folder.path() / "from_files").string()});
  ASSERT_EQ(from_files.code, 0) << from_files.err;
  const auto said = cameras_of(folder.path() / "from_bag");
  const auto expected = cameras_of(folder.path() / "from_files");
  ASSERT_EQ(said.size(), 2U);
  for (const auto& [name, camera] : expected) {
    ASSERT_TRUE(said.contains(name)) << name;
    EXPECT_NEAR(said.at(name).used, camera.used, 3) << name;  // corners have five digits in files
    EXPECT_NEAR(said.at(name).held_out_px, camera.held_out_px, 1e-3) << name;
  }
  // What run.json keeps of the recording is enough to run it again.
  EXPECT_EQ(run({"trace", (folder.path() / "from_bag").string(), "--quiet"}).code, 0);
  const Outcome inspected = run({"inspect", both});
  EXPECT_EQ(inspected.code, 0) << inspected.err << inspected.out;
}

TEST(ContainerCameras, OfImagesHaveTheIntrinsicsOfTheirNamespace) {
  const RecordingFolder folder;
  folder.write("bag/tags.yaml", "default_size: 0.05\n");
  const fs::path path = folder.path() / "bag/rig.mcap";
  truth::BagWriter bag(path);
  bag.write("/joint_states", "sensor_msgs/msg/JointState", kFirstNs,
            truth::joint_state(kFirstNs, {"a", "b"}, {0.1, 0.2}));
  for (const auto& [name, focal] : {std::pair("left", 500.0), std::pair("right", 700.0)}) {
    truth::CameraInfoFields camera;
    camera.width = 640;
    camera.height = 480;
    camera.fx = camera.fy = focal;
    camera.cx = 320.0;
    camera.cy = 240.0;
    bag.write(std::string("/") + name + "/camera_info", "sensor_msgs/msg/CameraInfo", kFirstNs,
              truth::camera_info(kFirstNs, camera));
    bag.write(std::string("/") + name + "/image_raw", "sensor_msgs/msg/Image", kFirstNs,
              truth::image(kFirstNs, 2, 1, "mono8", 2, "ab"));
  }
  bag.finish();
  RecordingPaths paths;
  paths.folder = path.string() + ":/right/image_raw,/left/image_raw";
  const Recording recording = read_recording(paths);
  ASSERT_EQ(recording.cameras.size(), 2U);
  EXPECT_EQ(recording.name, "rig");
  EXPECT_EQ(recording.entry, RecordingEntry::kVideo);
  EXPECT_EQ(recording.cameras[0].name, "left");
  EXPECT_EQ(recording.cameras[1].name, "right");
  EXPECT_EQ(value_of(recording.cameras[0].camera).fx, 500.0);
  EXPECT_EQ(value_of(recording.cameras[1].camera).fx, 700.0);
  EXPECT_EQ(recording.log.channels, (Names{"a", "b"}));
  EXPECT_TRUE(recording.warnings.empty()) << recording.warnings.front();
  // A file beside the bag comes before what the bag says.
  folder.write(
      "bag/camera_left.yaml",
      write_camera_info(
          {.width = 640, .height = 480, .fx = 600.0, .fy = 600.0, .cx = 320.0, .cy = 240.0}));
  EXPECT_EQ(value_of(read_recording(paths).cameras[0].camera).fx, 600.0);

  expect_refusal({"run", path.string() + ":/left/image_raw,/left/image_raw"}, ExitCode::kBadInput,
                 "is named twice");
  expect_refusal({"run", path.string() + ":/left/image_raw,/middle/image_raw"}, ExitCode::kBadInput,
                 "no images there");
  for (const char* names : {":/left/image_raw,", ":,/left/image_raw", ":/left/image_raw,,/b", ":,"})
    expect_refusal({"run", path.string() + names}, ExitCode::kBadInput,
                   "names a camera without a name");
  expect_refusal({"run", paths.folder.string(), "--camera", "x.yaml"}, ExitCode::kBadRequest,
                 "several cameras");
  expect_refusal({"run", paths.folder.string(), "--video", path.string()}, ExitCode::kBadRequest,
                 "names cameras already");
}

TEST(ContainerCameras, OfADatasetAreItsKeys) {
  const RecordingFolder folder;
  truth::DatasetFields fields;
  fields.joints = {"a.pos", "b.pos"};
  fields.cameras = {"observation.images.side", "observation.images.top"};
  for (int e = 0; e < 2; ++e) {
    truth::DatasetEpisode episode;
    for (int frame = 0; frame < 30; ++frame) {
      episode.state.push_back({0.1F * static_cast<float>(frame), 1.0F});
      episode.action = episode.state;
    }
    fields.episodes.push_back(std::move(episode));
  }
  const fs::path path = folder.path() / "arm";
  truth::write_dataset(path, fields);
  folder.write("tags.yaml", "default_size: 0.05\n");
  expect_refusal({"run", path.string()}, ExitCode::kBadInput,
                 "arm:observation.images.side,observation.images.top");
  for (const char* names :
       {":observation.images.top,", ":,observation.images.top:1", ":observation.images.top,:0-1"})
    expect_refusal({"run", path.string() + names}, ExitCode::kBadInput,
                   "names a camera without a name");
  RecordingPaths paths;
  paths.folder = path.string() + ":observation.images.top,observation.images.side:1";
  for (const std::string& camera : fields.cameras) {
    const fs::path video = truth::video_of_dataset(path, fields, camera, 1);
    fs::create_directories(video.parent_path());
    write_file_atomically(video, "not looked into");
  }
  const Recording recording = read_recording(paths);
  ASSERT_EQ(recording.cameras.size(), 2U);
  EXPECT_EQ(recording.cameras[0].name, "side");
  EXPECT_EQ(recording.cameras[1].name, "top");
  EXPECT_EQ(recording.cameras[1].video, path.string() + ":observation.images.top:1");
  EXPECT_EQ(recording.log.size(), 30U) << "of one episode";
}

TEST(ContainerCameras, NamesAreWhatTellsTopicsApart) {
  EXPECT_EQ(names_of_parts({"/left/image_raw", "/right/image_raw"}), (Names{"left", "right"}));
  EXPECT_EQ(names_of_parts({"/rig/cam0/image/compressed", "/rig/cam1/image/compressed"}),
            (Names{"cam0", "cam1"}));
  EXPECT_EQ(names_of_parts({"/front", "/rear/image"}), (Names{"front", "rear_image"}));
  EXPECT_EQ(names_of_parts({"observation.images.a b", "observation.images.c"}),
            (Names{"a_b", "c"}));
  EXPECT_EQ(names_of_parts({"/image", "/image/compressed"}), (Names{"camera1", "camera2"}));
  EXPECT_EQ(names_of_parts({"/a_b/image", "/a/b/image"}), (Names{"camera1", "camera2"}));
}

}  // namespace
}  // namespace kinescope
