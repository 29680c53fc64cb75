// SPDX-License-Identifier: Apache-2.0
#include "app/explain/explainer.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "app/explain/doubted_sight.h"
#include "app/explain/fit_nominal.h"
#include "app/explain/moving_camera.h"
#include "app/explain/see_cameras.h"
#include "app/explain/see_recordings.h"
#include "calib/bundle/undone.h"
#include "calib/quality/carrying_link.h"
#include "calib/quality/predictive_score.h"
#include "calib/quality/unknown_axes.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "calib/tracks/several_cameras.h"
#include "calib/tracks/shown_shapes.h"
#include "kinematics/structure/attach_marker.h"
#include "kinematics/structure/resting_base.h"
#include "kinematics/structure/resting_joint.h"
#include "kinematics/structure/slight_turn.h"

namespace kinescope {
namespace {

// Every link as the joints on its way, types and channels, and its markers: as a value that
// compares.
using Way = std::vector<std::pair<JointType, int>>;
using Shape = std::set<std::pair<Way, std::vector<TagId>>>;

Shape shape_of(const Structure& structure) {
  std::vector<Way> ways(structure.links.size());
  Shape out;
  out.emplace(ways.front(), structure.links.front().markers);
  for (const StructureJoint& joint : structure.joints) {
    const auto child = static_cast<std::size_t>(joint.child_link);
    ways[child] = ways[static_cast<std::size_t>(joint.parent_link)];
    ways[child].emplace_back(joint.type, joint.channel ? joint.channel->channel : -1);
    out.emplace(ways[child], structure.links[child].markers);
  }
  return out;
}

bool has_model_doubt(const Structure& structure) {
  return std::ranges::any_of(structure.doubts, &StructureDoubt::of_model);
}

bool is_converged(const Calibration& of) { return of.status == CalibrationStatus::kConverged; }

/// No axis is known of a joint too many that nothing but noise drives (`undeclared`, 11083).
bool are_axes_known(const Explanation& of) {
  return !of.fitted || unknown_axes(of.fitted->calibration).empty();
}

/// By its scale, which then says nothing of a joint that channel drives.
bool has_joint_at_rest(const Calibration& of) {
  for (std::size_t j = 0; j < of.joints.size(); ++j) {
    const auto sigma = of.joints[j].scale_sigma;
    if (!sigma || of.tree.joints[j].channel.empty()) continue;
    const double z = of.tree.joints[j].scale / *sigma;
    if (0.5 * z * z < StructureOptions{}.min_log_odds) return true;
  }
  return false;
}

bool is_structure_clear(const Explanation& of) {
  return !of.structure || (of.structure->status == StructureStatus::kDetermined &&
                           !has_model_doubt(*of.structure) && are_axes_known(of));
}

/// Certain of itself, and a fit of its parameters settled.
bool is_structure_sound(const Explanation& of) {
  return is_structure_clear(of) && (!of.fitted || is_converged(of.fitted->calibration));
}

bool is_all_explained(const Trace& trace) {
  return trace.verdict != TraceVerdict::kUnknown && trace.verdict != TraceVerdict::kNothingToSay;
}

/// A fit of the whole that leaves nothing.
bool is_explained(const Explanation& of) {
  return of.fitted && is_converged(of.fitted->calibration) &&
         (of.fitted->trace.verdict == TraceVerdict::kNotRun || is_all_explained(of.fitted->trace));
}

/// What was found is large beside the noise: tracks with it in them may have bent the structure,
/// however certain that was of itself.
bool is_bent(const TracedCalibration& fitted) {
  constexpr double kBent = 3.0;  // times the noise
  return !fitted.effects.empty() &&
         fitted.trace.held_out_before.value > kBent * fitted.trace.held_out_after.value;
}

/// What it takes for an account: joints, the motion of those that no channel tells, and effects.
std::size_t parts_of(const Explanation& of) {
  const auto told_by_none = static_cast<std::size_t>(
      std::ranges::count(of.start.tree.joints, std::string(), &Joint::channel));
  return of.start.tree.joints.size() + told_by_none + of.fitted->trace.accepted.size();
}

/// A structure, and effects to begin with beside it.
struct Proposal {
  Structure structure;
  TraceStart begin = {};
};

/// Structures that were fitted, each with the effects to begin with.
using Tried = std::set<std::pair<Shape, std::vector<EffectId>>>;

std::pair<Shape, std::vector<EffectId>> tried_as(const Structure& structure,
                                                 const TraceStart& begin) {
  std::pair<Shape, std::vector<EffectId>> out{shape_of(structure), {}};
  for (const AddedEffect& effect : begin.known) out.second.push_back(effect.id);
  return out;
}

class Explainer {
 public:
  /// `evidence` must outlive it.
  Explainer(const Evidence& evidence, ExplainOptions options,
            std::optional<Structure> believed = {})
      : evidence_(evidence), options_(std::move(options)), believed_(std::move(believed)) {}

