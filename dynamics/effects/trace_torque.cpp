// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/trace_torque.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "calib/trace/normal_system.h"
#include "calib/trace/stage.h"
#include "calib/trace/verdict.h"
#include "dynamics/effects/base_choice.h"
#include "dynamics/effects/disagreement.h"
#include "dynamics/identify/consistent_model.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr int kMostPasses = 4;  // of a trace, with the contact spans that the last one shows

/// Spans of a trajectory that touch are one.
std::vector<ContactSpan> merged(std::vector<ContactSpan> spans, double gap_s) {
  std::ranges::sort(spans, {}, &ContactSpan::from_s);
  std::vector<ContactSpan> out;
  for (ContactSpan& span : spans) {
    if (out.empty() || span.from_s > out.back().to_s + gap_s ||
        span.from.trajectory != out.back().from.trajectory) {
      out.push_back(std::move(span));
      continue;
    }
    ContactSpan& last = out.back();
    if (span.to_s > last.to_s) {
      last.to_s = span.to_s;
      last.to = span.to;
    }
    for (Eigen::Index j = 0; j < span.peak.size(); ++j) {
      if (std::abs(span.peak[j]) > std::abs(last.peak[j])) last.peak[j] = span.peak[j];
      last.noise_ratio[j] = std::max(last.noise_ratio[j], span.noise_ratio[j]);
    }
  }
  return out;
}

Trace trace_with(const TorqueTracedModel& model, const TorqueTraceOptions& options,
                 const Progress& progress) {
  TraceOptions trace = options.trace;
  trace.found = "beyond rigid bodies the torques show";
  trace.noise_floor = std::max(trace.noise_floor, options.noise_share);
  return trace_effects(model, trace, progress);
}

/// "3.05 to 3.33 s", with the trajectory where there are several.
std::string when(const ContactSpan& span, const TorqueSamples& samples) {
  std::string out = fmt::format("{:.2f} to {:.2f} s", span.from.t_s, span.to.t_s);
  if (samples.trajectory.minCoeff() == samples.trajectory.maxCoeff()) return out;
  return out + " of " + samples.trajectory_name(span.from.trajectory);
}

/// A contact as an effect among the others: the joint that felt it most, and how much.
TracedEffect contact_effect(const ContactSpan& span, const TorqueTracedModel& model,
                            const HeldOutError& before, const HeldOutError& after) {
  Eigen::Index joint = 0;
  span.noise_ratio.maxCoeff(&joint);
  const auto j = static_cast<std::size_t>(joint);
  const EffectContext& context = model.context();
  TracedEffect out;
  out.id = {"contact", when(span, model.motion().samples())};
  out.words = fmt::format("something pushed the robot, felt most at {}", context.joints[j]);
  out.check = "what stood in the way, or who touched the robot";
  out.size = std::abs(span.peak[joint]);
  out.unit = context.unit(j);
  const double half = 1.96 * model.base().sigma[joint];
  out.interval = {std::max(0.0, out.size - half), out.size + half};
  out.p_value = std::exp(-0.5 * std::pow(span.noise_ratio[joint], 2));
  out.held_out_before = before;
  out.held_out_after = after;
  return out;
}

void add_contacts(const TorqueTracedModel& model, const HeldOutError& before, TorqueTrace& out) {
  std::vector<TracedEffect> contacts;
  for (const ContactSpan& span : out.contacts) {
    contacts.push_back(contact_effect(span, model, before, out.trace.held_out_before));
  }
  out.trace.accepted.insert(out.trace.accepted.begin(), contacts.begin(), contacts.end());
  out.trace.held_out_before = before;
  if (out.trace.verdict == TraceVerdict::kClean) out.trace.verdict = TraceVerdict::kEffects;
  out.trace.reason = fmt::format("{} contact spans are left out; beyond them, {}", contacts.size(),
                                 out.trace.reason);
}

std::vector<TorqueEffect> effects_of(const Trace& trace) {
  std::vector<TorqueEffect> out;
  for (const TracedEffect& effect : trace.accepted) {
    if (effect.id.effect == "contact") continue;
    TorqueEffect own{effect.id,
                     effect.scan,
                     effect.scan_name,
                     effect.scan_unit,
                     {},
                     Eigen::VectorXd(static_cast<Eigen::Index>(effect.values.size()))};
    for (std::size_t k = 0; k < effect.values.size(); ++k) {
      own.parameters.push_back(effect.values[k].parameter);
      own.values[static_cast<Eigen::Index>(k)] = effect.values[k].value;
    }
    out.push_back(std::move(own));
  }
  return out;
}

