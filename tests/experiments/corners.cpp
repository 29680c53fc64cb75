// SPDX-License-Identifier: Apache-2.0
//
// How exact corners are, on pictures with exactly known ones: `corners [--trials N]`. A row is a
// size of markers under one kind of picture: contrast 200, tilts to 55 degrees. The packaged
// detector (its default, half resolution) and ours (full resolution, refined corners; the lens
// declared, or with --undeclared not) see the same pictures. 2-D RMS of a corner and its mean pull
// outward, px; the Cramér-Rao floor of the border's four lines, sigma = 2 / sqrt(I L), I = A^2 / (2
// sqrt(pi) b s^2), with the lines of these very tags; and the share of corners inside the 95 %
// ellipse of the sigma that is given with them.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "calib/vision/detect.h"
#include "calib/vision/find_tone.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/tag_detector.h"
#include "calib/vision/video.h"
#include "tests/experiments/command_line.h"
#include "tests/truth/h264_writer.h"
#include "tests/truth/render.h"
#include "tests/truth/temporary_path.h"

namespace kinescope {
namespace {

constexpr double kSquare95 = 5.991;  // of chi square with two degrees of freedom
constexpr double kSame = 3.0;        // px between a tag that is seen and the one that is there
constexpr double kFrameRate_hz = 30.0;
constexpr double kPixelBlur = 1.0 / 12.0;  // px^2, of a pixel's own integration

constexpr std::size_t kToneViews = 64;

enum class Codec { kNone, kJpeg, kH264 };

struct Row {
  std::string name;
  double side_px = 60.0;
  ImageOptions image;
  double motion_px = 0.0;  ///< in a random direction
  double k1 = 0.0;         ///< of the lens, with the axis far away
  Codec codec = Codec::kNone;
  int quality = 0;  ///< of JPEG, or crf of H.264
  std::string family = "tag36h11";
};

/// One picture.
struct Scene {
  CameraModel camera;
  GreyImage image;
  Corners truth;
  double floor_square = 0.0;  ///< px^2, sum over the corners of the least 2-D variance
};

struct Tally {
  int tags = 0;
  double square = 0.0;
  double outward = 0.0;
  int inside = 0;  ///< corners in their ellipse
  double sigma = 0.0;

