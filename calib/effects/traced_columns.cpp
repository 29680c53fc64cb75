// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/traced_columns.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/log/unsteady_reading.h"

namespace kinescope::effects {
namespace {

constexpr Eigen::Index kMostRows = 2000;
constexpr double kMostShift_s = 1.0;
constexpr double kShiftOfLog = 0.05;  // of a short log, at either end
constexpr double kBend_s = 0.025;  // between the samples of an acceleration: at 1 Hz it loses 1 %
const double kRoundedSigma = 1.0 / std::sqrt(12.0);  // of a grid rounded to its steps
// Of the difference's rms: less is rounding, whatever neighbours differ by.
constexpr double kRounding = 1e-4;
constexpr double kNothing = 1e-12;  // rad or m

void append(const Eigen::VectorXd& column, Eigen::MatrixXd& columns) {
  columns.conservativeResize(column.size(), columns.cols() + 1);
  columns.rightCols<1>() = column;
}

std::vector<double> later(std::vector<double> times_s, double by_s) {
  for (double& t : times_s) t += by_s;
  return times_s;
}

Eigen::VectorXd centred(const Eigen::VectorXd& values) {
  return (values.array() - values.mean()).matrix();
}

double rms_about_mean(const Eigen::VectorXd& values) {
  return centred(values).norm() / std::sqrt(static_cast<double>(values.size()));
}

std::vector<double> steps_of(const std::vector<double>& times_s) {
  std::vector<double> out;
  for (std::size_t i = 1; i < times_s.size(); ++i) out.push_back(times_s[i] - times_s[i - 1]);
  return out;
}

// Widths of bands that a motion over this range can show.
std::vector<double> widths_within(double range) {
  constexpr double kFinest = 1.0 / 2000.0;  // of the range
  constexpr double kWidest = 0.3;
  constexpr double kFactor = 1.8;
  std::vector<double> out;
  if (!(range > 0.0)) return out;
  out.push_back(kFinest * range);
  while (kFactor * out.back() < kWidest * range) out.push_back(kFactor * out.back());
  return out;
}

double median_magnitude(const Eigen::VectorXd& values) {
  const Eigen::VectorXd magnitudes = values.cwiseAbs();
  return median_of({magnitudes.begin(), magnitudes.end()});
}

// By what neighbours on both sides leave; a straight line leaves nothing.
double noise_between_neighbours(const Eigen::VectorXd& r) {
  const Eigen::Index n = r.size() - 2;
  const double kOfSecondDifference = std::sqrt(6.0);  // squares of 1 -2 1
  return kSigmaOverMedian * median_magnitude(r.head(n) - 2.0 * r.segment(1, n) + r.tail(n)) /
         kOfSecondDifference;
}

// Integral time of the autocorrelation up to where it vanishes, in steps.
double memory_of(const Eigen::VectorXd& r) {
  constexpr double kVanished = 0.05;
  const double squares = r.squaredNorm();
  double sum = 0.5;
  if (!(squares > 0.0)) return sum;
  for (Eigen::Index lag = 1; lag <= r.size() / 4; ++lag) {
    const Eigen::Index pairs = r.size() - lag;
    const double rho = r.head(pairs).dot(r.tail(pairs)) / squares;
    if (rho < kVanished) break;
    sum += rho;
  }
  return sum;
}

// Samples that reach across a gap are no use: what is in it nobody knows.
void forbid_gaps(const std::vector<double>& times_s, double reach_s, std::vector<char>& usable) {
  constexpr double kLong = 5.0;  // median steps
  const std::vector<double> steps = steps_of(times_s);
  const double longest = std::max(kMaxGap, kLong * median_of(steps));
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] <= longest) continue;
    const auto first = std::ranges::lower_bound(times_s, times_s[i] - reach_s);
    const auto last = std::ranges::upper_bound(times_s, times_s[i + 1] + reach_s);
    std::fill(usable.begin() + (first - times_s.begin()), usable.begin() + (last - times_s.begin()),
              0);
  }
}

