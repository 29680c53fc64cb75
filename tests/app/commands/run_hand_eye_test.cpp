// SPDX-License-Identifier: Apache-2.0
//
// A folder with flange.csv in place of joints.csv, through `run` and `inspect`.
#include <functional>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/truth/hand_eye_world.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kCameraFile =
    "image_width: 2560\nimage_height: 1920\ncamera_name: camera\n"
    "camera_matrix: {rows: 3, cols: 3, data: [1000, 0, 1279.5, 0, 1000, 959.5, 0, 0, 1]}\n"
    "distortion_model: plumb_bob\n"
    "distortion_coefficients: {rows: 1, cols: 5, data: [-0.05, 0, 0, 0, 0]}\n";

void put(const fs::path& folder, const char* name, const std::string& text) {
  write_file_atomically(folder / name, text);
}

using RowWriter = std::function<std::string(double, const Pose&)>;

std::string in_metres(double t, const Pose& T) {
  const auto q = T.rotation.coeffs();
  const auto p = T.translation;
  return fmt::format("{},{},{},{},{},{},{},{}\n", t, p.x(), p.y(), p.z(), q[0], q[1], q[2], q[3]);
}

void write_flange(const fs::path& folder, const truth::HandEyeWorld& world,
                  const std::string& header, const RowWriter& row) {
  const PoseLog& log = world.input.readings.front().log;
  std::string text = header + "\n";
  for (std::size_t i = 0; i < log.poses.size(); ++i) text += row(log.times_s[i], log.poses[i]);
  put(folder, "flange.csv", text);
}

fs::path recording_of(const truth::HandEyeWorld& world, const std::string& name) {
  const fs::path folder = truth::temporary_path(name);
  fs::remove_all(folder);
  fs::create_directories(folder);
  put(folder, "camera.yaml", kCameraFile);
  put(folder, "tags.yaml", "family: tag36h11\ndefault_size: 0.1\n");
  std::string corners = "t,tag,corner,u,v\n";
  for (const TagObservation& seen : world.input.measurements.corners)
    for (std::size_t c = 0; c < seen.corners_px.size(); ++c)
      corners += fmt::format("{},{},{},{},{}\n", seen.frame, seen.id.value, c,
                             seen.corners_px[c].x(), seen.corners_px[c].y());
  put(folder, "corners.csv", corners);
  write_flange(folder, world, "row,x,y,z,qx,qy,qz,qw", in_metres);
  return folder;
}

fs::path output_of(const fs::path& folder) { return folder.string() + "_run"; }

ExitCode run_on(const fs::path& folder) {
  RunOptions options;
  options.recording.folder = folder;
  options.output = output_of(folder);
  return run_command(options, {.json = false, .quiet = true, .progress = {}});
}

json hand_eye_of(const fs::path& folder) {
  return json::parse(read_text_file(output_of(folder) / "hand_eye.json"));
}

Eigen::Vector3d camera_of(const json& result) {
  const json& t = result.at("camera").at("translation_m");
  return {t[0].get<double>(), t[1].get<double>(), t[2].get<double>()};
}

// Code and words of a refusal.
std::pair<ExitCode, std::string> refusal_of(const fs::path& folder) {
  try {
    return {run_on(folder), ""};
  } catch (const Error& error) {
    return {error.code(), error.what()};
  }
}