  void add(const Corners& found, const Corners& truth, double sigma_px) {
    const Eigen::Vector2d middle = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d error = found[i] - truth[i];
      square += error.squaredNorm();
      outward += error.dot((truth[i] - middle).normalized());
      inside += error.squaredNorm() < kSquare95 * sigma_px * sigma_px ? 1 : 0;
    }
    sigma += sigma_px;
    ++tags;
  }
  [[nodiscard]] double rms() const { return std::sqrt(square / (4.0 * tags)); }
  [[nodiscard]] double bias() const { return outward / (4.0 * tags); }
};

// Sum over the corners of the variance that four fitted lines leave at least.
double floor_square(const Corners& corners, const Row& row, const Eigen::Vector2d& motion) {
  const auto developed = [&](double light) {
    return 255.0 * std::pow(light / 255.0, 1.0 / row.image.gamma);
  };
  const double contrast = developed(row.image.white) - developed(row.image.black);
  const double noise_square = row.image.noise * row.image.noise + 1.0 / 12.0;  // rounding
  std::array<double, 4> variance;  // of a line's offset at its ends, px^2
  std::array<Eigen::Vector2d, 4> along;
  for (std::size_t e = 0; e < 4; ++e) {
    const Eigen::Vector2d line = corners[(e + 1) % 4] - corners[e];
    along[e] = line.normalized();
    const double across = along[e].x() * motion.y() - along[e].y() * motion.x();
    const double blur =
        std::sqrt(row.image.blur_px * row.image.blur_px + kPixelBlur + across * across / 12.0);
    const double information =
        contrast * contrast / (2.0 * std::sqrt(std::numbers::pi) * blur * noise_square);
    variance[e] = 4.0 / (information * line.norm());
  }
  double sum = 0.0;
  for (std::size_t c = 0; c < 4; ++c) {
    const Eigen::Vector2d& a = along[(c + 3) % 4];
    const Eigen::Vector2d& b = along[c];
    const double sine = a.x() * b.y() - a.y() * b.x();
    sum += (variance[(c + 3) % 4] + variance[c]) / (sine * sine);
  }
  return sum;
}

// Where a marker is in a picture: drawn anew each time, or moving on from frame to frame.
struct Placement {
  double x, y, tilt, tilt_direction, turn;
};

Placement placement(const Row& row, int trial) {
  Rng rng =
      Rng::from_name("corners", row.codec == Codec::kH264 ? 0U : static_cast<unsigned>(trial));
  Placement p{rng.uniform(-5.0, 5.0), rng.uniform(-5.0, 5.0),
              rng.uniform(0.0, 55.0) * std::numbers::pi / 180.0,
              rng.uniform(0.0, 2.0 * std::numbers::pi), rng.uniform(0.0, 2.0 * std::numbers::pi)};
  if (row.codec == Codec::kH264) {
    const double t = trial / kFrameRate_hz;
    p.x = 5.0 * std::sin(2.1 * t + p.turn);
    p.y = 5.0 * std::cos(1.7 * t);
    p.tilt = 0.48 * (1.0 - std::cos(1.1 * t));
    p.tilt_direction += 0.9 * t;
    p.turn += 0.7 * t;
  }
  return p;
}

Scene make_scene(const Row& row, int trial) {
  const Placement place = placement(row, trial);
  Rng rng = Rng::from_name("corners, noise", static_cast<std::uint64_t>(trial));
  const int size = 2 * static_cast<int>(0.9 * row.side_px + 25.0);  // even: H.264
  CameraModel camera = pinhole_guess(size, size, 900.0);
  camera.distortion[0] = row.k1;
  if (row.k1 != 0.0) {  // far from the axis, where lines bend
    camera.cx -= 300.0;
    camera.cy -= 200.0;
  }
  PlacedMarker marker;
  const int id = rng.index(30);
  marker.art = row.family.starts_with("DICT") ? aruco_art(10, id) : apriltag_art(row.family, id);
  if (row.codec == Codec::kH264) marker.art = apriltag_art(row.family, 7);
  marker.T_camera_tag =
      pose_showing(camera, {0.5 * size + place.x, 0.5 * size + place.y}, row.side_px, marker.size_m,
                   place.tilt, place.tilt_direction, place.turn);
  ImageOptions image = row.image;
  const double direction = rng.uniform(0.0, 2.0 * std::numbers::pi);
  image.motion_px = row.motion_px * Eigen::Vector2d(std::cos(direction), std::sin(direction));
  Scene scene{camera, render_markers(camera, {marker}, image, rng), true_corners(camera, marker),
              0.0};
  scene.floor_square = floor_square(scene.truth, row, image.motion_px);
  return scene;
}

GreyImage through_jpeg(const GreyImage& image, int quality) {
  cv::Mat grey(image.height, image.width, CV_8U);
  std::ranges::copy(image.pixels, grey.data);
  std::vector<std::uint8_t> bytes;
  cv::imencode(".jpg", grey, bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  const cv::Mat back = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE);
  return {image.width, image.height, {back.begin<std::uint8_t>(), back.end<std::uint8_t>()}};
}

Corners corners_of(const TagObservation& tag) {
  Corners out;
  std::ranges::copy(tag.corners_px, out.begin());
  return out;
}

const TagObservation* seen(const std::vector<TagObservation>& tags, const Corners& truth) {
  const auto found = std::ranges::find_if(tags, [&](const TagObservation& tag) {
    return (corners_of(tag)[0] - truth[0]).norm() < kSame;
  });
  return found == tags.end() ? nullptr : &*found;
}

// One row's sums.
class Trial {
 public:
  Trial(const Row& row, bool declared)
      : row_(row),
        declared_(declared),
        packaged_(make_tag_detector(row.family, {.decimate = 2.0, .min_margin = 0.0})),
        search_(make_tag_detector(row.family)),
        layout_(tag_layout(row.family)) {}

