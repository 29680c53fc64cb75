// SPDX-License-Identifier: Apache-2.0
//
// Takes   a fit (torque_model.h) as numbers: SavedTorqueModel, a plain value that files hold.
// Gives   TorquePredictor: mean and sigma of every joint's torque, one sample after another.
// Units   those of the samples learned from; vectors have one entry a joint.
// Method  base parameters times regressor (dynamics/rigid); processes by gp/compact.h. The value in
//         memory and the one read from a file give the same bits.
// Not here: files (app/io/torque_model_file.h), effects with a memory (dynamics/effects).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/gp/compact.h"
#include "dynamics/models/constant_joints.h"
#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

enum class TorqueModelKind;

/// Identified base and drive parameters.
struct SavedParametric {
  std::vector<int> terms;  ///< of torque_terms(): the columns they multiply
  Eigen::VectorXd parameters;
  Eigen::MatrixXd covariance;     ///< zero where a parameter is undetermined
  std::vector<int> undetermined;  ///< parameters of infinite variance
  Eigen::VectorXd acting;         ///< size of its column from which each of them acts
  Eigen::VectorXd gains;          ///< one a joint
  Eigen::VectorXd sigma;          ///< noise of each joint's torque
};

/// One joint's process.
struct SavedProcess {
  enum class Features {
    kNone,
    kFriction,  ///< rate and smoothed sign of the joint's own rate
    kTerms      ///< columns of the rigid body and the drives
  };
  gp::CompactGp gp;
  Features features = Features::kNone;
  std::vector<int> terms;  ///< of torque_terms()
};

/// The motion that was learned from, one entry a joint.
struct MotionSpan {
  Eigen::VectorXd lower;    ///< position
  Eigen::VectorXd upper;    ///< position
  Eigen::VectorXd fastest;  ///< |rate|
  Eigen::VectorXd hardest;  ///< |acceleration|
};
[[nodiscard]] MotionSpan span_of(const TorqueSamples& samples);

struct SavedTorqueModel {
  TorqueModelKind kind{};
  std::string robot;
  std::string torque_unit;  ///< "Nm" or "A"
  RigidModel rigid;
  DriveTerms drives;
  int samples = 0;                            ///< learned from
  std::optional<SavedParametric> parametric;  ///< alone, or what the processes add to
  Eigen::MatrixXd motions;                    ///< (q, dq, ddq) of the processes' points
  std::vector<SavedProcess> processes;        ///< one a joint, or none
  SigmaParts parts;                           ///< of sigma
  BandFactors bands;
  ConstantJoints constants;
  MotionSpan learned;
};

/// One sample after another, one predictor a thread; mean and sigma do not allocate.
class TorquePredictor {
 public:
  /// Throws bad_request for parts that do not fit each other.
  explicit TorquePredictor(const SavedTorqueModel& model);
  ~TorquePredictor();
  TorquePredictor(const TorquePredictor&) = delete;
  TorquePredictor& operator=(const TorquePredictor&) = delete;

  [[nodiscard]] const Eigen::VectorXd& mean(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                            const Eigen::VectorXd& ddq);
  /// Of a new measurement, at the sample of the last `mean`; bands are so many of them wide.
  [[nodiscard]] const Eigen::VectorXd& sigma();
  /// The part of it that is doubt about the function. After `sigma`.
  [[nodiscard]] const Eigen::VectorXd& model_sigma() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Samples x joints. `threads`: 0 all of the machine; never changes a result.
[[nodiscard]] TorquePrediction predict_torque(const SavedTorqueModel& model,
                                              const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                              const Eigen::MatrixXd& ddq, int threads = 0);

/// As numbers; sigma as identified.
[[nodiscard]] SavedParametric saved_parametric(const Identification& identification);

}  // namespace kinescope
