// SPDX-License-Identifier: Apache-2.0
//
// Takes   trials of a system.
// Gives   VelocityModel: one Gaussian process for each speed's increment over a step; positions
//         follow by integration, p' = p + step dp + step / 2 * increment (Amadio et al., T-RO
//         2022).
// Units   SI; inputs of the processes are state_features() and the inputs u.
// Method  exact regression on a subset of the samples (greedy by posterior variance),
//         hyperparameters by the marginal likelihood (dynamics/gp).
// Not here: prediction for particles (velocity_posterior.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/policy/state_features.h"

namespace kinescope::policy {

enum class VelocityKernel {
  kSquaredExponential,  ///< length scales of their own for every column
  kPolynomial2,         ///< the same + a multiplicative polynomial of degree 2
  kSemiParametric,      ///< the same + a linear kernel of features of physics
};
/// "se", "se+p2", "semi-parametric".
[[nodiscard]] std::string_view name_of(VelocityKernel kernel);

/// Features of physics in which a speed's increment is nearly linear.
class PhysicsFeatures {
 public:
  virtual ~PhysicsFeatures() = default;
  [[nodiscard]] virtual Eigen::Index count() const = 0;
  /// values (rows x count) of model inputs (rows x D). Every row alike and alone.
  virtual void evaluate(const ConstBlock& inputs, Block values) const = 0;
  /// d_inputs += the pullback of d_values.
  virtual void pullback(const ConstBlock& inputs, const ConstBlock& d_values,
                        Block d_inputs) const = 0;

 protected:
  PhysicsFeatures() = default;
  PhysicsFeatures(const PhysicsFeatures&) = default;
  PhysicsFeatures& operator=(const PhysicsFeatures&) = default;
};

/// o + sum_d w_d x_d y_d.
struct LinearFactor {
  double offset = 1.0;
  Eigen::VectorXd weights;
};

/// k(x, y) = variance exp(-1/2 sum_d ((x_d - y_d) / l_d)^2) + product of the factors (none: 0). The
/// factors are of x itself, or of physics(x) where there are any. Of targets over `target_scale`.
struct KernelValues {
  double variance = 1.0;
  Eigen::VectorXd length_scales;      ///< D
  std::vector<LinearFactor> factors;  ///< P2: two of D weights; semi-parametric: one
  double noise_variance = 1e-2;
};

/// One speed's increment. A plain value: these numbers are all that a file needs to hold.
struct VelocityProcess {
  KernelValues kernel;
  double target_scale = 1.0;  ///< (m/s or rad/s): increments are over it
  Eigen::MatrixXd inputs;     ///< N x D, the samples that were kept
  Eigen::VectorXd targets;    ///< N, over target_scale
  /// How the hyperparameters were found.
  double log_likelihood = 0.0;
  Eigen::Index samples = 0;  ///< there were before the subset
  double jitter = 0.0;       ///< added to the kernel matrix' diagonal; 0 as a rule
};

struct VelocityModel {
  StateLayout layout;
  VelocityKernel kernel = VelocityKernel::kSquaredExponential;
  std::vector<VelocityProcess> processes;  ///< one a position, in their order
  /// Of kSemiParametric, else null. Not in a file: the system knows it.
  std::shared_ptr<const PhysicsFeatures> physics;
};

/// Throws bad_request where sizes contradict each other or a number is not finite or, where it must
/// be, not above zero.
void check_model(const VelocityModel& model);

struct ModelOptions {
  VelocityKernel kernel = VelocityKernel::kSquaredExponential;
  std::shared_ptr<const PhysicsFeatures> physics;  ///< of kSemiParametric
  /// A sample is kept while its posterior standard deviation, given the ones that were kept, is
  /// above this times the noise's; 0 keeps all.
  double subset_threshold = 0.5;
  Eigen::Index max_samples = 300;  ///< of one process
  int starts = 3;                  ///< of the search of hyperparameters
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: all of the machine. Never changes a result
};

/// From the smoothed signals of all trials. `last`: hyperparameters of the trial before, one of the
/// starts; null: none. Throws undetermined where there are too few samples or a speed never
/// changes, bad_request for trials that do not fit the layout or are not finite.
[[nodiscard]] VelocityModel learn_model(const StateLayout& layout, const std::vector<Trial>& trials,
                                        const ModelOptions& options,
                                        const VelocityModel* last = nullptr);

}  // namespace kinescope::policy
