// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/velocity_model.h"

#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "dynamics/gp/hyperparameters.h"
#include "dynamics/policy/kernel_matrix.h"
#include "dynamics/policy/model_data.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Ranges of the search, relative to what the data show. Wide: they keep the search from where a
// kernel matrix is singular, nothing else.
constexpr double kShortestScale = 0.1;  // of the column's standard deviation
constexpr double kLongestScale = 100.0;
constexpr double kLowestNoise = 1e-6;  // variance, of the target's mean square
constexpr double kHighestNoise = 1.0;
constexpr double kFirstNoise = 1e-2;
constexpr double kSmallestWeight = 1e-8;  // of a linear factor, over the column's mean square
constexpr double kLargestWeight = 1e3;

Eigen::VectorXd deviation_of(const Eigen::MatrixXd& x) {
  const Eigen::RowVectorXd mean = x.colwise().mean();
  const Eigen::VectorXd squares =
      (x.rowwise() - mean).colwise().squaredNorm().transpose() / static_cast<double>(x.rows());
  return (squares.array() > 0.0).select(squares.cwiseSqrt(), 1.0);
}

Eigen::VectorXd mean_square_of(const Eigen::MatrixXd& x) {
  const Eigen::VectorXd out = x.colwise().squaredNorm().transpose() / static_cast<double>(x.rows());
  return (out.array() > 0.0).select(out, 1.0);
}

// Kernel of dynamics/gp with its parameters in one order: variance and length scales of the
// exponential part, then the factors.
class KernelSearch {
 public:
  KernelSearch(VelocityKernel kind, const Eigen::MatrixXd& inputs,
               std::shared_ptr<const PhysicsFeatures> physics)
      : kind_(kind),
        columns_(inputs.cols()),
        linear_(physics ? physics->count() : inputs.cols()),
        physics_(std::move(physics)),
        kernel_(make()) {
    std::vector<gp::Parameter> parameters = kernel_.parameters();
    const Eigen::VectorXd spread = deviation_of(inputs);
    set(parameters[0], 1.0, 1e-4, 1e3);
    for (Index d = 0; d < columns_; ++d) {
      set(parameters[static_cast<std::size_t>(1 + d)],
          std::sqrt(static_cast<double>(columns_)) * spread[d], kShortestScale * spread[d],
          kLongestScale * spread[d]);
    }
    const Eigen::VectorXd squares = mean_square_of(linear_columns(inputs, physics_.get()));
    for (auto i = static_cast<std::size_t>(1 + columns_); i < parameters.size(); ++i) {
      const std::optional<Index> column = column_of(static_cast<Index>(i));
      const double unit = column ? squares[*column] : 1.0;
      set(parameters[i], 1.0 / (unit * static_cast<double>(linear_)), kSmallestWeight / unit,
          kLargestWeight / unit);
    }
    kernel_ = kernel_.with_parameters(std::move(parameters));
  }

  [[nodiscard]] gp::GpModel model() const {
    gp::GpModel out = gp::make_model(kernel_, kFirstNoise);
    set(out.noise_variance[0], kFirstNoise, kLowestNoise, kHighestNoise);
    return out;
  }

  [[nodiscard]] KernelValues values_of(const gp::GpModel& model) const {
    const Eigen::VectorXd v = model.kernel.log_values().array().exp();
    KernelValues out{v[0], v.segment(1, columns_), {}, model.noise_variance[0].value};
    Index at = 1 + columns_;
    if (kind_ == VelocityKernel::kPolynomial2) {
      out.factors = {{v[at], v.segment(at + 1, linear_)},
                     {1.0, v.segment(at + 1 + linear_, linear_)}};
    }
    if (kind_ == VelocityKernel::kSemiParametric) out.factors = {{0.0, v.segment(at, linear_)}};
    return out;
  }

  [[nodiscard]] gp::GpModel model_at(const KernelValues& values) const {
    Eigen::VectorXd v(kernel_.log_values().size());
    v[0] = values.variance;
    v.segment(1, columns_) = values.length_scales;
    Index at = 1 + columns_;
    if (kind_ == VelocityKernel::kPolynomial2) v[at++] = values.factors[0].offset;
    for (const LinearFactor& factor : values.factors) {
      v.segment(at, linear_) = factor.weights;
      at += linear_;
    }
    gp::GpModel out = model();
    out.kernel = out.kernel.with_log_values(v.array().log());
    out.noise_variance[0].value = values.noise_variance;
    return out;
  }

 private:
  [[nodiscard]] gp::Kernel make() const {
    gp::Kernel smooth = gp::rbf(gp::first_columns(static_cast<int>(columns_)));
    if (kind_ == VelocityKernel::kSquaredExponential) return smooth;
    if (kind_ == VelocityKernel::kPolynomial2) {
      return smooth +
             gp::multiplicative_polynomial(gp::first_columns(static_cast<int>(columns_)), 2);
    }
    gp::FeatureMap map{{}, static_cast<int>(columns_), {}};
    for (Index f = 0; f < linear_; ++f) map.names.push_back(fmt::format("physics {}", f));
    map.map = [physics = physics_](const gp::Inputs& inputs, gp::Features features) {
      physics->evaluate(inputs, std::move(features));
    };
    return smooth + gp::linear(std::move(map), gp::Offset::kNone);
  }

  // The column that a factor's parameter weighs; nothing for the offset.
  [[nodiscard]] std::optional<Index> column_of(Index parameter) const {
    Index at = parameter - 1 - columns_;
    if (kind_ == VelocityKernel::kPolynomial2 && at-- == 0) return std::nullopt;
    return at % linear_;
  }