/// How an effect went into a DynamicModel, and why not, or not as it was found.
struct PutIn {
  bool done = false;
  std::string note;  ///< empty: as it was found, or a DynamicModel has no place for it
};

PutIn put_into(JointDynamics& joint, const TorqueEffect& effect) {
  double* value = effect.id.effect == "viscous"         ? &joint.viscous
                  : effect.id.effect == "coulomb"       ? &joint.coulomb
                  : effect.id.effect == "motor_inertia" ? &joint.motor_inertia
                                                        : nullptr;
  if (value == nullptr) return {};
  const double sum = *value + effect.values[0];
  // No URDF reader takes friction that drives.
  if (sum < 0.0) {
    return {false, fmt::format("{} of {} would be negative ({:.3g})", effect.id.effect,
                               effect.id.place, sum)};
  }
  *value = sum;
  return {true, {}};
}

/// Inverse of the covariance of an added effect's parameters, all others being free; that noise
/// lasts is allowed for by the median of the ratios of the variances in `found` to those of white
/// noise.
Eigen::MatrixXd information_of(const TracedFit& fit, const std::vector<AddedEffect>& added,
                               std::size_t index, const TracedEffect& found) {
  Eigen::Index first = fit.linear.jacobian.cols();
  for (std::size_t k = index; k < added.size(); ++k) first -= fit.values[k].size();
  const Eigen::Index count = fit.values[index].size();
  std::vector<Eigen::Index> others;
  for (Eigen::Index k = 0; k < fit.linear.jacobian.cols(); ++k) {
    if (k < first || k >= first + count) others.push_back(k);
  }
  Eigen::MatrixXd H = fit.linear.jacobian.transpose() * fit.linear.jacobian;
  if (fit.linear.prior.size() > 0) H += fit.linear.prior;
  const auto own = Eigen::seqN(first, count);
  const Eigen::MatrixXd across = H(others, own);
  const Eigen::MatrixXd information =
      H(own, own) -
      across.transpose() * trace::scaled_pseudo_inverse(H(others, others), trace::kUnseen) * across;
  const Eigen::MatrixXd white = trace::scaled_pseudo_inverse(information, trace::kUnseen);
  std::vector<double> ratios;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double sigma = found.values[static_cast<std::size_t>(k)].sigma;
    const double ratio = sigma * sigma / white(k, k);
    if (std::isfinite(ratio)) ratios.push_back(ratio);
  }
  return information / std::max(1.0, median_of(std::move(ratios)));
}

/// A payload beside its link. What the torques do not show of it is anything, so that the sum may
/// be no body: the nearest body takes its place, near in what the torques show.
PutIn put_payload_into(InertialParameters& link, const TorqueEffect& effect,
                       const std::function<Matrix10d()>& information) {
  InertialParameters sum = link;
  sum += InertialParameters::from_vector(effect.values);
  if (sum.mass_kg > 0.0 && is_consistent(sum)) {
    link = sum;
    return {true, {}};
  }
  const std::string what =
      fmt::format("no body has the inertia of {} with the payload found there", effect.id.place);
  if (!(link.mass_kg > 0.0)) return {false, what + ", and without it the link has no mass"};
  link = consistent_body(sum, information(), link);
  return {true, fmt::format("{}: the nearest body has {:.3g} kg instead of {:.3g} kg", what,
                            link.mass_kg, sum.mass_kg)};
}

/// Puts an effect into the model where a DynamicModel has a place for it.
PutIn put_into(DynamicModel& model, const TorqueEffect& effect,
               const std::function<Matrix10d()>& information) {
  for (std::size_t j = 0; j < model.tree.joints.size(); ++j) {
    if (model.tree.joints[j].name == effect.id.place) return put_into(model.joints[j], effect);
  }
  const auto link = model.tree.link(effect.id.place);
  if (effect.id.effect != "payload" || !link) return {};
  return put_payload_into(model.links[link->index()], effect, information);
}

