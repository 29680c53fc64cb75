// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/effect_bundle.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "calib/bundle/choose_sightings.h"
#include "calib/bundle/corrected.h"
#include "calib/bundle/folds.h"
#include "calib/bundle/linearise.h"
#include "calib/bundle/make_spec.h"
#include "calib/bundle/solve.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/error.h"

namespace kinescope {

// Where a fit ended.
struct bundle::End {
  bool time_offset = false;
  std::vector<std::string> corrections;
  std::vector<std::size_t> without_couplings;
  bundle::State state;
  double cost = 0.0;

  [[nodiscard]] bool is_of_the_same(const End& other) const {
    return time_offset == other.time_offset && corrections == other.corrections &&
           without_couplings == other.without_couplings;
  }
};

using bundle::End;
using bundle::FreeBlock;
using bundle::LinearBundle;
using bundle::Readings;
using bundle::Sighting;
using bundle::Spec;
using bundle::State;

namespace {

// Frames beyond this many are thinned evenly: tests of effects gain nothing from more.
constexpr int kMostFrames = 2500;
constexpr int kFolds = 5;

std::vector<int> thin_frames(const Spec& spec, const std::vector<int>& usable) {
  std::set<int> frames;
  for (const int index : usable) {
    frames.insert(spec.sightings[static_cast<std::size_t>(index)].frame);
  }
  if (static_cast<int>(frames.size()) <= kMostFrames) return usable;
  const auto step = (frames.size() + kMostFrames - 1) / kMostFrames;
  std::set<int> kept;
  std::vector<std::size_t> seen_of_camera(spec.cameras.size(), 0);
  for (const int frame : frames) {
    const auto camera =
        spec.camera_of_frame.empty()
            ? 0
            : static_cast<std::size_t>(spec.camera_of_frame[static_cast<std::size_t>(frame)]);
    if (seen_of_camera[camera]++ % step == 0) kept.insert(frame);
  }
  std::vector<int> out;
  for (const int index : usable) {
    if (kept.contains(spec.sightings[static_cast<std::size_t>(index)].frame)) out.push_back(index);
  }
  return out;
}

// The first joint that a channel drives.
std::optional<std::size_t> joint_of_channel(const Spec& spec, int channel) {
  const auto found = std::ranges::find(spec.channel, channel);
  if (found == spec.channel.end()) return std::nullopt;
  return static_cast<std::size_t>(found - spec.channel.begin());
}

std::vector<DesignCoupling> couplings_of(const Spec& spec) {
  std::vector<DesignCoupling> out;
  for (std::size_t j = 0; j < spec.couplings.size(); ++j) {
    for (const auto& [channel, ratio] : spec.couplings[j]) {
      const auto other = joint_of_channel(spec, channel);
      if (!other) continue;
      const double units = spec.tree.joints[j].scale / spec.tree.joints[*other].scale;
      out.push_back({static_cast<int>(j), static_cast<int>(*other), units * ratio});
    }
  }
  return out;
}

void remove_coupling(const DesignCoupling& coupling, Spec& spec) {
  const int channel = spec.channel[static_cast<std::size_t>(coupling.other)];
  std::erase_if(spec.couplings[static_cast<std::size_t>(coupling.joint)],
                [&](const auto& share) { return share.first == channel; });
}

std::vector<std::string> names_of(const std::vector<Correction>& corrections) {
  std::vector<std::string> out;
  for (const Correction& correction : corrections) out.push_back(correction.name);
  return out;
}

// For each of the names the first of `among` of that name that no earlier one has; nothing where
// one is not among them.
std::optional<std::vector<std::size_t>> matching(const std::vector<std::string>& names,
                                                 const std::vector<std::string>& among) {
  std::vector<std::size_t> out;
  std::vector<bool> taken(among.size(), false);
  for (const std::string& name : names) {
    std::size_t k = 0;
    while (k < among.size() && (taken[k] || among[k] != name)) ++k;
    if (k == among.size()) return std::nullopt;
    taken[k] = true;
    out.push_back(k);
  }
  return out;
}

using Ends = std::vector<std::shared_ptr<const End>>;

void remember_in(Ends& ends, std::shared_ptr<const End> end) {
  const auto known =
      std::ranges::find_if(ends, [&](const auto& other) { return other->is_of_the_same(*end); });
  if (known != ends.end()) {
    *known = std::move(end);
  } else {
    ends.push_back(std::move(end));
  }
}

// Where the best fit ended whose freedom the change has, too.
std::optional<State> end_with_less(const Ends& ends, const BundleChange& change,
                                   const State& state) {
  const std::vector<std::string> names = names_of(change.corrections);
  const End* best = nullptr;
  std::vector<std::size_t> best_places;
  for (const auto& end : ends) {
    if (end->time_offset && !change.time_offset) continue;
    if (end->without_couplings != change.without_couplings) continue;
    if (best != nullptr && end->cost > best->cost) continue;
    auto places = matching(end->corrections, names);
    if (!places) continue;
    best = end.get();
    best_places = std::move(*places);
  }
  if (best == nullptr) return std::nullopt;
  State out = best->state;
  if (!best->time_offset) out.time_offset = state.time_offset;
  out.corrections = state.corrections;
  for (std::size_t k = 0; k < best_places.size(); ++k)
    out.corrections[best_places[k]] = best->state.corrections[k];
  return out;
}

// Where the best fit ended that has the change's freedom and the least beyond it.
std::optional<State> end_with_more(const Ends& ends, const BundleChange& change,
                                   const State& state) {
  const std::vector<std::string> names = names_of(change.corrections);
  const auto freedom_of = [](const End& end) {
    return end.corrections.size() + static_cast<std::size_t>(end.time_offset);
  };
  const End* best = nullptr;
  std::vector<std::size_t> best_places;
  for (const auto& end : ends) {
    if (change.time_offset && !end->time_offset) continue;
    if (end->without_couplings != change.without_couplings) continue;
    if (best != nullptr &&
        std::pair(freedom_of(*end), end->cost) >= std::pair(freedom_of(*best), best->cost))
      continue;
    auto places = matching(names, end->corrections);
    if (!places) continue;
    best = end.get();
    best_places = std::move(*places);
  }
  if (best == nullptr) return std::nullopt;
  State out = best->state;
  if (!change.time_offset) out.time_offset = state.time_offset;
  out.corrections.clear();
  for (const std::size_t place : best_places)
    out.corrections.push_back(best->state.corrections[place]);
  return out;
}

}  // namespace

struct EffectBundle::Impl {
  Spec spec;  // plain, noise known
  State start;
  double offset_start_s = 0.0;
  std::vector<int> usable;
  std::vector<int> used;
  double reject_sigma = 0.0;
  std::vector<int> fold;
  std::vector<DesignCoupling> couplings;
  double bias_px = 0.0;
  double jitter_s = 0.0;
  mutable std::vector<std::shared_ptr<const End>> ends;  // the last of the same change

