// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics; masses as a prior where there are any) and TorqueSamples.
// Gives   FittedTorqueModel: predictive mean and sigma of every joint's torque, whatever the kind.
// Units   those of the samples; rows are samples, columns joints, as in dynamics/data.
// Method  parametric: dynamics/identify; Gaussian processes: dynamics/gp with the kernels of the
//         field, hyperparameters by marginal likelihood; bands: bands.h.
// Not here: filtering (dynamics/data), what a model lacks (dynamics/effects).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/identify/identify.h"
#include "dynamics/identify/prediction.h"
#include "dynamics/models/bands.h"
#include "dynamics/models/torque_predictor.h"
#include "kinematics/core/progress.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

enum class TorqueModelKind {
  kParametric,      ///< rigid body and drives, least squares (dynamics/identify)
  kRbf,             ///< squared exponential of (q, dq, ddq), one length each, each joint by itself
  kGip,             ///< geometrically inspired polynomial and friction, each joint by itself
  kModelBased,      ///< features of the parametric model, each joint by itself
  kSemiParametric,  ///< the parametric model, its features and a squared exponential for what it
                    ///< lacks, noise with a memory
  kLip,             ///< Lagrangian-inspired polynomial of all joints together, and friction
  kSupportVectors,  ///< epsilon-SVR with a Gaussian kernel, each joint by itself
  kNeuralNetwork    ///< two hidden layers of 400 sigmoids, all joints together
};

[[nodiscard]] std::string_view to_string(TorqueModelKind kind);
/// Nothing for an unknown name.
[[nodiscard]] std::optional<TorqueModelKind> torque_model_kind(std::string_view name);
[[nodiscard]] const std::vector<TorqueModelKind>& all_torque_models();
/// Parametric, GIP, semi-parametric: those that quick_options() learn within seconds.
[[nodiscard]] const std::vector<TorqueModelKind>& usual_torque_models();

struct NeuralNetworkOptions {
  int epochs = 600;             ///< at most; passes over the training samples
  int batch = 50;               ///< samples a step
  double learning_rate = 2e-3;  ///< of Adam, at the start
  double smallest_rate = 3e-5;  ///< the training ends below it
  double weight_decay = 3e-4;   ///< relative to the rate of learning
  int patience = 20;            ///< epochs without a better held-out error before the rate halves
};

struct TorqueModelOptions {
  IdentifyOptions identify;
  /// Training samples of a Gaussian process, evenly chosen; kernels of few features take all.
  int samples = 1500;
  /// > 0: Gaussian processes of single joints learn from all samples, through so many inducing
  /// points (dynamics/gp/sparse.h); for more samples than an exact one can hold.
  int inducing_points = 0;
  int inducing_samples = 0;          ///< at most so many of them, evenly chosen; 0: all
  int samples_of_all_joints = 400;   ///< the same for kLip, whose matrix is joints times as wide
  int hyperparameter_samples = 600;  ///< of them, for the search
  int starts = 3;
  /// The search ends where a step changes the likelihood by less than this share of it.
  double search_tolerance = 1e-5;
  NeuralNetworkOptions network;
  std::uint64_t seed = 1;
  int band_folds = 8;  ///< of the parametric model's bands; below 2: the normal distribution's
  /// The same for Gaussian processes, at most band_folds: each costs a search from the optimum of
  /// all samples.
  int process_band_folds = 5;
  int threads = 0;                     ///< 0: all of the machine; never changes a result
  std::size_t memory_limit_bytes = 0;  ///< of a kernel matrix; 0: what the machine has available
  /// FittedTorqueModel::saved is made; inducing points make it anyway.
  bool keep_saved = false;
};

/// For an answer within seconds: few inducing points, hyperparameters from few samples.
[[nodiscard]] TorqueModelOptions quick_options(TorqueModelOptions options = {});

struct FittedTorqueModel {
  TorqueModelKind kind = TorqueModelKind::kParametric;
  int samples = 0;  ///< learned from
  /// q, dq, ddq: samples x joints.
  std::function<TorquePrediction(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                 const Eigen::MatrixXd& ddq)>
      predict;
  BandFactors bands = {};  ///< calibrated for the parametric model and Gaussian processes
  /// `predict` before its sigma was calibrated; empty: it is not.
  std::function<TorquePrediction(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                 const Eigen::MatrixXd& ddq)>
      claim = {};
  SigmaParts parts = {};  ///< that make `predict` of `claim`
  /// Joints at which a semi-parametric model is the parametric one up to a constant: what it
  /// learned beside that predicted motion left out worse.
  std::vector<int> plainer_joints = {};
  /// Joints at which it is a constant: it predicted motion left out of the fit worse.
  std::vector<int> constant_joints = {};
  /// nMSE on motion left out of the fit, one a joint, NaN where the torque does not vary: what
  /// models are chosen by. Empty: too short a log, or not asked for.
  Eigen::VectorXd left_out_nmse_percent = {};
  int inducing_points = 0;  ///< most of any joint; 0: none
  /// The same as numbers, for files and controllers; null: not made, or of a kind that has none.
  std::shared_ptr<const SavedTorqueModel> saved = {};
};

/// Throws bad_request where a Gaussian process of these kinds would not fit into memory, with what
/// would: to be asked before any work.
void check_torque_memory(const std::vector<TorqueModelKind>& kinds, Eigen::Index samples,
                         Eigen::Index joints, const TorqueModelOptions& options);

/// Throws what check_torque_memory, identification and fit throw.
[[nodiscard]] FittedTorqueModel fit_torque_model(TorqueModelKind kind, const DynamicModel& model,
                                                 const TorqueSamples& samples,
                                                 const TorqueModelOptions& options = {},
                                                 const Progress& progress = {});

/// The parametric model of an identification of these samples that is already there.
[[nodiscard]] FittedTorqueModel parametric_model(const Identification& found,
                                                 const DynamicModel& model,
                                                 const TorqueSamples& samples,
                                                 const TorqueModelOptions& options = {});

/// `count` rows at most, evenly spread over the samples.
[[nodiscard]] std::vector<Eigen::Index> evenly_chosen(Eigen::Index samples, int count);

}  // namespace kinescope
