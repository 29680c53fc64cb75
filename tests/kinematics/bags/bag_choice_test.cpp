// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

JointSeries joints(const std::string& topic, int count) {
  JointSeries out;
  out.topic = topic;
  for (int i = 0; i < count; ++i) out.names.push_back("j" + std::to_string(i));
  out.times_s = {0.0, 1.0};
  out.position = Eigen::MatrixXd::Zero(2, count);
  return out;
}

ImageSeries images(const std::string& topic, const std::string& type = std::string(kImageType),
                   const std::string& encoding = "mono8") {
  ImageSeries out;
  out.topic = topic;
  out.type = type;
  out.encoding = encoding;
  return out;
}

Contents contents_of(std::vector<JointSeries> series) {
  Contents out;
  out.source = "x.mcap";
  out.joints = std::move(series);
  return out;
}

Contents contents_of(std::vector<ImageSeries> series) {
  Contents out;
  out.source = "x.mcap";
  out.images = std::move(series);
  return out;
}

std::string refusal(const Contents& contents, const std::string& topic = {}) {
  try {
    return choose_joints(contents, topic).topic;
  } catch (const Error& error) {
    return error.what();
  }
}

TEST(ChooseJoints, MostJointsOfWhatWasMeasured) {
  EXPECT_EQ(refusal(contents_of({joints("/gripper", 1), joints("/arm", 6)})), "/arm");
  EXPECT_EQ(refusal(contents_of({joints("/joint_commands", 6), joints("/arm", 6)})), "/arm");
  EXPECT_EQ(refusal(contents_of({joints("/desired_state", 7), joints("/arm", 6)})), "/arm");
  EXPECT_EQ(refusal(contents_of({joints("/raw", 6), joints("/joint_states", 6)})), "/joint_states");
}

TEST(ChooseJoints, OfEqualOnesTheMostMessagesAndTheOneThatIsNamed) {
  JointSeries right = joints("/right/joint_states", 6);
  right.times_s.push_back(2.0);
  right.position = Eigen::MatrixXd::Zero(3, 6);
  const Contents rivals = contents_of({joints("/left/joint_states", 6), right});
  EXPECT_EQ(refusal(rivals), "/right/joint_states");
  EXPECT_EQ(refusal(rivals, "/left/joint_states"), "/left/joint_states");
  EXPECT_NE(refusal(rivals, "/middle").find("x.mcap:/middle: no joint positions there"),
            std::string::npos);
}

TEST(ChooseImages, OfOneCameraTheRawOnes) {
  EXPECT_EQ(choose_images(contents_of({images("/cam/image_raw"),
                                       images("/cam/image_raw/compressed",
                                              std::string(kCompressedImageType), "jpeg")}),
                          {})
                .topic,
            "/cam/image_raw");
  EXPECT_EQ(
      choose_images(contents_of({images("/cam/image_rect"), images("/cam/image_raw")}), {}).topic,
      "/cam/image_raw");
  EXPECT_EQ(
      choose_images(
          contents_of({images("/cam/color/image_raw"),
                       images("/cam/depth/image_rect_raw", std::string(kImageType), "16UC1")}),
          {})
          .topic,
      "/cam/color/image_raw");
}

TEST(ChooseImages, OfTwoCamerasNone) {
  const Contents two = contents_of({images("/left/image_raw"), images("/right/image_raw")});
  EXPECT_THROW(static_cast<void>(choose_images(two, {})), Error);
  EXPECT_EQ(choose_images(two, "/right/image_raw").topic, "/right/image_raw");
}

TEST(CameraOf, TheOneBesideTheImages) {
  Contents contents;
  CameraInfo calibrated;
  calibrated.k[0] = 500.0;
  contents.cameras = {{"/left/camera_info", calibrated, false},
                      {"/right/camera_info", calibrated, false}};
  EXPECT_EQ(camera_of(contents, "/right/image_raw")->topic, "/right/camera_info");
  // One that was never calibrated is none, and another camera's is not its own.
  contents.images = {images("/left/image_raw"), images("/right/image_raw")};
  contents.cameras = {{"/left/camera_info", CameraInfo{}, false},
                      {"/right/camera_info", calibrated, false}};
  EXPECT_FALSE(camera_of(contents, "/left/image_raw"));
  contents.cameras.erase(contents.cameras.begin());
  EXPECT_FALSE(camera_of(contents, "/left/image_raw"));
  contents.images.clear();
  EXPECT_EQ(camera_of(contents, "/detections")->topic, "/right/camera_info");
}

}  // namespace
}  // namespace kinescope::bags