  [[nodiscard]] Explanation explained(std::vector<std::string>& warnings) const {
    if (recording().nominal) return of_nominal(warnings);
    Structure believed = believed_structure();
    Explanation first = plainly_fitted(believed);
    ExplainOptions options = options_;
    if (first.fitted && options.calibrate.fold_of_frame.empty())
      options.calibrate.fold_of_frame = folds_of(first.fitted->calibration);
    return Explainer(evidence_, std::move(options), std::move(believed))
        .best_beside(std::move(first));
  }

  [[nodiscard]] Explanation plainly_explained() const {
    try {
      return plainly_fitted(believed_structure());
    } catch (const Error& error) {
      Explanation out = begun();
      keep_if_undetermined(error, out);
      return out;
    }
  }

  [[nodiscard]] std::optional<Explanation> carried_over(const Explanation& of) const {
    if (!of.fitted || !of.structure) return std::nullopt;
    // What needs effects here and none there is no better for them.
    if (of.fitted->effects.empty()) return plainly_fitted(*of.structure);
    return of_structure(*of.structure, {of.fitted->trace.added});
  }

 private:
  [[nodiscard]] Structure believed_structure() const {
    if (!evidence_.structure) return structure_of(evidence_.tracks);
    return whole_of(as_robot(recording(), *evidence_.structure), evidence_.tracks);
  }

  /// `first`: a plain fit.
  [[nodiscard]] Explanation best_beside(Explanation first) const {
    Tried tried;
    Explanation now = with_rivals_judged(asked_again(begun_with(std::move(first), tried)));
    // Beside joints that no fit settles for, doubts about some of them are not worth their time.
    if (now.fitted && !is_converged(now.fitted->calibration)) now = improved(std::move(now), tried);
    now = with_base_at_rest(with_couplings_doubted(std::move(now)));
    now = with_fewer_joints(with_rivals_judged(improved(std::move(now), tried)));
    return with_free_markers_attached(std::move(now));
  }

  [[nodiscard]] Explanation begun() const {
    Explanation out;
    out.log = recording().log;
    out.tracks = evidence_.tracks;
    return out;
  }

  [[nodiscard]] Explanation of_nominal(std::vector<std::string>& warnings) const {
    Explanation out = begun();
    CheckedNominal checked = start_from_nominal(recording(), evidence_.observed, evidence_.tracks,
                                                evidence_.camera, warnings);
    lap("structure");
    out.nominal_faults = std::move(checked.faults);
    out.start = std::move(checked.start);
    NominalFit fitted = fit_nominal(
        evidence_.observed.measurements, options_.free,
        [&](FreeGeometry free) {
          Calibration plain = calibrated(out.start, free);
          lap("calibrate");
          return plain;
        },
        [&](FreeGeometry free, const Calibration& plain) {
          return closed_loop(out.start, free, plain, {});
        });
    out.fitted = std::move(fitted.best);
    out.levels = std::move(fitted.levels);
    return out;
  }

  [[nodiscard]] Calibration calibrated(const CalibrationStart& start, FreeGeometry free) const {
    CalibrateOptions options = options_.calibrate;
    options.free = free;
    return calibrate(evidence_.observed.measurements, recording().markers, recording().log, start,
                     options, options_.progress);
  }

