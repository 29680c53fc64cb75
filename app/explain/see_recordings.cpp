// SPDX-License-Identifier: Apache-2.0
#include "app/explain/see_recordings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/explain/join_recordings.h"
#include "app/explain/recording_pieces.h"
#include "calib/bundle/place_recording.h"
#include "calib/quality/predictive_score.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/vision/thinned_frames.h"
#include "kinematics/core/error.h"
#include "kinematics/log/join_logs.h"
#include "kinematics/structure/attach_marker.h"

namespace kinescope {
namespace {

// Between two recordings on the common clock, s: more than the clocks of one are apart, so that no
// frame meets the log of another.
constexpr double kApartS = 10.0;

double clearly() { return StructureOptions{}.min_log_odds; }

// Values of a tree's joints by a log: times x joints, NaN where it has none.
Eigen::MatrixXd values_by_log(const KinematicTree& tree, const JointLog& log,
                              const std::vector<double>& times_s, double ahead_s) {
  const Eigen::MatrixXd readings = resample(log, times_s, ahead_s);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(times_s.size()),
                                              static_cast<Eigen::Index>(tree.joints.size()));
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    const auto channel = log.channel(joint.channel);
    if (!channel || joint.type == JointType::kFixed) continue;
    Eigen::VectorXd sum = readings.col(*channel);
    for (const ChannelShare& share : joint.couplings)
      if (const auto other = log.channel(share.channel)) sum += share.ratio * readings.col(*other);
    out.col(static_cast<Eigen::Index>(j)) = (joint.scale * sum).array() + joint.offset;
  }
  return out;
}

std::size_t sightings_by(const LoneCamera& of) {
  return sightings_in(of.seen.observed.measurements);
}

// A marker of a recording that is taken as another one there; or a joint whose zero is.
struct Elsewhere {
  std::size_t recording = 0;
  std::optional<TagId> marker;
  std::size_t joint = 0;
  bool operator==(const Elsewhere&) const = default;
};

// All recordings together, fitted plainly.
struct Together {
  SeenTogether seen;
  std::optional<Calibration> fitted;
  PredictiveScore score;
};

bool is_clearly_better(const Together& one, const Together& other) {
  if (!one.fitted || !other.fitted) return one.fitted.has_value();
  return log_odds(one.score, other.score) > clearly();
}

// ln odds against the other; whatever was not fitted is last.
double odds_of(const Together& one, const Together& other) {
  if (!one.fitted) return -std::numeric_limits<double>::infinity();
  if (!other.fitted) return std::numeric_limits<double>::infinity();
  return log_odds(one.score, other.score);
}

// What says where a marker goes in one structure: joints before it, by channel.
using WaysOfMarkers = std::map<TagId, std::vector<std::pair<std::string, JointType>>>;

class Joiner {
 public:
  Joiner(std::vector<LoneCamera> alone, const std::vector<Recording>& given,
         const SightOptions& options)
      : alone_(std::move(alone)), given_(given), options_(options) {
    find_structures();
  }

  // Recordings as given, all sharing their markers; by the reference under which they are most
  // probable.
  [[nodiscard]] std::size_t best_reference() const {
    std::vector<std::size_t> order(alone_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, std::greater{},
                             [&](std::size_t k) { return sightings_by(alone_[k]); });
    if (is_nominal()) return order.front();
    std::erase_if(order, [&](std::size_t k) { return !is_known(k); });
    if (order.empty()) refuse_unknown();
    for (const std::size_t k : order) require_same_types(order.front(), k);
    if (all_agree(order)) return order.front();
    std::optional<Together> best;
    std::size_t reference = order.front();
    for (const std::size_t r : order) {
      Together one = together(r, {});
      if (best && !is_clearly_better(one, *best)) continue;
      best = std::move(one);
      reference = r;
    }
    return reference;
  }

