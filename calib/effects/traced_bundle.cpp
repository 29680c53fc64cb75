// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/traced_bundle.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>

#include <fmt/format.h>

#include "calib/effects/elsewhere.h"
#include "calib/effects/suspect.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

// What it does at an instant is not in proportion to its size.
bool depends_on_its_size(const AddedEffect& added) {
  return is_sag(added.id) || is_bend(added.id, added.scan);
}

// Probes without a share, each once: what columns of candidates act through. A direction that
// changes with time is a probe of its own.
class Carriers {
 public:
  int add(Correction correction) {
    if (const auto known = place_of(correction)) return *known;
    if (correction.twists.rows() == 0) {
      correction.share.resize(0);
      correction.value = 0.0;
    }
    probes_.push_back(std::move(correction));
    return static_cast<int>(probes_.size()) - 1;
  }

  // The column of a correction that was added: a carrier, and the share of each instant.
  [[nodiscard]] EffectColumn column(const Correction& correction,
                                    const std::vector<int>& frames) const {
    const auto known = place_of(correction);
    KINESCOPE_CHECK(known.has_value(), "a fit knows the carriers of all its candidates");
    EffectColumn out;
    out.carrier = *known;
    if (correction.twists.rows() > 0 || correction.share.size() == 0) return out;
    out.share.resize(static_cast<Eigen::Index>(frames.size()));
    for (std::size_t i = 0; i < frames.size(); ++i)
      out.share[static_cast<Eigen::Index>(i)] = correction.share[frames[i]];
    return out;
  }

  [[nodiscard]] const std::vector<Correction>& probes() const { return probes_; }

 private:
  [[nodiscard]] std::optional<int> place_of(const Correction& correction) const {
    const auto is_same = [&](const Correction& known) {
      if (known.part != correction.part || known.index != correction.index) return false;
      if (known.twists.rows() != correction.twists.rows()) return false;
      if (known.twists.rows() > 0) return known.twists == correction.twists;
      return known.direction == correction.direction;
    };
    const auto found = std::ranges::find_if(probes_, is_same);
    if (found == probes_.end()) return std::nullopt;
    return static_cast<int>(found - probes_.begin());
  }

  std::vector<Correction> probes_;
};

std::vector<CameraEffect> all_effects(const EffectWorld& world) {
  std::vector<CameraEffect> out = camera_effects(world);
  for (CameraEffect& effect : time_effects(world)) out.push_back(std::move(effect));
  for (CameraEffect& effect : recording_effects(world)) out.push_back(std::move(effect));
  for (CameraEffect& effect : joint_effects(world)) out.push_back(std::move(effect));
  return out;
}

const CameraEffect& effect_of(const std::vector<CameraEffect>& library, const EffectId& id) {
  const auto found = std::ranges::find_if(
      library, [&](const CameraEffect& effect) { return effect.candidate.id == id; });
  KINESCOPE_CHECK(found != library.end(), "an added effect is in the library");
  return *found;
}

// Behind the effects' own parameters.
std::vector<Correction> nuisances_of(const std::vector<CameraEffect>& library,
                                     const std::vector<AddedEffect>& effects) {
  std::vector<Correction> out;
  for (const AddedEffect& added : effects) {
    const CameraEffect& effect = effect_of(library, added.id);
    if (!effect.nuisances) continue;
    for (Correction& nuisance : effect.nuisances(added.scan)) {
      // Play that was found twice began at one place.
      if (std::ranges::find(out, nuisance.name, &Correction::name) == out.end())
        out.push_back(std::move(nuisance));
    }
  }
  return out;
}

// Where each effect's parameters stand among those of the change.
std::vector<std::vector<Eigen::Index>> parameter_places(const std::vector<CameraEffect>& library,
                                                        const std::vector<AddedEffect>& effects,
                                                        Eigen::Index corrections) {
  std::vector<std::vector<Eigen::Index>> out;
  Eigen::Index next = 0;
  for (const AddedEffect& added : effects) {
    const CameraEffect& effect = effect_of(library, added.id);
    std::vector<Eigen::Index>& places = out.emplace_back();
    if (effect.is_time_offset) {
      places.push_back(corrections);
      continue;
    }
    const std::size_t count = effect.candidate.is_curve() ? effect.corrections(added.scan).size()
                                                          : effect.candidate.parameters.size();
    for (std::size_t k = 0; k < count; ++k) places.push_back(next++);
  }
  return out;
}