  [[nodiscard]] TracedCalibration closed_loop(const CalibrationStart& start, FreeGeometry free,
                                              const Calibration& plain,
                                              const TraceStart& begin) const {
    if (!options_.trace) return {{}, plain, {}, {}, 0.0};
    if (options_.free && free != FreeGeometry::kGeometry) {
      TracedCalibration out{{}, plain, {}, {}, 0.0};
      out.trace.verdict = TraceVerdict::kNothingToSay;
      out.trace.reason =
          "the robot's geometry is held as declared, and its errors cannot be told from effects: "
          "trace with --free geometry";
      return out;
    }
    CalibrateOptions options = options_.calibrate;
    options.free = free;
    TracedCalibration out = trace_stage(recording(), evidence_.observed, start, plain, begin,
                                        options, options_.progress);
    lap("trace");
    return out;
  }

  [[nodiscard]] Explanation of_structure(Structure structure, const TraceStart& begin) const {
    return traced(plainly_fitted(std::move(structure)), begin);
  }

  /// A fit of the structure alone.
  [[nodiscard]] Explanation plainly_fitted(Structure structure) const {
    Explanation out = begun();
    out.structure = std::move(structure);
    try {
      require_determined(*out.structure);
      out.start = start_from_structure(*out.structure, recording(), evidence_.camera);
      add_further_cameras(evidence_.observed, out.start);
      add_moving_camera(recording(), *out.structure, evidence_.tracks, out.start);
      Calibration plain = calibrated(out.start, options_.calibrate.free);
      if (is_converged(plain) && take_usual_units(plain.tree, out.start))
        plain = calibrated(out.start, options_.calibrate.free);
      out.fitted = {{}, std::move(plain), {}, {}, 0.0};
      lap("calibrate");
    } catch (const Error& error) {
      keep_if_undetermined(error, out);
    }
    return out;
  }

  /// The robot that shows with another sight, beside that; nothing where none does.
  [[nodiscard]] std::optional<Explanation> fitted_with(const Sight& sight) const {
    std::optional<Structure> structure = proposed_structure(
        pose_tracks_from_tags(evidence_.observed.tags, sight.camera, sight.markers));
    if (!structure) return std::nullopt;
    ExplainOptions options = options_;
    options.calibrate.estimate_intrinsics |= sight.is_camera_free;
    Recording other = recording();
    other.markers = sight.markers;
    const Evidence seen{other, evidence_.observed, evidence_.tracks, sight.camera};
    return Explainer(seen, std::move(options)).plainly_fitted(*std::move(structure));
  }

  /// What a plain fit lacks, found and added.
  [[nodiscard]] Explanation traced(Explanation plain, const TraceStart& begin) const {
    if (!plain.fitted) return plain;
    try {
      close_loop(plain, begin);
    } catch (const Error& error) {
      keep_if_undetermined(error, plain);
    }
    return plain;
  }

  [[nodiscard]] Structure structure_of(const PoseTracks& tracks,
                                       std::optional<double> allowance = {}) const {
    const std::vector<int>& cameras = evidence_.observed.measurements.camera_of_frame;
    return whole_of(
        find_robot(recording(), at_common_instants(tracks, cameras), options_.calibrate, allowance),
        tracks);
  }

  [[nodiscard]] Structure whole_of(Structure robot, const PoseTracks& tracks) const {
    Structure out = with_further_markers(std::move(robot), recording(), evidence_.observed, tracks,
                                         evidence_.camera);
    lap("structure");
    return out;
  }

  // Of a part or a change of the evidence, which may lack what was declared.
  [[nodiscard]] std::optional<Structure> proposed_structure(
      const PoseTracks& tracks, std::optional<double> allowance = {}) const {
    try {
      return structure_of(tracks, allowance);
    } catch (const Error&) {
      return std::nullopt;
    }
  }

