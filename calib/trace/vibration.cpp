// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/vibration.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/LU>
#include <fmt/format.h>
#include <unsupported/Eigen/FFT>

#include "calib/trace/distribution.h"
#include "kinematics/core/golden_section.h"
#include "kinematics/core/median.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::trace {
namespace {

// Turns in the recording: fewer are a curve over time, whose test has eight knots. Autofocus that
// hunts swings a few times (`undeclared`, 14239: 5.3 turns in 18 s).
constexpr double kLeastTurns = 3.0;
// Up to here joints move as slowly in a recording: what they do swings, too (chosen).
constexpr double kTurnsOfMotion = 12.0;
// Frequencies tried, in steps of one turn in the recording.
constexpr int kOversampling = 4;
constexpr int kFrequencySteps = 40;  // of the golden section: to 1e-8 of the bracket

// Instants on an even grid of time, which a film's are but for frames left out.
struct Grid {
  double step_s = 0.0;
  std::vector<std::size_t> cell;  // of every instant
  std::size_t cells = 0;
};

std::optional<Grid> grid_of(const Eigen::VectorXd& time_s) {
  constexpr Eigen::Index kFewInstants = 100;
  constexpr double kMostCells = 8.0;  // an instant: with gaps as long there is no rate
  const Eigen::Index n = time_s.size();
  if (n < kFewInstants) return std::nullopt;
  std::vector<double> steps;
  for (Eigen::Index i = 1; i < n; ++i) steps.push_back(time_s[i] - time_s[i - 1]);
  Grid grid;
  grid.step_s = median_of(std::move(steps));
  const double duration = time_s[n - 1] - time_s[0];
  if (!(grid.step_s > 0.0) || duration > kMostCells * static_cast<double>(n) * grid.step_s)
    return std::nullopt;
  for (const double t : time_s)
    grid.cell.push_back(static_cast<std::size_t>(std::lround((t - time_s[0]) / grid.step_s)));
  grid.cells = grid.cell.back() + 1;
  return grid;
}

// carrier'residual and carrier'carrier of every instant.
struct Series {
  Eigen::VectorXd with_residual;
  Eigen::VectorXd with_itself;
};

Series series_of(const Linearisation& linear, int carrier) {
  Series out{Eigen::VectorXd::Zero(linear.instants()), Eigen::VectorXd::Zero(linear.instants())};
  std::size_t instant = 0;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, carrier); entry; ++entry) {
    while (linear.first_row[instant + 1] <= entry.row()) ++instant;
    const auto i = static_cast<Eigen::Index>(instant);
    out.with_residual[i] += entry.value() * linear.residual[entry.row()];
    out.with_itself[i] += entry.value() * entry.value();
  }
  return out;
}

std::vector<EffectColumn> swing(int carrier, const Eigen::VectorXd& time_s, double frequency_hz) {
  const Eigen::ArrayXd phase = 2.0 * std::numbers::pi * frequency_hz * time_s.array();
  return {{carrier, phase.cos().matrix()}, {carrier, phase.sin().matrix()}};
}

struct Peak {
  double frequency_hz = 0.0;
  double gain = 0.0;  // of the sum of squares, without the model's own parameters
};

// The periodogram's highest line above `least_hz`.
Peak highest_line(const Series& series, const Grid& grid, double least_hz) {
  const std::size_t size = static_cast<std::size_t>(kOversampling) * grid.cells;
  std::vector<double> padded(size, 0.0);
  for (std::size_t i = 0; i < grid.cell.size(); ++i)
    padded[grid.cell[i]] += series.with_residual[static_cast<Eigen::Index>(i)];
  std::vector<std::complex<double>> spectrum;
  Eigen::FFT<double> fft;
  fft.fwd(spectrum, padded);
  const double unit_hz = 1.0 / (static_cast<double>(size) * grid.step_s);
  const double weight = series.with_itself.sum();
  Peak best;
  for (std::size_t k = 0; 2 * k < size; ++k) {
    const double frequency_hz = static_cast<double>(k) * unit_hz;
    const double gain = 2.0 * std::norm(spectrum[k]) / weight;
    if (frequency_hz >= least_hz && gain > best.gain) best = {frequency_hz, gain};
  }
  return best;
}

// Over one step of the periodogram to either side.
double refined_frequency(const NormalSystem& system, int carrier, double frequency_hz,
                         double step_hz) {
  const auto gain = [&](double f) {
    return gain_of(system, swing(carrier, system.linear().time_s, f));
  };
  return golden_section(gain, frequency_hz - step_hz, frequency_hz + step_hz, kFrequencySteps).at;
}

