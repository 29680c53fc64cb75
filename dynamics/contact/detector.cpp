// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "dynamics/contact/hinge.h"
#include "kinematics/core/chi_square.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// Without external torque, all end windows are below their level at 99.9 % of the samples.
constexpr double kQuietZ = 3.1;
/// Sigmas beyond which a joint's torque is part of a contact: the coverage factor of the report.
constexpr double kBeyondNoise = 2.0;

int in_steps(double span_s, double step_s) {
  return std::max(1, static_cast<int>(std::lround(span_s / step_s)));
}

std::size_t record_capacity(const ContactCalibration& c) {
  const int steps = in_steps(c.options.longest_window_s, c.step_s) +
                    4 * in_steps(c.options.end_window_s, c.step_s) + 8;
  return static_cast<std::size_t>(steps);
}

}  // namespace

ContactDetector::ContactDetector(ContactCalibration calibration, std::vector<TimeSpan> loaded)
    : calibration_(std::move(calibration)),
      loaded_(std::move(loaded)),
      filter_(calibration_.noise),
      bank_(calibration_.joints(),
            in_steps(calibration_.options.longest_window_s, calibration_.step_s)),
      record_(calibration_.joints(), record_capacity(calibration_)) {
  KINESCOPE_CHECK(calibration_.thresholds.size() == bank_.octaves(), "one threshold an octave");
  const Eigen::Index n = calibration_.joints();
  mean_ = error_mean_ = error_variance_ = Eigen::VectorXd::Zero(n);
  covariance_ = Eigen::MatrixXd::Zero(n, n);
  slides_since_s_ = Eigen::VectorXd::Constant(n, std::numeric_limits<double>::quiet_NaN());
  carried_ = Eigen::VectorXi::Zero(n);
  bend_t_.reserve(record_capacity(calibration_));
  bend_y_.reserve(record_capacity(calibration_));
  quiet_level_ = chi_square_quantile(static_cast<double>(n), kQuietZ);
}

ContactDecision ContactDetector::update(const BalanceSample& sample) {
  if (sample.drive.size() != calibration_.joints()) {
    throw bad_request("contact", "a sample of another number of joints than the calibration",
                      "calibrate with a log of the same robot");
  }
  ContactDecision decision{.stamp_s = sample.stamp_s};
  if (is_finite(sample)) watch_sliding(sample);
  if (!is_finite(sample)) {
    decision.fault = SampleFault::kNotFinite;
  } else if (!filter_.started()) {
    begin(sample);
  } else if (sample.stamp_s <= record_.back().stamp_s) {
    decision.fault = SampleFault::kNotLater;
  } else if (sample.stamp_s - record_.back().stamp_s > kGapSteps * calibration_.step_s) {
    decision.fault = SampleFault::kAfterGap;
    decision.ended = finish();
    begin(sample);
  } else if (in_contact_) {
    watch_end(sample, decision);
  } else {
    watch_onset(sample, decision);
  }
  decision.contact = in_contact_;
  return decision;
}

void ContactDetector::begin(const BalanceSample& sample) {
  filter_.start(sample);
  bank_.clear();
  record_.clear();
  record_.append(sample, filter_);
}

void ContactDetector::watch_onset(const BalanceSample& sample, ContactDecision& decision) {
  filter_.advance(sample);
  bank_.advance(filter_);
  record_.append(sample, filter_);
  int age = 0;
  for (int k = 0; k < bank_.octaves(); ++k) {
    const double ratio = bank_.octave(k).statistic / calibration_.thresholds[k];
    if (ratio <= decision.statistic) continue;
    decision.statistic = ratio;
    age = bank_.octave(k).age;
  }
  if (decision.statistic < 1.0) return;
  decision.alarm = in_contact_ = true;
  double onset_s = look_for_onset(age);
  if (const TimeSpan* load = load_at(sample.stamp_s)) onset_s = std::min(onset_s, load->begin_s);
  decision.resumed = goes_on(onset_s);
  shown_s_ = std::max(decision.resumed ? shown_s_ : 0.0, sample.stamp_s - onset_s);
  if (decision.resumed) {
    event_.open = true;
    segment_ = record_.back();
  } else {
    raise_alarm(onset_s);
    event_.alarm_s = sample.stamp_s;
    event_.statistic = decision.statistic;
  }
  estimate(record_.size() - 1);
}

