// SPDX-License-Identifier: Apache-2.0
#include "app/explain/explainer.h"

#include <algorithm>
#include <set>
#include <utility>

#include "app/explain/compare_explanations.h"
#include "app/explain/doubted_sight.h"
#include "app/explain/hypothesis_fit.h"
#include "calib/quality/carrying_link.h"
#include "calib/quality/predictive_score.h"
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

/// A structure, and effects to begin with beside it.
struct Proposal {
  Structure structure;
  TraceStart begin = {};
};

/// Structures that were fitted, each with the effects to begin with.
using Tried = std::set<std::pair<Shape, std::vector<EffectId>>>;

bool has_more_joints_than_channels(const Structure& structure) {
  std::set<int> channels;
  for (const StructureJoint& joint : structure.joints)
    if (joint.channel) channels.insert(joint.channel->channel);
  return structure.joints.size() > channels.size();
}

std::pair<Shape, std::vector<EffectId>> tried_as(const Structure& structure,
                                                 const TraceStart& begin) {
  std::pair<Shape, std::vector<EffectId>> out{shape_of(structure), {}};
  for (const AddedEffect& effect : begin.known) out.second.push_back(effect.id);
  return out;
}

class Explainer {
 public:
  /// `evidence` must outlive it.
  Explainer(const Evidence& evidence, const ExplainOptions& options,
            std::optional<Structure> believed = {})
      : evidence_(evidence),
        options_(options),
        fit_(evidence, options),
        believed_(std::move(believed)) {}

  [[nodiscard]] Explanation explained(std::vector<std::string>& warnings) const {
    if (recording().nominal) return fit_.of_nominal(warnings);
    Structure believed = fit_.believed_structure();
    Explanation first = fit_.plainly_fitted(believed);
    ExplainOptions options = options_;
    if (first.fitted && options.calibrate.fold_of_frame.empty())
      options.calibrate.fold_of_frame = folds_of(first.fitted->calibration);
    return Explainer(evidence_, std::move(options), std::move(believed))
        .best_beside(std::move(first));
  }

 private:
  /// `first`: a plain fit.
  [[nodiscard]] Explanation best_beside(Explanation first) const {
    Tried tried;
    Explanation now = with_rivals_judged(asked_again(begun_with(std::move(first), tried)));
    // Beside joints that no fit settles for, doubts about some of them are not worth their time.
    if (now.fitted && !is_converged(now.fitted->calibration)) now = improved(std::move(now), tried);
    now = with_base_at_rest(with_couplings_doubted(std::move(now)), tried);
    now = with_fewer_joints(with_rivals_judged(improved(std::move(now), tried)));
    return with_free_markers_attached(std::move(now));
  }

  /// Where channels drive several joints and that is in doubt, a robot with fewer joints comes
  /// first: errors look like joints, which cost most to find with other cameras and markers, and to
  /// trace. Where it explains all, no other robot explains more.
  [[nodiscard]] Explanation begun_with(Explanation first, Tried& tried) const {
    std::optional<Explanation> simpler = with_one_joint_a_channel(first, tried);
    // So does a camera that drifts, like a joint below all others: 17 min were spent on tracing
    // beside one of a temperature (`undeclared`, 13885).
    if (!simpler && !is_structure_sound(first)) simpler = on_resting_base(first, tried);
    if (simpler && is_settled(*simpler)) return *std::move(simpler);
    Explanation now = seen_best(std::move(first), tried);
    return simpler && is_better(*simpler, now) ? *std::move(simpler) : now;
  }

  /// Effects are looked for beside the robot that shows with what was declared; or with a camera or
  /// markers that the images themselves speak for, where that predicts unseen frames better. Tracks
  /// that a focal length of 19 % too much bends keep tracing busy for minutes, and leave it beside
  /// couplings (`undeclared`, 12006); those of a marker that is not flat hang others elsewhere
  /// (11063).
  [[nodiscard]] Explanation seen_best(Explanation first, Tried& tried) const {
    std::optional<Explanation> best;
    TraceStart begin;
    if (options_.trace) {
      for (const std::optional<Sight>& sight : contradicted_sights(first)) {
        std::optional<Explanation> with = sight ? fit_.fitted_with(*sight) : std::nullopt;
        if (!with || !with->fitted || !is_better(*with, best ? *best : first)) continue;
        begin = {sight->told_by, with->fitted->calibration};
        best = std::move(with);
      }
    }
    if (!best) {
      if (first.structure) tried.insert(tried_as(*first.structure, {}));
      return fit_.traced(std::move(first), {});
    }
    tried.insert(tried_as(*best->structure, begin));
    return fit_.of_structure(*std::move(best->structure), begin);
  }

