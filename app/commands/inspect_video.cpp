// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands/inspection.h"
#include "app/explain/families_in_video.h"
#include "app/explain/recording_advice.h"
#include "calib/camera/camera_file.h"
#include "calib/vision/double_ids.h"
#include "calib/vision/sightings.h"
#include "calib/vision/tag_detector.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr int kFramesSearched = 20;
constexpr int kFramesDecoded = 900;  ///< 30 s at 30 Hz, a second or two of work

/// What the searched frames showed of one marker.
struct Sightings {
  MarkerEdges edges;
  int frames = 0;
  int doubled = 0;  ///< frames in which it was seen in two places
};

void add_frame(std::map<TagId, Sightings>& seen, const ImageView& image,
               const std::vector<TagObservation>& tags) {
  std::map<TagId, const TagObservation*> first;
  std::set<TagId> doubled;
  for (const TagObservation& tag : tags) {
    add_edges(seen[tag.id].edges, image, tag);
    const auto [other, is_first] = first.emplace(tag.id, &tag);
    if (!is_first && !is_same_place(tag.corners_px, other->second->corners_px)) {
      doubled.insert(tag.id);
    }
  }
  for (const auto& [id, tag] : first) ++seen[id].frames;
  for (const TagId id : doubled) ++seen[id].doubled;
}

// A wrong detection here and there is put aside by `run`.
void judge_doubled(const std::map<TagId, Sightings>& seen, std::vector<Finding>& findings) {
  constexpr double kShareOfWrongOnes = 0.1;
  for (const auto& [id, sightings] : seen) {
    if (sightings.doubled < 2 || sightings.doubled < kShareOfWrongOnes * sightings.frames) continue;
    findings.push_back(
        {false, fmt::format("{} {} are in view (in {} of {} frames): remove one", kTwoMarkers,
                            id.value, sightings.doubled, sightings.frames)});
  }
}

std::vector<MarkerFacts> summarise(const std::map<TagId, Sightings>& seen,
                                   const MarkerSet& markers) {
  std::vector<MarkerFacts> out;
  out.reserve(seen.size());
  for (const auto& [id, sightings] : seen) {
    out.push_back({.id = id,
                   .size_m = markers.size_m(id),
                   .frames = sightings.frames,
                   .edge_px = median_of(sightings.edges.edges_px),
                   .contrast = median_of(sightings.edges.contrasts),
                   .blur_px = median_of(sightings.edges.blurs_px)});
  }
  return out;
}

void judge_nothing_seen(const Recording& recording, const std::vector<GreyImage>& images,
                        std::vector<Finding>& findings) {
  const std::vector<std::string> others = other_families(images, recording.markers.family);
  const std::string remedy =
      others.empty()
          ? "are they sharp, bright and wider than 20 px?"
          : fmt::format("but markers of {}: correct family in tags.yaml", fmt::join(others, ", "));
  findings.push_back(
      {true, fmt::format("no marker of family {} is seen: {}", recording.markers.family, remedy)});
}

void judge_markers(const Recording& recording, const VideoFacts& facts,
                   std::vector<Finding>& findings) {
  for (const MarkerFacts& marker : facts.markers) {
    const int id = marker.id.value;
    if (recording.markers.only_listed && !recording.markers.sizes_m.contains(marker.id)) {
      findings.push_back(
          {false, fmt::format("tag {} is seen but not listed in tags.yaml: it is left out; "
                              "add its size if it sits on the robot",
                              id)});
      continue;
    }
    for (std::string& advice :
         marker_advice(marker.id, marker.edge_px, marker.blur_px, marker.contrast))
      findings.push_back({false, std::move(advice)});
  }
  for (const auto& [id, size] : recording.markers.sizes_m) {
    if (std::ranges::find(facts.markers, id, &MarkerFacts::id) != facts.markers.end()) continue;
    findings.push_back({false, listed_but_not_seen(id, facts.frames_searched)});
  }
  if (facts.markers.size() == 1) {
    findings.push_back({false, kOneMarkerOnly});
  }
}