TEST(RunHandEye, WritesTheTransformsTheFramesAndAReport) {
  const truth::HandEyeWorld world = truth::make_hand_eye_world({});
  const fs::path folder = recording_of(world, "hand_eye_run");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const json result = hand_eye_of(folder);
  EXPECT_EQ(result.at("camera_mount"), "hand");
  EXPECT_EQ(result.at("log_direction"), "base_from_flange");
  const double expanded = result.at("camera").at("translation_expanded_m").get<double>();
  // Three axes of two standard deviations each.
  EXPECT_LT((camera_of(result) - world.camera.translation).norm(), 2.0 * expanded);
  const KinematicTree tree = read_urdf(output_of(folder) / "hand_eye.urdf");
  const auto poses = forward_kinematics(tree, Eigen::VectorXd::Zero(2));
  ASSERT_EQ(tree.links.size(), 3U);
  EXPECT_EQ(tree.links[0].name, "flange");
  EXPECT_EQ(tree.links[2].name, "camera_optical_frame");
  EXPECT_LT((poses[2].translation - camera_of(result)).norm(), 1e-9);
  EXPECT_LT(angle_between(poses[2].rotation, world.camera.rotation), 0.01);
  const std::string page = read_text_file(output_of(folder) / "report.html");
  for (const char* words : {"The camera is on the hand", "Readings of the log", "Closing the loop"})
    EXPECT_NE(page.find(words), std::string::npos) << words;
  EXPECT_TRUE(fs::exists(output_of(folder) / "trace.json"));
}

TEST(RunHandEye, AgainTheSameBytes) {
  const fs::path folder = recording_of(truth::make_hand_eye_world({}), "hand_eye_again");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const std::string first = read_text_file(output_of(folder) / "hand_eye.json");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  EXPECT_EQ(read_text_file(output_of(folder) / "hand_eye.json"), first);
}

constexpr double kDegrees = 57.29577951308232;

// Roll, pitch and yaw about fixed axes, rad.
Eigen::Vector3d rpy(const Pose& T) {
  const Eigen::Matrix3d R = T.matrix3();
  return {std::atan2(R(2, 1), R(2, 2)), std::asin(-R(2, 0)), std::atan2(R(1, 0), R(0, 0))};
}

std::string angles_row(double t, const Pose& T, double length, const Eigen::Vector3d& a) {
  const Eigen::Vector3d p = length * T.translation;
  return fmt::format("{},{},{},{},{},{},{}\n", t, p.x(), p.y(), p.z(), a.x(), a.y(), a.z());
}

TEST(RunHandEye, OtherUsualFormsSayTheSame) {
  const truth::HandEyeWorld world = truth::make_hand_eye_world({});
  const fs::path folder = recording_of(world, "hand_eye_forms");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const Eigen::Vector3d camera = camera_of(hand_eye_of(folder));
  struct Form {
    const char* header;
    RowWriter row;
  };
  const std::vector<Form> forms{
      {"index,X [mm],Y [mm],Z [mm],A [deg],B [deg],C [deg]",
       [](double t, const Pose& T) { return angles_row(t, T, 1e3, kDegrees * rpy(T).reverse()); }},
      {"frame,x,y,z,roll,pitch,yaw",
       [](double t, const Pose& T) { return angles_row(t, T, 1e3, rpy(T)); }},
      {"t,x,y,z,rx,ry,rz",
       [](double t, const Pose& T) { return angles_row(t, T, 1.0, log_rotation(T.rotation)); }},
      {"row,x,y,z,rx [deg],ry [deg],rz [deg]",
       [](double t, const Pose& T) { return angles_row(t, T, 1.0, kDegrees * rpy(T)); }},
  };
  for (const Form& form : forms) {
    write_flange(folder, world, form.header, form.row);
    ASSERT_EQ(run_on(folder), ExitCode::kDone) << form.header;
    EXPECT_LT((camera_of(hand_eye_of(folder)) - camera).norm(), 1e-7) << form.header;
  }
}

// Roll, pitch and yaw about axes that turn with the hand: of the inverse rotation about fixed axes,
// the other way round.
Eigen::Vector3d turned_rpy(const Pose& T) {
  const Eigen::Matrix3d R = T.matrix3().transpose();
  return -Eigen::Vector3d(std::atan2(R(2, 1), R(2, 2)), std::asin(-R(2, 0)),
                          std::atan2(R(1, 0), R(0, 0)));
}

