// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/hand_eye.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>

#include <fmt/format.h>

#include "calib/hand_eye/closed_form.h"
#include "calib/hand_eye/held_out.h"
#include "calib/hand_eye/observability.h"
#include "calib/hand_eye/odd_sightings.h"
#include "calib/hand_eye/traced.h"
#include "calib/hand_eye/usual.h"
#include "calib/trace/trace.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace hand_eye {
namespace {

bundle::Sighting sighting_of(const TagObservation& seen, const MarkerSet& markers) {
  bundle::Sighting out;
  out.kind = MeasurementKind::kCorners;
  out.corners_px = seen.corners_px;
  out.geometry_m = markers.corners_m(seen.id);
  out.sigma = seen.sigma_px;
  out.declared_sigma = seen.sigma_px;
  return out;
}

bundle::Sighting sighting_of(const PoseSample& sample) {
  bundle::Sighting out;
  out.kind = MeasurementKind::kPose;
  out.T_camera_marker = sample.T_camera_marker;
  out.whitening = sample.covariance.diagonal().cwiseSqrt().cwiseInverse().asDiagonal();
  return out;
}

// Sightings by frame, then marker.
using Sightings = std::map<int, std::map<TagId, bundle::Sighting>>;

Sightings sightings_of(const HandEyeInput& input) {
  Sightings out;
  for (const TagObservation& seen : input.measurements.corners)
    out[seen.frame].insert_or_assign(seen.id, sighting_of(seen, input.markers));
  for (const PoseTrack& track : input.measurements.poses.tracks)
    for (const PoseSample& sample : track.samples)
      out[sample.frame].insert_or_assign(track.id, sighting_of(sample));
  return out;
}

constexpr int kFewestViews = 3;  // of a target: two poses leave the equation open

// Readings of the file that are judged beside each other.
using Readings = std::vector<const FlangeReading*>;

// Frames that each reading has a pose for; targets seen in three of them or more.
Data make_data(const HandEyeInput& input, const Readings& readings) {
  const std::vector<double>& times_s = input.measurements.times_s;
  Sightings sightings = sightings_of(input);
  std::erase_if(sightings, [&](const auto& frame) {
    const double time_s = times_s[static_cast<std::size_t>(frame.first)];
    return std::ranges::any_of(
        readings, [&](const FlangeReading* reading) { return !pose_at(reading->log, time_s); });
  });
  std::map<TagId, int> views;
  for (const auto& [frame, seen] : sightings)
    for (const auto& [id, sighting] : seen) ++views[id];
  std::erase_if(views, [](const auto& view) { return view.second < kFewestViews; });
  Data out;
  out.kind =
      input.measurements.corners.empty() ? MeasurementKind::kPose : MeasurementKind::kCorners;
  out.camera = input.camera;
  for (const auto& [id, count] : views) out.targets.push_back(id);
  for (auto& [index, seen] : sightings) {
    Frame frame{times_s[static_cast<std::size_t>(index)], index, {}};
    for (auto& [id, sighting] : seen) {
      const auto target = std::ranges::lower_bound(out.targets, id);
      if (target == out.targets.end() || *target != id) continue;
      sighting.frame = static_cast<int>(out.frames.size());
      sighting.marker = static_cast<int>(target - out.targets.begin());
      frame.sightings.push_back(std::move(sighting));
    }
    if (!frame.sightings.empty()) out.frames.push_back(std::move(frame));
  }
  out.postures = is_posture_log(readings.front()->log, times_s);
  return out;
}

// Poses of one target beside the motion that carries it.
std::vector<MotionPair> pairs_of(const Model& model, const HandEyeInput& input, int target) {
  const TagId id = model.data().targets[static_cast<std::size_t>(target)];
  const auto track = std::ranges::find(input.tracks.tracks, id, &PoseTrack::id);
  if (track == input.tracks.tracks.end()) return {};
  std::map<int, const PoseSample*> by_frame;
  for (const PoseSample& sample : track->samples) by_frame[sample.frame] = &sample;
  std::vector<MotionPair> out;
  const State plain;
  for (const Frame& frame : model.data().frames) {
    const auto sample = by_frame.find(frame.index);
    if (sample == by_frame.end()) continue;
    const Pose F = flange_at(model, plain, frame).T_base_flange;
    const bool on_hand = model.hypothesis().mount == CameraMount::kOnHand;
    out.push_back({on_hand ? F.inverse() : F, sample->second->T_camera_marker,
                   sample->second->T_camera_marker_alternative});
  }
  return out;
}

struct Started {
  State state;
  std::string solver;
};

// Every target proposes; the camera that leaves the least open over all of them is kept.
std::optional<Started> start_of(const Model& model, const HandEyeInput& input) {
  constexpr int kMostProposers = 6;
  const int targets = static_cast<int>(model.data().targets.size());
  std::vector<std::vector<MotionPair>> pairs;
  for (int k = 0; k < targets; ++k) pairs.push_back(pairs_of(model, input, k));
  std::vector<int> order(static_cast<std::size_t>(targets));
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater{},
                           [&](int k) { return pairs[static_cast<std::size_t>(k)].size(); });
  std::optional<Started> best;
  double least = std::numeric_limits<double>::infinity();
  for (int p = 0; p < std::min(targets, kMostProposers); ++p) {
    const auto start =
        closed_form(pairs[static_cast<std::size_t>(order[static_cast<std::size_t>(p)])]);
    if (!start) continue;
    Started out{{}, start->solver};
    out.state.cameras.push_back(bundle::to_block(start->X));
    double misfit = 0.0;
    for (const std::vector<MotionPair>& own : pairs) {
      const HandEyeStart placed = target_for(own, start->X);
      out.state.targets.push_back(bundle::to_block(placed.Y));
      misfit += placed.misfit * static_cast<double>(own.size());
    }
    if (!(misfit < least)) continue;
    least = misfit;
    best = std::move(out);
  }
  return best;
}

