// SPDX-License-Identifier: Apache-2.0
//
// Takes   samples of a robot's motion and torque, and its kinematics as somebody believes them.
// Gives   torques that the learners of the field predict for other motion.
// Method  exact Gaussian processes of single joints, all with the same search of their
//         hyperparameters, and the same through inducing points; least squares; the network that
//         papers compare with.
// Not here: bands, memory of the noise: dynamics/models, whose models are for use.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/gp/gaussian_process.h"
#include "dynamics/gp/hyperparameters.h"
#include "dynamics/models/torque_model.h"

namespace kinescope::experiments {

enum class Learner {
  kGip,             ///< geometrically inspired polynomial, and friction
  kRbf,             ///< squared exponential of (q, dq, ddq), one length scale each
  kNetwork,         ///< two layers of 400 sigmoids
  kSemiParametric,  ///< features of the believed model plus a squared exponential, zero mean
  kModelBased,      ///< features of the believed model alone
  kParametric,      ///< base parameters of the believed model by weighted least squares
  kLip,             ///< Lagrangian-inspired polynomial of all joints together, and no friction
  // The same kernels and hyperparameters through inducing points (dynamics/gp/sparse.h).
  kGipInducing,
  kRbfInducing,
  kSemiParametricInducing
};

/// "gip", "rbf", "network", "semi_parametric", "model_based", "parametric", "lip", "gip_inducing",
/// "rbf_inducing", "semi_parametric_inducing".
[[nodiscard]] std::string_view to_string(Learner learner);
/// Nothing for an unknown name.
[[nodiscard]] std::optional<Learner> learner_of(std::string_view name);
[[nodiscard]] std::vector<std::string_view> learner_names();
/// All but LIP, which takes minutes, and those of inducing points.
[[nodiscard]] const std::vector<Learner>& usual_learners();

struct SearchOptions {
  int starts = 3;
  int samples = 1000;  ///< of the training, evenly chosen, that the search sees
  std::uint64_t seed = 1;
};

/// The hyperparameters of largest marginal likelihood on part of the samples, then the process of
/// all of them. Ranges are as wide as a torque that is linear in one input asks for: there a
/// squared exponential has long scales and a large variance.
[[nodiscard]] gp::Estimate search(const gp::GpModel& start, const gp::Dataset& data,
                                  const SearchOptions& options, int threads);

struct LearnOptions {
  SearchOptions search;
  NeuralNetworkOptions network;
  int inducing = 500;  ///< points, of the learners that take them
  int threads = 0;     ///< 0: all of the machine; never changes a result
};

/// Throws bad_request where the kernel matrix that a learner keeps of `samples`, one joint at a
/// time, does not fit into memory; to be asked before the work begins. `like`: some samples of the
/// robot. `limit_bytes` 0: what the machine has available.
void require_memory(const std::vector<Learner>& learners, const DynamicModel& believed,
                    const TorqueSamples& like, Eigen::Index samples, std::size_t limit_bytes = 0);

/// Torques at the test's motion, samples x joints, in the unit of the training. Throws what the
/// learners throw where there are too few samples.
[[nodiscard]] Eigen::MatrixXd predict_by(Learner learner, const DynamicModel& believed,
                                         const TorqueSamples& train, const TorqueSamples& test,
                                         const LearnOptions& options);

}  // namespace kinescope::experiments