std::vector<AddedEffect> sized(std::vector<AddedEffect> effects) {
  std::erase_if(effects, [](const AddedEffect& added) { return !depends_on_its_size(added); });
  return effects;
}

// Both do the same at every instant, nearly.
bool are_alike(const Correction& one, const Correction& other) {
  // Of what the effect does; the narrowest interval of a sag was 0.4 % (`undeclared`, 10004).
  constexpr double kAlike = 1e-4;
  const auto near = [](const auto& a, const auto& b) {
    return a.size() == b.size() && (a - b).norm() <= kAlike * b.norm();
  };
  if (one.name != other.name) return false;
  return one.is_nuisance || (near(one.share, other.share) && near(one.twists, other.twists));
}

// By its neighbours, in its unit per s.
Eigen::VectorXd slope_of(const Eigen::VectorXd& values, const std::vector<double>& times_s) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Eigen::Index before = std::max<Eigen::Index>(0, i - 1);
    const Eigen::Index after = std::min<Eigen::Index>(values.size() - 1, i + 1);
    const double span_s =
        times_s[static_cast<std::size_t>(after)] - times_s[static_cast<std::size_t>(before)];
    if (span_s > 0.0) out[i] = (values[after] - values[before]) / span_s;
  }
  return out;
}

// Two joints that act together (gravity, a cable along both) bend each other's curves: of such
// surfaces the product is the first term that no curve over one of them has.
std::vector<Covariate> products_of(const std::vector<Covariate>& values) {
  std::vector<Covariate> out;
  const auto centred = [](const Covariate& joint) -> Eigen::ArrayXd {
    return joint.value.array() - joint.value.mean();
  };
  for (std::size_t a = 0; a < values.size(); ++a) {
    for (std::size_t b = a + 1; b < values.size(); ++b) {
      const std::string unit = values[a].unit == values[b].unit
                                   ? values[a].unit + "^2"
                                   : values[a].unit + " " + values[b].unit;
      out.push_back({fmt::format("{} times {}", values[a].name, values[b].name), unit,
                     centred(values[a]) * centred(values[b]), true});
    }
  }
  return out;
}

std::vector<Covariate> covariates_of(const EffectWorld& world, const std::vector<int>& frames) {
  std::vector<Covariate> joints;
  std::vector<Covariate> out;
  const auto at_instants = [&](const Eigen::VectorXd& by_frame) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(frames.size()));
    for (std::size_t i = 0; i < frames.size(); ++i) {
      values[static_cast<Eigen::Index>(i)] = by_frame[frames[i]];
    }
    return values;
  };
  for (const int joint : world.driven) {
    const Joint& j = world.tree.joints[static_cast<std::size_t>(joint)];
    const std::string unit = j.type == JointType::kRevolute ? "rad" : "m";
    joints.push_back({"value of " + j.name, unit, at_instants(world.frames.value.col(joint))});
    out.push_back(joints.back());
    if (world.postures) continue;
    const Eigen::VectorXd rate = at_instants(world.frames.rate.col(joint));
    out.push_back({"acceleration of " + j.name, unit + "/s^2",
                   at_instants(slope_of(world.frames.rate.col(joint), world.frames.times_s))});
    out.push_back({"speed of " + j.name, unit + "/s", rate});
    out.push_back({"direction of " + j.name, "",
                   rate.unaryExpr([](double v) { return v > 0.0 ? 1.0 : -1.0; })});
  }
  std::ranges::move(products_of(joints), std::back_inserter(out));
  if (!world.postures) {
    out.push_back({"time", "s",
                   at_instants(Eigen::Map<const Eigen::VectorXd>(
                       world.frames.times_s.data(),
                       static_cast<Eigen::Index>(world.frames.times_s.size())))});
  }
  return out;
}