// How well a reading closes the loop in closed form, over the target that was seen most, the
// camera on the hand or fixed: infinite where it cannot be said.
double closed_form_misfit(const Data& data, const FlangeReading& reading,
                          const HandEyeInput& input) {
  double least = std::numeric_limits<double>::infinity();
  for (const CameraMount mount : {CameraMount::kOnHand, CameraMount::kFixed}) {
    const Model model(data, reading.log, {mount, PoseDirection::kBaseFlange, reading.rotation});
    std::vector<MotionPair> most;
    for (int k = 0; k < static_cast<int>(data.targets.size()); ++k) {
      std::vector<MotionPair> pairs = pairs_of(model, input, k);
      if (pairs.size() > most.size()) most = std::move(pairs);
    }
    const auto start = linear_closed_form(std::move(most));
    if (start) least = std::min(least, start->misfit);
  }
  return least;
}

Readings usual_readings(const HandEyeInput& input) {
  Readings out;
  for (const FlangeReading& reading : input.readings)
    if (reading.usual) out.push_back(&reading);
  return out;
}

// Of the other conventions the one that closes the loop best, where it does better than the usual
// ones: a proposal, which the likelihood of unseen poses judges.
const FlangeReading* proposed_reading(const Data& usual_data, const HandEyeInput& input) {
  const PoseLog& first = input.readings.front().log;
  const FlangeReading* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const FlangeReading& reading : input.readings) {
    const bool same_rows = reading.log.times_s == first.times_s;
    const double misfit = same_rows
                              ? closed_form_misfit(usual_data, reading, input)
                              : closed_form_misfit(make_data(input, {&reading}), reading, input);
    if (!(misfit < least)) continue;
    least = misfit;
    best = &reading;
  }
  return best != nullptr && !best->usual ? best : nullptr;
}

// A hypothesis with its fit.
struct Rival {
  const FlangeReading* reading = nullptr;
  std::unique_ptr<Model> model;
  Fit fit;
  std::string start;
  std::vector<HeldOutFrame> held_out;
};

