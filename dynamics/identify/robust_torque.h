// SPDX-License-Identifier: Apache-2.0
//
// Takes   a DynamicModel (kinematics; masses do not matter) and TorqueSamples.
// Gives   RobustTorque: every joint's torque as a function of the motion that bad samples do not
//         bend, three ways side by side; its friction, gravity and inertia parts.
// Units   those of the samples.
// Method  a Gaussian process a joint: features of rigid body and drive plus a squared exponential
//         of (q, dq, ddq). Bandwidths and noise by 10-fold cross-validation over trajectories.
//         Trimmed: wide bandwidth, worst tenth left out, refit (Dang's report on the Barrett arm).
//         Student's t instead of normal noise: no share to choose (gp/robust.h).
// Not here: marginal likelihood and other kernels (dynamics/models).
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "dynamics/data/torque_samples.h"
#include "dynamics/gp/gaussian_process.h"
#include "dynamics/identify/prediction.h"
#include "dynamics/identify/torque_terms.h"
#include "kinematics/model/dynamic_model.h"

namespace kinescope {

enum class RobustMethod {
  kPlain,    ///< normal noise, all samples
  kTrimmed,  ///< the worst tenth of a wide-bandwidth fit left out
  kStudent   ///< Student's t with 4 degrees of freedom
};
inline constexpr std::array<RobustMethod, 3> kRobustMethods = {
    RobustMethod::kPlain, RobustMethod::kTrimmed, RobustMethod::kStudent};
[[nodiscard]] std::string_view to_string(RobustMethod method);

struct RobustTorqueOptions {
  DriveTerms drives = {};
  int samples = 600;  ///< learned from, evenly chosen; cost grows with the cube
  int folds = 10;     ///< at most: whole trajectories, or blocks of a single one
  double trimmed_share = 0.1;
  double widen = 3.0;  ///< factor on the bandwidths of the first of the two trimmed fits
  int threads = 0;     ///< 0: all of the machine; never changes a result
};

/// What cross-validation chose for a joint.
struct RobustJoint {
  /// Length scale of q, dq, ddq beyond the rigid body, in standard deviations of each signal.
  Eigen::Vector3d bandwidth = Eigen::Vector3d::Zero();
  double beyond = 0.0;      ///< standard deviation of what the rigid body lacks, unit of the torque
  double noise = 0.0;       ///< standard deviation of a normal noise, unit of the torque
  double unseen_rms = 0.0;  ///< robust: 1.48 times the median size of the left-out errors
  double down_weighted = 0.0;  ///< share of samples with less than half their weight (Student)
};

struct RobustTorque {
  std::vector<RobustJoint> joints;
  int folds = 0;
  bool by_trajectory = false;
  TorqueSamples samples;     ///< those learned from
  std::vector<int> fold_of;  ///< of each
  /// One a joint: the trimmed ones hold nine tenths of the samples.
  std::array<std::vector<gp::FittedGp>, kRobustMethods.size()> fits;
  Eigen::MatrixXd weight;  ///< samples x joints, Student's: near 0 for what does not fit
  int threads = 0;

  [[nodiscard]] TorquePrediction predict(RobustMethod method, const Eigen::MatrixXd& q,
                                         const Eigen::MatrixXd& dq,
                                         const Eigen::MatrixXd& ddq) const;
};

/// Throws undetermined for too few samples for two folds. O(samples^3) a joint, about 40 times.
[[nodiscard]] RobustTorque learn_robust_torque(const DynamicModel& model,
                                               const TorqueSamples& samples,
                                               const RobustTorqueOptions& options = {});

/// Student's fit without one fold.
[[nodiscard]] std::vector<gp::FittedGp> without_fold(const RobustTorque& learned, int fold);

/// A learned torque at a log's motion, in three parts that add up to it.
struct TorqueSplit {
  Eigen::MatrixXd friction;  ///< odd in the velocity at zero acceleration: (F(q,dq) - F(q,-dq)) / 2
  Eigen::MatrixXd gravity;   ///< even, F_m: gravity, centrifugal, offsets
  Eigen::MatrixXd inertia;   ///< what the acceleration adds
};
[[nodiscard]] TorqueSplit split_torque(const std::vector<gp::FittedGp>& fits,
                                       const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                       const Eigen::MatrixXd& ddq, int threads = 0);

/// Mean of the friction part over one joint's velocity.
struct FrictionBin {
  double velocity = 0.0;  ///< mean of the bin's samples
  double friction = 0.0;
  double spread = 0.0;  ///< standard deviation within the bin: what else friction depends on
  int samples = 0;
};
/// Bins of equal width between the fastest motions either way; empty ones are left out.
[[nodiscard]] std::vector<FrictionBin> friction_profile(const Eigen::VectorXd& velocity,
                                                        const Eigen::VectorXd& friction,
                                                        int bins = 24);

}  // namespace kinescope