void judge_times(const Recording& recording, VideoFacts& facts, std::vector<Finding>& findings) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < facts.times_s.size(); ++i) {
    constexpr double kTickS = 1e-3;  // to which containers round stamps, at worst
    if (recording.log.is_joined_between(facts.times_s[i - 1], facts.times_s[i] + kTickS)) continue;
    steps.push_back(facts.times_s[i] - facts.times_s[i - 1]);
  }
  if (steps.empty()) return;
  const double step = median_of(steps);
  facts.frame_rate_hz = step > 0.0 ? 1.0 / step : 0.0;
  facts.longest_step_s = std::ranges::max(steps);
  if (step > 0.0 && facts.longest_step_s > 2.5 * step && facts.frame_rate_hz > 2.0) {
    findings.push_back(
        {false, fmt::format("frames are missing: up to {:.0f} ms between two of them, {:.0f} ms "
                            "as a rule",
                            1e3 * facts.longest_step_s, 1e3 * step)});
  }
  if (recording.log.empty()) return;
  const double begin_s = facts.times_s.front();
  const double seen_s = facts.times_s.back();
  const double end_s =
      facts.decoded_to_end ? seen_s : std::max(seen_s, begin_s + facts.info.duration_s);
  require_time_overlap(recording.log, {begin_s, end_s}, recording.video.string());
  const double common_s = std::min(end_s, recording.log.times_s.back()) -
                          std::max(begin_s, recording.log.times_s.front());
  if (end_s > begin_s && common_s < 0.8 * (end_s - begin_s)) {
    findings.push_back(
        {false, fmt::format("only {:.1f} s of the {:.1f} s of video are covered by the log",
                            common_s, end_s - begin_s)});
  }
}

}  // namespace

VideoFacts look_at_video(const Recording& recording, const Progress& progress,
                         std::vector<Finding>& findings) {
  const std::unique_ptr<VideoReader> video = open_video(recording.video);
  const std::unique_ptr<TagDetector> detector = make_tag_detector(recording.markers.family);
  VideoFacts facts;
  facts.info = video->info();
  const int expected = facts.info.frame_count > 0 ? std::min(facts.info.frame_count, kFramesDecoded)
                                                  : kFramesDecoded;
  const int every = std::max(1, expected / kFramesSearched);
  std::map<TagId, Sightings> seen;
  std::vector<GreyImage>
      kept;  // first, middle, last of those searched, for the search of other families
  while (facts.frames_decoded < kFramesDecoded) {
    std::optional<VideoFrame> frame = video->next();
    if (!frame) {
      facts.decoded_to_end = true;
      break;
    }
    facts.times_s.push_back(frame->time_s + recording.settings.video_start_s);
    if (facts.frames_decoded++ % every != 0) continue;
    report_progress(progress, "inspect", facts.frames_decoded, expected);
    add_frame(seen, frame->image.view(), detector->detect(frame->image.view()));
    if (seen.empty() && facts.frames_searched % 9 == 0) kept.push_back(std::move(frame->image));
    ++facts.frames_searched;
  }
  report_progress(progress, "inspect", expected, expected);
  for (const std::string& warning : video->warnings()) {
    // A bag's log was read from the same file.
    if (std::ranges::find(findings, warning, &Finding::text) == findings.end())
      findings.push_back({false, warning});
  }
  facts.markers = summarise(seen, recording.markers);
  judge_doubled(seen, findings);
  if (recording.camera) {
    try {
      static_cast<void>(with_image_size(*recording.camera, facts.info.width, facts.info.height,
                                        recording.camera_file.string()));
    } catch (const Error& error) {
      findings.push_back({true, error.what()});
    }
  }
  try {
    judge_times(recording, facts, findings);
  } catch (const Error& error) {
    findings.push_back({true, error.what()});
  }
  if (facts.markers.empty()) {
    judge_nothing_seen(recording, kept, findings);
  } else {
    judge_markers(recording, facts, findings);
  }
  return facts;
}

}  // namespace kinescope