std::string quaternion_row(double t, const Pose& T, const Eigen::Vector4d& q) {
  const auto p = T.translation;
  return fmt::format("{},{},{},{},{},{},{},{}\n", t, p.x(), p.y(), p.z(), q[0], q[1], q[2], q[3]);
}

TEST(RunHandEye, OtherConventionsAreToldByTheMarkersAndCanBeDeclared) {
  const truth::HandEyeWorld world = truth::make_hand_eye_world({});
  const fs::path folder = recording_of(world, "hand_eye_conventions");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const Eigen::Vector3d camera = camera_of(hand_eye_of(folder));
  struct Form {
    const char* header;
    RowWriter row;
    const char* declaration;
  };
  const auto coefficients = [](const Pose& T) { return T.rotation.coeffs(); };
  const std::vector<Form> forms{
      {"row,x,y,z,qx,qy,qz,qw",  // w first
       [&](double t, const Pose& T) {
         const Eigen::Vector4d q = coefficients(T);
         return quaternion_row(t, T, {q[3], q[0], q[1], q[2]});
       },
       "flange: {rotation: quaternion_wxyz}"},
      {"row,x,y,z,qx,qy,qz,qw",
       [&](double t, const Pose& T) {
         const Eigen::Vector4d q = coefficients(T);
         return quaternion_row(t, T, {-q[0], -q[1], -q[2], q[3]});
       },
       "flange: {conjugate: true}"},
      {"row,x,y,z,roll,pitch,yaw",
       [](double t, const Pose& T) { return angles_row(t, T, 1.0, turned_rpy(T)); },
       "flange: {rotation: xyz}"},
      {"row,x,y,z,roll,pitch,yaw",
       [](double t, const Pose& T) { return angles_row(t, T, 1.0, kDegrees * rpy(T)); },
       "flange: {unit: deg}"},
      {"row,x,y,z,qx,qy,qz,qw", [](double t, const Pose& T) { return in_metres(t + 1.0, T); },
       "flange: {row_offset: 1}"},
  };
  for (const Form& form : forms) {
    fs::remove(folder / "recording.yaml");
    write_flange(folder, world, form.header, form.row);
    testing::internal::CaptureStderr();
    ASSERT_EQ(run_on(folder), ExitCode::kDone) << form.declaration;
    const std::string said = testing::internal::GetCapturedStderr();
    EXPECT_NE(said.find(form.declaration), std::string::npos) << said;
    // Off by one costs the first image, which no usual reading has a pose for.
    EXPECT_LT((camera_of(hand_eye_of(folder)) - camera).norm(), 5e-4) << form.declaration;
    put(folder, "recording.yaml", form.declaration);
    testing::internal::CaptureStderr();
    ASSERT_EQ(run_on(folder), ExitCode::kDone) << form.declaration;
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << form.declaration;
    EXPECT_LT((camera_of(hand_eye_of(folder)) - camera).norm(), 1e-7) << form.declaration;
  }
}

TEST(RunHandEye, ADeclarationThatCannotBeIsRefused) {
  const fs::path folder = recording_of(truth::make_hand_eye_world({}), "hand_eye_declared");
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"flange: {rotation: zyz}", "cannot be read as recording.yaml says"},
           {"flange: {rotation: zxy}", "a convention nobody knows"},
           {"flange: {unit: grad}", "write rad or deg"}}) {
    put(folder, "recording.yaml", text);
    const auto [code, words] = refusal_of(folder);
    EXPECT_EQ(code, ExitCode::kBadInput) << text;
    EXPECT_NE(words.find(expected), std::string::npos) << words;
  }
}