/// The bank's onsets are spaced, and its torque is constant: looks again where the impulse along
/// the torque that was found begins to rise.
double ContactDetector::look_for_onset(int age) {
  const std::size_t last = record_.size() - 1;
  const auto back = std::min<std::size_t>(last, static_cast<std::size_t>(age));
  const contact::RecordEntry before = std::exchange(onset_, record_[last - back]);
  mean_torque(onset_, record_[last]);
  onset_ = before;
  const Eigen::VectorXd direction = CholeskyFactor(covariance_).solve(mean_);
  bend_t_.clear();
  bend_y_.clear();
  for (std::size_t k = last - std::min(last, 2 * back + 8); k <= last; ++k) {
    bend_t_.push_back(record_[k].stamp_s);
    bend_y_.push_back(direction.dot(record_[k].imbalance - record_[0].imbalance));
  }
  return std::min(contact::bend_time(bend_t_, bend_y_), record_[last - 1].stamp_s);
}

void ContactDetector::raise_alarm(double onset_s) {
  event_ = {};
  event_.onset_s = onset_s;
  onset_ = record_[record_.at_or_before(onset_s)];
  segment_ = onset_;
  const bool series = is_series(calibration_.options.parents);
  segments_ = {
      .squares = Eigen::MatrixXd::Zero(series ? 1 : calibration_.joints(), calibration_.joints())};
}

/// A torque that changes its sign shows in short segments though not in the mean.
void ContactDetector::look_at_segment() {
  if (record_.back().stamp_s - segment_.stamp_s < calibration_.options.end_window_s) return;
  mean_torque(segment_, record_.back());
  segments_.squares += joint_answers(mean_, covariance_, calibration_.options.parents).cwiseAbs2();
  ++segments_.count;
  segment_ = record_.back();
}

/// The model's error at an entry as far as it was known at the onset, to error_mean_ and
/// error_variance_: what was known fades with the error's correlation time.
void ContactDetector::expect_error(const contact::RecordEntry& at) {
  const double age = std::max(0.0, at.stamp_s - onset_.stamp_s);
  for (Eigen::Index j = 0; j < mean_.size(); ++j) {
    const double kept = std::exp(-age / calibration_.noise.model_time_s[j]);
    const double usual = at.model_variance[j];
    error_mean_[j] = kept * onset_.error_mean[j];
    error_variance_[j] = usual + kept * kept * std::min(0.0, onset_.error_variance[j] - usual);
  }
}

/// Mean external torque between two entries and its covariance, to mean_ and covariance_.
void ContactDetector::mean_torque(const contact::RecordEntry& from,
                                  const contact::RecordEntry& to) {
  const BalanceNoise& noise = calibration_.noise;
  const double span = to.stamp_s - from.stamp_s;
  const double steps_s2 = to.sigma_steps_s2 - from.sigma_steps_s2;
  mean_ = (to.imbalance - from.imbalance) / span;
  covariance_ = from.momentum_covariance + to.momentum_covariance;
  expect_error(to);
  for (Eigen::Index j = 0; j < mean_.size(); ++j) {
    const double sigma = noise.torque_sigma[j];
    const double time = noise.model_time_s[j];
    // What is left of the known error, averaged over the span; the rest is correlated over its
    // time.
    const double span_of_known = std::max(0.0, to.stamp_s - std::max(from.stamp_s, onset_.stamp_s));
    const double before_s = std::max(0.0, to.stamp_s - onset_.stamp_s) - span_of_known;
    mean_[j] += onset_.error_mean[j] * std::exp(-before_s / time) * time / span *
                std::expm1(-span_of_known / time);
    covariance_(j, j) +=
        sigma * sigma * steps_s2 + error_variance_[j] * span * std::min(span, 2.0 * time);
  }
  covariance_ /= span * span;
}

void ContactDetector::estimate(std::size_t end) {
  mean_torque(onset_, record_[end]);
  event_.end_s = record_[end].stamp_s;
  event_.torque = mean_;
  event_.torque_covariance = covariance_;
  const std::vector<int>& parents = calibration_.options.parents;
  const std::array looks{
      JointAnswers{.squares = joint_answers(mean_, covariance_, parents).cwiseAbs2(), .count = 1},
      segments_};
  LinkEvidence evidence = link_evidence(std::span(looks).first(segments_.count > 0 ? 2U : 1U),
                                        calibration_.options.link_level, parents);
  event_.link = evidence.link;
  event_.link_probability = std::move(evidence.probability);
  event_.beyond_p_value = std::move(evidence.beyond_p_value);
}

void ContactDetector::watch_end(const BalanceSample& sample, ContactDecision& decision) {
  record_.append_unfiltered(sample, calibration_.noise);
  event_.end_s = sample.stamp_s;
  look_at_segment();
  if (load_at(sample.stamp_s) != nullptr || !is_quiet()) return;
  close(end_of_contact());
  decision.ended = true;
  expect_error(record_.back());
  filter_.start(sample, error_mean_, error_variance_);
  bank_.clear();
}

