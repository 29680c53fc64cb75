// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/detect.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <span>

#include <fmt/format.h>

#include "calib/vision/find_tone.h"
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
constexpr std::size_t kMostWaitingBytes = 512U << 20U;  // frames that wait for what later ones tell
constexpr std::size_t kRunsTogether = 6;  // runs of frames read between two gap searches
constexpr std::size_t kToneViews = 64;    // from which the camera's tone curve is told
// Frames of a gap: one is searched, and those beside it where it is found.
constexpr int kTryEvery = 4;
constexpr int kLookEvery = 10;  // frames: the whole of one is searched at reduced resolution
constexpr const char* kStage = "finding markers";
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
      : options_(options),
        layout_(tag_layout(markers.family)),
        every_(std::max(1, options.full_search_every)) {
    detector_sigma_ = markers.family.starts_with("DICT") ? kArucoSigma : kAprilTagSigma;
    DetectorOptions fine = options.detector;
    fine.decimate = 1.0;
    for (int i = 0; i < std::max(1, options.threads); ++i) {
      searchers_.push_back(
          {make_tag_detector(markers.family, options.detector),
           options.detector.decimate > 1.0 ? make_tag_detector(markers.family, fine) : nullptr});
    }
  }

  Detection run(const std::filesystem::path& video, const MarkerSet& markers,
                const Progress& progress) {
    const std::unique_ptr<VideoReader> reader = open_video(video);
    const VideoInfo& info = reader->info();
    lossy_ = is_lossy(info.codec);
    one_by_one_ = is_one_by_one(info);
    const std::size_t run_length = one_by_one_ ? 1 : static_cast<std::size_t>(every_);
    Detection out;
    TagObservations& found = out.observations;
    found.width = info.width;
    found.height = info.height;
    found.lens_known = options_.lens.has_value();
    std::vector<SearchedFrame> waiting;  // searched, not yet for gaps
    const std::size_t most = most_frames(info);
    const auto every = static_cast<std::size_t>(every_);
    const std::size_t block = every * std::clamp<std::size_t>(most / every, 1, kRunsTogether);
    const auto read = [&](SearchedFrame& next) {
      std::optional<VideoFrame> frame = reader->next();
      if (!frame) return false;
      next = {std::move(*frame), {}};
      report_progress(progress, kStage, next.frame.index + 1, info.frame_count);
      return true;
    };
    for (bool ended = false; !ended;) {
      const std::size_t begin = waiting.size();
      waiting.resize(begin + block);
      const std::size_t count = for_each_run(
          std::span(waiting).subspan(begin), run_length, searchers_.size(), read,
          [&](std::size_t worker, std::span<SearchedFrame> run) { search_run(worker, run); });
      ended = begin + count < waiting.size();
      waiting.resize(begin + count);
      if (options_.refine_corners && !tone_settled_)
        settle_tone(std::span(waiting).subspan(begin), markers);
      for (std::size_t i = begin; i < waiting.size(); ++i) {
        found.times_s.push_back(waiting[i].frame.time_s);
        std::ranges::copy(waiting[i].tags, std::back_inserter(found.observations));
        std::ranges::copy(waiting[i].tags, std::back_inserter(recent_));
      }
      const std::size_t due = ended ? waiting.size() : count_due(waiting, most);
      if (looks_for_gaps()) {
        search_gaps(std::span(waiting).first(due), found, markers);
        for (std::size_t i = 0; i < due; ++i) {
          std::ranges::move(waiting[i].tags, std::back_inserter(found.observations));
        }
      }
      waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(due));
    }
    out.warnings = reader->warnings();
    std::ranges::copy(tone_warnings_, std::back_inserter(out.warnings));
    // A file that ends early, or does not say how long it is.
    const int frames = static_cast<int>(found.times_s.size());
    if (frames != info.frame_count) report_progress(progress, kStage, frames, frames);
    return out;
  }

 private:
  // Pictures that were taken one by one need not follow from one another. A film kept as images is
  // followed as a film: its frames are nearer to each other than a marker is looked for behind its
  // last sighting.
  static bool is_one_by_one(const VideoInfo& info) {
    return info.codec == "images" &&
           !(info.duration_s < kGapOneSide_s * static_cast<double>(info.frame_count - 1));
  }

  static bool is_lossy(const std::string& codec) {
    static const std::set<std::string> kLossless = {"images",  "rawvideo", "ffv1",   "huffyuv",
                                                    "ffvhuff", "png",      "utvideo"};
    return !kLossless.contains(codec);
  }

  TagDetector* fine(std::size_t worker) const {
    const Searcher& searcher = searchers_[worker];
    return (searcher.fine ? searcher.fine : searcher.coarse).get();
  }

  // Consecutive frames: the first one whole, from there on the markers are followed.
  void search_run(std::size_t worker, std::span<SearchedFrame> run) const {
    for (std::size_t i = 0; i < run.size(); ++i) {
      const bool full = run[i].frame.index % every_ == 0;
      run[i].tags = i == 0 ? finish(search_whole(worker, run[i].frame, full), run[i].frame)
                           : follow(worker, run.first(i + 1));
    }
  }

  // From the first frames that show enough of the markers, which are then refined once more.
  void settle_tone(std::span<SearchedFrame> frames, const MarkerSet& markers) {
    const std::vector<ToneView> views = choose_views(frames, markers);
    if (views.size() < kFewestToneViews) return;
    tone_settled_ = true;
    const std::optional<FoundTone> found = find_tone(views, layout_);
    if (!found) return;
    if (!found->is_explained()) {
      tone_warnings_.push_back(fmt::format(
          "bright cells of the markers spread over dark ones by {:.2f} px, more than a camera's "
          "tone curve explains: markers look too small, and lengths come out too large; expose "
          "less and switch sharpening off (corners are left as they are)",
          found->shift_px));
      return;
    }
    tone_ = found->curve;
    tone_sigma_ = found->sigma_per_blur;
    tone_warnings_.push_back(fmt::format(
        "the camera's tone curve (gamma {:.2f}) moves the markers' edges by {:.2f} px: the corners "
        "are corrected for it",
        tone_.gamma(), found->shift_px));
    for_each_run(
        frames, 1, searchers_.size(), [](SearchedFrame&) { return true; },
        [&](std::size_t, std::span<SearchedFrame> run) {
          run.front().tags = finish(std::move(run.front().tags), run.front().frame);
        });
  }

  // As many of each marker, evenly over the frames.
  std::vector<ToneView> choose_views(std::span<const SearchedFrame> frames,
                                     const MarkerSet& markers) const {
    std::map<TagId, std::vector<ToneView>> seen;
    for (const SearchedFrame& searched : frames) {
      for (const TagObservation& tag : searched.tags) {
        const Corners corners = as_corners(tag.corners_px);
        if (tag.partly_hidden || !(tag.sigma_px < detector_sigma_)) continue;
        if (!shows_tone(corners, layout_)) continue;
        seen[tag.id].push_back(
            {searched.frame.image.view(), tag.id, corners, markers.size_m(tag.id)});
      }
    }
    std::vector<ToneView> out;
    for (const auto& [id, views] : seen) {
      const std::size_t most = std::max<std::size_t>(1, kToneViews / seen.size());
      const std::size_t count = std::min(most, views.size());
      for (std::size_t i = 0; i < count; ++i) out.push_back(views[i * views.size() / count]);
    }
    return out;
  }

  [[nodiscard]] bool looks_for_gaps() const {
    return options_.fill_gaps && options_.detector.decimate > 1.0;
  }

  static std::size_t most_frames(const VideoInfo& info) {
    const std::size_t pixels =
        static_cast<std::size_t>(info.width) * static_cast<std::size_t>(info.height);
    return kMostWaitingBytes / std::max<std::size_t>(1, pixels);
  }

  // The frames about which nothing more will be learned from later ones, or that are more than may
  // wait.
  [[nodiscard]] static std::size_t count_due(const std::vector<SearchedFrame>& waiting,
                                             std::size_t most) {
    if (waiting.empty()) return 0;
    const double newest = waiting.back().frame.time_s;
    const auto later = std::ranges::find_if(waiting, [&](const SearchedFrame& searched) {
      return newest - searched.frame.time_s < kGapBothSides_s;
    });
    return std::max(static_cast<std::size_t>(later - waiting.begin()),
                    waiting.size() - std::min(most, waiting.size()));
  }

  // Frames once more, only where a marker was lost; their tags are then those found so.
  void search_gaps(std::span<SearchedFrame> frames, const TagObservations& all,
                   const MarkerSet& markers) {
    if (frames.empty()) return;
    // What may tell of these frames, with frames counted from the first of them.
    const double oldest = frames.front().frame.time_s - kGapBothSides_s;
    const int own = frames.front().frame.index;
    const auto known_from = std::ranges::lower_bound(all.times_s, oldest);
    const int first = std::min(own, static_cast<int>(known_from - all.times_s.begin()));
    std::erase_if(recent_, [&](const TagObservation& tag) { return tag.frame < first; });
    TagObservations near;
    near.times_s.assign(all.times_s.begin() + first, all.times_s.end());
    near.width = all.width;
    near.height = all.height;
    near.observations = recent_;
    for (TagObservation& tag : near.observations) tag.frame -= first;
    (void)sort_out_sightings(near, markers, std::min(2, options_.min_sightings));
    for (SearchedFrame& searched : frames) searched.tags.clear();
    const int begin = own - first;
    GapWindows windows = find_gaps(near, begin, begin + static_cast<int>(frames.size()));
    for (const Brightness brightness : {Brightness::kAsSeen, Brightness::kCutOff}) {
      GapWindows tried = windows;
      std::erase_if(tried, [&](const auto& window) { return !is_tried(windows, window.first); });
      const std::set<TagAtFrame> found = search_again(frames, first, tried, brightness);
      GapWindows beside = windows;
      std::erase_if(beside, [&](const auto& window) {
        return is_tried(windows, window.first) || !is_beside(found, window.first);
      });
      const std::set<TagAtFrame> more = search_again(frames, first, beside, brightness);
      std::erase_if(windows, [&](const auto& window) {
        return found.contains(window.first) || more.contains(window.first);
      });
    }
  }

  // Frames counted from the first one of which anything is known.
  using TagAtFrame = std::pair<int, TagId>;
  using GapWindows = std::map<TagAtFrame, TagWindow>;

  // The ends of each gap, and now and then a frame: what hides a marker lasts.
  static bool is_tried(const GapWindows& windows, const TagAtFrame& at) {
    const auto [frame, id] = at;
    return frame % kTryEvery == 0 || !windows.contains({frame - 1, id}) ||
           !windows.contains({frame + 1, id});
  }

  static bool is_beside(const std::set<TagAtFrame>& found, const TagAtFrame& at) {
    for (int step = 1; step < kTryEvery; ++step) {
      if (found.contains({at.first - step, at.second}) ||
          found.contains({at.first + step, at.second})) {
        return true;
      }
    }
    return false;
  }

  // Adds what is found in `windows` (frames counted from `first`) to the frames' tags. Which.
  std::set<TagAtFrame> search_again(std::span<SearchedFrame> frames, int first,
                                    const GapWindows& windows, Brightness brightness) {
    std::map<int, std::vector<TagWindow>> by_frame;
    for (const auto& [at, window] : windows) by_frame[at.first].push_back(window);
    std::vector<std::vector<TagObservation>> found(frames.size());
    for_each_run(
        frames, 1, searchers_.size(), [](SearchedFrame&) { return true; },
        [&](std::size_t worker, std::span<SearchedFrame> run) {
          const VideoFrame& frame = run.front().frame;
          const auto of_frame = by_frame.find(frame.index - first);
          if (of_frame == by_frame.end()) return;
          found[static_cast<std::size_t>(&run.front() - frames.data())] = finish(
              search_windows(*fine(worker), frame.image.view(), of_frame->second, brightness),
              frame);
        });
    std::set<TagAtFrame> out;
    for (std::size_t i = 0; i < found.size(); ++i) {
      for (TagObservation& tag : found[i]) {
        out.emplace(tag.frame - first, tag.id);
        frames[i].tags.push_back(std::move(tag));
      }
    }
    return out;
  }

  std::vector<TagObservation> search_whole(std::size_t worker, const VideoFrame& frame,
                                           bool full) const {
    const Searcher& searcher = searchers_[worker];
    if (one_by_one_ && searcher.fine)
      return detect_with_both(*searcher.fine, *searcher.coarse, frame.image.view());
    return (full ? fine(worker) : searchers_[worker].coarse.get())->detect(frame.image.view());
  }

  // The markers of the frame before, each where it should be: by its edges alone where its motion
  // is known, else by a search nearby; the whole frame where one of them is not there any more, and
  // now and then for those that enter.
  // `run` ends with the frame to search.
  std::vector<TagObservation> follow(std::size_t worker, std::span<const SearchedFrame> run) const {
    const VideoFrame& frame = run.back().frame;
    const SearchedFrame& before = run[run.size() - 2];
    const ImageView image_before = before.frame.image.view();
    const std::vector<TagObservation> none;
    const std::vector<TagObservation>& before_last =
        run.size() > 2 ? run[run.size() - 3].tags : none;
    std::vector<TagObservation> found;
    std::vector<TagWindow> windows;
    std::vector<TagWindow> reduced;
    for (const TagObservation& tag : before.tags) {
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
    add(search_windows(*fine(worker), image, windows, Brightness::kAsSeen));
    add(search_windows(*searchers_[worker].coarse, image, reduced, Brightness::kAsSeen));
    if (found.empty() || found.size() < before.tags.size() || frame.index % kLookEvery == 0) {
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
    const auto refined =
        follow_tag(frame.image.view(), start, {image_before, seen}, layout_, tone_, lens());
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
        take(tag,
             refine_corners(frame.image.view(), as_corners(tag.corners_px), layout_, tone_, lens()),
             frame);
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
    tag.fitted = refined.status == RefineStatus::kDone;
    if (tag.fitted) {
      std::ranges::copy(refined.corners_px, tag.corners_px.begin());
      // All cells together tell the tone curve's part themselves.
      tag.sigma_px = std::hypot(refined.sigma_px, lossy_ ? kCompressionSigma : 0.0,
                                refined.by_cells ? 0.0 : tone_sigma_ * refined.blur_px);
    }
    tag.partly_hidden = is_partly_hidden(frame.image.view(), refined, layout_, detector_sigma_);
  }

  // Where to look again in frames from `begin` to `end`: markers that are there before or after a
  // frame, and not in it.
  static GapWindows find_gaps(const TagObservations& so_far, int begin, int end) {
    std::map<TagId, std::vector<const TagObservation*>> tracks;
    for (const TagObservation& tag : so_far.observations) tracks[tag.id].push_back(&tag);
    GapWindows out;
    const auto& times = so_far.times_s;
    for (const auto& [id, track] : tracks) {
      std::size_t next = 0;
      for (int f = begin; f < end; ++f) {
        while (next < track.size() && track[next]->frame < f) ++next;
        if (next < track.size() && track[next]->frame == f) continue;
        const TagObservation* before = next > 0 ? track[next - 1] : nullptr;
        const TagObservation* after = next < track.size() ? track[next] : nullptr;
        if (const auto window = expect(id, before, after, times, f, so_far.width, so_far.height))
          out.emplace(TagAtFrame{f, id}, *window);
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

  [[nodiscard]] const CameraModel* lens() const {
    return options_.lens ? &*options_.lens : nullptr;
  }

  DetectOptions options_;
  TagLayout layout_;
  double detector_sigma_ = kAprilTagSigma;
  bool lossy_ = true;
  bool one_by_one_ = false;  // pictures; nothing is known from one to the next
  ToneCurve tone_;
  double tone_sigma_ = 0.0;  // of what it leaves, px per px of blur
  bool tone_settled_ = false;
  std::vector<std::string> tone_warnings_;
  int every_;
  std::vector<Searcher> searchers_;
  std::vector<TagObservation> recent_;  // found without gaps, of frames that may tell of others
};

}  // namespace

Detection detect_tags(const std::filesystem::path& video, const MarkerSet& markers,
                      const DetectOptions& options, const Progress& progress) {
  Detecting detecting(markers, options);
  Detection out = detecting.run(video, markers, progress);
  for (std::string& warning :
       sort_out_sightings(out.observations, markers, options.min_sightings)) {
    out.warnings.push_back(std::move(warning));
  }
  put_unfitted_aside(out.observations);
  return out;
}

}  // namespace kinescope