  /// The model with the change in it, before a fit.
  void change_model(const BundleChange& change, Spec& with, State& state) const;
  /// `state` moved to the minimum, from where the best of `ends` that fits is.
  [[nodiscard]] bundle::SolveSummary solve_from(const BundleChange& change, const Spec& with,
                                                State& state) const;
  [[nodiscard]] BundleSolution solve(const BundleChange& change, Spec& with, State& state) const;
  [[nodiscard]] JointMotion motion(const std::vector<double>& times_s,
                                   const Eigen::MatrixXd& ahead_s) const;
  void add_copies(const Spec& at, const Eigen::MatrixXd& ahead_s, JointMotion& out) const;
};

EffectBundle::EffectBundle(const Measurements& measurements, const MarkerSet& markers,
                           const JointLog& log, const CalibrationStart& start,
                           const CalibrateOptions& options)
    : impl_(std::make_unique<Impl>()) {
  Spec& spec = impl_->spec;
  spec = bundle::make_spec(measurements, markers, log, start, options);
  // The best plain model shows which sightings stand out; the clock is free for that only.
  State state = bundle::initial_state(spec, start);
  bundle::guess_targets(spec, bundle::usable_sightings(spec, state), state);
  impl_->reject_sigma = options.reject_sigma;
  impl_->usable = thin_frames(spec, bundle::usable_sightings(spec, state));
  const std::vector<int>& usable = impl_->usable;
  Spec robust = spec;
  if (spec.postures) {
    const bundle::RobustSolution solution =
        bundle::solve_robustly(robust, state, usable, options.reject_sigma, options.max_iterations);
    spec = std::move(robust);
    impl_->used = bundle::with_what_lasts(spec, state, solution);
  } else {
    bundle::settle(robust, state, usable, options.max_iterations);
    bundle::ChosenSightings chosen =
        bundle::choose_by_neighbours(spec, state, usable, options.reject_sigma);
    impl_->used = std::move(chosen.used);
    impl_->bias_px = chosen.bias_px;
    impl_->jitter_s = chosen.jitter_s;
  }
  spec.corrections.clear();
  state.corrections.clear();
  impl_->offset_start_s = state.time_offset[0];
  impl_->start = state;
  impl_->couplings = couplings_of(spec);

  std::set<int> frames;
  for (const int index : impl_->used) {
    frames.insert(spec.sightings[static_cast<std::size_t>(index)].frame);
  }
  const std::vector<int> driven = driven_joints();
  const Readings readings(spec, state);
  Eigen::MatrixXd features(static_cast<Eigen::Index>(frames.size()),
                           static_cast<Eigen::Index>(driven.size()));
  Eigen::Index row = 0;
  for (const int frame : frames) {
    for (std::size_t d = 0; d < driven.size(); ++d) {
      features(row, static_cast<Eigen::Index>(d)) = readings.value(frame, driven[d]);
    }
    ++row;
  }
  const std::vector<int> folds = bundle::assign_folds(features, kFolds);
  impl_->fold.assign(spec.times_s.size(), -1);
  std::size_t next = 0;
  for (const int frame : frames) impl_->fold[static_cast<std::size_t>(frame)] = folds[next++];
}

EffectBundle::~EffectBundle() = default;

namespace {

// Columns of a linearised bundle: the model's own, the change's, the probes'.
struct Columns {
  std::vector<Eigen::Index> own;
  std::vector<Eigen::Index> change;
  std::vector<Eigen::Index> probes;
};

Columns sort_columns(const LinearBundle& linear, std::size_t corrections, bool time_offset) {
  Columns out;
  Eigen::Index clock = -1;
  Eigen::Index next = 0;
  std::size_t known = 0;
  for (const FreeBlock& block : linear.blocks) {
    for (std::size_t i = 0; i < block.names.size(); ++i, ++next) {
      if (block.block == "effects") {
        (known++ < corrections ? out.change : out.probes).push_back(next);
      } else if (block.block == "clock") {
        clock = next;
      } else {
        out.own.push_back(next);
      }
    }
  }
  if (time_offset) out.change.push_back(clock);
  return out;
}

// Of every column of a bundle its place among some; -1: not there.
std::vector<Eigen::Index> places_in(const std::vector<Eigen::Index>& some, int width) {
  std::vector<Eigen::Index> out(static_cast<std::size_t>(width), -1);
  for (std::size_t i = 0; i < some.size(); ++i)
    out[static_cast<std::size_t>(some[i])] = static_cast<Eigen::Index>(i);
  return out;
}

// Of the rows from `first` on.
void add_entries(const Eigen::VectorXd& values, Eigen::Index first, Eigen::Index column,
                 std::vector<Eigen::Triplet<double>>& to) {
  if (column < 0) return;
  for (Eigen::Index i = 0; i < values.size(); ++i)
    if (values[i] != 0.0) to.emplace_back(first + i, column, values[i]);
}

// The part of a square matrix that these places tell of.
Eigen::MatrixXd among(const Eigen::SparseMatrix<double>& whole,
                      const std::vector<Eigen::Index>& places, Eigen::Index size) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index c = 0; c < whole.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator entry(whole, c); entry; ++entry) {
      const Eigen::Index a = places[static_cast<std::size_t>(entry.row())];
      const Eigen::Index b = places[static_cast<std::size_t>(entry.col())];
      if (a >= 0 && b >= 0) out(a, b) = entry.value();
    }
  }
  return out;
}