  // As if they were one recording, with one tone curve.
  void pictures(int trials) {
    std::vector<Scene> scenes;
    std::vector<ToneView> views;
    for (int trial = 0; trial < trials; ++trial) {
      scenes.push_back(make_scene(row_, trial));
      Scene& scene = scenes.back();
      if (row_.codec == Codec::kJpeg) scene.image = through_jpeg(scene.image, row_.quality);
      judge_packaged(scene.image, scene);
      const std::vector<TagObservation> tags = search_->detect(scene.image.view());
      if (const TagObservation* tag = seen(tags, scene.truth); tag != nullptr)
        starts_.emplace_back(trial, *tag);
    }
    found_ = static_cast<int>(starts_.size());
    for (const auto& [trial, tag] : starts_) {
      const ImageView image = scenes[static_cast<std::size_t>(trial)].image.view();
      const RefinedCorners refined = refine_border(image, corners_of(tag), layout_);
      if (views.size() < kToneViews && refined.status == RefineStatus::kDone &&
          shows_tone(refined.corners_px, layout_))
        views.push_back({image, tag.id, refined.corners_px, PlacedMarker{}.size_m});
    }
    if (const std::optional<FoundTone> tone = find_tone(views, layout_)) tone_ = *tone;
    for (const auto& [trial, tag] : starts_) {
      const Scene& scene = scenes[static_cast<std::size_t>(trial)];
      const RefinedCorners refined =
          refine_corners(scene.image.view(), corners_of(tag), layout_, tone_.curve,
                         declared_ ? &scene.camera : nullptr);
      if (refined.status != RefineStatus::kDone) continue;
      const double left = tone_.is_explained() ? tone_.sigma_per_blur * refined.blur_px : 0.0;
      ours_.add(refined.corners_px, scene.truth, std::hypot(refined.sigma_px, left));
    }
  }

  // A marker that moves, through the whole of detect_tags.
  void video(int frames) {
    const std::filesystem::path file = truth::temporary_path("corners.mp4");
    std::vector<Scene> scenes;
    for (int f = 0; f < frames; ++f) scenes.push_back(make_scene(row_, f));
    truth::H264Writer writer(file, scenes.front().image.width, scenes.front().image.height,
                             kFrameRate_hz, row_.quality);
    for (const Scene& scene : scenes) writer.add(scene.image.pixels);
    writer.finish();
    const std::unique_ptr<VideoReader> reader = open_video(file);
    while (const auto frame = reader->next())
      judge_packaged(frame->image, scenes.at(static_cast<std::size_t>(frame->index)));
    MarkerSet markers;
    markers.family = row_.family;
    markers.default_size_m = PlacedMarker{}.size_m;
    DetectOptions options;
    if (declared_) options.lens = scenes.front().camera;
    for (const TagObservation& tag :
         detect_tags(file, markers, options).observations.observations) {
      const Corners& truth = scenes.at(static_cast<std::size_t>(tag.frame)).truth;
      if ((tag.corners_px[0] - truth[0]).norm() > kSame) continue;
      ++found_;
      ours_.add(corners_of(tag), truth, tag.sigma_px);
    }
  }

  void print() const {
    const double floor = std::sqrt(floor_ / (4.0 * count_));
    fmt::print("{:34} {:5.1f}", row_.name, 100.0 * packaged_sum_.tags / count_);
    if (packaged_sum_.tags > 0) {
      fmt::print(" {:7.4f} {:+8.4f}", packaged_sum_.rms(), packaged_sum_.bias());
    } else {
      fmt::print(" {:>7} {:>8}", "-", "-");
    }
    if (ours_.tags == 0) {
      fmt::print(" | none\n");
      std::fflush(stdout);
      return;
    }
    fmt::print(" | {:5.1f} {:5.1f} {:7.4f} {:+8.4f} {:7.4f} {:5.1f} {:7.4f} {:6.1f} {:5.2f}\n",
               100.0 * found_ / count_, 100.0 * ours_.tags / count_, ours_.rms(), ours_.bias(),
               floor, ours_.rms() / floor, ours_.sigma / ours_.tags * std::numbers::sqrt2,
               100.0 * ours_.inside / (4.0 * ours_.tags), tone_.curve.gamma());
    std::fflush(stdout);
  }

 private:
  void judge_packaged(const GreyImage& image, const Scene& scene) {
    ++count_;
    floor_ += scene.floor_square;
    const std::vector<TagObservation> tags = packaged_->detect(image.view());
    const TagObservation* tag = seen(tags, scene.truth);
    if (tag != nullptr) packaged_sum_.add(corners_of(*tag), scene.truth, 0.0);
  }