// A signal without the straight line of every stretch, which would look alike in all of them.
Eigen::VectorXd without_trends(const Eigen::VectorXd& value, const Eigen::VectorXd& time_s,
                               const Partition& partition) {
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(partition.stretches, 5);  // 1, t, x, tt, tx
  const auto of = [&](Eigen::Index i) { return partition.stretch[static_cast<std::size_t>(i)]; };
  for (Eigen::Index i = 0; i < value.size(); ++i) {
    const double t = time_s[i] - time_s[0];
    sums.row(of(i)) += Eigen::RowVectorXd{{1.0, t, value[i], t * t, t * value[i]}};
  }
  Eigen::VectorXd out(value.size());
  for (Eigen::Index i = 0; i < value.size(); ++i) {
    const Eigen::RowVectorXd mean = sums.row(of(i)) / sums(of(i), 0);
    const double spread = mean[3] - mean[1] * mean[1];
    const double slope = spread > 0.0 ? (mean[4] - mean[1] * mean[2]) / spread : 0.0;
    out[i] = value[i] - mean[2] - slope * (time_s[i] - time_s[0] - mean[1]);
  }
  return out;
}

// p-value of a line in a covariate: the mean of what each stretch says of its cosine and sine
// (Hotelling 1931).
double line_p_value(const Covariate& covariate, const Eigen::VectorXd& time_s, double frequency_hz,
                    const Partition& partition) {
  const int n = partition.stretches;
  const Eigen::VectorXd value = without_trends(covariate.value, time_s, partition);
  Eigen::MatrixX2d swings = Eigen::MatrixX2d::Zero(n, 2);
  for (Eigen::Index i = 0; i < value.size(); ++i) {
    const double phase = 2.0 * std::numbers::pi * frequency_hz * time_s[i];
    swings.row(partition.stretch[static_cast<std::size_t>(i)]) +=
        value[i] * Eigen::RowVector2d(std::cos(phase), std::sin(phase));
  }
  const Eigen::RowVector2d mean = swings.colwise().mean();
  const Eigen::MatrixX2d about = swings.rowwise() - mean;
  const Eigen::Matrix2d scatter = about.transpose() * about / (n - 1.0);
  if (n < 4 || !(scatter.determinant() > 0.0)) return 1.0;
  const double squared = n * mean.dot((scatter.inverse() * mean.transpose()).transpose());
  return f_survival(squared * (n - 2.0) / (2.0 * (n - 1.0)), 2.0, n - 2.0);
}

// True where a joint's motion swings so, too: what is left then follows it.
bool is_of_the_motion(const NormalSystem& system, const std::vector<Covariate>& covariates,
                      double frequency_hz, double level) {
  return std::ranges::any_of(covariates, [&](const Covariate& covariate) {
    if (covariate.name == "time") return false;  // a straight line: rounding is left of it
    const double p_value =
        line_p_value(covariate, system.linear().time_s, frequency_hz, system.partition());
    return p_value * static_cast<double>(covariates.size()) <= level;
  });
}

Covariate phase_of(const Eigen::VectorXd& time_s, double frequency_hz) {
  Covariate out;
  out.name = fmt::format("phase of a vibration of {:.3g} Hz", frequency_hz);
  out.unit = "rad";
  const Eigen::ArrayXd turns = frequency_hz * time_s.array();
  out.value = 2.0 * std::numbers::pi * (turns - turns.floor()).matrix();
  return out;
}

}  // namespace

std::optional<Vibration> find_vibration(const NormalSystem& system,
                                        const std::vector<RestPlace>& places,
                                        const std::vector<Covariate>& covariates, double level,
                                        const TraceOptions& options) {
  const Linearisation& linear = system.linear();
  const bool noise_is_known = !linear.body.empty() || linear.noise.size() > 0;
  if (linear.independent_instants || !noise_is_known || places.empty()) return std::nullopt;
  const std::optional<Grid> grid = grid_of(linear.time_s);
  if (!grid) return std::nullopt;
  const double duration = static_cast<double>(grid->cells) * grid->step_s;
  std::vector<Peak> peaks(places.size());
  parallel_for(places.size(), [&](std::size_t k) {
    const Series series = series_of(linear, places[k].carrier);
    if (series.with_itself.sum() > 0.0)
      peaks[k] = highest_line(series, *grid, kLeastTurns / duration);
  });
  const auto highest = std::ranges::max_element(peaks, {}, &Peak::gain);
  if (!(highest->gain > 0.0)) return std::nullopt;
  const auto place = static_cast<std::size_t>(highest - peaks.begin());
  const int carrier = places[place].carrier;
  const double frequency_hz =
      refined_frequency(system, carrier, highest->frequency_hz, 1.0 / (kOversampling * duration));
  // One independent frequency a turn in the recording (Scargle 1982, eq. 13).
  const double tests = static_cast<double>(places.size() * grid->cells) / 2.0;
  const std::vector<EffectColumn> columns = swing(carrier, linear.time_s, frequency_hz);
  Vibration out{place, phase_of(linear.time_s, frequency_hz), score_test(system, columns), 1.0};
  if (out.score.hidden() || !is_large(out.score, options)) return std::nullopt;
  out.p_value = tests * std::max(out.score.p_value, jackknife_test(system, columns).p_value);
  if (out.p_value > level) return std::nullopt;
  const bool as_slow_as_motion = frequency_hz * duration < kTurnsOfMotion;
  if ((linear.body.empty() || as_slow_as_motion) &&
      is_of_the_motion(system, covariates, frequency_hz, level))
    return std::nullopt;
  return out;
}

}  // namespace kinescope::trace
