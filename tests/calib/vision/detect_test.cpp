// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/detect.h"

#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/calib/vision/temporary_folder.h"
#include "tests/calib/vision/write_video.h"
#include "tests/truth/render.h"

namespace kinescope {
namespace {

constexpr int kFilmedFrames = 24;
constexpr double kErrors = 5.0;  // sigmas, of 24 x 2 x 8 coordinates none should be beyond

// Two markers, one at rest, one that moves and turns.
class Detect : public TemporaryFolder {
 protected:
  void SetUp() override {
    TemporaryFolder::SetUp();
    camera_ = pinhole_guess(320, 240, 500.0);
    Rng rng = Rng::from_name("detect");
    for (int f = 0; f < kFilmedFrames; ++f) {
      PlacedMarker still;
      still.art = apriltag_art("tag36h11", 4);
      still.T_camera_tag = pose_showing(camera_, {70.0, 70.0}, 60.0, still.size_m, 0.3, 0.2, 0.1);
      PlacedMarker moving;
      moving.art = apriltag_art("tag36h11", 9);
      moving.T_camera_tag = pose_showing(camera_, {180.0 + 3.0 * f, 150.0 + f}, 40.0, moving.size_m,
                                         0.5, 0.1 * f, 0.05 * f);
      truth_.push_back({true_corners(camera_, still), true_corners(camera_, moving)});
      frames_.push_back(render_markers(camera_, {still, moving}, {.supersample = 4}, rng));
    }
    markers_.default_size_m = 0.05;
  }

  std::filesystem::path image_folder() const {
    std::string times = "image,t\n";
    for (int f = 0; f < kFilmedFrames; ++f) {
      const GreyImage& image = frames_[static_cast<std::size_t>(f)];
      const std::string name = fmt::format("{:03d}.png", f);
      const cv::Mat picture(image.height, image.width, CV_8UC1,
                            const_cast<std::uint8_t*>(image.pixels.data()));
      EXPECT_TRUE(cv::imwrite((folder_ / name).string(), picture));
      times += fmt::format("{},{}\n", name, 0.1 * f);
    }
    write_file_atomically(folder_ / "times.csv", times);
    return folder_;
  }

  void expect_truth(const Detection& found, double extra_sigma) const {
    for (const TagObservation& tag : found.observations.observations) {
      const auto& truth = truth_[static_cast<std::size_t>(tag.frame)][tag.id == TagId{4} ? 0U : 1U];
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_LT((tag.corners_px[i] - truth[i]).cwiseAbs().maxCoeff(),
                  kErrors * std::hypot(tag.sigma_px, extra_sigma))
            << "frame " << tag.frame << " id " << tag.id.value << " corner " << i;
      }
      EXPECT_LT(tag.sigma_px, 0.1);
    }
  }