// Evenly, at most so many.
std::vector<Eigen::Index> thinned(const std::vector<Eigen::Index>& rows, std::ptrdiff_t most) {
  const std::ptrdiff_t stride = (std::ssize(rows) + most - 1) / most;
  std::vector<Eigen::Index> out;
  for (std::ptrdiff_t i = 0; i < std::ssize(rows); i += stride)
    out.push_back(rows[static_cast<std::size_t>(i)]);
  return out;
}

}  // namespace

TracedColumns::TracedColumns(const ColumnPair& pair, const KinematicTree& tree,
                             const std::optional<Eigen::Vector3d>& gravity_base)
    : pair_(&pair), tree_(&tree) {
  const Joint& joint = tree.joints[static_cast<std::size_t>(pair.joint)];
  name_ = joint.name;
  unit_ = joint.type == JointType::kRevolute ? "rad" : "m";
  used_.times_s = pair.used.times_s;
  used_.channels = {name_};
  used_.values = pair.used.value.col(pair.joint);
  choose_rows();
  if (rows() < 3) return;
  if (!pair.postures) widths_ = widths_within(pair.other.maxCoeff() - pair.other.minCoeff());
  find_start();
  take_loads(gravity_base);
  take_steps();
  fit_widest();
}

void TracedColumns::choose_rows() {
  const std::vector<double>& times_s = used_.times_s;
  std::vector<char> usable(times_s.size(), 1);
  double reach_s = 0.0;
  if (!pair_->postures) {
    most_shift_s_ = std::min(kMostShift_s, kShiftOfLog * (times_s.back() - times_s.front()));
    bend_s_ = std::max(kBend_s, median_of(steps_of(times_s)));
    reach_s = most_shift_s_ + 2.0 * bend_s_;
    forbid_gaps(times_s, reach_s, usable);
  }
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const bool inside =
        times_s[i] >= times_s.front() + reach_s && times_s[i] <= times_s.back() - reach_s;
    if (inside && usable[i] != 0) row_.push_back(static_cast<Eigen::Index>(i));
  }
  row_ = thinned(row_, kMostRows);
  for (const Eigen::Index sample : row_)
    row_s_.push_back(times_s[static_cast<std::size_t>(sample)]);
}

Eigen::VectorXd TracedColumns::at_rows(const Eigen::VectorXd& samples) const {
  return samples(row_);
}

TracedColumns::Used TracedColumns::used_at(double shift_s) const {
  if (pair_->postures) return {at_rows(used_.values.col(0)), Eigen::VectorXd::Zero(rows())};
  Used out{Eigen::VectorXd(rows()), Eigen::VectorXd(rows())};
  for (Eigen::Index i = 0; i < rows(); ++i) {
    const double t = std::clamp(row_s_[static_cast<std::size_t>(i)] + shift_s,
                                used_.times_s.front(), used_.times_s.back());
    const ChannelValue read =
        value_of(interpolate(used_, 0, t, std::numeric_limits<double>::infinity()));
    out.value[i] = read.value;
    out.rate[i] = read.rate;
  }
  return out;
}

// Over a time in which noise of the encoder comes to little, and without the instant itself, whose
// noise is in the difference, too; the largest is 1.
Eigen::VectorXd TracedColumns::acceleration_at(double shift_s) const {
  const auto beside = [&](double steps) {
    return Eigen::VectorXd(used_at(shift_s - steps * bend_s_).value +
                           used_at(shift_s + steps * bend_s_).value);
  };
  const Eigen::VectorXd change = beside(2.0) - beside(1.0);
  const double largest = change.cwiseAbs().maxCoeff();
  return largest > 0.0 ? Eigen::VectorXd(change / largest) : change;
}

