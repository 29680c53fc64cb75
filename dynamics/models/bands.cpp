// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/bands.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "dynamics/data/splits.h"
#include "dynamics/gp/workers.h"
#include "dynamics/models/normal_widths.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Eigen::Index;

// Below so many residuals the 95 % quantile is the largest one or nearly so.
constexpr std::size_t kFewest = 40;

// |residual| / sigma of one joint, and where it comes from.
struct Studentised {
  double value = 0.0;
  int fold = 0;
};

// Sorted; rows whose sigma is not finite say nothing.
std::vector<Studentised> ascending(const LeftOutTorques& left, Index joint,
                                   const Eigen::VectorXd& sigma) {
  std::vector<Studentised> out;
  for (Index i = 0; i < sigma.size(); ++i) {
    if (!std::isfinite(sigma[i])) continue;
    const double value = std::abs(left.residual(i, joint)) / sigma[i];
    if (std::isfinite(value)) out.push_back({value, left.fold[i]});
  }
  std::ranges::sort(out, {}, &Studentised::value);
  return out;
}

constexpr int kNone = -1;

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

// Residuals over the sigma that comes of all folds but one, and the mean logarithm of that sigma
// over the one of all: a band is a quantile times a sigma.
struct WithoutFold {
  std::vector<Studentised> values;
  double log_scale = 0.0;
};