// What a joint that rests for long is off by is known from one fold for another.
bool is_of_one_fold(const Correction& correction, const std::vector<int>& fold_of_frame) {
  constexpr int kFew = 5;  // frames of other folds that tell little; chosen
  if (!correction.is_local || correction.share.size() == 0) return false;
  std::map<int, int> frames;
  for (Eigen::Index f = 0; f < correction.share.size(); ++f) {
    const int fold = fold_of_frame[static_cast<std::size_t>(f)];
    if (correction.share[f] != 0.0 && fold >= 0) ++frames[fold];
  }
  int all = 0, most = 0;
  for (const auto& [fold, count] : frames) {
    all += count;
    most = std::max(most, count);
  }
  return all - most <= kFew;
}

// What one whitened unit of each row of a sighting is.
Eigen::VectorXd units_of(const Sighting& sighting) {
  switch (sighting.kind) {
    case MeasurementKind::kCorners:
    case MeasurementKind::kPoint:
      return Eigen::VectorXd::Constant(sighting.dimension(), sighting.sigma);
    case MeasurementKind::kPose:
      break;
  }
  // Of a pose the error is given in metres: the turn's rows have none.
  Eigen::VectorXd units = Eigen::VectorXd::Zero(6);
  units.tail<3>() = sighting.whitening.bottomRightCorner<3, 3>().rowwise().norm().cwiseInverse();
  return units;
}