std::vector<RestPlace> rest_places_of(const EffectWorld& world, Carriers& carriers) {
  // An rms of some dozen postures' readings, and of joints behind one another, is no better known.
  constexpr double kAtLeast = 0.5;
  constexpr double kAtMost = 1.3;
  std::vector<RestPlace> out;
  for (const int joint : world.driven) {
    const Joint& j = world.tree.joints[static_cast<std::size_t>(joint)];
    Correction value;
    value.index = joint;
    const bool turns = j.type == JointType::kRevolute;
    (turns ? value.direction.head<3>() : value.direction.tail<3>()) = j.axis;
    RestPlace place{j.name, turns ? "rad" : "m", carriers.add(value), 0.0, 0.0};
    if (const auto found = world.unsteady.find(joint); found != world.unsteady.end()) {
      // Where a motion took the place of the reading, any part of the error may be left.
      if (world.postures) place.reading_error_least = kAtLeast * found->second.error;
      place.reading_error_most = kAtMost * found->second.error;
    }
    out.push_back(std::move(place));
  }
  // One that sways, or creeps as no drift does; a shift of it looks like a turn.
  const bool alone = world.cameras.size() <= 1 && !world.is_carried;
  for (int axis = 0; alone && axis < 3; ++axis) {
    Correction turn;
    turn.part = CorrectedPart::kCamera;
    turn.direction = Vector6d::Unit(axis);
    out.push_back({fmt::format("camera-to-base pose about {}", "xyz"[axis]), "rad",
                   carriers.add(turn), 0.0, 0.0});
  }
  if (alone && world.kind == MeasurementKind::kCorners) {
    Correction focal;  // autofocus that hunts
    focal.part = CorrectedPart::kFocalLength;
    out.push_back({"camera focal length", "", carriers.add(focal), 0.0, 0.0});
  }
  for (const int marker : world.seen) {
    const Marker& m = world.tree.markers[static_cast<std::size_t>(marker)];
    for (int axis = 0; axis < 2; ++axis) {
      Correction shift;
      shift.part = CorrectedPart::kMarker;
      shift.index = marker;
      shift.direction = Vector6d::Unit(3 + axis);
      out.push_back({fmt::format("tag_{} along {}", m.id.value, "xy"[axis]), "m",
                     carriers.add(shift), 0.0, 0.0});
    }
  }
  return out;
}

// The time of a frame, as all joints that move show it.
int clock_carrier(Carriers& carriers) {
  Correction time;
  time.part = CorrectedPart::kClock;
  time.index = kEverywhere;
  return carriers.add(time);
}

// The carriers' places are filled in when the fit has told which rows have one.
std::vector<RestField> rest_fields_of(const EffectWorld& world, double floor, Carriers& carriers) {
  if (world.kind != MeasurementKind::kCorners) return {};
  RestField image{"camera", "px", "place in the image", "px", {}, {}, std::max(floor, kUsualShift)};
  for (int axis = 0; axis < 2; ++axis) {
    Correction shift;  // all corners alike
    shift.part = CorrectedPart::kIntrinsic;
    shift.index = kFirstOfCentre + axis;
    image.carriers[static_cast<std::size_t>(axis)] = carriers.add(shift);
  }
  std::vector<RestField> out;
  for (std::size_t c = 0; c < world.cameras.size(); ++c) {
    image.name = place_at(world, c, "camera");
    out.push_back(image);
  }
  return out;
}

// The places of one camera's rows.
Eigen::MatrixX2d places_in_image(const EffectWorld& world, std::size_t camera,
                                 const BundleFit& fit) {
  Eigen::MatrixX2d out = fit.place_px;
  const auto series_of_camera = static_cast<int>(world.tree.markers.size());
  for (std::size_t row = 0; row < fit.series.size(); ++row) {
    if (fit.series[row] / series_of_camera != static_cast<int>(camera))
      out.row(static_cast<Eigen::Index>(row)).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  return out;
}

// Adds to the joints' values (frames x joints) what the corrections of a solution move them by.
void add_values(const std::vector<Correction>& corrections, const BundleSolution& solution,
                Eigen::MatrixXd& values) {
  for (std::size_t k = 0; k < corrections.size(); ++k) {
    const Correction& correction = corrections[k];
    if (correction.part != CorrectedPart::kJoint || correction.share.size() == 0) continue;
    const Joint& joint = solution.tree.joints[static_cast<std::size_t>(correction.index)];
    const double along = joint.type == JointType::kRevolute
                             ? correction.direction.head<3>().dot(joint.axis)
                             : correction.direction.tail<3>().dot(joint.axis);
    values.col(correction.index) +=
        along * solution.values[static_cast<Eigen::Index>(k)] * correction.share;
  }
}

// Of what stands beside an effect, as it was fitted.
Eigen::VectorXd values_of(const std::vector<Correction>& nuisances,
                          const std::vector<Correction>& fitted) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(nuisances.size()));
  for (std::size_t k = 0; k < nuisances.size(); ++k) {
    const auto known = std::ranges::find(fitted, nuisances[k].name, &Correction::name);
    KINESCOPE_CHECK(known != fitted.end(), "what stands beside an effect is fitted with it");
    out[static_cast<Eigen::Index>(k)] = known->value;
  }
  return out;
}