  [[nodiscard]] Together together(std::size_t reference,
                                  const std::vector<Elsewhere>& elsewhere) const {
    Together out;
    std::vector<LoneCamera> alone = alone_;
    std::vector<std::vector<StuckAnew>> anew(alone.size());
    for (const Elsewhere& one : elsewhere) {
      if (!one.marker) continue;
      const TagId renamed = new_id(one.recording, *one.marker);
      rename_marker(*one.marker, renamed, alone[one.recording]);
      anew[one.recording].push_back({*one.marker, renamed});
    }
    const std::vector<double> starts_s = starts();
    const PlacedCameras placed = placed_beside(reference, alone, starts_s);
    MarkerSet markers = alone[reference].recording.markers;
    for (const LoneCamera& one : alone) {
      markers.sizes_m.insert(one.recording.markers.sizes_m.begin(),
                             one.recording.markers.sizes_m.end());
      markers.boards.insert(one.recording.markers.boards.begin(),
                            one.recording.markers.boards.end());
    }
    out.seen = join_views(std::move(alone), placed, options_);
    describe(reference, starts_s, placed, std::move(markers), anew, out.seen);
    fit(elsewhere, out);
    return out;
  }

  // Markers that sit elsewhere in a recording. Where all of them at once, and all zeros, make it no
  // more probable, none does.
  [[nodiscard]] Together with_markers_anew(std::size_t reference, Together now) const {
    std::vector<Elsewhere> known;
    for (std::size_t k = 0; k < alone_.size(); ++k) {
      if (k == reference) continue;
      const std::vector<Elsewhere> all = all_elsewhere(k, now);
      const Together anything = together(reference, joined(known, all));
      if (!is_clearly_better(anything, now)) continue;
      require_same_robot_in(reference, k, anything);
      // What does not settle even so lacks something else, which is traced.
      if (anything.fitted->status != CalibrationStatus::kConverged) continue;
      while (is_clearly_better(anything, now)) {
        std::optional<std::pair<Elsewhere, Together>> next = best_of(reference, known, all, now);
        if (!next) break;
        known.push_back(next->first);
        now = std::move(next->second);
      }
    }
    // Zeros are looked for among the effects; here they only keep markers from standing for them.
    const auto zeros = std::erase_if(known, [](const Elsewhere& one) { return !one.marker; });
    return zeros == 0 ? now : together(reference, known);
  }