// Where in the image the model expects each row of a sighting: at the place seen, its own error
// would be among what a field may depend on.
Eigen::MatrixX2d places_of(const Spec& spec, const Sighting& sighting,
                           const Eigen::VectorXd& whitened) {
  Eigen::MatrixX2d places =
      Eigen::MatrixX2d::Constant(sighting.dimension(), 2, std::numeric_limits<double>::quiet_NaN());
  const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
  if (spec.path[marker.link.index()].empty()) return places;
  for (std::size_t i = 0; i < sighting.corners_px.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(2 * i);
    const Eigen::Vector2d expected =
        sighting.corners_px[i] - sighting.sigma * whitened.segment<2>(row);
    places.middleRows<2>(row).rowwise() = expected.transpose();
  }
  return places;
}

// What is eliminated from a frame mixes its rows: then none has a place of its own.
bool rows_have_places(const Spec& spec, const std::vector<int>& used) {
  if (spec.carried || std::ranges::find(spec.free_value, true) != spec.free_value.end())
    return false;
  return std::ranges::all_of(used, [&](int index) {
    return spec.sightings[static_cast<std::size_t>(index)].kind == MeasurementKind::kCorners;
  });
}

// The tree of a state, for joint values by the start's idea of the channels' units.
KinematicTree fitted_tree(const Spec& spec, const State& state, const State& start) {
  KinematicTree out = spec.tree;
  for (std::size_t j = 0; j < out.joints.size(); ++j) {
    Joint& joint = out.joints[j];
    const double offset = state.joint_maps[j][1] - start.joint_maps[j][1];
    joint.T_parent_joint = bundle::from_block(state.joint_frames[j].data()) *
                           joint_motion(joint.type, joint.axis, offset);
  }
  for (std::size_t m = 0; m < out.markers.size(); ++m)
    out.markers[m].T_link_marker = bundle::from_block(state.mounts[m].data());
  return out;
}

}  // namespace