// Gravity as the joint says whose sag hangs on it most; nothing where none does.
std::optional<Eigen::Vector3d> gravity_of(const std::vector<CameraEffect>& library,
                                          const std::vector<AddedEffect>& effects,
                                          const std::vector<Correction>& fitted) {
  std::optional<Eigen::Vector3d> out;
  double most = -1.0;
  for (const AddedEffect& added : effects) {
    const CameraEffect& effect = effect_of(library, added.id);
    if (!effect.gravity_base) continue;
    const std::vector<Correction> turns = effect.nuisances(added.scan);
    double telling = 0.0;
    for (const Correction& turn : turns) telling += turn.share.squaredNorm();
    if (telling <= most) continue;
    most = telling;
    out = effect.gravity_base(values_of(turns, fitted));
  }
  return out;
}

// Doubts that move what is seen by less than its noise are none.
void keep_visible_doubts(const EffectBundle& bundle, std::map<int, UnsteadyReading>& readings) {
  EffectWorld world;
  world.tree = bundle.tree();
  world.frames = bundle.motion_at_frames(0.0);
  std::vector<int> joints;
  std::vector<Correction> turns;
  for (const auto& [joint, reading] : readings) {
    if (reading.doubts.empty()) continue;
    const Suspect s = suspect(world, joint);
    joints.push_back(joint);
    turns.push_back(turn(s, "turn", s.unit, {}));
  }
  if (joints.empty()) return;
  const BundleFit fit = bundle.fit({}, turns);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Eigen::VectorXd slope = fit.probes.col(static_cast<Eigen::Index>(j));
    Eigen::VectorXd information = Eigen::VectorXd::Zero(world.frames.value.rows());
    for (std::size_t i = 0; i < fit.frames.size(); ++i) {
      const Eigen::Index first = fit.first_row[i];
      information[fit.frames[i]] = slope.segment(first, fit.first_row[i + 1] - first).squaredNorm();
    }
    readings.at(joints[j]).keep_visible(world.frames.read_s.col(joints[j]), information);
  }
}

}  // namespace

TracedBundle::TracedBundle(const EffectBundle& bundle, const CalibrationTraceOptions& options,
                           std::vector<std::size_t> without_couplings)
    : bundle_(&bundle), options_(options), without_couplings_(std::move(without_couplings)) {
  const bool postures = bundle_->postures();
  unsteady_ =
      unsteady_readings(postures ? bundle_->motion_at_frames(0.0) : bundle_->motion_of_log(0.0),
                        bundle_->driven_joints(), postures);
  if (!postures) keep_visible_doubts(*bundle_, unsteady_);
}

BundleChange TracedBundle::change_of(const std::vector<CameraEffect>& library,
                                     const std::vector<AddedEffect>& effects) const {
  BundleChange out;
  out.without_couplings = without_couplings_;
  for (const AddedEffect& added : effects) {
    const CameraEffect& effect = effect_of(library, added.id);
    if (effect.is_time_offset) {
      out.time_offset = true;
      continue;
    }
    for (Correction& correction : effect.corrections(added.scan)) {
      correction.prior_sigma = added.spread;
      out.corrections.push_back(std::move(correction));
    }
  }
  for (Correction& nuisance : nuisances_of(library, effects))
    out.corrections.push_back(std::move(nuisance));
  return out;
}