  /// Effects are looked for beside the robot that shows with what was declared; or with a camera or
  /// markers that the images themselves speak for, where that predicts unseen frames better. Tracks
  /// that a focal length of 19 % too much bends keep tracing busy for minutes, and leave it beside
  /// couplings (`undeclared`, 12006); those of a marker that is not flat hang others elsewhere
  /// (11063).
  [[nodiscard]] Explanation begun_with(Explanation first, Tried& tried) const {
    std::optional<Explanation> best;
    TraceStart begin;
    if (options_.trace) {
      for (const std::optional<Sight>& sight : contradicted_sights(first)) {
        std::optional<Explanation> with = sight ? fitted_with(*sight) : std::nullopt;
        if (!with || !with->fitted || !is_better(*with, best ? *best : first)) continue;
        begin = {sight->told_by, with->fitted->calibration};
        best = std::move(with);
      }
    }
    if (!best) {
      if (first.structure) tried.insert(tried_as(*first.structure, {}));
      return traced(std::move(first), {});
    }
    tried.insert(tried_as(*best->structure, begin));
    return of_structure(*std::move(best->structure), begin);
  }

  [[nodiscard]] std::vector<std::optional<Sight>> contradicted_sights(const Explanation& of) const {
    const Observed& observed = evidence_.observed;
    if (!observed.cameras.empty()) return {};
    std::vector<std::optional<Sight>> out = {
        with_other_sizes(recording(), observed, evidence_.tracks, evidence_.camera)};
    if (!misses_more_than_shapes(of)) return out;
    out.push_back(with_shown_camera(recording(), observed, evidence_.camera, options_.calibrate));
    out.push_back(with_other_markers(recording(), observed, evidence_.camera));
    return out;
  }

  /// Worth the second that a look at the shapes takes: more than half of what the robot misses is
  /// no noise of the corners.
  [[nodiscard]] bool misses_more_than_shapes(const Explanation& of) const {
    const TagObservations& tags = evidence_.observed.tags;
    if (tags.observations.empty()) return false;
    if (!of.fitted) return true;
    constexpr double kHalf = 2.0;
    return scale_of_corners(of.fitted->calibration) >
           kHalf * scale_of_shapes(evidence_.camera, tags, recording().markers);
  }

  /// The best of what the moves propose, one after the other until one is of one piece.
  [[nodiscard]] Explanation improved(Explanation now, Tried& tried) const {
    if (now.structure) tried.insert(tried_as(*now.structure, {}));
    for (const auto& propose :
         {&Explainer::with_slides_for_slight_turns, &Explainer::with_half_the_recording,
          &Explainer::with_errors_allowed, &Explainer::with_camera_doubted,
          &Explainer::with_all_believed}) {
      if (is_settled(now)) break;
      for (const Proposal& proposal : (this->*propose)(now)) {
        if (is_settled(now)) break;
        if (!tried.insert(tried_as(proposal.structure, proposal.begin)).second) continue;
        Explanation other = asked_again(of_structure(proposal.structure, proposal.begin));
        if (is_better(other, now)) now = std::move(other);
      }
    }
    return now;
  }

  [[nodiscard]] const Recording& recording() const { return evidence_.recording; }

  void lap(std::string_view stage) const {
    if (options_.lap) options_.lap(stage);
  }

  static void keep_if_undetermined(const Error& error, Explanation& out) {
    if (error.code() != ExitCode::kUndetermined) throw Error(error);
    out.fitted.reset();
    out.failure = error;
  }

  void close_loop(Explanation& out, const TraceStart& begin) const {
    const FreeGeometry free = options_.calibrate.free;
    out.fitted = closed_loop(out.start, free, out.fitted->calibration, begin);
    // An effect may have looked like another unit.
    if (!is_converged(out.fitted->calibration) ||
        !take_usual_units(out.fitted->calibration.tree, out.start))
      return;
    const Calibration plain = calibrated(out.start, free);
    lap("calibrate");
    out.fitted = closed_loop(out.start, free, plain, {out.fitted->trace.added});
  }

  [[nodiscard]] bool is_better(const Explanation& one, const Explanation& other) const {
    return kinescope::is_better(one, other, evidence_.observed.measurements);
  }