void EffectBundle::Impl::change_model(const BundleChange& change, Spec& with, State& state) const {
  with = spec;
  state = start;
  for (const std::size_t coupling : change.without_couplings) {
    remove_coupling(couplings[coupling], with);
  }
  with.free_time_offset = change.time_offset;
  state.time_offset[0] = change.time_offset ? offset_start_s : 0.0;
  with.corrections = change.corrections;
  state.corrections.clear();
  for (const Correction& correction : with.corrections) {
    state.corrections.push_back(correction.value);
  }
}

bundle::SolveSummary EffectBundle::Impl::solve_from(const BundleChange& change, const Spec& with,
                                                    State& state) const {
  constexpr int kIterations = 60;
  const State begin = state;
  state = end_with_less(ends, change, begin).value_or(begin);
  bundle::SolveSummary out = bundle::solve(with, state, used, {}, kIterations);
  if (out.settled) return out;
  // Far from where it ends: with more freedom another one may have come near.
  if (std::optional<State> nearer = end_with_more(ends, change, begin)) {
    const bundle::SolveSummary other = bundle::solve(with, *nearer, used, {}, kIterations);
    if (other.settled) {
      state = *std::move(nearer);
      return other;
    }
  }
  if (out.iterations > 0) return out;
  // Beside what other effects bent, these put a marker where nothing can be predicted.
  state = begin;
  std::ranges::fill(state.corrections, 0.0);
  return bundle::solve(with, state, used, {}, kIterations);
}

// The least squares fit; `with` and `state` are left with the change in them.
BundleSolution EffectBundle::Impl::solve(const BundleChange& change, Spec& with,
                                         State& state) const {
  change_model(change, with, state);
  const bundle::SolveSummary summary = solve_from(change, with, state);
  BundleSolution out;
  out.converged = summary.settled;
  out.reason = summary.message;
  out.time_offset_s = state.time_offset[0];
  out.ahead_s = bundle::clock_of(with, state);
  int rows = 0;
  for (const int index : used) rows += with.sightings[static_cast<std::size_t>(index)].dimension();
  out.variance = 2.0 * summary.final_cost / std::max(1, rows);
  out.tree = fitted_tree(with, state, start);
  out.values = Eigen::Map<const Eigen::VectorXd>(
      state.corrections.data(), static_cast<Eigen::Index>(state.corrections.size()));
  if (change.time_offset) {
    out.values.conservativeResize(out.values.size() + 1);
    out.values[out.values.size() - 1] = state.time_offset[0];
  }
  out.end = std::make_shared<const End>(End{change.time_offset, names_of(change.corrections),
                                            change.without_couplings, state, summary.final_cost});
  return out;
}

BundleSolution EffectBundle::solve(const BundleChange& change) const {
  Spec spec;
  State state;
  BundleSolution out = impl_->solve(change, spec, state);
  if (out.converged) remember_in(impl_->ends, out.end);
  return out;
}

