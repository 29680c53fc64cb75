// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/detect.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "calib/vision/follow_tag.h"
#include "calib/vision/frame_workers.h"
#include "calib/vision/pattern_shift.h"
#include "calib/vision/refine_corners.h"
#include "calib/vision/sightings.h"
#include "calib/vision/tag_windows.h"
#include "calib/vision/video.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

// Corners that could not be refined, px: what the detectors themselves reach on difficult markers.
constexpr double kAprilTagSigma = 0.3;
constexpr double kArucoSigma = 0.8;
// Lossy video moves edges, alike for neighbouring pixels and frames; measured on H.264 with known
// corners.
constexpr double kCompressionSigma = 0.025;
// A gap in a track is searched where sightings on both sides, or one of them, are this near.
constexpr double kGapBothSides_s = 2.5;
constexpr double kGapOneSide_s = 0.35;
constexpr double kLargeEdge = 150.0;   // px; larger markers are not lost for want of resolution
constexpr double kSeenReduced = 50.0;  // px; markers as large are followed at reduced resolution

// What one worker has of its own.
struct Searcher {
  std::unique_ptr<TagDetector> coarse;  // whole frames
  std::unique_ptr<TagDetector> fine;    // full resolution
};

class Detecting {
 public:
  Detecting(const MarkerSet& markers, const DetectOptions& options)
      : options_(options), layout_(tag_layout(markers.family)) {
    detector_sigma_ = markers.family.starts_with("DICT") ? kArucoSigma : kAprilTagSigma;
    DetectorOptions fine = options.detector;
    fine.decimate = 1.0;
    for (int i = 0; i < std::max(1, options.threads); ++i) {
      searchers_.push_back(
          {make_tag_detector(markers.family, options.detector),
           options.detector.decimate > 1.0 ? make_tag_detector(markers.family, fine) : nullptr});
    }
  }

  Detection search_frames(const std::filesystem::path& video, const Progress& progress) {
    const std::unique_ptr<VideoReader> reader = open_video(video);
    lossy_ = is_lossy(reader->info().codec);
    Detection out;
    out.observations.width = reader->info().width;
    out.observations.height = reader->info().height;
    // Pictures that were taken one by one need not follow from one another.
    const bool follows = reader->info().codec != "images";
    const int every = std::max(1, options_.full_search_every);
    out.observations.times_s = for_each_run(
        *reader, searchers_.size(), follows ? static_cast<std::size_t>(every) : 1,
        [&](std::size_t worker, const std::vector<VideoFrame>& run) {
          FrameTags found;
          for (std::size_t i = 0; i < run.size(); ++i) {
            const bool full = run[i].index % every == 0;
            found.push_back(found.empty() ? finish(search_whole(worker, run[i], full), run[i])
                                          : follow(worker, run[i], run[i - 1].image.view(), found));
          }
          return found;
        },
        tags_, progress, "finding markers");
    out.warnings = reader->warnings();
    return out;
  }

  // Once more through the video, only where a marker was lost.
  void search_gaps(const std::filesystem::path& video, const Detection& so_far,
                   const Progress& progress) {
    const std::map<int, std::vector<TagWindow>> windows = find_gaps(so_far.observations);
    if (windows.empty()) return;
    const std::unique_ptr<VideoReader> reader = open_video(video);
    FrameTags more;
    for_each_run(
        *reader, searchers_.size(), 1,
        [&](std::size_t worker, const std::vector<VideoFrame>& run) {
          const VideoFrame& frame = run.front();
          const auto found = windows.find(frame.index);
          if (found == windows.end()) return FrameTags(1);
          return FrameTags{finish(
              search_windows(*fine(worker), frame.image.view(), found->second, true), frame)};
        },
        more, progress, "searching gaps");
    for (std::size_t f = 0; f < std::min(more.size(), tags_.size()); ++f) {
      tags_[f].insert(tags_[f].end(), more[f].begin(), more[f].end());
    }
  }