// A delay that is long beside the motion's own changes has several best values near zero's side:
// the one that leaves least beside a straight line, where it leaves clearly less than none does.
void TracedColumns::find_start() {
  constexpr double kStep_s = 0.01;
  constexpr double kClearly = 0.9;
  if (pair_->postures) return;
  const Eigen::VectorXd other = centred(at_rows(pair_->other));
  const auto left_at = [&](double shift_s) {
    const Eigen::VectorXd used = centred(used_at(shift_s).value);
    const double squares = used.squaredNorm();
    return squares > 0.0 ? other.squaredNorm() - std::pow(used.dot(other), 2) / squares
                         : other.squaredNorm();
  };
  double least = kClearly * left_at(0.0);
  const auto steps = static_cast<int>(most_shift_s_ / kStep_s);
  for (int k = -steps; k <= steps; ++k) {
    const double left = left_at(k * kStep_s);
    if (left >= least) continue;
    least = left;
    start_shift_s_ = k * kStep_s;
  }
}

void TracedColumns::take_loads(const std::optional<Eigen::Vector3d>& gravity_base) {
  JointMotion motion;
  motion.times_s = row_s_;
  motion.value.resize(rows(), pair_->used.value.cols());
  const std::vector<double> read_s = later(row_s_, start_shift_s_);
  for (Eigen::Index j = 0; j < motion.value.cols(); ++j) {
    const Eigen::VectorXd values = pair_->used.value.col(j);
    motion.value.col(j) =
        pair_->postures ? at_rows(values) : read_at(used_.times_s, values, read_s);
  }
  const std::vector<Load> loads = gravity_loads(*tree_, motion, pair_->joint, gravity_base);
  loads_.resize(rows(), 0);
  for (const Load& load : loads) {
    const double largest = load.arm_m.cwiseAbs().maxCoeff();
    if (largest < kNoArm) continue;
    // Behind its command where gravity pulls it backwards.
    append(-load.arm_m / largest, loads_);
    load_names_.push_back(load.what);
  }
  pull_ = Eigen::VectorXd::Zero(rows());
  if (!gravity_base) return;
  const std::vector<Load> middle = gravity_loads(*tree_, motion, pair_->joint, std::nullopt);
  for (std::size_t k = 0; k < middle.size(); ++k)
    pull_ -= (*gravity_base)[static_cast<Eigen::Index>(k)] * middle[k].arm_m;
}

void TracedColumns::take_steps() {
  if (pair_->postures || !step_of(pair_->other)) return;
  const auto reading = unsteady_reading(used_.times_s, pair_->other);
  if (!reading || !reading->in_steps) return;
  step_ = reading->size;
  steps_ = at_rows(pair_->other - reading->motion) / step_;
}

// What all effects leave beside a band of some width (0: none), and the share of play in it.
TracedColumns::Widest TracedColumns::widest(const Shares& shares, double width) const {
  Eigen::MatrixXd columns(rows(), 4 + shares.loads.cols());
  columns << Eigen::VectorXd::Ones(rows()), centred(shares.used.value), shares.delay,
      shares.acceleration, shares.loads;
  if (width > 0.0) append(at_rows(play_state(shares.drive, width)), columns);
  const Eigen::VectorXd observed = at_rows(pair_->other) - shares.used.value;
  const Eigen::VectorXd theta = shortest_least_squares(columns, observed);
  return {observed - columns * theta, width > 0.0 ? theta.tail<1>()[0] : 0.0};
}

// With all effects at once: what is left between neighbours, and who follows whom. With a band
// either way in one search, two that cancel are found in noise (in 12 of 150 logs without any).
void TracedColumns::fit_widest() {
  constexpr double kPlayOfNoise = 10.0;  // play in a noisy column: below, it is that noise
  const Shares shares = shares_at({start_shift_s_, Eigen::VectorXd::Zero(rows())});
  Widest best = widest(shares, 0.0);
  std::vector<Widest> with_band;
  for (const double width : widths_) with_band.push_back(widest(shares, width));
  for (const Widest& fitted : with_band)
    if (fitted.left.squaredNorm() < best.left.squaredNorm()) best = fitted;
  noise_ = noise_of(best.left);
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < widths_.size(); ++k) {
    if (widths_[k] < kPlayOfNoise * noise_ || with_band[k].left.squaredNorm() >= least) continue;
    least = with_band[k].left.squaredNorm();
    other_follows_ = with_band[k].play > 0.0;
  }
  std::erase_if(widths_, [&](double width) { return width < kPlayOfNoise * noise_; });
}