BundleFit EffectBundle::fit(const BundleChange& change, const std::vector<Correction>& probes,
                            const BundleSolution* solved) const {
  Spec spec;
  State state;
  BundleFit out;
  if (solved != nullptr) {
    impl_->change_model(change, spec, state);
    state = solved->end->state;
    static_cast<BundleSolution&>(out) = *solved;
  } else {
    static_cast<BundleSolution&>(out) = impl_->solve(change, spec, state);
  }

  // Probes stand beside the corrections, at zero.
  spec.corrections.insert(spec.corrections.end(), probes.begin(), probes.end());
  state.corrections.resize(spec.corrections.size(), 0.0);
  const LinearBundle linear = bundle::linearise(spec, state, impl_->used);
  const Columns columns = sort_columns(linear, change.corrections.size(), change.time_offset);
  std::vector<Eigen::Index> model = columns.own;
  std::vector<Eigen::Index> local;
  for (std::size_t c = 0; c < columns.change.size(); ++c) {
    const bool is_local =
        c < change.corrections.size() && is_of_one_fold(change.corrections[c], impl_->fold);
    (is_local ? local : model).push_back(columns.change[c]);
    if (is_local) out.local_corrections.push_back(static_cast<Eigen::Index>(c));
  }

  std::map<int, std::vector<int>> sightings;
  for (const int index : impl_->used) {
    sightings[spec.sightings[static_cast<std::size_t>(index)].frame].push_back(index);
  }
  Eigen::Index rows = 0;
  for (const auto& [frame, block] : linear.frames) rows += frame < 0 ? 0 : block.r.size();
  out.residual.resize(rows);
  out.unit.resize(rows);
  const bool with_places = rows_have_places(spec, impl_->used);
  if (with_places) out.place_px.resize(rows, 2);
  out.jacobian.setZero(rows, static_cast<Eigen::Index>(model.size()));
  const auto width = bundle::width_of(linear.blocks);
  const std::vector<Eigen::Index> in_model = places_in(model, width);
  const std::vector<Eigen::Index> in_probes = places_in(columns.probes, width);
  const std::vector<Eigen::Index> in_local = places_in(local, width);
  std::vector<Eigen::Triplet<double>> probe_entries;
  std::vector<Eigen::Triplet<double>> local_entries;
  Eigen::Index row = 0;
  for (const auto& [frame, block] : linear.frames) {
    if (frame < 0) continue;  // measured distances are part of the model's prior knowledge
    out.frames.push_back(frame);
    out.first_row.push_back(row);
    const Eigen::Index count = block.r.size();
    out.residual.segment(row, count) = block.r;
    for (std::size_t k = 0; k < block.shown.size(); ++k) {
      const auto column = static_cast<std::size_t>(block.shown[k]);
      const Eigen::VectorXd derivative = -block.J.col(static_cast<Eigen::Index>(k));
      if (in_model[column] >= 0)
        out.jacobian.col(in_model[column]).segment(row, count) = derivative;
      add_entries(derivative, row, in_probes[column], probe_entries);
      add_entries(derivative, row, in_local[column], local_entries);
    }
    Eigen::Index at = row;
    for (const int index : sightings.at(frame)) {
      const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
      const Eigen::VectorXd units = units_of(sighting);
      out.unit.segment(at, units.size()) = units;
      out.series.insert(out.series.end(), static_cast<std::size_t>(units.size()), sighting.series);
      if (with_places) {
        out.place_px.middleRows(at, units.size()) =
            places_of(spec, sighting, out.residual.segment(at, units.size()));
      }
      at += units.size();
    }
    row += count;
  }
  out.first_row.push_back(row);
  out.probes.resize(rows, static_cast<Eigen::Index>(probes.size()));
  out.probes.setFromTriplets(probe_entries.begin(), probe_entries.end());
  out.local.resize(rows, std::ssize(local));
  out.local.setFromTriplets(local_entries.begin(), local_entries.end());
  out.local_values = out.values(out.local_corrections);
  out.local_information = Eigen::VectorXd(linear.prior_information.diagonal())(local);
  if (linear.prior_information.nonZeros() > 0) {
    out.prior_information = among(linear.prior_information, in_model, std::ssize(model));
    out.prior_gradient = linear.prior_gradient(model);
  }
  if (const auto distances = linear.frames.find(-1); distances != linear.frames.end()) {
    const Eigen::MatrixXd J = distances->second.dense(width)(Eigen::all, model);
    if (out.prior_information.size() == 0) {
      out.prior_information = Eigen::MatrixXd::Zero(J.cols(), J.cols());
      out.prior_gradient = Eigen::VectorXd::Zero(J.cols());
    }
    out.prior_information += J.transpose() * J;
    out.prior_gradient += J.transpose() * distances->second.r;
  }
  out.correlation_time_s = spec.postures ? 0.0 : bundle::correlation_time(spec, state, impl_->used);
  return out;
}