  [[nodiscard]] std::vector<TagObservation> all() const {
    std::vector<TagObservation> out;
    for (const auto& frame : tags_) out.insert(out.end(), frame.begin(), frame.end());
    return out;
  }

 private:
  static bool is_lossy(const std::string& codec) {
    static const std::set<std::string> kLossless = {"images",  "rawvideo", "ffv1",   "huffyuv",
                                                    "ffvhuff", "png",      "utvideo"};
    return !kLossless.contains(codec);
  }

  TagDetector* fine(std::size_t worker) const {
    const Searcher& searcher = searchers_[worker];
    return (searcher.fine ? searcher.fine : searcher.coarse).get();
  }

  std::vector<TagObservation> search_whole(std::size_t worker, const VideoFrame& frame,
                                           bool full) const {
    return (full ? fine(worker) : searchers_[worker].coarse.get())->detect(frame.image.view());
  }

  // The markers of the frame before, each where it should be: by its edges alone where its motion
  // is known, else by a search nearby; the whole frame where one of them is not there any more.
  std::vector<TagObservation> follow(std::size_t worker, const VideoFrame& frame,
                                     const ImageView& image_before, const FrameTags& before) const {
    const std::vector<TagObservation> none;
    const std::vector<TagObservation>& before_last =
        before.size() > 1 ? before[before.size() - 2] : none;
    std::vector<TagObservation> found;
    std::vector<TagWindow> windows;
    std::vector<TagWindow> reduced;
    for (const TagObservation& tag : before.back()) {
      const TagPrediction expected = predict_tag(tag, before_last);
      if (auto followed = follow_edges(tag, expected, image_before, frame)) {
        found.push_back(std::move(*followed));
      } else if (const auto window = window_around(tag.id, expected.corners_px, expected.reach,
                                                   frame.image.width, frame.image.height)) {
        (window->edge < kSeenReduced ? windows : reduced).push_back(*window);
      }
    }
    const ImageView image = frame.image.view();
    const auto add = [&](std::vector<TagObservation> tags) {
      std::ranges::move(finish(std::move(tags), frame), std::back_inserter(found));
    };
    add(search_windows(*fine(worker), image, windows, false));
    add(search_windows(*searchers_[worker].coarse, image, reduced, false));
    if (found.empty() || found.size() < before.back().size()) {
      std::vector<TagObservation> others = search_whole(worker, frame, false);
      std::erase_if(others, [&](const TagObservation& tag) {
        return std::ranges::any_of(found, [&](const TagObservation& known) {
          return known.id == tag.id && is_same_place(known.corners_px, tag.corners_px);
        });
      });
      add(std::move(others));
    }
    sort_detections(found);
    return found;
  }

  // Without a search; only from corners that were themselves refined and belong to all of it.
  std::optional<TagObservation> follow_edges(const TagObservation& last,
                                             const TagPrediction& expected,
                                             const ImageView& image_before,
                                             const VideoFrame& frame) const {
    if (!expected.motion_known || last.partly_hidden || !(last.sigma_px < detector_sigma_))
      return std::nullopt;
    const Corners start = as_corners(expected.corners_px);
    const Corners seen = as_corners(last.corners_px);
    const auto refined = follow_tag(frame.image.view(), start, {image_before, seen}, layout_);
    if (!refined) return std::nullopt;
    TagObservation tag = last;
    take(tag, *refined, frame);
    return tag;
  }

  // Refined corners, sigma and frame number.
  std::vector<TagObservation> finish(std::vector<TagObservation> tags,
                                     const VideoFrame& frame) const {
    for (TagObservation& tag : tags) {
      if (options_.refine_corners) {
        take(tag, refine_corners(frame.image.view(), as_corners(tag.corners_px), layout_), frame);
      } else {
        take(tag, {}, frame);
      }
    }
    return tags;
  }

