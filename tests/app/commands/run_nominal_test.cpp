// SPDX-License-Identifier: Apache-2.0
//
// `kinescope run --nominal` with a drawing that is grossly wrong.
#include <numbers>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/poses_of_arm.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/check_products.h"

namespace kinescope {
namespace {

// The robot that a run without a drawing finds.
KinematicTree learned_from(const RecordingFolder& folder) {
  const std::filesystem::path found = folder.path() / "found";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", found.string(), "--quiet", "--no-trace"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  return read_urdf(found / "robot.urdf");
}

std::string declared_as_ticks(const JointLog& log) {
  std::string text = "units:\n";
  for (const std::string& channel : log.channels) text += "  " + channel + ": ticks\n";
  return text;
}

TEST(RunNominal, AnAxisDrawnTheWrongWayRoundIsNamedAndMended) {
  const RecordingFolder folder;
  write_poses(arm("nominal the wrong way round", {}).recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  std::size_t turned = 0;
  while (drawing.joints.at(turned).type == JointType::kFixed) ++turned;
  const Eigen::Vector3d axis = drawing.joints[turned].axis;
  drawing.joints[turned].axis = -axis;
  folder.write("drawing.urdf", write_urdf(drawing));

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", out.string(), "--quiet", "--nominal",
           (folder.path() / "drawing.urdf").string(), "--free", "geometry"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("of the nominal robot moves about"), std::string::npos) << outcome.out;
  const nlohmann::json result = nlohmann::json::parse(read_text_file(out / "result.json"));
  ASSERT_EQ(result.at("nominal_faults").size(), 1U);
  EXPECT_EQ(result["nominal_faults"][0]["joint"], drawing.joints[turned].name);
  const KinematicTree mended = read_urdf(out / "robot.urdf");
  const auto joint = mended.joint(drawing.joints[turned].name);
  ASSERT_TRUE(joint);
  EXPECT_GT(mended.joints[joint->index()].axis.dot(axis), 0.99);
  const ProductCheck check = check_products(out);
  if (!check.done) GTEST_SKIP() << "the files' schemas were not checked: " << check.words;
  EXPECT_TRUE(check.passed) << check.words;
}

TEST(RunNominal, ColumnsInDegreesAreSaidAndTakenSo) {
  const RecordingFolder folder;
  RobotRecording recording = arm("nominal in degrees", {}).recording;
  write_poses(recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  folder.write("drawing.urdf", write_urdf(drawing));
  recording.log.values /= kRadPerDegree;
  write_poses(recording, folder);

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", out.string(), "--quiet", "--no-trace",
           "--nominal", (folder.path() / "drawing.urdf").string()});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("are in degrees; taken so"), std::string::npos) << outcome.out;
  const nlohmann::json result = nlohmann::json::parse(read_text_file(out / "result.json"));
  ASSERT_EQ(result.at("nominal_faults").size(), 3U);
  for (const nlohmann::json& fault : result["nominal_faults"])
    EXPECT_EQ(fault["unit"], kRadPerDegree);
  EXPECT_LT(result["calibration"]["held_out_rms"].get<double>(), 0.01);
}