/// Seen backwards in time, the impulse begins to change where the contact ended.
double ContactDetector::end_of_contact() {
  const auto before = static_cast<std::size_t>(
      2 * in_steps(calibration_.options.end_window_s, calibration_.step_s));
  const std::size_t last = record_.size() - 1;
  const std::size_t first = std::max(last - std::min(last, quiet_window() + before),
                                     record_.at_or_before(onset_.stamp_s));
  mean_torque(record_[first], record_[last]);
  const Eigen::VectorXd direction = CholeskyFactor(covariance_).solve(mean_);
  bend_t_.clear();
  bend_y_.clear();
  const double now = record_[last].stamp_s;
  for (std::size_t k = last + 1; k-- > first;) {
    bend_t_.push_back(now - record_[k].stamp_s);
    bend_y_.push_back(direction.dot(record_[k].imbalance - record_[0].imbalance));
  }
  return now - contact::bend_time(bend_t_, bend_y_);
}

/// A contact that took a long window to show goes on unseen in shorter ones: it is over where a
/// window as long as the one that showed it is quiet.
std::size_t ContactDetector::quiet_window() const {
  const ContactOptions& options = calibration_.options;
  const double shown_s = std::min(options.longest_window_s, shown_s_);
  return static_cast<std::size_t>(
      in_steps(std::max(options.end_window_s, shown_s), calibration_.step_s));
}

/// No external torque in any window up to that one.
bool ContactDetector::is_quiet() {
  const std::size_t window = quiet_window();
  const std::size_t last = record_.size() - 1;
  if (last < window || record_[last - window].stamp_s < onset_.stamp_s) return false;
  for (std::size_t length = window; length >= 1; length /= 2) {
    mean_torque(record_[last - length], record_[last]);
    if (!contact::inverse_cholesky(covariance_)) return false;
    double square = 0.0;
    for (Eigen::Index r = 0; r < mean_.size(); ++r) {
      const double white = covariance_.row(r).head(r + 1).dot(mean_.head(r + 1));
      square += white * white;
    }
    if (square > quiet_level_) return false;
  }
  return true;
}

void ContactDetector::watch_sliding(const BalanceSample& sample) {
  for (Eigen::Index j = 0; j < slides_since_s_.size(); ++j) {
    if (sample.may_stick(j)) {
      slides_since_s_[j] = std::numeric_limits<double>::quiet_NaN();
    } else if (std::isnan(slides_since_s_[j])) {
      slides_since_s_[j] = sample.stamp_s;
    }
  }
  if (in_contact_ || std::isfinite(end_seen_s_)) return;
  const double window_s = static_cast<double>(quiet_window()) * calibration_.step_s;
  for (Eigen::Index j = 0; j < slides_since_s_.size(); ++j) {
    const double since_s = std::max(slides_since_s_[j], event_.end_s);
    if (carried_[j] != 0 && !(sample.stamp_s - since_s >= window_s)) return;
  }
  end_seen_s_ = sample.stamp_s;
}

/// Where the joints that carried it stick, friction may hide a contact. It went on where they find
/// it again as they slide, in the same direction: mean_ and covariance_ are those of the alarm.
bool ContactDetector::goes_on(double onset_s) const {
  if (event_.open || event_.cut_off) return false;
  if (event_.end_s >= onset_s) return true;
  if (end_seen_s_ <= onset_s) return false;
  for (Eigen::Index j = 0; j < carried_.size(); ++j) {
    if (carried_[j] != 0 && std::isnan(slides_since_s_[j])) return false;
  }
  return CholeskyFactor(covariance_).solve(event_.torque).dot(mean_) > 0.0;
}

const TimeSpan* ContactDetector::load_at(double stamp_s) const {
  const auto found = std::ranges::find_if(loaded_, [stamp_s](const TimeSpan& span) {
    return span.begin_s <= stamp_s && stamp_s <= span.end_s;
  });
  return found == loaded_.end() ? nullptr : &*found;
}

void ContactDetector::close(double end_s) {
  const std::size_t end = record_.at_or_before(end_s);
  if (record_[end].stamp_s > onset_.stamp_s) estimate(end);
  event_.open = false;
  in_contact_ = false;
  end_seen_s_ = std::numeric_limits<double>::infinity();
  carried_ = (event_.torque.array().abs() >
              kBeyondNoise * event_.torque_covariance.diagonal().array().sqrt())
                 .cast<int>();
}

bool ContactDetector::finish() {
  if (!in_contact_) return false;
  close(record_.back().stamp_s);
  event_.cut_off = true;
  return true;
}

}  // namespace kinescope