CorrectedTorqueModel correct(const DynamicModel& model, const TorqueTracedModel& traced,
                             const Trace& trace, std::vector<TorqueEffect> effects) {
  const std::vector<AddedEffect>& added = trace.added;
  CorrectedTorqueModel out;
  out.model = model;
  out.effects = std::move(effects);
  out.base = traced.fitted(added);
  out.travels = traced.context().travels;
  out.log = traced.context().log;
  if (traced.base().kind == TorqueBaseKind::kIdentified) {
    for (JointDynamics& joint : out.model.joints) joint = {};
  }
  for (const TorqueEffect& effect : out.effects) {
    if (effect.id.effect == "gravity_direction") {
      out.model.gravity_m_s2 = out.base.rigid.gravity_m_s2;
      out.in_model.push_back(1);
      continue;
    }
    const auto information = [&]() -> Matrix10d {
      const auto at = std::ranges::find(added, effect.id, &AddedEffect::id);
      const auto found = std::ranges::find(trace.accepted, effect.id, &TracedEffect::id);
      KINESCOPE_CHECK(at != added.end() && found != trace.accepted.end(), "an effect of the trace");
      return information_of(traced.fit(added), added, static_cast<std::size_t>(at - added.begin()),
                            *found);
    };
    PutIn put = put_into(out.model, effect, information);
    out.in_model.push_back(put.done ? 1 : 0);
    if (!put.note.empty()) out.notes.push_back(std::move(put.note));
  }
  return out;
}

/// The low-pass smears a contact over its own memory.
double contact_margin_s(const TorqueTraceOptions& options) {
  const double cutoff_hz = options.model.filter.cutoff_hz;
  return options.contact_spans.window_s + (cutoff_hz > 0.0 ? 0.5 / cutoff_hz : 0.0);
}

/// What the corrected model leaves at every instant of the whole log, spans and all.
std::vector<ContactSpan> spans_left(const CorrectedTorqueModel& corrected,
                                    const TorqueTracedModel& whole, const Eigen::VectorXd& sigma,
                                    const TorqueTraceOptions& options) {
  const TorqueSamples& samples = whole.motion().samples();
  const Eigen::MatrixXd left =
      samples.torque - predict_torque(corrected, samples, options.model.filter);
  Eigen::MatrixXd whitened =
      whole.motion().rows_at_instants(left) * sigma.cwiseInverse().asDiagonal();
  // About a turn, friction depends on what noise makes of the speed: no sign of a contact.
  const Eigen::MatrixXd dq = whole.motion().rows_at_instants(samples.dq);
  for (const TorqueEffect& effect : corrected.effects) {
    for (Eigen::Index j = 0; j < dq.cols(); ++j) {
      const bool rubs = effect.id.effect == "coulomb" || effect.id.effect == "hysteresis";
      if (!rubs || effect.id.place != whole.context().joints[static_cast<std::size_t>(j)]) continue;
      constexpr double kTurns = 5.0;
      const Eigen::ArrayXd near =
          (dq.col(j).array().abs() < kTurns * corrected.base.widths[j]).cast<double>();
      whitened.col(j).array() *= 1.0 - near;
    }
  }
  // Nor about the instant at which a load comes, which is known to a step of the samples.
  const Eigen::ArrayXd time_s = whole.motion().at_instants(whole.motion().time_s()).array();
  for (const TorqueEffect& effect : corrected.effects) {
    if (effect.id.effect != "payload_change") continue;
    const Eigen::ArrayXd near =
        ((time_s - effect.scan).abs() < contact_margin_s(options)).cast<double>();
    whitened.array().colwise() *= 1.0 - near;
  }
  return merged(find_contact_spans(whole.motion(), whitened, sigma, options.contact_spans),
                2.0 * options.contact_spans.window_s);
}

/// The effects that were found with the values of another fit.
std::vector<TorqueEffect> with_values(std::vector<TorqueEffect> effects,
                                      const std::vector<AddedEffect>& added,
                                      const std::vector<Eigen::VectorXd>& values) {
  for (std::size_t k = 0; k < added.size(); ++k) {
    const auto own = std::ranges::find_if(effects, [&](const TorqueEffect& effect) {
      return effect.id == added[k].id && effect.scan == added[k].scan;
    });
    if (own != effects.end() && own->values.size() == values[k].size()) own->values = values[k];
  }
  return effects;
}