EffectWorld TracedBundle::world_at(const Eigen::MatrixXd& ahead_s) const {
  EffectWorld world;
  world.tree = bundle_->tree();
  world.cameras = bundle_->cameras();
  world.camera_of_frame = bundle_->camera_of_frame();
  world.of_recordings = bundle_->of_recordings();
  world.camera_link = bundle_->camera_link();
  world.is_carried = bundle_->is_camera_carried();
  world.kind = bundle_->kind();
  world.postures = bundle_->postures();
  world.driven = bundle_->driven_joints();
  world.moving = bundle_->moving_joints();
  world.seen = bundle_->seen_markers();
  if (world.of_recordings) world.seen_by = bundle_->cameras_of_markers();
  world.frames = bundle_->motion_at_frames(ahead_s);
  world.loaded = world.frames;
  world.log = bundle_->motion_of_log(world.postures ? 0.0 : ahead_s.mean());
  world.unsteady = unsteady_;
  world.gravity_base = options_.gravity_base;
  world.clock_free = options_.calibrate.estimate_time_offset;
  world.first_s = world.frames.times_s.front();
  world.last_s = world.frames.times_s.back();
  return world;
}

// The clock as the last fit with an effect of it had it: the next is near.
Eigen::MatrixXd TracedBundle::likely_clock(const std::vector<AddedEffect>& effects) const {
  if (std::ranges::none_of(effects, is_of_clock, &AddedEffect::id)) return clock_ahead(0.0);
  return memory_.ahead_s ? *memory_.ahead_s : clock_ahead(bundle_->start_time_offset_s());
}

Eigen::MatrixXd TracedBundle::clock_ahead(double time_offset_s) const {
  return bundle_->clock_ahead(time_offset_s);
}

TracedBundle::Ready TracedBundle::ready_at(const Eigen::MatrixXd& ahead_s,
                                           const std::vector<AddedEffect>& effects) const {
  Ready out;
  out.world = world_at(ahead_s);
  const std::optional<Sized>& sizes = memory_.sizes;
  if (sizes && sizes->effects == sized(effects)) {
    out.world.tree = sizes->tree;
    out.world.loaded.value += sizes->added;
    out.world.sags = sizes->sags;
    out.world.bends = sizes->bends;
  }
  // Of one that is asked for again, too: it is compared with others as it was found.
  out.world.play_starts = memory_.play_starts;
  for (const AddedEffect& added : effects) {
    if (!is_play(added.id)) continue;
    const std::optional<JointId> joint = out.world.tree.joint(added.id.place);
    KINESCOPE_CHECK(joint.has_value(), "an effect of a joint sits on one");
    // In the middle of its gap, as far as is known.
    out.world.play_starts.emplace(joint->value, 0.0);
  }
  out.library = all_effects(out.world);
  out.change = change_of(out.library, effects);
  return out;
}

TracedBundle::Sized TracedBundle::sizes_of(const std::vector<AddedEffect>& effects,
                                           const Ready& ready,
                                           const BundleSolution& solution) const {
  const std::vector<Correction>& corrections = ready.change.corrections;
  const auto places =
      parameter_places(ready.library, effects, static_cast<Eigen::Index>(corrections.size()));
  Sized out{sized(effects),
            solution.tree,
            Eigen::MatrixXd::Zero(ready.world.frames.value.rows(), ready.world.frames.value.cols()),
            {},
            {}};
  add_values(corrections, solution, out.added);
  for (std::size_t i = 0; i < effects.size(); ++i) {
    if (!depends_on_its_size(effects[i])) continue;
    Eigen::VectorXd values = solution.values(places[i]);
    const int joint = corrections[static_cast<std::size_t>(places[i].front())].index;
    if (is_bend(effects[i].id, effects[i].scan)) {
      out.bends.insert_or_assign(joint, Eigen::Vector2d(values));
      continue;
    }
    for (std::size_t k = 0; k < places[i].size(); ++k)
      values[static_cast<Eigen::Index>(k)] /=
          corrections[static_cast<std::size_t>(places[i][k])].reference;
    out.sags.insert_or_assign(joint, std::move(values));
  }
  return out;
}

bool TracedBundle::find_play_starts(const std::vector<AddedEffect>& effects, const Ready& ready,
                                    const BundleSolution& solution) const {
  constexpr double kSameStart = 1e-3;  // of the gap; chosen, not measured
  bool are_new = false;
  for (const AddedEffect& added : effects) {
    if (!is_play(added.id)) continue;
    const std::string name = fmt::format("{} {}", added.id.place, kPlayStart);
    const std::vector<Correction>& corrections = ready.change.corrections;
    const auto further = std::ranges::find(corrections, name, &Correction::name);
    if (further == corrections.end()) continue;
    const double before = ready.world.play_starts.at(further->index);
    const double start = std::clamp(before + solution.values[further - corrections.begin()],
                                    -0.5 * added.scan, 0.5 * added.scan);
    are_new = are_new || std::abs(start - before) > kSameStart * added.scan;
    memory_.play_starts.insert_or_assign(further->index, start);
  }
  return are_new;
}