// Servos count in ticks, some against the drawn direction, and none from the drawn zero.
TEST(RunNominal, TicksAreTakenAsTheAxesOfTheDrawingSay) {
  const RecordingFolder folder;
  RobotRecording recording = arm("nominal in ticks", {}, 4).recording;
  write_poses(recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  folder.write("drawing.urdf", write_urdf(drawing));
  constexpr double kTicksPerRad = 4096.0 / (2.0 * std::numbers::pi);
  const std::vector<double> directions{-1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0};
  for (Eigen::Index c = 0; c < recording.log.values.cols(); ++c) {
    const double per_rad = directions.at(static_cast<std::size_t>(c)) * kTicksPerRad;
    recording.log.values.col(c) =
        (per_rad * recording.log.values.col(c).array() + 500.0 * static_cast<double>(c + 1))
            .round();
  }
  write_poses(recording, folder);
  folder.write("recording.yaml", declared_as_ticks(recording.log));

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", out.string(), "--quiet", "--no-trace",
           "--nominal", (folder.path() / "drawing.urdf").string(), "--free", "offsets"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("count in units of their own"), std::string::npos) << outcome.err;
  const nlohmann::json result = nlohmann::json::parse(read_text_file(out / "result.json"));
  EXPECT_EQ(result.at("nominal_faults").size(), 0U) << result["nominal_faults"].dump(2);
  const nlohmann::json calibrated = nlohmann::json::parse(read_text_file(out / "calibration.json"));
  const nlohmann::json& joints = calibrated.at("robot").at("joints");
  int inner = 0;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const nlohmann::json& joint = joints[j];
    if (joint.value("channel", "").empty()) continue;
    const auto channel = recording.log.channel(joint["channel"].get<std::string>());
    ASSERT_TRUE(channel);
    const double per_rad = directions.at(static_cast<std::size_t>(*channel)) * kTicksPerRad;
    const double scale = joint["scale"].get<double>();
    EXPECT_NEAR(scale * per_rad, 1.0, 2e-3) << joint["name"];
    // Of the first joint and the last no axes tell the zero.
    ++inner;
    if (inner == 1 || inner == 4) continue;
    const double tick_of_zero = 500.0 * static_cast<double>(*channel + 1);
    EXPECT_NEAR(joint["offset"].get<double>() + scale * tick_of_zero, 0.0, 0.01) << joint["name"];
  }
  EXPECT_EQ(inner, 4);
  // Frames stay as drawn, and so do limits.
  const KinematicTree robot = read_urdf(out / "robot.urdf");
  for (const Joint& joint : robot.joints) {
    const auto drawn = drawing.joint(joint.name);
    if (!drawn || joint.type == JointType::kFixed) continue;
    const Pose apart =
        drawing.joints[drawn->index()].T_parent_joint.inverse() * joint.T_parent_joint;
    EXPECT_LT(log_pose(apart).norm(), 1e-6) << joint.name;
  }
}

// Without what shows the joints by themselves, nothing says what a tick is.
TEST(RunNominal, TicksOfJointsThatNoMarkerShowsAreRefused) {
  const RecordingFolder folder;
  RobotRecording recording = arm("nominal in ticks, a marker at the end", {}, 3).recording;
  write_poses(recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  folder.write("drawing.urdf", write_urdf(drawing));
  recording.log.values *= 600.0;
  recording.tracks.tracks.erase(recording.tracks.tracks.begin(), recording.tracks.tracks.end() - 1);
  write_poses(recording, folder);
  folder.write("recording.yaml", declared_as_ticks(recording.log));
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", (folder.path() / "out").string(), "--quiet",
           "--no-trace", "--nominal", (folder.path() / "drawing.urdf").string()});
  EXPECT_EQ(outcome.code, 4) << outcome.out;
  EXPECT_NE(outcome.err.find("count in units of their own, and the markers do not show"),
            std::string::npos)
      << outcome.err;
}

TEST(RunNominal, AGripperThatIsNotLoggedRestsAndKeepsItsJoint) {
  const RecordingFolder folder;
  write_poses(arm("nominal with a gripper", {}, 2).recording, folder);
  KinematicTree drawing = learned_from(folder);
  const KinematicTree truth = drawing;
  drawing.markers.clear();
  const LinkId hand{static_cast<int>(drawing.links.size()) - 1};
  drawing.links.push_back({"left"});
  Joint finger;
  finger.name = "finger";
  finger.type = JointType::kPrismatic;
  finger.parent = hand;
  finger.child = LinkId{hand.value + 1};
  finger.limits = JointLimits{0.0, 0.04};
  drawing.joints.push_back(finger);
  // Wider than what the recording shows, and a drive that nobody can film.
  std::size_t moving = 0;
  while (drawing.joints.at(moving).type == JointType::kFixed) ++moving;
  drawing.joints[moving].limits = JointLimits{-6.0, 6.5};
  drawing.joints[moving].effort = 200.0;
  drawing.joints[moving].velocity = 5.0;
  folder.write("drawing.urdf", write_urdf(drawing));

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", out.string(), "--quiet", "--no-trace",
           "--nominal", (folder.path() / "drawing.urdf").string(), "--free", "geometry"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("no logged channel drives finger"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("No uncertainty can be given for the axis of finger"),
            std::string::npos)
      << outcome.out;
  const KinematicTree calibrated = read_urdf(out / "robot.urdf");
  const auto kept = calibrated.joint("finger");
  ASSERT_TRUE(kept);
  EXPECT_EQ(calibrated.joints[kept->index()].limits, finger.limits);
  const auto drive = calibrated.joint(drawing.joints[moving].name);
  ASSERT_TRUE(drive);
  EXPECT_EQ(calibrated.joints[drive->index()].limits, drawing.joints[moving].limits);
  EXPECT_EQ(calibrated.joints[drive->index()].effort, 200.0);
  EXPECT_EQ(calibrated.joints[drive->index()].velocity, 5.0);
  // The hand's markers sit on the hand, not on a finger that might move.
  EXPECT_EQ(calibrated.markers.size(), truth.markers.size());
  for (const Marker& marker : truth.markers) {
    ASSERT_NE(calibrated.marker(marker.id), nullptr);
    EXPECT_EQ(calibrated.links[calibrated.marker(marker.id)->link.index()].name,
              truth.links[marker.link.index()].name);
  }
}

