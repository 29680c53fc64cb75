// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/camera_file.h"

#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/core/rng.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

// A file of the test's own, removed with it.
class CameraFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& content, const std::string& name = "camera.yaml") {
    const std::filesystem::path path = truth::temporary_path(
        std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + "_" + name);
    write_file_atomically(path, content);
    files_.push_back(path);
    return path;
  }
  void TearDown() override {
    for (const auto& file : files_) std::filesystem::remove(file);
  }
  // The message of the bad_input that reading throws.
  std::string complaint(const std::string& content, const std::string& name = "camera.yaml") {
    try {
      (void)read_camera(write(content, name));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      const std::string text = error.what();
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
      EXPECT_NE(text.find(name), std::string::npos) << text;
      return text;
    }
    return "no complaint";
  }

 private:
  std::vector<std::filesystem::path> files_;
};

constexpr const char* kRos = R"(image_width: 1280
image_height: 720
camera_name: cam0
camera_matrix:
  rows: 3
  cols: 3
  data: [878.5, 0.0, 629.25, 0.0, 876.5, 367.125, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.05, 0.017, -0.0002, -0.0001, 0.003]
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(CameraFile, ReadsRosCameraInfo) {
  const CameraModel camera = read_camera(write(kRos));
  EXPECT_EQ(camera.name, "cam0");
  EXPECT_EQ(camera.width, 1280);
  EXPECT_EQ(camera.height, 720);
  EXPECT_EQ(camera.fx, 878.5);
  EXPECT_EQ(camera.fy, 876.5);
  EXPECT_EQ(camera.cx, 629.25);
  EXPECT_EQ(camera.cy, 367.125);
  EXPECT_EQ(camera.model, DistortionModel::kPlumbBob);
  EXPECT_EQ(camera.distortion, (std::array<double, 8>{-0.05, 0.017, -0.0002, -0.0001, 0.003}));
}

TEST_F(CameraFile, WritesWhatItReads) {
  Rng rng = Rng::from_name("camera file round trip");
  for (const DistortionModel model :
       {DistortionModel::kPlumbBob, DistortionModel::kRationalPolynomial,
        DistortionModel::kEquidistant}) {
    CameraModel camera = pinhole_guess(1920, 1208, rng.uniform(500.0, 2000.0));
    camera.name = "wrist";
    camera.fy = rng.uniform(500.0, 2000.0);
    camera.model = model;
    for (int i = 0; i < distortion_count(model); ++i) {
      camera.distortion[static_cast<std::size_t>(i)] = rng.uniform(-0.5, 0.5);
    }
    EXPECT_EQ(read_camera(write(write_camera_info(camera))), camera);
  }
}

TEST_F(CameraFile, ReadsKalibrCamchain) {
  const CameraModel camera = read_camera(write(R"(cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.2, 0.3, 0.4]
  distortion_model: equidistant
  intrinsics: [461.5, 460.25, 362.5, 248.125]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
)"));
  EXPECT_EQ(camera.model, DistortionModel::kEquidistant);
  EXPECT_EQ(camera.width, 752);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fx, 461.5);
  EXPECT_EQ(camera.fy, 460.25);
  EXPECT_EQ(camera.cx, 362.5);
  EXPECT_EQ(camera.cy, 248.125);
  EXPECT_EQ(camera.distortion, (std::array<double, 8>{0.1, 0.2, 0.3, 0.4}));
}

TEST_F(CameraFile, ReadsOpenCvYaml) {
  const CameraModel camera = read_camera(write(R"(%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 535.5, 0., 342.25, 0., 536.5, 235.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.5e-01, -0.03, 1.5e-03, -2.5e-04, 0.25 ]
)",
                                               "camera.yml"));
  EXPECT_EQ(camera.fx, 535.5);
  EXPECT_EQ(camera.fy, 536.5);
  EXPECT_EQ(camera.cx, 342.25);
  EXPECT_EQ(camera.cy, 235.5);
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.distortion, (std::array<double, 8>{-0.25, -0.03, 1.5e-3, -2.5e-4, 0.25}));
}

constexpr const char* kOpenCvFourTerms = R"(%YAML:1.0
---
image_width: 1280
image_height: 960
K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 420., 0., 640., 0., 421., 480., 0., 0., 1. ]
D: !!opencv-matrix
   rows: 4
   cols: 1
   dt: d
   data: [ -.02, .003, -.001, .0002 ]
)";