// Shares are taken where the joints are by the clock that the fit finds, and loads where the
// effects leave them: a sag of q under k sin(q + sag) is not one under k sin(q).
TracedBundle::Ready TracedBundle::ready_for(const std::vector<AddedEffect>& effects) const {
  constexpr int kRounds = 2;           // each leaves of its error what the effect's size is, in rad
  constexpr double kSameTime = 20e-6;  // s: no joint moves noticeably
  const bool clock = std::ranges::any_of(effects, is_of_clock, &AddedEffect::id);
  const bool by_size = std::ranges::any_of(effects, depends_on_its_size);
  Eigen::MatrixXd ahead_s = likely_clock(effects);
  Ready out = ready_at(ahead_s, effects);
  const bool play = std::ranges::any_of(effects, is_play, &AddedEffect::id);
  const int rounds = by_size || play ? kRounds : clock ? 1 : 0;
  for (int round = 0; round < rounds; ++round) {
    BundleSolution solution = bundle_->solve(out.change);
    if (clock && solution.converged) memory_.ahead_s = solution.ahead_s;
    if (by_size && solution.converged) memory_.sizes = sizes_of(effects, out, solution);
    const bool starts_elsewhere =
        play && solution.converged && find_play_starts(effects, out, solution);
    const bool same_time = (solution.ahead_s - ahead_s).cwiseAbs().maxCoeff() < kSameTime;
    ahead_s = solution.ahead_s;
    std::optional<Ready> next;
    if (solution.converged && (by_size || starts_elsewhere || !same_time))
      next = ready_at(ahead_s, effects);
    if (!next || std::ranges::equal(next->change.corrections, out.change.corrections, are_alike)) {
      out.solved = std::move(solution);
      break;
    }
    out = std::move(*next);
  }
  if (!out.solved) out.solved = bundle_->solve(out.change);
  return out;
}

std::vector<AddedEffect> TracedBundle::possible(std::vector<AddedEffect> effects) const {
  const std::vector<CameraEffect> library = all_effects(world_at(clock_ahead(0.0)));
  std::erase_if(effects, [&](const AddedEffect& added) {
    return std::ranges::none_of(library, [&](const CameraEffect& effect) {
      return effect.candidate.id == added.id && !effect.candidate.is_curve();
    });
  });
  return effects;
}

std::vector<AddedEffect> TracedBundle::at_likeliest_instants(
    std::vector<AddedEffect> effects) const {
  const auto once = [](const CameraEffect& effect) { return effect.candidate.scan_step > 0.0; };
  const std::vector<CameraEffect> all = all_effects(world_at(clock_ahead(0.0)));
  const bool any = std::ranges::any_of(
      effects, [&](const AddedEffect& added) { return once(effect_of(all, added.id)); });
  if (!any || bundle_->of_recordings()) return effects;
  const auto [world, library, change, solved] = ready_for(effects);
  if (!solved->converged) return effects;
  const std::vector<double>& times_s = world.frames.times_s;
  // Cameras follow one another.
  std::vector<std::size_t> from_last(times_s.size());
  std::iota(from_last.begin(), from_last.end(), std::size_t{0});
  std::ranges::stable_sort(from_last, std::greater{}, [&](std::size_t f) { return times_s[f]; });
  const std::vector<AddedEffect> found = effects;
  // Of every frame, with the effect having happened by an instant.
  const auto squares_since = [&, &library = library, &solved = solved](std::size_t i, double at_s) {
    std::vector<AddedEffect> varied = found;
    varied[i].scan = at_s;
    return bundle_->squares_of_frames(change_of(library, varied), *solved);
  };
  constexpr double kNever = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < effects.size(); ++i) {
    AddedEffect& added = effects[i];
    const CameraEffect& effect = effect_of(library, added.id);
    if (!once(effect)) continue;
    const Eigen::VectorXd gain = squares_since(i, kNever) - squares_since(i, -kNever);
    // What it gains if it happened at each.
    double best_s = added.scan;
    double since = 0.0;
    double most = -std::numeric_limits<double>::infinity();
    double now = 0.0;
    for (const std::size_t f : from_last) {
      since += gain[static_cast<Eigen::Index>(f)];
      if (times_s[f] >= added.scan) now = since;
      const bool searched =
          times_s[f] >= effect.candidate.scan.front() && times_s[f] <= effect.candidate.scan.back();
      if (!searched || since <= most) continue;
      most = since;
      best_s = times_s[f];
    }
    if (most > now + bundle_->most_of_a_sighting()) added.scan = best_s;
  }
  return effects;
}