  // Two that may be pieces of one recording, and as one are no less probable.
  [[nodiscard]] std::optional<std::vector<LoneCamera>> with_pieces_joined(
      std::size_t reference) const {
    std::vector<std::size_t> order(alone_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::stable_sort(order, {}, [&](std::size_t k) { return span_of(alone_[k]).first; });
    std::optional<Together> apart;
    for (std::size_t i = 0; i + 1 < order.size(); ++i) {
      const LoneCamera& first = alone_[order[i]];
      const LoneCamera& second = alone_[order[i + 1]];
      if (!may_go_on(first, second)) continue;
      if (!apart) apart = together(reference, {});
      std::vector<LoneCamera> fewer{pieces_together(first, second)};
      for (std::size_t k = 0; k < alone_.size(); ++k)
        if (k != order[i] && k != order[i + 1]) fewer.push_back(alone_[k]);
      const Joiner as_one(fewer, given_, options_);
      const Together joined = as_one.together(as_one.best_reference(), {});
      if (joined.fitted && !is_clearly_better(*apart, joined)) return fewer;
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] bool is_nominal() const {
    return std::ranges::any_of(
        alone_, [](const LoneCamera& one) { return one.recording.nominal.has_value(); });
  }

  [[nodiscard]] bool is_known(std::size_t k) const {
    return structures_[k] && (structures_[k]->status == StructureStatus::kDetermined ||
                              structures_[k]->status == StructureStatus::kAmbiguous);
  }

  void find_structures() {
    structures_.resize(alone_.size());
    starts_of_nominal_.resize(alone_.size());
    for (std::size_t k = 0; k < alone_.size(); ++k) {
      const LoneCamera& one = alone_[k];
      if (!is_nominal()) {
        structures_[k] = find_robot(one.recording, one.tracks, options_.calibrate);
        continue;
      }
      std::vector<std::string> said_later;
      Recording with_nominal = one.recording;
      with_nominal.nominal = described_together(given_).nominal;
      with_nominal.nominal_file = described_together(given_).nominal_file;
      starts_of_nominal_[k] = start_from_nominal(with_nominal, one.seen.observed, one.tracks,
                                                 one.seen.camera, said_later)
                                  .start;
    }
  }

  [[noreturn]] void refuse_unknown() const {
    const auto most = std::ranges::max_element(alone_, {}, sightings_by);
    const Structure& structure = *structures_[static_cast<std::size_t>(most - alone_.begin())];
    try {
      require_determined(structure);
    } catch (const Error& error) {
      throw undetermined(most->recording.camera_name, error.what(),
                         "one of the recordings must show all joints");
    }
    KINESCOPE_CHECK(false, "a structure that is not known is refused");
    std::abort();
  }

  // Of every channel that drives a joint of its own.
  [[nodiscard]] std::map<std::string, JointType> types_by_channel(std::size_t k) const {
    std::map<std::string, JointType> out;
    const std::vector<std::string>& channels = alone_[k].recording.log.channels;
    for (const StructureJoint& joint : structures_[k]->joints)
      if (joint.channel)
        out.emplace(channels[static_cast<std::size_t>(joint.channel->channel)], joint.type);
    return out;
  }

  // One joint that hardly moves may look like the other kind; half of them do not.
  void require_same_types(std::size_t reference, std::size_t k) const {
    const std::map<std::string, JointType> first = types_by_channel(reference);
    int common = 0;
    std::vector<std::string> other;
    for (const auto& [channel, type] : types_by_channel(k)) {
      const auto there = first.find(channel);
      if (there == first.end()) continue;
      ++common;
      if (there->second != type) other.push_back(channel);
    }
    if (other.size() < 2 || 2 * std::ssize(other) < common) return;
    throw undetermined(
        alone_[k].recording.camera_name,
        fmt::format("joints that slide there turn in {}, or the other way round ({})",
                    alone_[reference].recording.camera_name, fmt::join(other, ", ")),
        "is it a recording of the same robot?");
  }

  // With every mount and every zero its own, it fits, or it is of another robot.
  void require_same_robot_in(std::size_t reference, std::size_t k, const Together& anything) const {
    if (anything.fitted && anything.fitted->status != CalibrationStatus::kUndetermined) return;
    throw undetermined(
        alone_[k].recording.camera_name,
        fmt::format("it does not show the robot that {} shows{}",
                    alone_[reference].recording.camera_name,
                    anything.fitted ? ": " + anything.fitted->status_reason : std::string()),
        "is it a recording of the same robot, with the same channels?");
  }

  [[nodiscard]] WaysOfMarkers ways_of(std::size_t k) const {
    const Structure& structure = *structures_[k];
    std::vector<std::vector<std::pair<std::string, JointType>>> ways(structure.links.size());
    WaysOfMarkers out;
    const auto keep = [&](std::size_t link) {
      for (const TagId id : structure.links[link].markers) out[id] = ways[link];
    };
    keep(0);
    for (const StructureJoint& joint : structure.joints) {
      const auto child = static_cast<std::size_t>(joint.child_link);
      ways[child] = ways[static_cast<std::size_t>(joint.parent_link)];
      ways[child].emplace_back(
          joint.channel
              ? alone_[k].recording.log.channels[static_cast<std::size_t>(joint.channel->channel)]
              : std::string(),
          joint.type);
      keep(child);
    }
    return out;
  }

  [[nodiscard]] bool all_agree(const std::vector<std::size_t>& known) const {
    return known.size() == alone_.size() && std::ranges::all_of(known, [&](std::size_t k) {
             return ways_of(k) == ways_of(known.front()) && structures_[k]->free_markers.empty();
           });
  }

  // The smallest thousands above all ids, one for each recording.
  [[nodiscard]] TagId new_id(std::size_t recording, TagId id) const {
    constexpr int kThousand = 1000;
    int most = 0;
    for (const LoneCamera& one : alone_)
      for (const TagId seen : ids_of(one)) most = std::max(most, seen.value);
    const int step = kThousand * (most / kThousand + 1);
    return TagId{static_cast<int>(recording + 1) * step + id.value};
  }

  // What every recording's stamps are moved by: one after the other, by whole seconds.
  [[nodiscard]] std::vector<double> starts() const {
    std::vector<double> out{0.0};
    double end_s = span_of(alone_.front()).second;
    for (std::size_t k = 1; k < alone_.size(); ++k) {
      const auto [first_s, last_s] = span_of(alone_[k]);
      out.push_back(std::ceil(end_s + kApartS - first_s));
      end_s = last_s + out.back();
    }
    return out;
  }

  // Of postures there is nothing to align.
  [[nodiscard]] double ahead_of_log(std::size_t k, std::size_t reference) const {
    if (is_of_postures(alone_[k])) return 0.0;
    if (is_known(k)) return structures_[k]->time_offset_s;
    return is_known(reference) ? structures_[reference]->time_offset_s : 0.0;
  }

  [[nodiscard]] PlacedCameras placed_beside(std::size_t reference,
                                            const std::vector<LoneCamera>& alone,
                                            const std::vector<double>& starts_s) const {
    PlacedCameras out;
    out.reference = reference;
    out.places.resize(alone.size());
    const double by_reference_s = ahead_of_log(reference, reference);
    std::optional<CalibrationStart> robot;
    if (is_nominal()) {
      robot = starts_of_nominal_[reference];
    } else {
      robot = start_from_structure(*structures_[reference], alone[reference].recording,
                                   alone[reference].seen.camera);
    }
    for (std::size_t k = 0; k < alone.size(); ++k) {
      CameraPlace& place = out.places[k].emplace();
      place.ahead_s = starts_s[k] + (ahead_of_log(k, reference) - by_reference_s);
      place.clock_known = true;
      if (k == reference) continue;
      const Pose T_camera_base = is_nominal() ? starts_of_nominal_[k]->T_camera_base
                                              : base_seen_by(alone[k], k, reference, *robot);
      place.T_reference_camera = robot->T_camera_base * T_camera_base.inverse();
    }
    return out;
  }

  [[nodiscard]] Pose base_seen_by(const LoneCamera& one, std::size_t k, std::size_t reference,
                                  const CalibrationStart& robot) const {
    const Eigen::MatrixXd values = values_by_log(robot.tree, one.recording.log, one.tracks.times_s,
                                                 ahead_of_log(k, reference));
    try {
      return place_recording(robot.tree, values, one.tracks).T_camera_base;
    } catch (const Error& error) {
      if (error.code() != ExitCode::kUndetermined) throw;
      throw undetermined(
          one.recording.camera_name,
          fmt::format("it shows too little of the robot that {} shows to be placed beside it",
                      alone_[reference].recording.camera_name),
          "leave the markers where they are between recordings, or move the joints before them");
    }
  }

  void describe(std::size_t reference, const std::vector<double>& starts_s,
                const PlacedCameras& placed, MarkerSet markers,
                std::vector<std::vector<StuckAnew>>& anew, SeenTogether& seen) const {
    const Recording whole = described_together(given_);
    std::vector<Recording> pieces;
    for (const LoneCamera& one : alone_) pieces.push_back(one.recording);
    Recording& out = seen.recording;
    out.log = logs_together(pieces, starts_s);
    out.markers = std::move(markers);
    out.nominal = whole.nominal;
    out.nominal_file = whole.nominal_file;
    out.name = whole.name;
    out.folder = whole.folder;
    out.files = whole.files;
    out.warnings = whole.warnings;
    out.joined = whole.joined;
    out.camera_name.clear();
    const std::string robot = whole.settings.name;
    out.settings.name = robot;
    out.settings.video_start_s += placed.places[reference]->ahead_s;
    Measurements& measurements = seen.observed.measurements;
    std::size_t c = 0;
    for (const std::size_t k : order_of_cameras(reference)) {
      ObservedCamera& camera = seen.observed.cameras[c++];
      camera.log_ahead_s = starts_s[k];
      camera.anew = anew[k];
      measurements.starts_s.push_back(placed.places[k]->ahead_s);
      if (!out.settings.gravity && pieces[k].settings.gravity)
        out.settings.gravity = camera.T_reference_camera.rotation * *pieces[k].settings.gravity;
      for (const std::string& warning : alone_[k].seen.observed.warnings)
        seen.observed.warnings.push_back(
            fmt::format("{}: {}", alone_[k].recording.camera_name, warning));
    }
  }

  // As join_views() has them.
  [[nodiscard]] std::vector<std::size_t> order_of_cameras(std::size_t reference) const {
    std::vector<std::size_t> out{reference};
    for (std::size_t k = 0; k < alone_.size(); ++k)
      if (k != reference) out.push_back(k);
    return out;
  }

  [[nodiscard]] CalibrateOptions calibrate_options(const SeenTogether& seen) const {
    CalibrateOptions out = options_.calibrate;
    out.estimate_intrinsics = options_.estimate_intrinsics || !seen.recording.camera;
    out.free = options_.free.value_or(FreeGeometry::kGeometry);
    return out;
  }

  [[nodiscard]] CalibrationStart start_of(const SeenTogether& seen) const {
    if (is_nominal()) {
      std::vector<std::string> said_later;
      return start_from_nominal(seen.recording, seen.observed, seen.tracks, seen.camera, said_later)
          .start;
    }
    const auto reference =
        std::ranges::find(alone_, seen.observed.cameras.front().name,
                          [](const LoneCamera& one) { return one.recording.camera_name; });
    const Structure& found = *structures_[static_cast<std::size_t>(reference - alone_.begin())];
    // Channels are numbered as in the common log.
    Structure structure = found;
    for (StructureJoint& joint : structure.joints) {
      if (joint.channel) renumber(*joint.channel, reference->recording.log, seen.recording.log);
      for (ChannelTerm& term : joint.couplings)
        renumber(term, reference->recording.log, seen.recording.log);
    }
    structure = with_further_markers(std::move(structure), seen.recording, seen.observed,
                                     seen.tracks, seen.camera);
    CalibrationStart out = start_from_structure(structure, seen.recording, seen.camera);
    add_further_cameras(seen.observed, out);
    return out;
  }

  static void renumber(ChannelTerm& term, const JointLog& from, const JointLog& to) {
    const auto channel = to.channel(from.channels[static_cast<std::size_t>(term.channel)]);
    KINESCOPE_CHECK(channel.has_value(), "all logs have the same channels");
    term.channel = *channel;
  }

  void fit(const std::vector<Elsewhere>& elsewhere, Together& out) const {
    try {
      CalibrationStart start = start_of(out.seen);
      for (const Elsewhere& one : elsewhere)
        if (!one.marker && one.joint < start.tree.joints.size())
          start.corrections.push_back(zero_of(one, start.tree, out.seen));
      out.fitted = calibrate(out.seen.observed.measurements, out.seen.recording.markers,
                             out.seen.recording.log, start, calibrate_options(out.seen));
      out.score = predictive_score(*out.fitted, out.seen.observed.measurements);
    } catch (const Error& error) {
      if (error.code() != ExitCode::kUndetermined) throw;
    }
  }

  [[nodiscard]] Correction zero_of(const Elsewhere& one, const KinematicTree& tree,
                                   const SeenTogether& seen) const {
    const Joint& joint = tree.joints[one.joint];
    const bool turns = joint.type == JointType::kRevolute;
    Correction out;
    out.name = joint.name + " recording zero";
    out.block = joint.name;
    out.unit = turns ? "rad" : "m";
    out.index = static_cast<int>(one.joint);
    (turns ? out.direction.head<3>() : out.direction.tail<3>()) = joint.axis;
    const auto camera = std::ranges::find(
        seen.observed.cameras, alone_[one.recording].recording.camera_name, &ObservedCamera::name);
    const std::vector<int>& cameras = seen.observed.measurements.camera_of_frame;
    out.share = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(cameras.size()));
    for (std::size_t f = 0; f < cameras.size(); ++f)
      if (cameras[f] == camera - seen.observed.cameras.begin())
        out.share[static_cast<Eigen::Index>(f)] = 1.0;
    return out;
  }

  // Zeros first: they are plainer.
  [[nodiscard]] std::vector<Elsewhere> all_elsewhere(std::size_t k, const Together& now) const {
    std::vector<Elsewhere> out;
    if (now.fitted) {
      const KinematicTree& tree = now.fitted->tree;
      for (std::size_t j = 0; j < tree.joints.size(); ++j)
        if (is_movable(tree.joints[j]) && !tree.joints[j].channel.empty())
          out.push_back({k, std::nullopt, j});
    }
    std::set<TagId> others;
    for (std::size_t o = 0; o < alone_.size(); ++o)
      if (o != k) others.merge(ids_of(alone_[o]));
    for (const TagId id : ids_of(alone_[k]))
      if (others.contains(id)) out.push_back({k, id, 0});
    return out;
  }

  static std::vector<Elsewhere> joined(std::vector<Elsewhere> known,
                                       const std::vector<Elsewhere>& more) {
    for (const Elsewhere& one : more)
      if (std::ranges::find(known, one) == known.end()) known.push_back(one);
    return known;
  }

  // The one thing more that makes all recordings most probable; nothing where none does clearly. A
  // zero is taken before a marker that is as likely.
  [[nodiscard]] std::optional<std::pair<Elsewhere, Together>> best_of(
      std::size_t reference, const std::vector<Elsewhere>& known, const std::vector<Elsewhere>& all,
      const Together& now) const {
    std::optional<std::pair<Elsewhere, Together>> best;
    for (const Elsewhere& one : all) {
      if (std::ranges::find(known, one) != known.end()) continue;
      Together with = together(reference, joined(known, {one}));
      if (!is_clearly_better(with, now)) continue;
      if (best) {
        const bool is_less_plain = one.marker.has_value() && !best->first.marker;
        const double odds = odds_of(with, best->second);
        if (odds <= (is_less_plain ? clearly() : 0.0)) continue;
      }
      best.emplace(one, std::move(with));
    }
    return best;
  }

  const std::vector<LoneCamera> alone_;
  const std::vector<Recording>& given_;
  const SightOptions& options_;
  std::vector<std::optional<Structure>> structures_;  // none: a nominal robot was given
  std::vector<std::optional<CalibrationStart>> starts_of_nominal_;
};

void say_what_was_decided(SeenTogether& seen) {
  std::vector<std::string>& warnings = seen.observed.warnings;
  for (const ObservedCamera& camera : seen.observed.cameras) {
    for (const StuckAnew& anew : camera.anew)
      warnings.push_back(fmt::format("tag_{} was stuck on anew in {}: there it is tag_{}",
                                     anew.id.value, camera.name, anew.renamed.value));
  }
}

// All of them are pieces of one.
SeenTogether as_one_recording(LoneCamera one, const std::vector<Recording>& given) {
  const Recording whole = described_together(given);
  Recording recording = one.recording;
  recording.name = whole.name;
  recording.folder = whole.folder;
  recording.files = whole.files;
  recording.warnings = whole.warnings;
  recording.settings.name = whole.settings.name;
  recording.camera_name.clear();
  recording.log.torque_columns.clear();
  return {std::move(one.seen.observed), one.seen.camera, std::move(one.tracks),
          std::move(recording)};
}

// So many recordings are thinned as one film of their length is.
void leave_out_neighbours(std::vector<LoneCamera>& alone) {
  std::size_t corners = 0;
  for (const LoneCamera& one : alone) corners += corners_of(one.seen.observed.tags);
  for (LoneCamera& one : alone)
    leave_out_neighbours(one.recording, thinning_of(corners), one.seen.observed);
}

}  // namespace