TEST(RunHandEye, NamesOfOtherMakersAreRead) {
  const truth::HandEyeWorld world = truth::make_hand_eye_world({});
  const fs::path folder = recording_of(world, "hand_eye_names");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const Eigen::Vector3d camera = camera_of(hand_eye_of(folder));
  write_flange(folder, world, "row,x,y,z,q1,q2,q3,q4", [](double t, const Pose& T) {
    const Eigen::Vector4d q = T.rotation.coeffs();
    return quaternion_row(t, T, {q[3], q[0], q[1], q[2]});
  });
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  EXPECT_LT((camera_of(hand_eye_of(folder)) - camera).norm(), 1e-7);
  write_flange(folder, world,
               "row,pose.position.x,pose.position.y,pose.position.z,pose.orientation.x,"
               "pose.orientation.y,pose.orientation.z,pose.orientation.w",
               in_metres);
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  EXPECT_LT((camera_of(hand_eye_of(folder)) - camera).norm(), 1e-7);
}

TEST(RunHandEye, WhatCannotBeToldLeavesTheEarlierAnswer) {
  const fs::path folder = recording_of(truth::make_hand_eye_world({}), "hand_eye_refused");
  ASSERT_EQ(run_on(folder), ExitCode::kDone);
  const std::string before = read_text_file(output_of(folder) / "hand_eye.json");
  truth::HandEyeWorldOptions options;
  options.one_axis = true;
  static_cast<void>(recording_of(truth::make_hand_eye_world(options), "hand_eye_refused"));
  const auto [code, words] = refusal_of(folder);
  EXPECT_EQ(code, ExitCode::kUndetermined);
  EXPECT_NE(words.find("one axis only"), std::string::npos) << words;
  EXPECT_EQ(read_text_file(output_of(folder) / "hand_eye.json"), before);
}

TEST(RunHandEye, BadFilesAreRefusedByNameAndRemedy) {
  const truth::HandEyeWorld world = truth::make_hand_eye_world({});
  const fs::path folder = recording_of(world, "hand_eye_bad");
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "flange.csv"},
      {"row,x,y,z,qx,qy,qz,qw\n", "has a header but no rows"},
      {"x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n", "has neither a column t"},
      {"row,x,y,z\n1,2,3,4\n", "has no rotation that is known"},
      {"row,x,y,z,qx,qy,qz,qw\n0,nan,0,0,0,0,0,1\n1,1,1,nan,0,0,0,1\n2,nan,0,0,0,0,0,1\n",
       "flange.csv:2"},
      {"row,x,y,z,qx,qy,qz,qw\n100,0,0,0,0,0,0,1\n101,0,0,0,0,0,0,1\n", "is the t of a frame"},
      {"row,x,y,z,qx,qy,qz,qw\n0.5,0,0,0,0,0,0,1\n", "0.5"},
  };
  for (const auto& [text, expected] : cases) {
    put(folder, "flange.csv", text);
    const auto [code, words] = refusal_of(folder);
    EXPECT_EQ(code, ExitCode::kBadInput) << text;
    EXPECT_NE(words.find(expected), std::string::npos) << words;
  }
}

TEST(RunHandEye, ACameraWithoutALensIsRefused) {
  const fs::path folder = recording_of(truth::make_hand_eye_world({}), "hand_eye_no_camera");
  fs::remove(folder / "camera.yaml");
  EXPECT_EQ(refusal_of(folder).first, ExitCode::kBadInput);
}

TEST(InspectHandEye, SaysThatRunCalibratesTheCamera) {
  const fs::path folder = recording_of(truth::make_hand_eye_world({}), "hand_eye_inspect");
  InspectOptions options;
  options.recording.folder = folder;
  testing::internal::CaptureStdout();
  const ExitCode code = inspect_command(options, {.json = false, .quiet = true, .progress = {}});
  const std::string words = testing::internal::GetCapturedStdout();
  EXPECT_EQ(code, ExitCode::kDone);
  EXPECT_NE(words.find("flange    20 poses"), std::string::npos) << words;
  EXPECT_EQ(words.find("no joints.csv"), std::string::npos) << words;
}

}  // namespace
}  // namespace kinescope