std::optional<Rival> fit_rival(const Data& data, const FlangeReading& reading,
                               const HandEyeInput& input, CameraMount mount,
                               const HandEyeOptions& options, const std::vector<int>& fold) {
  Rival out;
  out.reading = &reading;
  out.model = std::make_unique<Model>(
      data, reading.log, HandEyeHypothesis{mount, PoseDirection::kBaseFlange, reading.rotation});
  const auto start = start_of(*out.model, input);
  if (!start) return std::nullopt;
  out.start = start->solver;
  out.fit = fit(*out.model, start->state, options.reject_sigma);
  if (!out.fit.converged) return std::nullopt;
  out.held_out = hold_out(*out.model, out.fit, fold);
  // One whose folds leave directions open predicts nothing.
  const auto known = std::ranges::count_if(out.held_out, &HeldOutFrame::known);
  if (2 * known < std::ssize(out.fit.used)) return std::nullopt;
  return out;
}

// The same equation with its parts named the other way round: a camera on the hand sees what a
// fixed one sees whose log is inverted.
Rival renamed(const Rival& rival, const HandEyeOptions& options, const std::vector<int>& fold) {
  HandEyeHypothesis other = rival.model->hypothesis();
  other.mount = other.mount == CameraMount::kOnHand ? CameraMount::kFixed : CameraMount::kOnHand;
  other.direction = other.direction == PoseDirection::kBaseFlange ? PoseDirection::kFlangeBase
                                                                  : PoseDirection::kBaseFlange;
  Rival out;
  out.reading = rival.reading;
  out.model = std::make_unique<Model>(rival.model->data(), rival.model->log(), other);
  out.start = rival.start;
  out.fit = fit(*out.model, rival.fit.state, options.reject_sigma);
  out.held_out = hold_out(*out.model, out.fit, fold);
  return out;
}

// Log predictive density of one less that of the other, over the poses that both predict.
double log_score(const Rival& one, const Rival& other) {
  double sum = 0.0;
  for (std::size_t f = 0; f < one.held_out.size(); ++f) {
    if (!one.held_out[f].known || !other.held_out[f].known) continue;
    sum += one.held_out[f].log_density - other.held_out[f].log_density;
  }
  return sum;
}

HandEyeError error_over(const std::vector<ClosedLoop>& errors) {
  HandEyeError out;
  const auto n = static_cast<double>(errors.size());
  for (const ClosedLoop& e : errors) {
    out.m += e.m * e.m / n;
    out.rad += e.rad * e.rad / n;
    out.px += e.px * e.px / n;
  }
  return {std::sqrt(out.m), std::sqrt(out.rad), std::sqrt(out.px), static_cast<int>(errors.size())};
}

HandEyeError held_out_error(const std::vector<HeldOutFrame>& frames) {
  std::vector<ClosedLoop> known;
  for (const HeldOutFrame& frame : frames)
    if (frame.known) known.push_back(frame.error);
  return error_over(known);
}

HandEyeError fitted_error(const Model& model, const Fit& fit) {
  std::vector<ClosedLoop> errors;
  for (const std::size_t f : fit.used)
    errors.push_back(closed_loop(model.data().frames[f], value_of(fit.rows[f])));
  return error_over(errors);
}

// Of two names of one equation.
double usual_log_odds(const Rival& rival) {
  const std::vector<Pose> at = poses_at_end(*rival.model, rival.fit.state);
  double targets_m = 0.0;
  for (std::size_t k = 1; k < at.size(); ++k)
    targets_m += at[k].translation.norm() / static_cast<double>(at.size() - 1);
  return log_odds_on_hand(at.front().translation.norm(), targets_m, rival.model->hypothesis());
}

struct Chosen {
  Rival rival;
  std::vector<HandEyeRival> rivals;
};

HandEyeRival summary_of(const Rival& rival, double score, double probability, bool same) {
  return {rival.model->hypothesis(), held_out_error(rival.held_out), score, probability, same};
}

constexpr double kTold = 0.99;

void require_told_apart(const std::vector<Rival>& rivals, const std::vector<double>& probability,
                        std::size_t best) {
  if (probability[best] >= kTold) return;
  std::size_t second = best == 0 ? 1 : 0;
  for (std::size_t k = 0; k < rivals.size(); ++k)
    if (k != best && probability[k] > probability[second]) second = k;
  const auto words = [](const HandEyeHypothesis& h) {
    return fmt::format("{}{}",
                       h.mount == CameraMount::kOnHand ? "a camera on the hand" : "a fixed camera",
                       h.rotation.empty() ? "" : fmt::format(" ({})", h.rotation));
  };
  throw undetermined(
      rivals[best].model->log().source,
      fmt::format("{} and {} predict unseen poses alike (probability {:.2f} and {:.2f})",
                  words(rivals[best].model->hypothesis()),
                  words(rivals[second].model->hypothesis()), probability[best],
                  probability[second]),
      "record more poses, the hand turned about two axes or three");
}