  static Corners as_corners(const std::vector<Eigen::Vector2d>& corners_px) {
    Corners out;
    std::ranges::copy(corners_px, out.begin());
    return out;
  }

  void take(TagObservation& tag, const RefinedCorners& refined, const VideoFrame& frame) const {
    tag.frame = frame.index;
    tag.sigma_px = detector_sigma_;
    if (refined.status == RefineStatus::kDone) {
      std::ranges::copy(refined.corners_px, tag.corners_px.begin());
      tag.sigma_px = std::hypot(refined.sigma_px, lossy_ ? kCompressionSigma : 0.0);
    }
    tag.partly_hidden = is_partly_hidden(frame.image.view(), refined, layout_, detector_sigma_);
  }

  // Where to look again: markers that are there before or after a frame, and not in it.
  std::map<int, std::vector<TagWindow>> find_gaps(const TagObservations& so_far) const {
    std::map<TagId, std::vector<const TagObservation*>> tracks;
    for (const TagObservation& tag : so_far.observations) tracks[tag.id].push_back(&tag);
    std::map<int, std::vector<TagWindow>> out;
    const auto& times = so_far.times_s;
    for (const auto& [id, track] : tracks) {
      std::size_t next = 0;
      for (int f = 0; f < static_cast<int>(times.size()); ++f) {
        while (next < track.size() && track[next]->frame < f) ++next;
        if (next < track.size() && track[next]->frame == f) continue;
        const TagObservation* before = next > 0 ? track[next - 1] : nullptr;
        const TagObservation* after = next < track.size() ? track[next] : nullptr;
        if (const auto window = expect(id, before, after, times, f, so_far.width, so_far.height))
          out[f].push_back(*window);
      }
    }
    return out;
  }

  static std::optional<TagWindow> expect(TagId id, const TagObservation* before,
                                         const TagObservation* after,
                                         const std::vector<double>& times, int frame, int width,
                                         int height) {
    const auto time = [&](int f) { return times[static_cast<std::size_t>(f)]; };
    const double now = time(frame);
    std::vector<Eigen::Vector2d> corners;
    double reach = 0.0;  // px around the expected corners
    if (before != nullptr && after != nullptr &&
        time(after->frame) - time(before->frame) < kGapBothSides_s) {
      corners = corners_between(*before, time(before->frame), *after, time(after->frame), now);
      reach = 0.35 * corner_distance_px(before->corners_px, after->corners_px);
    } else {
      const bool follow = before != nullptr && now - time(before->frame) < kGapOneSide_s;
      const bool precede = after != nullptr && time(after->frame) - now < kGapOneSide_s;
      if (!follow && !precede) return std::nullopt;
      corners = (follow ? before : after)->corners_px;
      reach = mean_edge_px(corners);
    }
    if (mean_edge_px(corners) > kLargeEdge) return std::nullopt;
    return window_around(id, corners, reach, width, height);
  }

  DetectOptions options_;
  TagLayout layout_;
  double detector_sigma_ = kAprilTagSigma;
  bool lossy_ = true;
  std::vector<Searcher> searchers_;
  FrameTags tags_;
};

}  // namespace

Detection detect_tags(const std::filesystem::path& video, const MarkerSet& markers,
                      const DetectOptions& options, const Progress& progress) {
  Detecting detecting(markers, options);
  Detection out = detecting.search_frames(video, progress);
  if (options.fill_gaps && options.detector.decimate > 1.0) {
    Detection first = out;
    first.observations.observations = detecting.all();
    (void)sort_out_sightings(first.observations, markers, std::min(2, options.min_sightings));
    detecting.search_gaps(video, first, progress);
  }
  out.observations.observations = detecting.all();
  for (std::string& warning :
       sort_out_sightings(out.observations, markers, options.min_sightings)) {
    out.warnings.push_back(std::move(warning));
  }
  return out;
}

}  // namespace kinescope