  /// Nothing where none shows, or nothing is in doubt.
  [[nodiscard]] std::optional<Explanation> with_one_joint_a_channel(const Explanation& first,
                                                                    Tried& tried) const {
    if (!options_.trace || !first.fitted || is_structure_sound(first) ||
        !has_more_joints_than_channels(*first.structure))
      return std::nullopt;
    std::optional<Explanation> best;
    for (const auto& propose :
         {&Explainer::with_half_the_recording, &Explainer::with_errors_allowed}) {
      for (const Proposal& proposal : (this->*propose)(first)) {
        if (proposal.structure.joints.size() >= first.structure->joints.size() ||
            !tried.insert(tried_as(proposal.structure, proposal.begin)).second)
          continue;
        Explanation other = asked_again(fit_.of_structure(proposal.structure, proposal.begin));
        if (is_settled(other)) return other;
        if (!best || is_better(other, *best)) best = std::move(other);
      }
    }
    return best;
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
        Explanation other = asked_again(fit_.of_structure(proposal.structure, proposal.begin));
        if (is_better(other, now)) now = std::move(other);
      }
    }
    return now;
  }

  [[nodiscard]] const Recording& recording() const { return evidence_.recording; }

  [[nodiscard]] bool is_better(const Explanation& one, const Explanation& other) const {
    return kinescope::is_better(one, other, evidence_.observed.measurements);
  }

  // The structure was searched for on tracks that the effects were in: again without them, until
  // it is the one that they were found beside.
  [[nodiscard]] Explanation asked_again(Explanation now) const {
    std::set<Shape> answers;
    while (now.fitted && now.structure && !now.fitted->effects.empty() &&
           (!is_structure_clear(now) || is_bent(*now.fitted))) {
      std::optional<Structure> again =
          fit_.proposed_structure(fit_.undone(now.fitted->calibration));
      if (!again) return now;
      if (shape_of(*again) == shape_of(*now.structure)) {
        now.structure = std::move(again);
        return now;
      }
      if (!answers.insert(shape_of(*again)).second) return now;
      Explanation other = fit_.of_structure(std::move(*again), {now.fitted->trace.added});
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
    if (!is_explained(now)) plain = fit_.plainly_fitted(*now.structure);
    std::vector<double> odds;
    for (const RivalStructure& rival : now.structure->rivals) {
      Explanation other = fit_.plainly_fitted(rival.structure);
      const bool has_more = rival.structure.joints.size() > now.structure->joints.size();
      if (leaves_noise_only) {
        odds.push_back(log_odds_of(alone, other, evidence_.observed.measurements));
      } else if (plain && has_more && !is_better(other, *plain)) {
        odds.push_back(log_odds_of(*plain, other, evidence_.observed.measurements));
      } else {
        odds.push_back(log_odds_of(alone, fit_.traced(std::move(other), {now.fitted->trace.added}),
                                   evidence_.observed.measurements));
      }
    }
    const auto best = std::ranges::min_element(odds);
    const bool is_exchanged = best != odds.end() && *best < 0.0;
    if (is_exchanged) {
      const auto rival = static_cast<std::size_t>(best - odds.begin());
      now = fit_.of_structure(with_rival(*now.structure, rival, recording().log), {});
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
    Explanation other = asked_again(fit_.of_structure(std::move(free), {}));
    return is_better(other, now) ? other : now;
  }

  // What all that is seen moves with, and no channel drives, may be the camera.
  [[nodiscard]] Explanation with_base_at_rest(Explanation now, Tried& tried) const {
    const std::optional<Explanation> other = on_resting_base(now, tried);
    return other && is_better(*other, now) ? *other : now;
  }

  [[nodiscard]] std::optional<Explanation> on_resting_base(const Explanation& of,
                                                           Tried& tried) const {
    if (!of.structure || !options_.trace) return std::nullopt;
    std::optional<Structure> resting = kinescope::with_base_at_rest(*of.structure, recording().log);
    if (!resting || !tried.insert(tried_as(*resting, {})).second) return std::nullopt;
    return asked_again(fit_.of_structure(*std::move(resting), {}));
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
      Explanation other = fit_.of_structure(*std::move(without), {now.fitted->trace.added});
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
            fit_.of_structure(with_free_marker_on(*now.structure, marker, now.fitted->calibration),
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
      std::optional<Structure> structure = fit_.proposed_structure(half);
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
    std::optional<Structure> structure = fit_.proposed_structure(evidence_.tracks, kLargeErrors);
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
    const std::optional<Explanation> with = other ? fit_.fitted_with(*other) : std::nullopt;
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
  const HypothesisFit fit_;
  const std::optional<Structure> believed_;  ///< of all that was declared and read
};

}  // namespace

Explanation explained(const Evidence& evidence, const ExplainOptions& options,
                      std::vector<std::string>& warnings) {
  return Explainer(evidence, options).explained(warnings);
}

Explanation explained_part(const Evidence& part, const ExplainOptions& options,
                           std::vector<std::string>& warnings) {
  try {
    return explained(part, options, warnings);
  } catch (const Error& error) {
    Explanation out;
    out.failure = error;
    return out;
  }
}

}  // namespace kinescope