// Posterior over rivals that predict differently, all as likely before.
std::vector<double> posterior(const std::vector<Rival>& rivals, std::size_t best) {
  std::vector<double> out;
  for (const Rival& rival : rivals) out.push_back(std::exp(log_score(rival, rivals[best])));
  const double sum = std::accumulate(out.begin(), out.end(), 0.0);
  for (double& p : out) p /= sum;
  return out;
}

std::size_t best_of(const std::vector<Rival>& rivals) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < rivals.size(); ++k)
    if (log_score(rivals[k], rivals[best]) > 0.0) best = k;
  return best;
}

// Rivals that stand on what is usual, but where another convention is clearly better.
bool is_another_convention(const std::vector<Rival>& rivals, std::size_t conventions) {
  if (rivals.empty()) return false;
  const std::size_t best = best_of(rivals);
  if (rivals[best].reading->usual) return false;
  // As likely before as any other departure from what is documented, all of them together.
  const double prior = kUsualInverted / (1.0 - kUsualInverted) / static_cast<double>(conventions);
  double usual = 0.0;
  for (const Rival& rival : rivals)
    if (rival.reading->usual) usual += std::exp(log_score(rival, rivals[best])) / prior;
  return 1.0 / (1.0 + usual) >= kTold;
}

// The best rival, under the likelier of its two names (or the declared one).
Chosen choose(std::vector<Rival> rivals, const HandEyeInput& input, const HandEyeOptions& options,
              const std::vector<int>& fold) {
  const std::size_t best = best_of(rivals);
  require_observable(*rivals[best].model, rivals[best].fit);
  const std::vector<double> probability = posterior(rivals, best);
  require_told_apart(rivals, probability, best);
  const double on_hand_odds = usual_log_odds(rivals[best]);
  const CameraMount likely = on_hand_odds >= 0.0 ? CameraMount::kOnHand : CameraMount::kFixed;
  const CameraMount mount = input.mount.value_or(likely);
  const bool same_name = mount == rivals[best].model->hypothesis().mount;
  Rival other = renamed(rivals[best], options, fold);
  const double on_hand = 1.0 / (1.0 + std::exp(-on_hand_odds));
  const double name = input.mount ? 1.0 : (mount == CameraMount::kOnHand ? on_hand : 1 - on_hand);
  const Rival& first = same_name ? rivals[best] : other;
  const Rival& second = same_name ? other : rivals[best];
  Chosen out;
  out.rivals.push_back(summary_of(first, 0.0, probability[best] * name, false));
  out.rivals.push_back(summary_of(second, 0.0, probability[best] * (1.0 - name), true));
  for (std::size_t k = 0; k < rivals.size(); ++k) {
    if (k == best) continue;
    out.rivals.push_back(
        summary_of(rivals[k], log_score(rivals[k], rivals[best]), probability[k], false));
  }
  out.rival = same_name ? std::move(rivals[best]) : std::move(other);
  return out;
}

// Once with the markers that the first fit shows to be wrong left out, and once more with those
// that the second does.
struct Cleaned {
  std::unique_ptr<Data> data;  // that the rival's model is of
  int left_out = 0;
};

Cleaned clean(Rival& rival, const HandEyeOptions& options, const std::vector<int>& fold) {
  const std::unique_ptr<Model> all = std::move(rival.model);
  Cleaned out{std::make_unique<Data>(all->data()), 0};
  Fit seen = rival.fit;
  for (int round = 0; round < 2; ++round) {
    CleanedData cleaned = without_odd_sightings(*all, seen, options.reject_sigma);
    if (cleaned.left_out == 0) break;
    *out.data = std::move(cleaned.data);
    out.left_out = cleaned.left_out;
    const Model model(*out.data, all->log(), all->hypothesis());
    rival.fit = fit(model, rival.fit.state, options.reject_sigma);
    seen.state = rival.fit.state;
    seen.rows = rows_of_all(*all, seen.state);
  }
  rival.model = std::make_unique<Model>(*out.data, all->log(), all->hypothesis());
  if (out.left_out > 0) rival.held_out = hold_out(*rival.model, rival.fit, fold);
  return out;
}