double width(const std::vector<Studentised>& values, const std::vector<WithoutFold>& without_folds,
             double level, double normal) {
  constexpr double kFewestDegrees = 3.0;  // the expansion ends there
  const double all = quantile(values, level, kNone);
  std::vector<double> without;
  for (std::size_t f = 0; f < without_folds.size(); ++f) {
    const double left = quantile(without_folds[f].values, level, static_cast<int>(f));
    if (left > 0.0) without.push_back(std::log(left) + without_folds[f].log_scale);
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

struct JointParts {
  double model_factor = 1.0;
  double noise_sigma = 0.0;

  [[nodiscard]] Eigen::VectorXd sigma(const Eigen::VectorXd& model_sigma) const {
    // Not 0 times infinity: a model without any idea stays without.
    return model_sigma.unaryExpr([this](double s) {
      return std::isfinite(s) ? std::hypot(model_factor * s, noise_sigma) : s;
    });
  }
};

// `without`: a fold that does not count.
JointParts parts_of(const LeftOutTorques& left, Index joint, int without) {
  std::vector<Index> rows;
  for (Index i = 0; i < left.residual.rows(); ++i) {
    if (left.fold[i] != without && std::isfinite(left.model_sigma(i, joint))) rows.push_back(i);
  }
  if (rows.empty()) return {};
  const Eigen::ArrayXd squares = left.residual(rows, joint).array().square();
  const Eigen::ArrayXd function = left.model_sigma(rows, joint).array().square();
  const double mean = function.mean();
  // A model that claims to be sure everywhere says nothing about where it errs.
  const bool varies = mean > 0.0 && std::isfinite(mean);
  const Shape shape =
      varies ? likeliest_shape(squares, function / mean) : Shape{0.0, squares.mean()};
  return {varies ? std::sqrt(shape.scale * shape.share / mean) : 0.0,
          std::sqrt(shape.scale * (1.0 - shape.share))};
}

// Of every row, as it comes of all folds but `without`.
using SigmaOf = std::function<Eigen::VectorXd(Index joint, int without)>;

double mean_log_ratio(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  double sum = 0.0;
  double count = 0.0;
  for (Index i = 0; i < a.size(); ++i) {
    const double one = std::log(a[i] / b[i]);
    if (!std::isfinite(one)) continue;
    sum += one;
    count += 1.0;
  }
  return count > 0.0 ? sum / count : 0.0;
}

double largest_finite(const Eigen::VectorXd& values) {
  double largest = 0.0;
  for (const double value : values) {
    if (std::isfinite(value)) largest = std::max(largest, value);
  }
  return largest;
}

BandFactors bands_from(const LeftOutTorques& left, const SigmaOf& sigma_of) {
  const Index joints = left.residual.cols();
  BandFactors out{Eigen::VectorXd::Constant(joints, kNormal90),
                  Eigen::VectorXd::Constant(joints, kNormal95),
                  left.folds,
                  left.by_trajectory,
                  Eigen::VectorXi::Zero(joints),
                  Eigen::VectorXi::Zero(joints),
                  Eigen::VectorXd::Zero(joints)};
  for (Index j = 0; j < joints; ++j) {
    const Eigen::VectorXd sigma = sigma_of(j, kNone);
    const std::vector<Studentised> values = ascending(left, j, sigma);
    out.skipped[j] = static_cast<int>(left.residual.rows() - std::ssize(values));
    out.seen_sigma[j] = largest_finite(left.model_sigma.col(j));
    if (values.size() < kFewest) continue;
    std::vector<WithoutFold> without;
    for (int f = 0; f < left.folds; ++f) {
      const Eigen::VectorXd other = sigma_of(j, f);
      without.push_back({ascending(left, j, other), mean_log_ratio(other, sigma)});
    }
    out.residuals[j] = static_cast<int>(values.size());
    out.of_90[j] = width(values, without, 0.90, kNormal90);
    out.of_95[j] = std::max(out.of_90[j], width(values, without, 0.95, kNormal95));
  }
  return out;
}

}  // namespace

std::optional<LeftOutTorques> leave_folds_out(const TorqueSamples& samples, int folds,
                                              Index most_rows, const FoldPredictor& predict,
                                              int threads) {
  const Index step = most_rows > 0 ? (samples.size() + most_rows - 1) / most_rows : 1;
  bool by_trajectory = false;
  std::vector<TorqueSamples> tests;
  std::vector<TorquePrediction> predictions;
  std::vector<Eigen::RowVectorXd> means;
  Index rows = 0;
  try {
    const Folds split = split_folds(samples, {.folds = folds});
    by_trajectory = split.by_trajectory;
    for (const Fold& fold : split.folds) {
      std::vector<Index> chosen;
      for (std::size_t k = 0; k < fold.test.size(); k += static_cast<std::size_t>(step)) {
        chosen.push_back(fold.test[k]);
      }
      tests.push_back(select_rows(samples, chosen));
      rows += tests.back().size();
    }
    predictions.resize(tests.size());
    means.resize(tests.size());
    gp::Workers workers(threads);
    workers.run(std::ssize(tests), [&](Index task, gp::Scratch&) {
      const auto f = static_cast<std::size_t>(task);
      const TorqueSamples train = select_rows(samples, split.folds[f].train);
      means[f] = train.torque.colwise().mean();
      predictions[f] = predict(train, tests[f]);
    });
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;  // too short to leave something out
  }
  LeftOutTorques out;
  out.folds = static_cast<int>(tests.size());
  out.by_trajectory = by_trajectory;
  out.residual.resize(rows, samples.joints());
  out.model_sigma = out.sigma = out.torque = out.constant_residual = out.residual;
  out.fold.resize(rows);
  Index row = 0;
  for (std::size_t f = 0; f < tests.size(); ++f) {
    const Index count = tests[f].size();
    out.residual.middleRows(row, count) = tests[f].torque - predictions[f].mean;
    out.model_sigma.middleRows(row, count) = predictions[f].model_sigma;
    out.sigma.middleRows(row, count) = predictions[f].sigma;
    out.torque.middleRows(row, count) = tests[f].torque;
    out.constant_residual.middleRows(row, count) = tests[f].torque.rowwise() - means[f];
    out.fold.segment(row, count).setConstant(static_cast<int>(f));
    row += count;
  }
  return out;
}

BandFactors bands_of(const LeftOutTorques& left) {
  return bands_from(left, [&](Index joint, int) { return left.sigma.col(joint); });
}

BandFactors cross_validated_bands(const TorqueSamples& samples, int folds,
                                  const FoldPredictor& predict) {
  const auto left = leave_folds_out(samples, folds, 0, predict);
  return left ? bands_of(*left) : BandFactors{};
}

SigmaParts sigma_parts_of(const LeftOutTorques& left) {
  const Index joints = left.residual.cols();
  SigmaParts out{Eigen::VectorXd(joints), Eigen::VectorXd(joints)};
  for (Index j = 0; j < joints; ++j) {
    const JointParts parts = parts_of(left, j, kNone);
    out.model_factor[j] = parts.model_factor;
    out.noise_sigma[j] = parts.noise_sigma;
  }
  return out;
}

CalibratedSigma calibrate(const LeftOutTorques& left) {
  return {sigma_parts_of(left), bands_from(left, [&](Index joint, int without) {
            return parts_of(left, joint, without).sigma(left.model_sigma.col(joint));
          })};
}

TorquePrediction with_sigma_parts(TorquePrediction prediction, const SigmaParts& parts) {
  for (Index j = 0; j < prediction.sigma.cols(); ++j) {
    const JointParts own{parts.model_factor[j], parts.noise_sigma[j]};
    prediction.sigma.col(j) = own.sigma(prediction.model_sigma.col(j));
    prediction.model_sigma.col(j) =
        JointParts{own.model_factor, 0.0}.sigma(prediction.model_sigma.col(j));
  }
  return prediction;
}

}  // namespace kinescope