  CameraModel camera_;
  std::vector<std::array<std::array<Eigen::Vector2d, 4>, 2>> truth_;
  std::vector<GreyImage> frames_;
  MarkerSet markers_;
};

TEST_F(Detect, FindsEveryMarkerInEveryFrameWhereItIs) {
  const Detection found = detect_tags(image_folder(), markers_);
  EXPECT_EQ(found.observations.width, 320);
  EXPECT_EQ(found.observations.height, 240);
  ASSERT_EQ(found.observations.times_s.size(), static_cast<std::size_t>(kFilmedFrames));
  EXPECT_DOUBLE_EQ(found.observations.times_s[7], 0.7);
  EXPECT_EQ(found.observations.observations.size(), static_cast<std::size_t>(2 * kFilmedFrames));
  EXPECT_TRUE(found.observations.rejected.empty());
  EXPECT_TRUE(found.warnings.empty());
  expect_truth(found, 0.0);
}

TEST_F(Detect, TheCamerasToneCurveIsCorrectedAndNamed) {
  Rng rng = Rng::from_name("detect, tone");
  for (int f = 0; f < kFilmedFrames; ++f) {
    std::vector<PlacedMarker> all(2);
    for (std::size_t i = 0; i < 2; ++i) {
      all[i].art = apriltag_art("tag36h11", i == 0 ? 4 : 9);
      all[i].T_camera_tag = pose_showing(camera_, {80.0 + 130.0 * static_cast<double>(i), 90.0 + f},
                                         60.0, all[i].size_m, 0.5, 0.1 * f, 0.05 * f);
      truth_[static_cast<std::size_t>(f)][i] = true_corners(camera_, all[i]);
    }
    frames_[static_cast<std::size_t>(f)] =
        render_markers(camera_, all, {.supersample = 4, .gamma = 2.2}, rng);
  }
  const Detection found = detect_tags(image_folder(), markers_);
  EXPECT_EQ(found.observations.observations.size(), static_cast<std::size_t>(2 * kFilmedFrames));
  ASSERT_EQ(found.warnings.size(), 1U);
  EXPECT_NE(found.warnings[0].find("tone curve"), std::string::npos) << found.warnings[0];
  EXPECT_NE(found.warnings[0].find("corrected"), std::string::npos) << found.warnings[0];
  expect_truth(found, 0.0);
}

TEST_F(Detect, FromAVideoToo) {
  VideoSpec spec{frames_, {}, 2};
  for (int f = 0; f < kFilmedFrames; ++f) spec.stamps_ms.push_back(33 * f);
  write_video(folder_ / "v.mp4", spec);
  const Detection found = detect_tags(folder_ / "v.mp4", markers_);
  EXPECT_EQ(found.observations.observations.size(), static_cast<std::size_t>(2 * kFilmedFrames));
  constexpr double kMpeg4 = 0.05;  // px, what this codec moves edges by
  expect_truth(found, kMpeg4);
}

// Between whole searches markers are followed; one that enters or leaves then is noticed all the
// same.
TEST_F(Detect, MarkersThatEnterAndLeaveAreNoticed) {
  constexpr int kEnters = 14;
  constexpr int kLeaves = 17;
  Rng rng = Rng::from_name("detect, entering");
  VideoSpec spec{frames_, {}, 0};
  for (int f = 0; f < kFilmedFrames; ++f) {
    spec.stamps_ms.push_back(33 * f);
    std::vector<PlacedMarker> all;
    const std::map<int, Eigen::Vector2d> places = {
        {4, {70.0, 70.0}}, {9, {160.0, 150.0}}, {12, {250.0, 80.0}}};
    for (const auto& [id, place] : places) {
      PlacedMarker marker;
      marker.art = apriltag_art("tag36h11", id);
      marker.T_camera_tag = pose_showing(camera_, place, 45.0, marker.size_m, 0.3, 0.2, 0.1);
      if (id == 12 && f < kEnters) continue;
      if (id == 9 && f >= kLeaves) continue;
      all.push_back(marker);
    }
    spec.frames[static_cast<std::size_t>(f)] =
        render_markers(camera_, all, {.supersample = 3}, rng);
  }
  write_video(folder_ / "v.mp4", spec);
  const Detection found = detect_tags(folder_ / "v.mp4", markers_);
  std::map<int, int> count;
  for (const TagObservation& tag : found.observations.observations) ++count[tag.id.value];
  EXPECT_EQ(count[4], kFilmedFrames);
  EXPECT_EQ(count[9], kLeaves);
  EXPECT_EQ(count[12], kFilmedFrames - kEnters);
}

TEST_F(Detect, TheNumberOfThreadsChangesNothing) {
  VideoSpec spec{frames_, {}, 2};
  for (int f = 0; f < kFilmedFrames; ++f) spec.stamps_ms.push_back(33 * f);
  const auto folder = folder_ / "v.mp4";
  write_video(folder, spec);
  DetectOptions one;
  one.threads = 1;
  DetectOptions three;
  three.threads = 3;
  const TagObservations a = detect_tags(folder, markers_, one).observations;
  const TagObservations b = detect_tags(folder, markers_, three).observations;
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (std::size_t i = 0; i < a.observations.size(); ++i) {
    EXPECT_EQ(a.observations[i].frame, b.observations[i].frame);
    EXPECT_EQ(a.observations[i].id, b.observations[i].id);
    EXPECT_EQ(a.observations[i].corners_px, b.observations[i].corners_px);
    EXPECT_EQ(a.observations[i].sigma_px, b.observations[i].sigma_px);
  }
}

TEST_F(Detect, ReportsProgressAndReadsWhatIsAsked) {
  int last = 0;
  int total = 0;
  markers_.only_listed = true;
  markers_.sizes_m[TagId{9}] = 0.05;
  DetectOptions options;
  options.fill_gaps = false;
  const Detection found =
      detect_tags(image_folder(), markers_, options, [&](std::string_view, int done, int all) {
        EXPECT_EQ(done, last + 1);
        last = done;
        total = all;
      });
  EXPECT_EQ(last, kFilmedFrames);
  EXPECT_EQ(total, kFilmedFrames);
  EXPECT_EQ(found.observations.observations.size(), static_cast<std::size_t>(kFilmedFrames));
  EXPECT_EQ(found.observations.rejected.size(), static_cast<std::size_t>(kFilmedFrames));
}

TEST_F(Detect, NoMarkerIsAnAnswerToo) {
  for (GreyImage& image : frames_) std::ranges::fill(image.pixels, std::uint8_t{128});
  const Detection found = detect_tags(image_folder(), markers_);
  EXPECT_EQ(found.observations.times_s.size(), static_cast<std::size_t>(kFilmedFrames));
  EXPECT_TRUE(found.observations.observations.empty());
}

TEST_F(Detect, RefusesWhatCannotBeRead) {
  EXPECT_THROW((void)detect_tags(folder_ / "absent.mp4", markers_), Error);
  markers_.family = "tag0h0";
  EXPECT_THROW((void)detect_tags(image_folder(), markers_), Error);
}

}  // namespace
}  // namespace kinescope