double EffectBundle::most_of_a_sighting() const {
  int rows = 1;
  for (const int index : impl_->usable)
    rows = std::max(rows, impl_->spec.sightings[static_cast<std::size_t>(index)].dimension());
  return chi_square_quantile(rows, impl_->reject_sigma);
}

Eigen::VectorXd EffectBundle::squares_of_frames(const BundleChange& change,
                                                const BundleSolution& solved) const {
  Spec with;
  State unused;
  impl_->change_model(change, with, unused);
  const State& state = solved.end->state;
  const Readings readings(with, state);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(with.times_s.size()));
  for (const int index : impl_->usable) {
    const Sighting& sighting = with.sightings[static_cast<std::size_t>(index)];
    const auto at = bundle::corrected_error_of(with, state, readings, sighting);
    const double most = chi_square_quantile(sighting.dimension(), impl_->reject_sigma);
    const double squares = at ? at->error.residual.squaredNorm() : most;
    out[sighting.frame] += squares < most ? squares : most;
  }
  return out;
}

JointMotion EffectBundle::Impl::motion(const std::vector<double>& times_s,
                                       const Eigen::MatrixXd& ahead_s) const {
  Spec at = spec;
  at.times_s = times_s;
  const Readings readings(at, ahead_s);
  const auto rows = static_cast<Eigen::Index>(times_s.size());
  const auto joints = static_cast<Eigen::Index>(spec.tree.joints.size());
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(rows, joints);
  JointMotion out{times_s, none, none, ahead_s};
  out.read_s.colwise() += Eigen::Map<const Eigen::VectorXd>(times_s.data(), rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < joints; ++j) {
      const auto map = start.joint_maps[static_cast<std::size_t>(j)];
      out.value(i, j) = map[0] * readings.value(static_cast<int>(i), static_cast<int>(j)) + map[1];
      out.rate(i, j) = map[0] * readings.rate(static_cast<int>(i), static_cast<int>(j));
    }
  }
  add_copies(at, ahead_s, out);
  return out;
}

// What joints' copies say at the same times: read in place of their own channels.
void EffectBundle::Impl::add_copies(const Spec& at, const Eigen::MatrixXd& ahead_s,
                                    JointMotion& out) const {
  for (std::size_t j = 0; j < at.tree.joints.size(); ++j) {
    const auto map = start.joint_maps[j];
    for (const std::string& column : at.tree.joints[j].copies) {
      const auto channel = at.log.channel(column);
      if (at.channel[j] < 0 || !channel) continue;
      Spec instead = at;
      instead.channel[j] = *channel;
      const Readings readings(instead, ahead_s);
      Eigen::VectorXd value(out.value.rows());
      for (Eigen::Index i = 0; i < value.size(); ++i)
        value[i] = map[0] * readings.value(static_cast<int>(i), static_cast<int>(j)) + map[1];
      out.copies[static_cast<int>(j)].push_back(std::move(value));
    }
  }
}

const KinematicTree& EffectBundle::tree() const { return impl_->spec.tree; }
MeasurementKind EffectBundle::kind() const { return impl_->spec.kind; }
std::vector<BundleCamera> EffectBundle::cameras() const {
  std::vector<BundleCamera> out;
  for (const bundle::SpecCamera& camera : impl_->spec.cameras)
    out.push_back({camera.name, camera.model});
  return out;
}
bool EffectBundle::of_recordings() const { return !impl_->spec.starts_s.empty(); }
LinkId EffectBundle::camera_link() const { return impl_->spec.camera_link; }
bool EffectBundle::is_camera_carried() const { return impl_->spec.carried; }
const std::vector<int>& EffectBundle::camera_of_frame() const {
  return impl_->spec.camera_of_frame;
}
double EffectBundle::corner_bias_px() const { return impl_->bias_px; }
double EffectBundle::stamp_jitter_s() const { return impl_->jitter_s; }
bool EffectBundle::postures() const { return impl_->spec.postures; }
const std::vector<int>& EffectBundle::fold_of_frame() const { return impl_->fold; }