  [[nodiscard]] double log_odds_of(const Explanation& one, const Explanation& rival) const {
    constexpr double kMost = 1000.0;  // larger ones mean nothing: the models are not that right
    if (!rival.fitted || !is_converged(rival.fitted->calibration) || !are_axes_known(rival) ||
        has_joint_at_rest(rival.fitted->calibration))
      return kMost;
    const Measurements& measurements = evidence_.observed.measurements;
    return std::clamp(log_odds(predictive_score(one.fitted->calibration, measurements),
                               predictive_score(rival.fitted->calibration, measurements)),
                      -kMost, kMost);
  }

  [[nodiscard]] PoseTracks undone(const Calibration& calibration) const {
    const TagObservations& tags = evidence_.observed.tags;
    if (tags.observations.empty()) return with_effects_undone(calibration, evidence_.tracks);
    const MarkerSet& markers = recording().markers;
    const TagObservations undone = with_effects_undone(calibration, markers, tags);
    if (!calibration.further_cameras.empty())
      return tracks_of_cameras(undone, calibration, markers);
    return pose_tracks_from_tags(undone, calibration.camera, markers);
  }

  // The structure was searched for on tracks that the effects were in: again without them, until
  // it is the one that they were found beside.
  [[nodiscard]] Explanation asked_again(Explanation now) const {
    std::set<Shape> answers;
    while (now.fitted && now.structure && !now.fitted->effects.empty() &&
           (!is_structure_clear(now) || is_bent(*now.fitted))) {
      std::optional<Structure> again = proposed_structure(undone(now.fitted->calibration));
      if (!again) return now;
      if (shape_of(*again) == shape_of(*now.structure)) {
        now.structure = std::move(again);
        return now;
      }
      if (!answers.insert(shape_of(*again)).second) return now;
      Explanation other = of_structure(std::move(*again), {now.fitted->trace.added});
      if (!is_better(other, now)) return now;
      now = std::move(other);
    }
    return now;
  }

  // Depths of small or noisy markers err as no linear covariance says, and structures that poses
  // cannot tell apart are told by the images that the poses come from.
  [[nodiscard]] Explanation with_rivals_judged(Explanation now) const {
    if (!now.fitted || !now.structure || !is_converged(now.fitted->calibration)) return now;
    Explanation alone = now;
    alone.structure->status = StructureStatus::kDetermined;
    // Beside an account that leaves noise only, a rival can but be as good with more.
    const bool leaves_noise_only = is_settled(alone) && alone.fitted->effects.empty();
    // A joint more explains of what is left here only what it shows by itself.
    std::optional<Explanation> plain;
    if (!is_explained(now)) plain = plainly_fitted(*now.structure);
    std::vector<double> odds;
    for (const RivalStructure& rival : now.structure->rivals) {
      Explanation other = plainly_fitted(rival.structure);
      const bool has_more = rival.structure.joints.size() > now.structure->joints.size();
      if (leaves_noise_only) {
        odds.push_back(log_odds_of(alone, other));
      } else if (plain && has_more && !is_better(other, *plain)) {
        odds.push_back(log_odds_of(*plain, other));
      } else {
        odds.push_back(log_odds_of(alone, traced(std::move(other), {now.fitted->trace.added})));
      }
    }
    const auto best = std::ranges::min_element(odds);
    const bool is_exchanged = best != odds.end() && *best < 0.0;
    if (is_exchanged) {
      const auto rival = static_cast<std::size_t>(best - odds.begin());
      now = of_structure(with_rival(*now.structure, rival, recording().log), {});
      const double over_before = -*best;
      for (double& against : odds) against += over_before;
      *best = over_before;
    }
    now.structure = kinescope::with_rivals_judged(*std::move(now.structure), odds);
    return is_exchanged ? asked_again(std::move(now)) : now;
  }