// What a robot runs with has masses, shapes and drives; robot.urdf has none of them.
TEST(RunNominal, TheNominalFileIsWrittenWithCalibratedJointsAndAllElseAsItWas) {
  const RecordingFolder folder;
  write_poses(arm("nominal with masses and meshes", {}).recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  std::size_t turned = 0;
  while (drawing.joints.at(turned).type == JointType::kFixed) ++turned;
  drawing.joints[turned].T_parent_joint.translation.x() += 0.01;
  const std::string more =
      R"(<link name="tool0"><inertial><mass value="1.50"/><inertia ixx=".01" ixy="0" ixz="0" )"
      R"(iyy=".01" iyz="0" izz=".01"/></inertial><visual><geometry><mesh filename="a.stl"/>)"
      R"(</geometry></visual></link><joint name="tool" type="fixed"><parent link=")" +
      drawing.links.back().name +
      R"("/><child link="tool0"/><origin xyz="0 0 .10"/></joint><transmission name="t"/>)";
  std::string text = write_urdf(drawing);
  text.insert(text.find("</robot>"), more);
  folder.write("drawing.urdf", text);

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome =
      run({"run", folder.path().string(), "--output", out.string(), "--quiet", "--no-trace",
           "--nominal", (folder.path() / "drawing.urdf").string(), "--free", "geometry"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("\nnominal " + (out / "nominal_calibrated.urdf").string()),
            std::string::npos)
      << outcome.out;
  const std::string written = read_text_file(out / "nominal_calibrated.urdf");
  EXPECT_NE(written.find(more), std::string::npos) << written;
  const KinematicTree calibrated = read_urdf(out / "robot.urdf");
  const KinematicTree back = parse_urdf(written, "nominal_calibrated.urdf");
  ASSERT_EQ(back.joints.size(), calibrated.joints.size());
  Rng rng = Rng::from_name("nominal with masses and meshes, postures");
  const Eigen::VectorXd values =
      Eigen::VectorXd::NullaryExpr(static_cast<Eigen::Index>(back.joints.size()),
                                   [&](Eigen::Index) { return rng.uniform(-2.0, 2.0); });
  for (std::size_t link = 0; link < back.links.size(); ++link) {
    ASSERT_EQ(back.links[link].name, calibrated.links[link].name);
    const Pose apart = forward_kinematics(calibrated, values)[link].inverse() *
                       forward_kinematics(back, values)[link];
    EXPECT_LT(log_pose(apart).norm(), 1e-7) << back.links[link].name;  // arc cosine near one
  }
  for (std::size_t j = 0; j < back.joints.size(); ++j)
    EXPECT_EQ(back.joints[j].limits, parse_urdf(text, "drawing").joints[j].limits);
}

// A drawing without a fault needs nothing freed: what is freed costs certainty, and is not
// exported.
TEST(RunNominal, TheFreedomThatPredictsBestIsExported) {
  const RecordingFolder folder;
  write_poses(arm("nominal without a fault", {}).recording, folder);
  KinematicTree drawing = learned_from(folder);
  drawing.markers.clear();
  folder.write("drawing.urdf", write_urdf(drawing));

  const std::filesystem::path out = folder.path() / "out";
  const Outcome outcome = run({"run", folder.path().string(), "--output", out.string(), "--quiet",
                               "--nominal", (folder.path() / "drawing.urdf").string()});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json result = nlohmann::json::parse(read_text_file(out / "result.json"));
  const nlohmann::json& levels = result.at("nominal_levels");
  ASSERT_GE(levels.size(), 3U);
  const auto held_out = [&](std::size_t level) {
    return levels[level].at("held_out_m").at("rms").get<double>();
  };
  EXPECT_LT(held_out(0), held_out(2)) << levels.dump(2);
  EXPECT_TRUE(levels[0].at("exported").get<bool>()) << levels.dump(2);
  EXPECT_NE(outcome.out.find("held as drawn"), std::string::npos) << outcome.out;
  const std::string next = result.at("verdict").at("next").get<std::string>();
  EXPECT_NE(outcome.out.find("\nNext: " + next + "\n"), std::string::npos) << outcome.out;
}

}  // namespace
}  // namespace kinescope