// Not below what the columns' own digits, or rounding, make of it.
double TracedColumns::noise_of(const Eigen::VectorXd& residual) const {
  const Eigen::VectorXd used = used_.values.col(0);
  const double step = std::max(step_of(used).value_or(0.0), step_of(pair_->other).value_or(0.0));
  return std::max({pair_->postures ? kSigmaOverMedian * median_magnitude(residual)
                                   : noise_between_neighbours(residual),
                   kRoundedSigma * step, kRounding * rms_about_mean(at_rows(pair_->other - used)),
                   kNothing});
}

TracedColumns::Shares TracedColumns::shares_at(const State& state) const {
  Shares out;
  out.used = used_at(state.shift_s);
  out.delay = out.used.rate;
  // From no delay to a long one the way is no straight line: along the secant.
  if (state.shift_s == 0.0 && start_shift_s_ != 0.0)
    out.delay = (used_at(start_shift_s_).value - out.used.value) / start_shift_s_;
  out.acceleration = acceleration_at(state.shift_s);
  out.read_s = later(row_s_, state.shift_s);
  out.loads = loads_;
  const std::vector<double> loads_s = later(row_s_, start_shift_s_);
  for (Eigen::Index k = 0; k < loads_.cols() && state.shift_s != start_shift_s_; ++k)
    out.loads.col(k) = read_at(loads_s, loads_.col(k), out.read_s);
  out.drive = pair_->other;
  if (!state.droop.isZero(0.0)) out.drive -= read_at(row_s_, state.droop, used_.times_s);
  return out;
}

Eigen::VectorXd TracedColumns::band_share(const Shares& shares,
                                          Eigen::VectorXd (*share)(const Eigen::VectorXd&, double),
                                          double width) const {
  if (!other_follows_) return -at_rows(share(shares.drive, width));
  const Eigen::VectorXd drive = used_.values.col(0) + (pair_->other - shares.drive);
  return read_at(used_.times_s, share(drive, width), shares.read_s);
}

// The constant, and where dead bands began: a robot that rests at first rests anywhere in its band.
Eigen::MatrixXd TracedColumns::own_columns(const Shares& shares,
                                           const std::vector<AddedEffect>& effects) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Ones(rows(), 1);
  for (const AddedEffect& added : effects) {
    if (added.id.effect != "dead_band") continue;
    const Eigen::VectorXd start = band_share(shares, share_of_start, added.scan);
    if (!start.isZero(0.0)) append(start, out);
  }
  return out;
}

TracedColumns::Solution TracedColumns::solve(const State& state,
                                             const std::vector<AddedEffect>& effects) const {
  Solution out;
  out.shares = std::make_shared<const Shares>(shares_at(state));
  out.candidates = candidates(out.shares);
  out.columns = own_columns(*out.shares, effects);
  std::vector<std::pair<Eigen::Index, Eigen::Index>> places;
  for (const AddedEffect& added : effects) {
    const auto known = std::ranges::find(out.candidates, added.id, &Candidate::id);
    KINESCOPE_CHECK(known != out.candidates.end(), "an added effect is a candidate");
    const std::vector<EffectColumn> own = known->columns(added.scan);
    places.emplace_back(out.columns.cols(), std::ssize(own));
    for (const EffectColumn& column : own) append(column.share, out.columns);
    // Two bands, one in the other, are one that is no play operator.
    known->floor = std::numeric_limits<double>::infinity();
  }
  const Eigen::VectorXd observed = at_rows(pair_->other) - out.shares->used.value;
  const Eigen::VectorXd theta = shortest_least_squares(out.columns, observed);
  out.residual = observed - out.columns * theta;
  for (const auto& [first, count] : places) out.values.emplace_back(theta.segment(first, count));
  return out;
}

