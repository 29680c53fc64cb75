// SPDX-License-Identifier: Apache-2.0
//
// The torque is linear in the inertial parameters: torque = Y(q, dq, ddq) parameters (+ motor
// inertia * ddq). Y is also linear in gravity.
#pragma once

#include <memory>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// Y, joints x 10 bodies, for body_parameters(). Atkeson, An, Hollerbach 1986, eq. 7 to 11, with
/// the joint axes carried into each body's frame instead of wrenches to the joints. O(bodies x
/// depth).
[[nodiscard]] Eigen::MatrixXd regressor(const RigidModel& model, const Eigen::VectorXd& q,
                                        const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq);

/// regressor() of one sample after another, without allocation; one for each thread.
class SampleRegressor {
 public:
  explicit SampleRegressor(const RigidModel& model);
  ~SampleRegressor();
  SampleRegressor(SampleRegressor&&) noexcept;
  SampleRegressor& operator=(SampleRegressor&&) noexcept;

  /// Vectors of one entry a joint (asserted). Y is valid until the next call.
  [[nodiscard]] const Eigen::MatrixXd& at(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                          const Eigen::VectorXd& ddq);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Y, joints x 10 links, for the stacked parameters of all links of the tree, each in its own
/// frame.
[[nodiscard]] Eigen::MatrixXd link_regressor(const RigidModel& model, const Eigen::VectorXd& q,
                                             const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq);

/// A whole log at once: one matrix a joint, samples x 10 bodies. Row t of matrix j gives torque j
/// of sample t.
[[nodiscard]] std::vector<Eigen::MatrixXd> regressors_of_samples(const RigidModel& model,
                                                                 const Eigen::MatrixXd& q,
                                                                 const Eigen::MatrixXd& dq,
                                                                 const Eigen::MatrixXd& ddq);

}  // namespace kinescope