SeenTogether see_recordings(const std::vector<Recording>& given, const SightOptions& options,
                            const std::function<SeenAlone(const Recording&)>& see_alone) {
  std::vector<LoneCamera> alone;
  for (const Recording& recording : given)
    alone.push_back(LoneCamera{recording, see_alone(recording), {}});
  leave_out_neighbours(alone);
  std::vector<TagObservations> detected;
  for (LoneCamera& one : alone) {
    const Observed& observed = one.seen.observed;
    one.tracks = observed.tags.observations.empty()
                     ? observed.measurements.poses
                     : pose_tracks_from_tags(observed.tags, one.seen.camera, one.recording.markers);
    detected.push_back(all_tags(observed));
  }
  require_one_kind(alone);
  std::vector<std::string> pieces;
  SeenTogether out;
  while (true) {
    const Joiner joiner(alone, given, options);
    const std::size_t reference = joiner.best_reference();
    if (auto fewer = joiner.with_pieces_joined(reference)) {
      alone = *std::move(fewer);
      pieces.push_back(
          fmt::format("{}: pieces of one recording", alone.front().recording.camera_name));
      if (alone.size() > 1) continue;
      out = as_one_recording(std::move(alone.front()), given);
    } else {
      out = joiner.with_markers_anew(reference, joiner.together(reference, {})).seen;
    }
    break;
  }
  say_what_was_decided(out);
  out.observed.warnings.insert(out.observed.warnings.end(), pieces.begin(), pieces.end());
  out.detected = std::move(detected);
  return out;
}

