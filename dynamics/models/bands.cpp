// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/bands.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Eigen::Index;

// Two-sided quantiles of the normal distribution.
constexpr double kNormal90 = 1.6448536;
constexpr double kNormal95 = 1.9599640;
// Below so many residuals the 95 % quantile is the largest one or nearly so.
constexpr std::size_t kFewest = 40;

// |residual| / sigma of one joint, and where it comes from.
struct Studentised {
  double value = 0.0;
  int fold = 0;
};

std::vector<Studentised> ascending(const LeftOutTorques& left, Index joint) {
  std::vector<Studentised> out;
  for (Index i = 0; i < left.residual.rows(); ++i) {
    const double value = std::abs(left.residual(i, joint)) / left.sigma(i, joint);
    if (std::isfinite(value)) out.push_back({value, left.fold[i]});
  }
  std::ranges::sort(out, {}, &Studentised::value);
  return out;
}

// The smallest value that `level` of n + 1 exchangeable ones do not exceed; `without`: a fold that
// does not count.
double quantile(const std::vector<Studentised>& values, double level, int without) {
  const auto counts = [&](const Studentised& s) { return s.fold != without; };
  const auto n = static_cast<double>(std::ranges::count_if(values, counts));
  const double rank = std::min(std::ceil(level * (n + 1.0)), n);
  double seen = 0.0;
  double last = 0.0;
  for (const Studentised& s : values) {
    if (!counts(s)) continue;
    last = s.value;
    if (++seen >= rank) break;
  }
  return last;
}

// Student's over the normal distribution's two-sided quantile (Cornish and Fisher's expansion,
// Abramowitz and Stegun 26.7.5).
double student_over_normal(double normal, double degrees) {
  const double square = normal * normal;
  return 1.0 + (square + 1.0) / (4.0 * degrees) +
         (5.0 * square * square + 16.0 * square + 3.0) / (96.0 * degrees * degrees);
}

double width(const std::vector<Studentised>& values, double level, double normal, int folds) {
  constexpr int kNone = -1;
  constexpr double kFewestDegrees = 3.0;  // the expansion ends there
  const double all = quantile(values, level, kNone);
  std::vector<double> without;
  for (int f = 0; f < folds; ++f) {
    const double left = quantile(values, level, f);
    if (left > 0.0) without.push_back(std::log(left));
  }
  if (without.size() < 2) return all;
  const auto count = static_cast<double>(without.size());
  double mean = 0.0;
  for (const double value : without) mean += value / count;
  double variance = 0.0;
  for (const double value : without) {
    variance += (count - 1.0) / count * (value - mean) * (value - mean);
  }
  const double degrees = std::max(kFewestDegrees, 0.5 / std::max(variance, 1e-12));
  return all * student_over_normal(normal, degrees);
}

// The share of the function's variance (mean 1 here) in the shape of sigma^2 that makes the
// residuals likeliest, and the scale of that shape.
struct Shape {
  double share = 0.0;
  double scale = 0.0;
};

Shape likeliest_shape(const Eigen::ArrayXd& squares, const Eigen::ArrayXd& function) {
  constexpr int kSteps = 100;
  // Some noise is left: no band closes at a sample that was learned from.
  constexpr int kMost = 99;
  Shape best;
  double least = std::numeric_limits<double>::infinity();
  for (int step = 0; step <= kMost; ++step) {
    const double share = static_cast<double>(step) / kSteps;
    const Eigen::ArrayXd variance = (1.0 - share) + share * function;
    const double scale = (squares / variance).mean();
    const double cost = std::log(scale) + variance.log().mean();
    if (cost < least) {
      least = cost;
      best = {share, scale};
    }
  }
  return best;
}

}  // namespace

double BandFactors::width_90(Index joint) const {
  return of_90.size() > 0 ? of_90[joint] : kNormal90;
}

double BandFactors::width_95(Index joint) const {
  return of_95.size() > 0 ? of_95[joint] : kNormal95;
}