EffectWorld TracedBundle::world_of(const std::vector<AddedEffect>& effects) const {
  return std::move(ready_for(effects).world);
}

TracedFit TracedBundle::fit(const std::vector<AddedEffect>& effects) const {
  auto [world, library, change, solved] = ready_for(effects);
  // Carriers of all candidates at one value of their scans: the same for the others, unless a
  // direction changes with the scan.
  Carriers carriers;
  for (const CameraEffect& effect : library) {
    const std::vector<double> scan =
        effect.candidate.scan.empty() ? std::vector<double>{0.0} : effect.candidate.scan;
    const std::size_t values = effect.candidate.scan_listed ? scan.size() : 1;
    for (std::size_t v = 0; v < values; ++v) {
      for (Correction& correction : effect.corrections(scan[v]))
        carriers.add(std::move(correction));
    }
  }
  TracedFit out;
  out.rest_places = rest_places_of(world, carriers);
  out.rest_fields = rest_fields_of(world, options_.trace.floor, carriers);
  if (!world.postures) out.clock = clock_carrier(carriers);
  BundleFit fit = bundle_->fit(change, carriers.probes(), &*solved);
  if (fit.place_px.size() == 0) out.rest_fields.clear();
  for (std::size_t c = 0; c < out.rest_fields.size(); ++c)
    out.rest_fields[c].at = places_in_image(world, c, fit);
  out.converged = fit.converged;
  out.reason = fit.reason;
  const auto places =
      parameter_places(library, effects, static_cast<Eigen::Index>(change.corrections.size()));
  // The change's columns stand in the bundle's order: put them into that of the effects.
  const Eigen::Index own = fit.jacobian.cols() - fit.values.size() + fit.local_values.size();
  std::vector<Eigen::Index> column_of;  // of every value of the change
  std::vector<Eigen::Index> order;
  for (Eigen::Index c = 0; c < own; ++c) order.push_back(c);
  Eigen::Index column = own;
  for (Eigen::Index c = 0; c < fit.values.size(); ++c) {
    const auto at = static_cast<std::size_t>(c);
    const bool is_correction = at < change.corrections.size();
    const bool is_local = std::ranges::binary_search(fit.local_corrections, c);
    column_of.push_back(is_local ? -1 : column++);
    if (is_correction && !is_local && change.corrections[at].is_nuisance)
      order.push_back(column_of.back());
  }
  for (const std::vector<Eigen::Index>& effect : places) {
    Eigen::VectorXd& values = out.values.emplace_back(static_cast<Eigen::Index>(effect.size()));
    for (std::size_t k = 0; k < effect.size(); ++k) {
      order.push_back(column_of[static_cast<std::size_t>(effect[k])]);
      values[static_cast<Eigen::Index>(k)] = fit.values[effect[k]];
    }
  }
  Linearisation& linear = out.linear;
  linear.jacobian = fit.jacobian(Eigen::all, order);
  if (fit.prior_information.size() > 0) {
    linear.prior = fit.prior_information(order, order);
    linear.prior_gradient = fit.prior_gradient(order);
  }
  if (fit.local.cols() > 0) {
    linear.local_prediction = fit.local * fit.local_values;
    linear.local_residual = fit.residual;
    linear.local = std::move(fit.local);
    linear.local_information = std::move(fit.local_information);
  }
  linear.residual = std::move(fit.residual);
  linear.carriers.swap(fit.probes);
  linear.first_row = std::move(fit.first_row);
  linear.unit = std::move(fit.unit);
  linear.body = std::move(fit.series);
  // Of one camera after the other.
  const std::size_t cameras = std::max<std::size_t>(1, world.cameras.size());
  for (std::size_t c = 0; c < cameras; ++c) {
    for (const Marker& marker : world.tree.markers)
      linear.body_names.push_back(fmt::format("tag_{}", marker.id.value));
  }
  linear.unit_name = world.kind == MeasurementKind::kCorners ? "px" : "m";
  linear.coordinates = world.kind == MeasurementKind::kCorners ? 2 : 3;
  linear.independent_instants = world.postures;
  linear.whitened_by_neighbours = !world.postures;
  linear.correlation_time_s = fit.correlation_time_s;
  linear.time_s.resize(static_cast<Eigen::Index>(fit.frames.size()));
  for (std::size_t i = 0; i < fit.frames.size(); ++i) {
    const auto frame = static_cast<std::size_t>(fit.frames[i]);
    linear.time_s[static_cast<Eigen::Index>(i)] = world.frames.times_s[frame];
    linear.fold.push_back(bundle_->fold_of_frame()[frame]);
  }
  std::vector<Correction> fitted = change.corrections;
  for (std::size_t c = 0; c < fitted.size(); ++c)
    fitted[c].value = fit.values[static_cast<Eigen::Index>(c)];
  const auto shared = std::make_shared<const Carriers>(std::move(carriers));
  for (const CameraEffect& effect : library) {
    Candidate candidate = effect.candidate;
    candidate.columns = [shared, frames = fit.frames,
                         corrections = effect.corrections](double scan) {
      std::vector<EffectColumn> columns;
      for (const Correction& correction : corrections(scan)) {
        columns.push_back(shared->column(correction, frames));
      }
      return columns;
    };
    const auto added = std::ranges::find(effects, candidate.id, &AddedEffect::id);
    if (effect.size_beside && added != effects.end())
      candidate.size = effect.size_beside(values_of(effect.nuisances(added->scan), fitted));
    out.candidates.push_back(std::move(candidate));
  }
  out.covariates = covariates_of(world, fit.frames);
  return out;
}