Structure with_further_markers(Structure structure, const Recording& recording,
                               const Observed& observed, const PoseTracks& tracks,
                               const CameraModel& camera) {
  if (observed.measurements.starts_s.empty()) return structure;
  const CalibrationStart start = start_from_structure(structure, recording, camera);
  const Eigen::MatrixXd values =
      values_by_log(start.tree, recording.log, tracks.times_s, start.time_offset_s);
  for (const PoseTrack& track : tracks.tracks) {
    const bool free =
        std::ranges::find(structure.free_markers, track.id) != structure.free_markers.end();
    if (start.tree.marker(track.id) != nullptr || free) continue;
    const auto marker = placed_marker(start.tree, values, track, start.T_camera_base);
    if (!marker) continue;
    const Pose T_link_marker = marker->link.value == 0 ? start.T_camera_base * marker->T_link_marker
                                                       : marker->T_link_marker;
    structure = with_marker_on(std::move(structure), track.id, marker->link.value, T_link_marker);
  }
  return structure;
}

PoseTracks placed_again(PoseTracks tracks, const Observed& observed,
                        const Calibration& calibration) {
  if (!calibration.of_recordings()) return tracks;
  std::vector<Pose> T_again_before;
  for (std::size_t c = 0; c < calibration.cameras(); ++c)
    T_again_before.push_back(calibration.T_camera_base * calibration.T_camera_base_of(c).inverse() *
                             observed.cameras[c].T_reference_camera.inverse());
  for (PoseTrack& track : tracks.tracks) {
    for (PoseSample& sample : track.samples) {
      const Pose& T = T_again_before[calibration.camera_at(sample.frame)];
      sample.T_camera_marker = T * sample.T_camera_marker;
      if (sample.T_camera_marker_alternative)
        sample.T_camera_marker_alternative = T * *sample.T_camera_marker_alternative;
    }
  }
  return tracks;
}

}  // namespace kinescope