bool same_spans(const std::vector<ContactSpan>& a, const std::vector<ContactSpan>& b,
                double tolerance_s) {
  return std::ranges::equal(a, b, [tolerance_s](const ContactSpan& x, const ContactSpan& y) {
    return std::abs(x.from_s - y.from_s) <= tolerance_s && std::abs(x.to_s - y.to_s) <= tolerance_s;
  });
}

/// Masses that are declared wrongly would look like it.
bool is_like_masses(const TracedEffect& effect) {
  constexpr std::array<std::string_view, 7> kLikeMasses{
      "payload", "payload_change", "torque_gain",      "motor_inertia",
      "spring",  "cross_talk",     "gravity_direction"};
  return std::ranges::find(kLikeMasses, effect.id.effect) != kLikeMasses.end();
}

/// Of what was found, or left.
bool may_be_of_masses(const Trace& trace) {
  return trace.verdict == TraceVerdict::kUnknown ||
         std::ranges::any_of(trace.accepted, is_like_masses);
}

/// What identified masses make superfluous. A payload is a link of another mass by another name.
std::vector<TracedEffect> in_place_of_masses(const Trace& trace, const Trace& beside_identified) {
  std::vector<TracedEffect> out;
  std::ranges::copy_if(trace.accepted, std::back_inserter(out), [&](const TracedEffect& effect) {
    return is_like_masses(effect) && effect.id.effect != "payload" &&
           std::ranges::find(beside_identified.accepted, effect.id, &TracedEffect::id) ==
               beside_identified.accepted.end();
  });
  return out;
}

/// Identified masses explain as much without `effect`: the torques alone cannot tell which it is.
/// What both accounts find is known no better than they agree.
void doubt_masses(const TracedEffect& effect, const Trace& beside_identified, Trace& out) {
  Ambiguity doubt{
      {effect.id, {"masses", "links"}},
      {effect.words, "the links have other masses than the model says"},
      "weigh the links, or record the same motion with a known load; the torques fit both"};
  for (TracedEffect& found : out.accepted) {
    const auto twin = std::ranges::find(beside_identified.accepted, found.id, &TracedEffect::id);
    if (twin == beside_identified.accepted.end()) continue;
    found.interval.low = std::min(found.interval.low, twin->interval.low);
    found.interval.high = std::max(found.interval.high, twin->interval.high);
  }
  if (out.verdict == TraceVerdict::kEffects) {
    out.verdict = TraceVerdict::kAmbiguous;
    out.reason += "; " + trace::cannot_tell_words(doubt);
  }
  out.ambiguities.push_back(std::move(doubt));
}

/// But for the friction that the model declares, which is an effect beside identified masses.
std::ptrdiff_t effects_beyond(const DynamicModel& model, const Trace& trace) {
  return std::ranges::count_if(trace.accepted, [&](const TracedEffect& effect) {
    for (std::size_t j = 0; j < model.tree.joints.size(); ++j) {
      if (model.tree.joints[j].name != effect.id.place) continue;
      return !(effect.id.effect == "coulomb" && model.joints[j].coulomb > 0.0) &&
             !(effect.id.effect == "viscous" && model.joints[j].viscous > 0.0);
    }
    return true;
  });
}

bool explains_all(const Trace& trace) {
  return trace.verdict == TraceVerdict::kEffects || trace.verdict == TraceVerdict::kClean ||
         trace.verdict == TraceVerdict::kAmbiguous;
}

/// Student's t of the squares of held-out errors, whitened, over the stretches of the instants that
/// both know: positive where `rival` predicts better.
double advantage_of(const TorqueTrace& rival, const TorqueTrace& trace) {
  const trace::Partition& partition = trace.trace.partition;
  Eigen::VectorXd own = Eigen::VectorXd::Zero(partition.stretches);
  Eigen::VectorXd other = own;
  for (std::size_t i = 0; i < trace.rows.size(); ++i) {
    const auto same = std::ranges::lower_bound(rival.rows, trace.rows[i]);
    if (same == rival.rows.end() || *same != trace.rows[i]) continue;
    const int stretch = partition.stretch[i];
    own[stretch] += trace.trace.held_out_whitened[static_cast<Eigen::Index>(i)];
    other[stretch] += rival.trace.held_out_whitened[std::distance(rival.rows.begin(), same)];
  }
  return effects::paired_t(own, other) / std::sqrt(partition.widening);
}