TEST_F(CameraFile, TakesTheLensThatAnOpenCvFileDeclares) {
  const auto read = [&](const std::string& lines) {
    return read_camera(write(kOpenCvFourTerms + lines));
  };
  EXPECT_EQ(read("").model, DistortionModel::kPlumbBob);
  EXPECT_EQ(read("camera_model: pinhole\n").model, DistortionModel::kPlumbBob);
  for (const char* lines :
       {"distortion_model: fisheye\n", "distortion_model: Equidistant\n", "fisheye_model: 1\n",
        "camera_model: fisheye\n", "camera_model: pinhole\ndistortion_model: equidistant\n",
        "camera_model: KANNALA_BRANDT\n"}) {
    const CameraModel camera = read(lines);
    EXPECT_EQ(camera.model, DistortionModel::kEquidistant) << lines;
    EXPECT_EQ(camera.distortion, (std::array<double, 8>{-0.02, 0.003, -0.001, 0.0002})) << lines;
  }
  for (const char* lines :
       {"distortion_model: plumb_bob\n", "distortion_model: radtan\n", "fisheye_model: 0\n"}) {
    EXPECT_EQ(read(lines).model, DistortionModel::kPlumbBob) << lines;
  }
  EXPECT_NE(complaint(std::string(kOpenCvFourTerms) + "distortion_model: double_sphere\n")
                .find("distortion_model: 'double_sphere' is not known (known: plumb_bob, "),
            std::string::npos);
  EXPECT_NE(complaint(std::string(kOpenCvFourTerms) + "camera_model: omni\n")
                .find("camera_model: 'omni' is not known"),
            std::string::npos);
  EXPECT_NE(
      complaint(std::string(kOpenCvFourTerms) + "distortion_model: plumb_bob\nfisheye_model: 1\n")
          .find("fisheye_model: contradicts distortion_model"),
      std::string::npos);
}

TEST_F(CameraFile, ReadsOpenCvXmlWithoutSize) {
  const CameraModel camera = read_camera(write(R"(<?xml version="1.0"?>
<opencv_storage>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>
    4.845e+02 0. 3.25e+02 0.
    4.855e+02 2.405e+02 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>1</rows><cols>5</cols><dt>d</dt>
  <data>0.125 -0.5 -1e-03 -2.5e-04 0.25</data></distortion_coefficients>
</opencv_storage>)",
                                               "camera.xml"));
  EXPECT_EQ(camera.fx, 484.5);
  EXPECT_EQ(camera.fy, 485.5);
  EXPECT_EQ(camera.cx, 325.0);
  EXPECT_EQ(camera.cy, 240.5);
  EXPECT_EQ(camera.width, 0);
  EXPECT_EQ(camera.height, 0);
  EXPECT_EQ(camera.distortion[1], -0.5);
  const CameraModel sized = with_image_size(camera, 640, 480, "camera.xml");
  EXPECT_EQ(sized.width, 640);
  EXPECT_EQ(sized.height, 480);
}

TEST_F(CameraFile, RefusesAnotherImageSize) {
  const CameraModel camera = read_camera(write(kRos));
  EXPECT_EQ(with_image_size(camera, 1280, 720, "camera.yaml"), camera);
  EXPECT_THROW((void)with_image_size(camera, 640, 480, "camera.yaml"), Error);
  EXPECT_THROW((void)with_image_size(camera, 720, 1280, "camera.yaml"), Error);
}

TEST_F(CameraFile, RefusesAPrincipalPointOfAnotherResolution) {
  CameraModel camera = pinhole_guess(1920, 1080, 1389.0);
  camera.width = camera.height = 0;
  EXPECT_EQ(with_image_size(camera, 1920, 1080, "camera.xml").width, 1920);
  try {
    (void)with_image_size(camera, 1280, 720, "camera.xml");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              "camera.xml: its principal point (960, 540) is not near the middle of images of 1280 "
              "x 720, and it does not say which size it was made for (add image_width and "
              "image_height to it, or calibrate the camera at the resolution of the video "
              "(kinescope camera))");
  }
  camera.cx += 0.1 * 1920.0;  // a lens that is badly centred, or a small crop
  EXPECT_EQ(with_image_size(camera, 1920, 1080, "camera.xml").height, 1080);
}