std::optional<LeftOutTorques> leave_folds_out(const TorqueSamples& samples, int folds,
                                              Index most_rows, const FoldPredictor& predict) {
  const Index step = most_rows > 0 ? (samples.size() + most_rows - 1) / most_rows : 1;
  std::vector<TorqueSamples> tests;
  std::vector<TorquePrediction> predictions;
  Index rows = 0;
  try {
    for (const Fold& fold : split_folds(samples, {.folds = folds}).folds) {
      std::vector<Index> chosen;
      for (std::size_t k = 0; k < fold.test.size(); k += static_cast<std::size_t>(step)) {
        chosen.push_back(fold.test[k]);
      }
      tests.push_back(select_rows(samples, chosen));
      predictions.push_back(predict(select_rows(samples, fold.train), tests.back()));
      rows += tests.back().size();
    }
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;  // too short to leave something out
  }
  LeftOutTorques out;
  out.folds = static_cast<int>(tests.size());
  out.residual.resize(rows, samples.joints());
  out.model_sigma = out.sigma = out.residual;
  out.fold.resize(rows);
  Index row = 0;
  for (std::size_t f = 0; f < tests.size(); ++f) {
    const Index count = tests[f].size();
    out.residual.middleRows(row, count) = tests[f].torque - predictions[f].mean;
    out.model_sigma.middleRows(row, count) = predictions[f].model_sigma;
    out.sigma.middleRows(row, count) = predictions[f].sigma;
    out.fold.segment(row, count).setConstant(static_cast<int>(f));
    row += count;
  }
  return out;
}

BandFactors bands_of(const LeftOutTorques& left) {
  const Index joints = left.residual.cols();
  BandFactors out{Eigen::VectorXd::Constant(joints, kNormal90),
                  Eigen::VectorXd::Constant(joints, kNormal95), left.folds};
  for (Index j = 0; j < joints; ++j) {
    const std::vector<Studentised> values = ascending(left, j);
    if (values.size() < kFewest) continue;
    out.of_90[j] = width(values, 0.90, kNormal90, left.folds);
    out.of_95[j] = std::max(out.of_90[j], width(values, 0.95, kNormal95, left.folds));
  }
  return out;
}

BandFactors cross_validated_bands(const TorqueSamples& samples, int folds,
                                  const FoldPredictor& predict) {
  const auto left = leave_folds_out(samples, folds, 0, predict);
  return left ? bands_of(*left) : BandFactors{};
}

SigmaParts sigma_parts_of(const LeftOutTorques& left) {
  const Index joints = left.residual.cols();
  SigmaParts out{Eigen::VectorXd::Ones(joints), Eigen::VectorXd::Zero(joints)};
  for (Index j = 0; j < joints; ++j) {
    const Eigen::ArrayXd squares = left.residual.col(j).array().square();
    const Eigen::ArrayXd function = left.model_sigma.col(j).array().square();
    const double mean = function.mean();
    // A model that claims to be sure everywhere says nothing about where it errs.
    const bool varies = mean > 0.0 && std::isfinite(mean);
    const Shape shape =
        varies ? likeliest_shape(squares, function / mean) : Shape{0.0, squares.mean()};
    out.model_factor[j] = varies ? std::sqrt(shape.scale * shape.share / mean) : 0.0;
    out.noise_sigma[j] = std::sqrt(shape.scale * (1.0 - shape.share));
  }
  return out;
}

TorquePrediction with_sigma_parts(TorquePrediction prediction, const SigmaParts& parts) {
  prediction.model_sigma = (prediction.model_sigma * parts.model_factor.asDiagonal()).eval();
  for (Index j = 0; j < prediction.sigma.cols(); ++j) {
    const double noise = parts.noise_sigma[j];
    prediction.sigma.col(j) =
        (prediction.model_sigma.col(j).array().square() + noise * noise).sqrt();
  }
  return prediction;
}

}  // namespace kinescope