  const Row& row_;
  bool declared_;
  std::unique_ptr<TagDetector> packaged_;
  std::unique_ptr<TagDetector> search_;
  TagLayout layout_;
  std::vector<std::pair<int, TagObservation>> starts_;  // by picture
  FoundTone tone_;
  int count_ = 0;
  int found_ = 0;
  double floor_ = 0.0;
  Tally packaged_sum_;
  Tally ours_;
};

const ImageOptions kPicture{.blur_px = 0.7, .noise = 2.0, .supersample = 4};

std::vector<Row> all_rows() {
  std::vector<Row> rows;
  for (const auto& [noise, blur] : {std::pair{2.0, 0.7}, std::pair{5.0, 1.0}}) {
    for (const double side : {16.0, 20.0, 24.0, 30.0, 40.0, 60.0, 80.0, 120.0}) {
      Row row{.name = fmt::format("{:.0f} px, noise {:.0f}, blur {:.1f}", side, noise, blur),
              .side_px = side,
              .image = kPicture};
      row.image.noise = noise;
      row.image.blur_px = blur;
      rows.push_back(row);
    }
  }
  for (const double side : {30.0, 60.0}) {
    const auto add = [&](const std::string& what) -> Row& {
      rows.push_back(
          {.name = fmt::format("{:.0f} px, {}", side, what), .side_px = side, .image = kPicture});
      return rows.back();
    };
    add("motion 1 px").motion_px = 1.0;
    add("motion 2 px").motion_px = 2.0;
    add("motion 4 px").motion_px = 4.0;
    for (const double gamma : {1.5, 1.8, 2.2}) {
      add(fmt::format("gamma {:.1f}", gamma)).image.gamma = gamma;
      for (const double blur : {0.4, 1.2}) {
        ImageOptions& image = add(fmt::format("gamma {:.1f}, blur {:.1f}", gamma, blur)).image;
        image.gamma = gamma;
        image.blur_px = blur;
      }
      ImageOptions& noisy = add(fmt::format("gamma {:.1f}, noise 5", gamma)).image;
      noisy.gamma = gamma;
      noisy.noise = 5.0;
      Row& compressed = add(fmt::format("gamma {:.1f}, JPEG 80", gamma));
      compressed.image.gamma = gamma;
      compressed.codec = Codec::kJpeg;
      compressed.quality = 80;
      Row& video = add(fmt::format("gamma {:.1f}, H.264 crf 23", gamma));
      video.image.gamma = gamma;
      video.codec = Codec::kH264;
      video.quality = 23;
    }
    add("vignetting 0.5").image.vignetting = 0.5;
    add("lens, k1 -0.25").k1 = -0.25;
    for (const int quality : {95, 80}) {
      Row& row = add(fmt::format("JPEG {}", quality));
      row.codec = Codec::kJpeg;
      row.quality = quality;
    }
    for (const int crf : {18, 23, 28}) {
      Row& row = add(fmt::format("H.264 crf {}", crf));
      row.codec = Codec::kH264;
      row.quality = crf;
    }
    for (const char* family : {"tag25h9", "tagStandard41h12", "tagCircle21h7", "DICT_6X6_250"})
      add(family).family = family;
  }
  return rows;
}

void run(int trials, const std::string& only, bool declared) {
  fmt::print("{:34} packaged detector      | ours\n", "");
  fmt::print("{:34} {:>5} {:>7} {:>8} | {:>5} {:>5} {:>7} {:>8} {:>7} {:>5} {:>7} {:>6} {:>5}\n",
             "picture", "found", "rms", "outward", "found", "fit", "rms", "outward", "floor",
             "ratio", "sigma", "in 95%", "gamma");
  for (const Row& row : all_rows()) {
    if (!(row.name.find(only) != std::string::npos)) continue;
    Trial trial(row, declared);
    const int count = std::max(10, static_cast<int>(trials * std::min(1.0, 60.0 / row.side_px)));
    if (row.codec == Codec::kH264) {
      trial.video(count);
    } else {
      trial.pictures(count);
    }
    trial.print();
  }
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  CLI::App app(
      "Corners of rendered markers, beside the packaged detector and the Cramér-Rao floor");
  int trials = 150;
  std::string only;
  bool undeclared = false;
  app.add_option("--trials", trials, "pictures a row (fewer for large markers)");
  app.add_option("--only", only, "rows whose name holds this");
  app.add_flag("--undeclared", undeclared, "without the lens: by the markers' borders alone");
  return kinescope::run_experiment(app, argc, argv,
                                   [&] { kinescope::run(trials, only, !undeclared); });
}
