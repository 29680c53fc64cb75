// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/kinematics/structure/scenes.h"

namespace kinescope {
namespace {

// A hinge and a slide that move alike, the only joints.
Scene alike() {
  Scene scene;
  Rng rng = Rng::from_name("declared units");
  scene.robot = random_robot({.joints = 2}, rng);
  scene.robot.tree.joints[0].type = JointType::kRevolute;
  scene.robot.tree.joints[1].type = JointType::kPrismatic;
  RecordingOptions options = noisy();
  options.together = {{0, 1}};
  scene.recording = record(scene.robot, options, rng);
  return scene;
}

std::map<std::string, ChannelUnit> units_of_joints(const Scene& scene) {
  std::map<std::string, ChannelUnit> units;
  for (std::size_t j = 0; j < scene.robot.tree.joints.size(); ++j) {
    const auto c = static_cast<std::size_t>(scene.recording.channel_of_joint[j]);
    units[scene.recording.log.channels[c]] = scene.robot.tree.joints[j].type == JointType::kRevolute
                                                 ? ChannelUnit::kRadian
                                                 : ChannelUnit::kMetre;
  }
  return units;
}

TEST(DeclaredUnits, SayWhichOfTwoProportionalChannelsDrivesWhich) {
  const Scene scene = alike();
  const Structure customary = find_structure(scene.recording.tracks, scene.recording.log);
  EXPECT_EQ(customary.status, StructureStatus::kAmbiguous);
  StructureOptions options;
  options.units = units_of_joints(scene);
  const Structure declared = find_structure(scene.recording.tracks, scene.recording.log, options);
  EXPECT_EQ(described(declared, scene.robot), described(scene));
  EXPECT_EQ(declared.status, StructureStatus::kDetermined);
  EXPECT_GT(declared.probability, 0.99);
}

TEST(DeclaredUnits, YieldToTheMotion) {
  RecordingOptions recording = noisy();
  recording.channel_scale = 2.0;
  const Scene scene = make_scene("declared units, geared", {.joints = 3}, recording);
  StructureOptions options;
  options.units = units_of_joints(scene);
  const Structure found = find_structure(scene.recording.tracks, scene.recording.log, options);
  EXPECT_EQ(described(found, scene.robot), described(scene));
  EXPECT_EQ(found.status, StructureStatus::kDetermined);
}

}  // namespace
}  // namespace kinescope