TracedBundle::Corrected TracedBundle::corrected(const std::vector<AddedEffect>& effects,
                                                const std::vector<TracedEffect>& traced) const {
  Corrected out;
  if (effects.empty()) return out;
  const auto [world, library, change, solved] = ready_for(effects);
  const BundleSolution& fit = *solved;
  Eigen::Index next = 0;
  for (const AddedEffect& added : effects) {
    const CameraEffect& effect = effect_of(library, added.id);
    FittedEffect fitted{added.id, added.scan, effect.candidate.parameters, {}, {}, {}, {}};
    if (effect.is_time_offset) {
      fitted.values = Eigen::VectorXd::Constant(1, fit.time_offset_s);
      fitted.references = Eigen::VectorXd::Ones(1);
      out.effects.push_back(std::move(fitted));
      continue;
    }
    std::vector<Correction> corrections = effect.corrections(added.scan);
    fitted.values.resize(static_cast<Eigen::Index>(corrections.size()));
    fitted.references.resize(fitted.values.size());
    for (std::size_t k = 0; k < corrections.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      corrections[k].value = fit.values[next++];
      fitted.values[at] = corrections[k].value;
      fitted.references[at] = corrections[k].reference;
      // There the noise is that of the model with the effects.
      corrections[k].prior_sigma = added.spread * std::sqrt(fit.variance);
      out.corrections.push_back(std::move(corrections[k]));
    }
    if (effect.candidate.is_curve() && !traced.empty()) {
      const auto known = std::ranges::find_if(
          traced, [&](const TracedEffect& t) { return t.id == added.id && t.scan == added.scan; });
      KINESCOPE_CHECK(known != traced.end(), "tracing knows its curves");
      fitted.table = effect.table(added.scan, known->covariance, fitted.table_shares);
      fitted.table.error = fitted.table_shares * fitted.values;
    }
    out.effects.push_back(std::move(fitted));
  }
  for (Correction& nuisance : nuisances_of(library, effects)) {
    nuisance.value = fit.values[next++];
    nuisance.prior_sigma *= std::sqrt(fit.variance);
    out.corrections.push_back(std::move(nuisance));
  }
  out.gravity_base = gravity_of(library, effects, out.corrections);
  return out;
}

}  // namespace kinescope::effects