  static void set(gp::Parameter& parameter, double value, double lower, double upper) {
    parameter.value = value;
    parameter.lower = lower;
    parameter.upper = upper;
  }

  VelocityKernel kind_;
  Index columns_;
  Index linear_;
  std::shared_ptr<const PhysicsFeatures> physics_;
  gp::Kernel kernel_;
};

// The better of the search from the start values and of that from the trial before.
gp::Estimate best_estimate(const KernelSearch& search, const gp::Dataset& dataset,
                           const ModelOptions& options, const VelocityProcess* last) {
  gp::EstimateOptions estimate;
  estimate.fit.threads = options.threads;
  estimate.fit.route = gp::Route::kDense;
  estimate.starts = options.starts;
  estimate.seed = options.seed;
  gp::Estimate out = gp::estimate_hyperparameters(search.model(), dataset, estimate);
  if (last == nullptr) return out;
  estimate.starts = 1;
  gp::Estimate warm =
      gp::estimate_hyperparameters(search.model_at(last->kernel), dataset, estimate);
  const bool usable = warm.status != gp::EstimateStatus::kFailed;
  if (usable && (out.status == gp::EstimateStatus::kFailed || warm.score > out.score)) return warm;
  return out;
}

VelocityProcess learn_process(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& increments,
                              const ModelOptions& options, const VelocityProcess* last) {
  VelocityProcess out;
  out.samples = inputs.rows();
  out.target_scale = std::sqrt(increments.squaredNorm() / static_cast<double>(increments.size()));
  const Eigen::VectorXd targets = increments / out.target_scale;
  const KernelSearch search(options.kernel, inputs, options.physics);
  const gp::Estimate estimate = best_estimate(search, {inputs, targets, {}, {}}, options, last);
  if (estimate.status == gp::EstimateStatus::kFailed) {
    throw undetermined("model", fmt::format("no hyperparameters were found ({})", estimate.message),
                       "explore for longer or choose another kernel");
  }
  out.kernel = search.values_of(estimate.model);
  out.log_likelihood = estimate.score;
  const std::vector<Index> kept = informative_samples(
      out.kernel, inputs, options.physics.get(), options.subset_threshold, options.max_samples);
  out.inputs = inputs(kept, Eigen::all);
  out.targets = targets(kept);
  return out;
}

void check_model_options(const ModelOptions& options) {
  const bool semi = options.kernel == VelocityKernel::kSemiParametric;
  if (semi != (options.physics != nullptr) || (semi && options.physics->count() < 1)) {
    throw bad_request("model",
                      fmt::format("kernel {} {} features of physics", name_of(options.kernel),
                                  semi ? "without" : "with"),
                      semi ? "give the system's features" : "leave them out");
  }
  if (!(options.subset_threshold >= 0.0) || options.max_samples < 1 || options.starts < 1) {
    throw bad_request("model",
                      fmt::format("subset threshold {}, {} samples, {} starts",
                                  options.subset_threshold, options.max_samples, options.starts),
                      "give 0 or more, 1 or more, 1 or more");
  }
}

}  // namespace

std::string_view name_of(VelocityKernel kernel) {
  switch (kernel) {
    case VelocityKernel::kSquaredExponential:
      return "se";
    case VelocityKernel::kPolynomial2:
      return "se+p2";
    case VelocityKernel::kSemiParametric:
      return "semi-parametric";
  }
  KINESCOPE_CHECK(false, "a kernel that is not known");
}

void check_model(const VelocityModel& model) {
  check_layout(model.layout);
  const Index columns = feature_count(model.layout) + model.layout.input_count();
  const Index linear = model.physics ? model.physics->count() : columns;
  const auto factors =
      static_cast<std::size_t>(model.kernel == VelocityKernel::kPolynomial2
                                   ? 2
                                   : (model.kernel == VelocityKernel::kSemiParametric ? 1 : 0));
  bool fits = static_cast<Index>(model.processes.size()) == model.layout.position_count();
  fits = fits && (model.kernel == VelocityKernel::kSemiParametric) == (model.physics != nullptr);
  for (const VelocityProcess& p : model.processes) {
    const KernelValues& k = p.kernel;
    fits = fits && p.inputs.cols() == columns && p.inputs.rows() == p.targets.size() &&
           p.targets.size() > 0 && k.length_scales.size() == columns && k.factors.size() == factors;
    for (const LinearFactor& f : k.factors) {
      fits = fits && f.weights.size() == linear && f.weights.allFinite() && f.offset >= 0.0;
    }
    fits = fits && p.inputs.allFinite() && p.targets.allFinite() && k.length_scales.allFinite() &&
           (k.length_scales.array() > 0.0).all() && k.variance > 0.0 && k.noise_variance > 0.0 &&
           p.target_scale > 0.0;
  }
  if (fits) return;
  throw bad_request(
      "model",
      fmt::format("its {} processes do not fit {} positions and kernel {}, or hold a "
                  "number that is not finite",
                  model.processes.size(), model.layout.position_count(), name_of(model.kernel)),
      "give a model of this system, or learn it again");
}

VelocityModel learn_model(const StateLayout& layout, const std::vector<Trial>& trials,
                          const ModelOptions& options, const VelocityModel* last) {
  check_model_options(options);
  const IncrementData data = increments_of(layout, trials);
  VelocityModel out{layout, options.kernel, {}, options.physics};
  for (Index p = 0; p < layout.position_count(); ++p) {
    const VelocityProcess* before = last != nullptr && last->kernel == options.kernel
                                        ? &last->processes[static_cast<std::size_t>(p)]
                                        : nullptr;
    out.processes.push_back(learn_process(data.inputs, data.increments.col(p), options, before));
  }
  return out;
}

}  // namespace kinescope::policy
