// SPDX-License-Identifier: Apache-2.0
//
// What tracing found, as a value.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "calib/trace/partition.h"
#include "calib/trace/traced_model.h"

namespace kinescope {

enum class TraceVerdict {
  kNotRun,
  kEffects,      ///< named, sized, corrected; nothing else is left
  kAmbiguous,    ///< one of several effects; this recording cannot tell which
  kUnknown,      ///< structure is left that no known effect explains, or a curve carries it
  kClean,        ///< the residual is noise
  kNothingToSay  ///< the recording is too short, or the model did not converge
};

/// "not_run", "effects", "ambiguous", "unknown", "clean", "nothing_to_say".
[[nodiscard]] std::string_view to_string(TraceVerdict verdict);

struct Interval {
  double low = 0.0;
  double high = 0.0;
};

/// Root mean square error (a distance for points) on instants held out, with its 95 % interval.
struct HeldOutError {
  double value = 0.0;
  Interval interval;
  std::string unit;
};

struct EffectValue {
  EffectParameter parameter;
  double value = 0.0;
  double sigma = 0.0;  ///< standard uncertainty, residuals correlated in time allowed for
};

/// An effect made visible: what each instant says of the part it acts on (a joint's value, a
/// marker's place), from the residual alone, over what it depends on most.
struct EffectPicture {
  std::string covariate;  ///< "value of joint3"; empty: no picture
  std::string covariate_unit;
  std::string unit;
  Eigen::VectorXd at;      ///< of the covariate, instants
  Eigen::VectorXd before;  ///< without the effect
  Eigen::VectorXd after;   ///< with all effects
  Eigen::VectorXd effect;  ///< what the effect is
  Eigen::VectorXd sigma;   ///< of a curve: standard uncertainty of that; else empty
};

/// Another value of an effect's scan that says the same.
struct ScanAlternative {
  double scan = 0.0;
  std::string words;  ///< as TracedEffect::scan_words
  Interval size;
};

struct TracedEffect {
  EffectId id;
  std::string words;
  std::string check;
  double size = 0.0;
  std::string unit;
  Interval interval;       ///< 95 %; covers those of `as_likely`
  double explained = 0.0;  ///< share of the base model's sum of squares that it alone takes away
  std::vector<EffectValue> values;
  double scan = 0.0;
  std::string scan_name;  ///< empty: none
  std::string scan_unit;
  std::string scan_words;  ///< "joint2"; empty: the number says it
  std::vector<ScanAlternative> as_likely;
  double p_value = 1.0;          ///< over the whole family of tests
  HeldOutError held_out_before;  ///< with all the others, without this one
  HeldOutError held_out_after;   ///< with all
  EffectPicture picture;
  /// Of a curve (joint_map): of its parameters, which are no numbers to be read (`values` is
  /// empty).
  Eigen::MatrixXd covariance;
  [[nodiscard]] bool is_curve() const { return covariance.size() > 0; }
};

/// Several effects, each of which explains what the others explain.
struct Ambiguity {
  std::vector<EffectId> effects;  ///< the one that is in the model first
  std::vector<std::string> words;
  std::string record;  ///< what to record to decide
};

enum class CandidateState {
  kTested,    ///< not significant, or less so than another
  kRefitted,  ///< fitted in full and not chosen
  kAccepted,
  kRemoved,  ///< accepted at first, did not earn its place in the end
  kHidden    ///< the model's own parameters take its shape: this recording cannot show it
};

/// "tested", "refitted", "accepted", "removed", "hidden".
[[nodiscard]] std::string_view to_string(CandidateState state);

/// A candidate in one round.
struct TestedCandidate {
  int round = 0;
  EffectId id;
  CandidateState state = CandidateState::kTested;
  double statistic = 0.0;  ///< F of the score test, best value of the scan
  int parameters = 0;
  double freedom = 0.0;  ///< of the denominator
  double p_value = 1.0;  ///< with the scan and the family counted in
  double scan = 0.0;
  double size = 0.0;   ///< as the score test sees it
  double moves = 0.0;  ///< a coordinate of the prediction by, rms, beyond what other parameters
                       ///< could do, in the residual's unit
  std::string unit;
  std::optional<double> held_out;  ///< error after a refit, rms distance
};

struct NotFoundEffect {
  EffectId id;
  bool hidden = false;         ///< cannot be seen in this recording, whatever its size
  double smallest_size = 0.0;  ///< that would have been found in 95 of 100 recordings
  std::string unit;
  std::string record;  ///< hidden: what to record so that it shows
};

/// A vector that depends on a place of two coordinates: Gaussian process, posterior at the nodes of
/// a grid.
struct FieldMap {
  Eigen::MatrixX2d at;
  Eigen::MatrixX2d mean;
  Eigen::MatrixX2d sigma;
  double spacing = 0.0;  ///< of the nodes
};

/// Structure that no effect explains, as a function of what it depends on most.
struct Rest {
  std::string place;
  std::string unit;
  std::string covariate;
  std::string covariate_unit;
  double p_value = 1.0;
  double explained = 0.0;  ///< share of the residual's sum of squares
  Eigen::VectorXd at;      ///< of the covariate; empty where it is a place: see `field`
  Eigen::VectorXd mean;    ///< Gaussian process, posterior
  Eigen::VectorXd sigma;
  Eigen::VectorXd instants;  ///< its mean at every instant
  FieldMap field;            ///< empty: a curve
  HeldOutError held_out_before;
  HeldOutError held_out_after;
  [[nodiscard]] bool is_field() const { return field.at.rows() > 0; }
};

/// What is left at a place beside the noise there, where that is known by itself.
struct LeftOver {
  std::string place;
  double times = 0.0;      ///< of the most that noise makes there, by medians
  bool lasts = false;      ///< for certain more than noise makes
  std::string covariate;   ///< over which a curve explains most of it; empty: none does
  double explained = 0.0;  ///< by that curve: share of the squares at this place
};

/// One round, for a reader who wants to follow.
struct TraceStep {
  int round = 0;
  std::string words;
  double rms = 0.0;  ///< training, distance
  HeldOutError held_out;
};

struct Trace {
  TraceVerdict verdict = TraceVerdict::kNotRun;
  std::string reason;                      ///< in one sentence
  std::string found = "the model lacked";  ///< TraceOptions::found
  bool converged = true;                   ///< the model without any effect did
  std::vector<TracedEffect> accepted;      ///< in the order in which they were found
  std::vector<AddedEffect> added;          ///< what the search found, as TracedModel::fit takes it
  /// There are couplings by design, and a search that knows none names them before anything else.
  bool design_comes_first = false;
  std::vector<Ambiguity> ambiguities;
  std::vector<Rest> rest;
  std::vector<TestedCandidate> candidates;
  std::vector<NotFoundEffect> not_found;
  std::vector<TraceStep> steps;
  HeldOutError held_out_before;
  HeldOutError held_out_after;
  double noise = 0.0;  ///< rms distance that is left, in the residual's unit
  /// Of what is left over what rows differ by from their neighbours in time, rms: noise makes it 1
  /// or less, what lasts more; where it is known place by place, the most of
  /// `left_over`. 0 where neither is known.
  double over_neighbours = 0.0;
  std::vector<LeftOver> left_over;  ///< of every place whose noise is known, the most first
  int stretches = 0;                ///< of time, over which the noise was judged
  /// Of every instant, its fold held out: squared errors beside the effects, in variances.
  Eigen::VectorXd held_out_whitened;
  trace::Partition partition;  ///< of the instants
  double false_alarm_rate = 0.0;
};

}  // namespace kinescope