  // Joints that move in proportion may be coupled; or only one of them moves as it should not.
  [[nodiscard]] Explanation with_couplings_doubted(Explanation now) const {
    if (!now.fitted || !now.structure || !options_.trace) return now;
    if (now.fitted->trace.design_comes_first) return now;
    // A ratio that no gear has is not in the fit.
    if (std::ranges::all_of(now.start.tree.joints, &std::vector<ChannelShare>::empty,
                            &Joint::couplings))
      return now;
    Structure free = *now.structure;
    for (StructureJoint& joint : free.joints) joint.couplings.clear();
    Explanation other = asked_again(of_structure(std::move(free), {}));
    return is_better(other, now) ? other : now;
  }

  // What all that is seen moves with, and no channel drives, may be the camera.
  [[nodiscard]] Explanation with_base_at_rest(Explanation now) const {
    if (!now.structure || !options_.trace) return now;
    std::optional<Structure> resting =
        kinescope::with_base_at_rest(*now.structure, recording().log);
    if (!resting) return now;
    Explanation other = asked_again(of_structure(std::move(*resting), {}));
    return is_better(other, now) ? other : now;
  }

  // Some joints are but errors of the poses, or undo another one.
  [[nodiscard]] Explanation with_fewer_joints(Explanation now) const {
    if (!now.fitted || !now.structure || !options_.trace) return now;
    const JointLog& log = recording().log;
    for (std::size_t j = now.structure->joints.size(); j-- > 0;) {
      const Structure& structure = *now.structure;
      std::optional<Structure> without = with_joint_undone(structure, j, log);
      if (!without && hardly_moves(structure.joints[j]))
        without = with_joint_at_rest(structure, j, log);
      if (!without) continue;
      Explanation other = of_structure(*std::move(without), {now.fitted->trace.added});
      if (is_better(other, now)) now = std::move(other);
    }
    return now;
  }

  // A marker that is bent, or slips on its link, moves with no joint exactly. On the link in whose
  // frame it stands most still it is part of the robot, where an effect explains the rest.
  [[nodiscard]] Explanation with_free_markers_attached(Explanation now) const {
    // One bent by 1 mm moved by 7.2 mm on the link before its own and by 7.8 mm there
    // (`undeclared`, 5146).
    constexpr std::size_t kMostLinks = 2;
    if (!now.fitted || !now.structure || !options_.trace || now.start.moving) return now;
    for (const TagId id : std::vector<TagId>(now.structure->free_markers)) {
      const auto track = std::ranges::find(evidence_.tracks.tracks, id, &PoseTrack::id);
      if (track == evidence_.tracks.tracks.end()) continue;
      std::vector<Marker> links = on_carrying_links(now.fitted->calibration, *track);
      if (links.size() > kMostLinks) links.resize(kMostLinks);
      for (const Marker& marker : links) {
        Explanation other = asked_again(
            of_structure(with_free_marker_on(*now.structure, marker, now.fitted->calibration),
                         {now.fitted->trace.added}));
        if (!is_explained(other) || !is_better(other, now)) continue;
        now = std::move(other);
        break;
      }
    }
    return now;
  }

  static Structure with_free_marker_on(const Structure& structure, const Marker& marker,
                                       const Calibration& robot) {
    const Pose T_link_marker =
        marker.link.value == 0 ? robot.T_camera_base * marker.T_link_marker : marker.T_link_marker;
    return with_marker_on(structure, marker.id, marker.link.value, T_link_marker);
  }

  // What a lens bends looks like an arc.
  [[nodiscard]] std::vector<Proposal> with_slides_for_slight_turns(const Explanation& now) const {
    std::vector<Proposal> out;
    if (!now.structure) return out;
    for (std::size_t j = 0; j < now.structure->joints.size(); ++j) {
      if (auto slide = with_slide_for_slight_turn(*now.structure, j, recording().log))
        out.push_back({std::move(*slide), {}});
    }
    return out;
  }

  // Of two halves of a recording in which something happened once (a bump, a slip), one shows the
  // robot as it is.
  [[nodiscard]] std::vector<Proposal> with_half_the_recording(const Explanation& now) const {
    std::vector<Proposal> out;
    if (is_structure_sound(now) || evidence_.tracks.times_s.size() < 2) return out;
    const int middle = static_cast<int>(evidence_.tracks.times_s.size()) / 2;
    for (const bool first : {true, false}) {
      PoseTracks half = evidence_.tracks;
      for (PoseTrack& track : half.tracks)
        std::erase_if(track.samples,
                      [&](const PoseSample& sample) { return (sample.frame < middle) != first; });
      std::optional<Structure> structure = proposed_structure(half);
      if (structure && structure->status == StructureStatus::kDetermined)
        out.push_back({std::move(*structure), {}});
    }
    return out;
  }