TEST_F(CameraFile, NamesTheKeyThatIsWrong) {
  const std::string ros = kRos;
  struct Case {
    std::string content;
    std::string says;
  };
  const std::vector<Case> cases = {
      {"", "empty"},
      {"just words", "no camera"},
      {"- 1\n- 2\n", "no camera"},
      {"a: [1, 2\nb: 3\n", "not YAML"},
      {with(ros, "image_width: 1280\n", ""), "image_width"},
      {with(ros, "1280", "-5"), "image_width"},
      {with(ros, "1280", "0"), "image_width"},
      {with(ros, "1280", "1280.5"), "image_width"},
      {with(ros, "878.5", "-878.5"), "focal"},
      {with(ros, "878.5", "0.0"), "focal"},
      {with(ros, "878.5", ".nan"), "finite"},
      {with(ros, "878.5", "nan"), "finite"},
      {with(ros, "878.5, 0.0", "878.5, 2.0"), "skew"},
      {with(ros, ", 1.0]", "]"), "8 numbers"},
      {with(ros, "plumb_bob", "double_sphere"), "double_sphere"},
      {with(ros, "distortion_model: plumb_bob\n", ""), "distortion_model"},
      {with(ros, ", 0.003]", ", 0.003, 0.1]"), "6 distortion terms"},
      {with(ros, "[-0.05, 0.017, -0.0002, -0.0001, 0.003]", "[-0.05]"), "1 distortion terms"},
      {with(ros, "-0.05", "inf"), "finite"},
      {with(ros, "camera_matrix", "matrix"), "camera_matrix"},
      {"cam0: 3\n", "cam0"},
      {"cam0:\n  camera_model: omni\n", "omni"},
      {"cam0:\n  intrinsics: [1, 2, 3]\n  resolution: [4, 5]\n  distortion_model: radtan\n",
       "3 numbers"},
      {"cam0:\n  intrinsics: [9, 9, 3, 3]\n  resolution: [4]\n  distortion_model: none\n",
       "resolution"},
      {"cam0:\n  intrinsics: [9, 9, 3, 3]\n  resolution: [4, 5]\n  distortion_model: fov\n"
       "  distortion_coeffs: [0.1]\n",
       "fov"},
      {"%YAML:1.0\n---\nfoo: 3\n", "camera_matrix"},
      {"<opencv_storage><camera_matrix>", "not XML"},
      {"<robot/>", "opencv_storage"},
  };
  for (const Case& c : cases) {
    const std::string text = complaint(c.content);
    EXPECT_NE(text.find(c.says), std::string::npos) << text << "\nfor\n" << c.content;
    EXPECT_NE(text.find('('), std::string::npos) << "no remedy: " << text;
  }
}

// As `ros2 topic echo --once /camera/camera_info` prints it; ROS 1 writes D and K.
TEST_F(CameraFile, ReadsAnEchoedMessage) {
  const std::string ros2 =
      "header:\n  frame_id: cam\nheight: 720\nwidth: 1280\ndistortion_model: plumb_bob\n"
      "d:\n- -0.125\n- 0.25\n- 0.0\n- 0.0\n- 0.5\n"
      "k:\n- 926.0\n- 0.0\n- 632.5\n- 0.0\n- 924.5\n- 354.25\n- 0.0\n- 0.0\n- 1.0\n---\n";
  const std::string ros1 =
      "height: 720\nwidth: 1280\ndistortion_model: \"plumb_bob\"\nD: [-0.125, 0.25, 0.0, 0.0, "
      "0.5]\nK: [926.0, 0.0, 632.5, 0.0, 924.5, 354.25, 0.0, 0.0, 1.0]\n";
  for (const std::string& message : {ros2, ros1}) {
    const CameraModel camera = read_camera(write(message));
    EXPECT_EQ(camera.width, 1280);
    EXPECT_EQ(camera.height, 720);
    EXPECT_EQ(camera.fx, 926.0);
    EXPECT_EQ(camera.cy, 354.25);
    EXPECT_EQ(camera.distortion, (std::array<double, 8>{-0.125, 0.25, 0.0, 0.0, 0.5}));
  }
  EXPECT_NE(complaint("width: 640\nheight: 480\ndistortion_model: plumb_bob\nk: [1, 2]\nd: []\n")
                .find("k: "),
            std::string::npos);
}

TEST_F(CameraFile, ReadsTheFilesOfOthers) {
  struct Case {
    std::string path;
    double fx;
    int width;
  };
  for (const Case& c :
       {Case{"vision/door_hinge_aruco/camera_calib.xml", 484.66070892260035, 640},
        Case{"vision/chessboard_opencv_stereo/left_intrinsics.yml", 535.91573396163199, 640},
        Case{"vision/tagslam_board_d435/cameras.yaml", 612.569, 640},
        Case{"synthetic/ur6_none/camera.yaml", 878.947960, 1280}}) {
    const auto path = shared_data(c.path);
    if (!path) GTEST_SKIP() << "no " << c.path << " on this machine";
    const CameraModel camera = read_camera(*path);
    EXPECT_EQ(camera.fx, c.fx) << c.path;
    EXPECT_EQ(camera.width, c.width) << c.path;
  }
}

}  // namespace
}  // namespace kinescope