std::vector<OddFlangeRow> odd_rows_of(const Model& model, const Fit& fit) {
  std::vector<OddFlangeRow> out;
  const PoseLog& log = model.log();
  for (std::size_t f = 0; f < model.data().frames.size(); ++f) {
    if (!fit.rows[f] || std::ranges::binary_search(fit.used, f)) continue;
    const Frame& frame = model.data().frames[f];
    const FlangeError e = flange_error(*fit.rows[f], fit.noise);
    Pose expected = flange_at(model, fit.state, frame).T_base_flange * exp_pose(e.error);
    expected.translation /= 1.0 + fit.state.scale[0];
    if (model.hypothesis().direction == PoseDirection::kFlangeBase) expected = expected.inverse();
    const auto logged = pose_at(log, frame.time_s);
    OddFlangeRow row{frame.time_s,
                     std::nullopt,
                     value_of(logged).pose,
                     expected,
                     e.error.tail<3>().norm(),
                     e.error.head<3>().norm()};
    const auto at = std::ranges::lower_bound(log.times_s, frame.time_s);
    if (at != log.times_s.end() && *at == frame.time_s && !log.lines.empty())
      row.line = log.lines[static_cast<std::size_t>(at - log.times_s.begin())];
    out.push_back(row);
  }
  return out;
}

void take_poses(const Model& model, const Fit& fit, HandEye& out) {
  const std::vector<Pose> at = poses_at_end(model, fit.state);
  const auto covariance = covariance_of(model, fit);
  KINESCOPE_CHECK(covariance.has_value(), "an observable fit has a covariance");
  const Eigen::MatrixXd J = by_parameters_at_end(model, fit.state);
  out.covariance = J * *covariance * J.transpose();
  out.camera = {at.front(), out.covariance.topLeftCorner<6, 6>()};
  for (std::size_t k = 0; k < model.data().targets.size(); ++k) {
    const auto block = 6 + 6 * static_cast<Eigen::Index>(k);
    HandEyeTarget target{
        model.data().targets[k], {at[k + 1], out.covariance.block<6, 6>(block, block)}, 0};
    for (const std::size_t f : fit.used)
      for (const bundle::Sighting& s : model.data().frames[f].sightings)
        if (s.marker == static_cast<int>(k)) ++target.frames;
    out.targets.push_back(std::move(target));
  }
}

void take_frames(const Model& model, const Fit& fit, const std::vector<HeldOutFrame>& held_out,
                 const std::vector<int>& fold, HandEye& out) {
  const auto error_of = [](const ClosedLoop& e) { return HandEyeError{e.m, e.rad, e.px, 1}; };
  for (std::size_t f = 0; f < model.data().frames.size(); ++f) {
    if (!fit.rows[f]) continue;
    const Frame& frame = model.data().frames[f];
    HandEyeFrame entry;
    entry.time_s = frame.time_s;
    entry.fold = fold[f];
    entry.used = std::ranges::binary_search(fit.used, f);
    entry.fitted = error_of(closed_loop(frame, *fit.rows[f]));
    if (held_out[f].known) entry.held_out = error_of(held_out[f].error);
    out.frames.push_back(entry);
  }
}

// A jump has its time. One that is as likely at many is the shape of something else: of a robot
// whose errors follow the order in which its poses were chosen (114 poses of an FR3: 22 times).
bool is_vague(const TracedEffect& effect) {
  constexpr std::size_t kMostTimes = 4;
  return effect.scan_name == "at" && effect.as_likely.size() > kMostTimes;
}

Trace trace_of(const Rival& rival, const std::vector<int>& fold, const Progress& progress) {
  // Below what detectors and boards are right to.
  constexpr double kFloorM = 1e-5;
  TraceOptions options;
  options.floor = kFloorM;
  Trace out = trace_effects(TracedHandEye(*rival.model, rival.fit, fold), options, progress);
  if (std::ranges::none_of(out.accepted, is_vague)) return out;
  return trace_effects(TracedHandEye(*rival.model, rival.fit, fold, false), options, progress);
}