  // What a bumped camera or a marker of another size does may look like a joint of whatever channel
  // rises with time.
  [[nodiscard]] std::vector<Proposal> with_errors_allowed(const Explanation& now) const {
    // Of the distance, and rad: the bump of 1.2 deg and the misprint of 3 % of `undeclared --first
    // 325`, which the search's own allowances (up to 0.01) do not hold.
    constexpr double kLargeErrors = 0.03;
    if (is_structure_sound(now) || !now.fitted || recording().log.channels.empty()) return {};
    std::optional<Structure> structure = proposed_structure(evidence_.tracks, kLargeErrors);
    if (!structure) return {};
    return {{std::move(*structure), {}}};
  }

  // A lens or a focal length that is not this camera's bends the tracks themselves. The robot that
  // shows when the camera is found with it, the declared camera, and what it lacks as effects.
  [[nodiscard]] std::vector<Proposal> with_camera_doubted(const Explanation& now) const {
    const bool by_place =
        now.fitted && std::ranges::any_of(now.fitted->trace.rest, &Rest::is_field);
    const bool several = !evidence_.observed.cameras.empty();
    if (several || (is_structure_clear(now) && now.fitted && !by_place)) return {};
    const std::optional<Sight> other =
        with_other_camera(recording(), evidence_.observed, evidence_.camera, options_.calibrate);
    const std::optional<Explanation> with = other ? fitted_with(*other) : std::nullopt;
    if (!with || !with->fitted) return {};
    return {{*with->structure, {other->told_by, with->fitted->calibration}}};
  }

  // Where another sight was begun with.
  [[nodiscard]] std::vector<Proposal> with_all_believed(const Explanation&) const {
    if (!believed_) return {};
    return {{*believed_, {}}};
  }

  const Evidence& evidence_;
  const ExplainOptions options_;
  const std::optional<Structure> believed_;  ///< of all that was declared and read
};

}  // namespace

std::vector<int> folds_of(const Calibration& calibration) {
  if (calibration.folds < 2) return {};
  std::vector<int> out(calibration.times_s.size(), -1);
  for (const SightingResidual& residual : calibration.residuals)
    out[static_cast<std::size_t>(residual.frame)] = residual.fold;
  // A frame that it could not use goes with the one before.
  const auto known = std::ranges::find_if(out, [](int fold) { return fold >= 0; });
  int last = known == out.end() ? 0 : *known;
  for (int& fold : out) {
    if (fold < 0) fold = last;
    last = fold;
  }
  return out;
}

bool is_settled(const Explanation& of) { return is_explained(of) && is_structure_clear(of); }

bool is_better(const Explanation& one, const Explanation& other, const Measurements& measurements) {
  if (!one.fitted || !other.fitted) return one.fitted.has_value();
  const double clearly = StructureOptions{}.min_log_odds;
  const double odds = log_odds(predictive_score(one.fitted->calibration, measurements),
                               predictive_score(other.fitted->calibration, measurements));
  if (std::abs(odds) > clearly) return odds > 0.0;
  if (is_settled(one) != is_settled(other)) return is_settled(one);
  return parts_of(one) < parts_of(other);
}

Explanation explained(const Evidence& evidence, const ExplainOptions& options,
                      std::vector<std::string>& warnings) {
  return Explainer(evidence, options).explained(warnings);
}

Explanation plainly_explained(const Evidence& evidence, const ExplainOptions& options) {
  return Explainer(evidence, options).plainly_explained();
}

std::optional<Explanation> carried_over(const Evidence& evidence, const ExplainOptions& options,
                                        const Explanation& of) {
  return Explainer(evidence, options).carried_over(of);
}

}  // namespace kinescope