// A step of the delay, and what the loads do, as a solution says.
TracedColumns::State TracedColumns::after(const State& state, const Solution& solution,
                                          const std::vector<AddedEffect>& effects) const {
  State out{state.shift_s, Eigen::VectorXd::Zero(rows())};
  for (std::size_t e = 0; e < effects.size(); ++e) {
    const Eigen::VectorXd& values = solution.values[e];
    if (effects[e].id.effect == "droop") out.droop += solution.shares->loads * values;
    if (effects[e].id.effect == "time_offset")
      out.shift_s = std::clamp(state.shift_s + values[0], -most_shift_s_, most_shift_s_);
  }
  return out;
}

TracedFit TracedColumns::fit(const std::vector<AddedEffect>& effects) const {
  constexpr int kRounds = 20;
  constexpr double kSameTime_s = 1e-6;
  constexpr double kSameDroop = 0.01;  // of the noise
  const bool delayed = std::ranges::any_of(
      effects, [](const AddedEffect& added) { return added.id.effect == "time_offset"; });
  State state{delayed ? start_shift_s_ : 0.0, Eigen::VectorXd::Zero(rows())};
  Solution solution;
  TracedFit out;
  for (int round = 0; round < kRounds && !out.converged; ++round) {
    solution = solve(state, effects);
    State next = after(state, solution, effects);
    out.converged = std::abs(next.shift_s - state.shift_s) < kSameTime_s &&
                    (next.droop - state.droop).cwiseAbs().maxCoeff() < kSameDroop * noise_;
    state = std::move(next);
  }
  if (!out.converged) out.reason = "the delay does not settle";
  out.linear = linearise(solution.columns, solution.residual);
  out.values = std::move(solution.values);
  for (std::size_t e = 0; e < effects.size(); ++e)
    if (effects[e].id.effect == "time_offset") out.values[e][0] = state.shift_s;
  out.candidates = std::move(solution.candidates);
  return out;
}

bool TracedColumns::is_lifted(const std::vector<AddedEffect>& effects) const {
  const TracedFit fitted = fit(effects);
  double along = 0.0;
  for (std::size_t e = 0; e < effects.size(); ++e)
    if (effects[e].id.effect == "droop") along = (loads_ * fitted.values[e]).dot(centred(pull_));
  return along < 0.0;
}

Linearisation TracedColumns::linearise(const Eigen::MatrixXd& columns,
                                       const Eigen::VectorXd& residual) const {
  constexpr Eigen::Index kFolds = 5;
  constexpr Eigen::Index kBlocks = 3 * kFolds;  // of time: each fold sees all of the recording
  Linearisation out;
  out.residual = residual / noise_;
  out.jacobian = columns / noise_;
  out.carriers = Eigen::MatrixXd::Constant(rows(), 1, 1.0 / noise_).sparseView();
  out.unit = Eigen::VectorXd::Constant(rows(), noise_);
  out.unit_name = unit_;
  // Stretches of the time that is looked at: gaps are none.
  const double step_s = median_of(steps_of(row_s_));
  out.time_s = Eigen::VectorXd::LinSpaced(rows(), 0.0, step_s * static_cast<double>(rows() - 1));
  for (Eigen::Index i = 0; i <= rows(); ++i) out.first_row.push_back(i);
  for (Eigen::Index i = 0; i < rows(); ++i)
    out.fold.push_back(static_cast<int>(i * kBlocks / rows() % kFolds));
  out.independent_instants = pair_->postures;
  // Not said to be whitened by neighbours: a drive has its own dynamics, which last, and a droop
  // that is ten times as large would be taken back for them. What is left is judged by noise().
  if (!pair_->postures) out.correlation_time_s = step_s * memory_of(residual);
  return out;
}

}  // namespace kinescope::effects