TorqueTrace trace_beside_base(const DynamicModel& model, const TorqueSamples& samples,
                              const TorqueTraceOptions& options, const Progress& progress) {
  const TorqueTracedModel whole(model, samples, options.model);
  const double margin_s = contact_margin_s(options);
  TorqueTrace out;
  HeldOutError before;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    std::optional<TorqueTracedModel> outside;
    if (!out.contacts.empty()) {
      outside.emplace(model, samples, options.model);
      outside->leave_out(outside_spans(whole.motion(), out.contacts, margin_s));
    }
    const TorqueTracedModel& traced = outside ? *outside : whole;
    out.trace = trace_with(traced, options, progress);
    effects::widen_by_disagreement(traced, out.trace);
    out.base = traced.base();
    out.rows = traced.motion().kept();
    out.corrected = correct(model, traced, out.trace, effects_of(out.trace));
    if (pass == 0) before = out.trace.held_out_before;
    if (!options.contacts || out.trace.verdict == TraceVerdict::kNothingToSay) break;
    std::vector<ContactSpan> spans = spans_left(out.corrected, whole, out.base.sigma, options);
    if (same_spans(spans, out.contacts, options.contact_spans.window_s)) break;
    out.contacts = std::move(spans);
  }
  if (!out.contacts.empty()) add_contacts(whole, before, out);
  return out;
}

}  // namespace

double tracing_cutoff_hz(const CutoffChoice& chosen) {
  constexpr double kOverEnd = 2.0;  // of the fastest motion
  const double end_hz = chosen.motion_end_hz.size() > 0 ? chosen.motion_end_hz.maxCoeff() : 0.0;
  return end_hz > 0.0 ? std::min(chosen.cutoff_hz, kOverEnd * end_hz) : chosen.cutoff_hz;
}

TorqueTrace trace_torque(const DynamicModel& model, const TorqueSamples& samples,
                         const TorqueTraceOptions& options, const Progress& progress) {
  TorqueTrace out = trace_beside_base(model, samples, options, progress);
  if (options.model.base != TorqueBaseKind::kAuto || out.base.kind != TorqueBaseKind::kDeclared ||
      !may_be_of_masses(out.trace)) {
    return out;
  }
  TorqueTraceOptions beside_identified = options;
  beside_identified.model.base = TorqueBaseKind::kIdentified;
  TorqueTrace rival = trace_beside_base(model, samples, beside_identified, progress);
  const double advantage = advantage_of(rival, out);
  // Masses that bend to what they are not ask for further effects.
  if (effects_beyond(model, rival.trace) > std::ssize(out.trace.accepted)) return out;
  if (advantage >= effects::kClearlyBetter) {
    rival.base.reason = fmt::format(
        "with the effects that were found, identified masses predict unseen stretches better than "
        "declared ones do with theirs (Student's t {:.1f})",
        advantage);
    return rival;
  }
  if (advantage <= -effects::kClearlyBetter || !explains_all(rival.trace)) return out;
  const std::vector<TracedEffect> superfluous = in_place_of_masses(out.trace, rival.trace);
  if (superfluous.size() == 1) doubt_masses(superfluous.front(), rival.trace, out.trace);
  if (superfluous.size() < 2) return out;
  // Wrong masses are one cause, and plainer than several.
  rival.base.reason = trace::found_words(
      "identified masses predict unseen stretches as well as declared ones do with", superfluous);
  return rival;
}

CorrectedTorqueModel refit(const DynamicModel& model, const TorqueSamples& samples,
                           const TorqueTraceOptions& options, const TorqueTrace& found,
                           const std::vector<char>& wanted) {
  TracedTorqueOptions same = options.model;
  same.base = found.base.kind;
  const TorqueTracedModel traced(model, samples, same, [&](const EffectMotion& motion) {
    std::vector<char> kept = outside_spans(motion, found.contacts, contact_margin_s(options));
    for (std::size_t k = 0; k < kept.size(); ++k) {
      if (wanted[k] == 0) kept[k] = 0;
    }
    return kept;
  });
  const std::vector<AddedEffect>& added = found.trace.added;
  return correct(model, traced, found.trace,
                 with_values(effects_of(found.trace), added, traced.fit(added).values));
}

}  // namespace kinescope