double EffectBundle::start_time_offset_s() const { return impl_->offset_start_s; }

Eigen::MatrixXd EffectBundle::clock_ahead(double time_offset_s) const {
  State at = impl_->start;
  at.time_offset[0] = time_offset_s;
  return bundle::plain_clock(impl_->spec, at);
}

JointMotion EffectBundle::motion_at_frames(double time_offset_s) const {
  return motion_at_frames(clock_ahead(time_offset_s));
}

JointMotion EffectBundle::motion_at_frames(const Eigen::MatrixXd& ahead_s) const {
  return impl_->motion(impl_->spec.times_s, ahead_s);
}

JointMotion EffectBundle::motion_of_log(double time_offset_s) const {
  constexpr double kBeforeFirst = 5.0;  // s of history, for what depends on where a joint came from
  const Spec& spec = impl_->spec;
  std::vector<double> times_s;
  for (const double t : spec.log.times_s) {
    if (t >= spec.times_s.front() + time_offset_s - kBeforeFirst &&
        t <= spec.times_s.back() + time_offset_s + 1.0) {
      times_s.push_back(t);
    }
  }
  // A fit may have run off with the clock.
  if (times_s.empty()) times_s = spec.log.times_s;
  return impl_->motion(times_s,
                       Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(times_s.size()),
                                             static_cast<Eigen::Index>(spec.tree.joints.size())));
}

std::vector<int> EffectBundle::driven_joints() const {
  std::vector<int> out;
  for (std::size_t j = 0; j < impl_->spec.channel.size(); ++j) {
    if (impl_->spec.channel[j] >= 0) out.push_back(static_cast<int>(j));
  }
  return out;
}

std::vector<int> EffectBundle::moving_joints() const {
  std::vector<int> out = driven_joints();
  std::erase_if(out, [&](int joint) {
    return bundle::stands_still(impl_->spec, static_cast<std::size_t>(joint));
  });
  return out;
}

const std::vector<DesignCoupling>& EffectBundle::couplings() const { return impl_->couplings; }

bool EffectBundle::chose_as(const EffectBundle& other) const {
  return impl_->used == other.impl_->used;
}

double EffectBundle::finer_than(const EffectBundle& other) const {
  struct Sum {
    double log_ratio = 0.0;
    int count = 0;
  };
  std::map<int, Sum> of_marker;
  std::vector<int> common;
  std::ranges::set_intersection(impl_->used, other.impl_->used, std::back_inserter(common));
  for (const int index : common) {
    const auto i = static_cast<std::size_t>(index);
    const Sighting& here = impl_->spec.sightings[i];
    Sum& sum = of_marker[here.marker];
    sum.log_ratio += std::log(other.impl_->spec.sightings[i].sigma / here.sigma);
    ++sum.count;
  }
  double out = 1.0;
  for (const auto& [marker, sum] : of_marker)
    out = std::max(out, std::exp(sum.log_ratio / sum.count));
  return out;
}

std::vector<int> EffectBundle::seen_markers() const {
  std::set<int> seen;
  for (const int index : impl_->used) {
    seen.insert(impl_->spec.sightings[static_cast<std::size_t>(index)].marker);
  }
  return {seen.begin(), seen.end()};
}

std::map<int, std::vector<int>> EffectBundle::cameras_of_markers() const {
  std::map<int, std::set<int>> seen;
  for (const int index : impl_->used) {
    const Sighting& sighting = impl_->spec.sightings[static_cast<std::size_t>(index)];
    seen[sighting.marker].insert(sighting.camera);
  }
  std::map<int, std::vector<int>> out;
  for (const auto& [marker, cameras] : seen) out[marker] = {cameras.begin(), cameras.end()};
  return out;
}

}  // namespace kinescope