// What the equation lacks; the fit with it.
void trace_into(Rival& rival, const HandEyeOptions& options, const std::vector<int>& fold,
                HandEye& out, const Progress& progress) {
  out.trace = trace_of(rival, fold, progress);
  if (out.trace->added.empty()) return;
  auto model = std::make_unique<Model>(rival.model->data(), rival.model->log(),
                                       rival.model->hypothesis(), out.trace->added);
  Fit with = fit(*model, state_for(*model, *rival.model, rival.fit.state), options.reject_sigma);
  if (!with.converged || !covariance_of(with.information)) return;
  rival.held_out = hold_out(*model, with, fold);
  // Weighed beside the effects, which passed for noise before.
  Fit base = with;
  base.state = state_for(*rival.model, *model, with.state);
  size_again(TracedHandEye(*rival.model, base, fold), *out.trace);
  rival.model = std::move(model);
  rival.fit = std::move(with);
}

// What readings are judged on, and their fits.
struct Judged {
  std::unique_ptr<Data> data;
  std::vector<int> fold;
  std::vector<Rival> rivals;
};

Judged judge(const HandEyeInput& input, const Readings& readings, const HandEyeOptions& options,
             const Progress& progress) {
  Judged out;
  out.data = std::make_unique<Data>(make_data(input, readings));
  const PoseLog& log = readings.front()->log;
  require_enough_frames(*out.data, log.source);
  out.fold = folds_of(*out.data, log, options.folds);
  int done = 0;
  const int all = 2 * static_cast<int>(readings.size());
  for (const FlangeReading* reading : readings) {
    for (const CameraMount mount : {CameraMount::kOnHand, CameraMount::kFixed}) {
      report_progress(progress, "rival readings", done++, all);
      auto rival = fit_rival(*out.data, *reading, input, mount, options, out.fold);
      if (rival) out.rivals.push_back(std::move(*rival));
    }
  }
  return out;
}

// The usual readings, beside another convention where one is clearly better.
Judged judge_all(const HandEyeInput& input, const HandEyeOptions& options,
                 const Progress& progress) {
  const Readings usual = usual_readings(input);
  Readings readings = usual;
  if (const FlangeReading* other = proposed_reading(make_data(input, usual), input)) {
    readings.push_back(other);
    Judged with = judge(input, readings, options, progress);
    if (is_another_convention(with.rivals, input.readings.size() - usual.size())) return with;
  }
  return judge(input, usual, options, progress);
}

}  // namespace
}  // namespace hand_eye

HandEye calibrate_hand_eye(const HandEyeInput& input, const HandEyeOptions& options,
                           const Progress& progress) {
  using namespace hand_eye;
  KINESCOPE_CHECK(!input.readings.empty() && input.readings.front().usual, "a log can be read");
  Judged judged = judge_all(input, options, progress);
  if (judged.rivals.empty()) {
    throw undetermined(input.readings.front().log.source,
                       "no reading of the poses closes the loop with the markers",
                       "check that each pose belongs to its image");
  }
  const std::vector<int>& fold = judged.fold;
  Chosen chosen = choose(std::move(judged.rivals), input, options, fold);
  HandEye out;
  out.hypothesis = chosen.rival.model->hypothesis();
  out.rivals = std::move(chosen.rivals);
  const Cleaned cleaned = clean(chosen.rival, options, fold);
  out.odd_sightings = cleaned.left_out;
  out.rivals.front().held_out = held_out_error(chosen.rival.held_out);
  out.postures = judged.data->postures;
  if (options.trace) trace_into(chosen.rival, options, fold, out, progress);
  const Rival& rival = chosen.rival;
  out.start = rival.start;
  take_poses(*rival.model, rival.fit, out);
  out.camera_noise = rival.fit.noise.camera;
  out.flange_noise_rad = rival.fit.noise.flange_rad;
  out.flange_noise_m = rival.fit.noise.flange_m;
  out.fitted = fitted_error(*rival.model, rival.fit);
  out.held_out = held_out_error(rival.held_out);
  take_frames(*rival.model, rival.fit, rival.held_out, fold, out);
  out.odd_rows = odd_rows_of(*rival.model, rival.fit);
  return out;
}

}  // namespace kinescope
