// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/compensation.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/models/torque_predictor.h"
#include "kinematics/core/error.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

void require_joints_of(const RigidModel& learned, const RigidModel& nominal) {
  const bool same =
      std::ranges::equal(learned.bodies, nominal.bodies, {}, &RigidBody::joint, &RigidBody::joint);
  if (same) return;
  throw bad_request("controller", "the learned torque model is of another robot's joints",
                    "give the model that was learned with this robot");
}

void check(const KnownRobot& robot) {
  if (!robot.learned) return;
  const LearnedTorque& learned = *robot.learned;
  KINESCOPE_CHECK(learned.model || learned.traced, "a model, effects, or both");
  if (learned.model) {
    require_joints_of(learned.model->rigid, robot.nominal);
    if (learned.model->torque_unit == "A") {
      throw bad_request("controller", "the learned model predicts currents, not torques",
                        "learn it from torques: state the gain of the drives (--torque-factor)");
    }
  }
  if (learned.traced) require_joints_of(learned.traced->base.rigid, robot.nominal);
}

/// (q, dq, ddq) at random within the motion that was learned; always the same.
Eigen::MatrixXd within(const MotionSpan& learned, Eigen::Index joints) {
  constexpr Eigen::Index kMotions = 200;  // the rms to a twentieth
  Rng rng = Rng::from_name("nominal errors");
  Eigen::MatrixXd out(kMotions, 3 * joints);
  for (Eigen::Index i = 0; i < kMotions; ++i) {
    for (Eigen::Index j = 0; j < joints; ++j) {
      out(i, j) = rng.uniform(learned.lower[j], learned.upper[j]);
      out(i, joints + j) = rng.uniform(-learned.fastest[j], learned.fastest[j]);
      out(i, 2 * joints + j) = rng.uniform(-learned.hardest[j], learned.hardest[j]);
    }
  }
  return out;
}

}  // namespace

struct Compensation::State {
  rigid::NewtonEuler nominal;
  std::optional<rigid::NewtonEuler> payload;
  std::optional<OnlineTorque> traced;
  std::unique_ptr<TorquePredictor> predictor;
  Eigen::VectorXd nominal_error;
  Eigen::VectorXd torque, load, weight;
  MotionPoint still;

  explicit State(const KnownRobot& robot) : nominal(robot.nominal) {
    check(robot);
    torque = load = weight = Eigen::VectorXd::Zero(robot.nominal.size());
    still = {0.0, torque, torque, torque};
    if (robot.payload) payload.emplace(payload_alone(robot.nominal, *robot.payload));
    if (!robot.learned) return;
    const LearnedTorque& learned = *robot.learned;
    if (learned.traced) traced.emplace(make_plant(*learned.traced));
    if (!learned.model) return;
    predictor = std::make_unique<TorquePredictor>(*learned.model);
    nominal_error = nominal_errors(*learned.model, robot.nominal);
  }

  /// Of the model at the motion of its last mean.
  void weigh() {
    if (!predictor) {
      weight.setOnes();
      return;
    }
    (void)predictor->sigma();
    for (Eigen::Index j = 0; j < weight.size(); ++j) {
      weight[j] = weight_of_doubt(predictor->model_sigma()[j], nominal_error[j]);
    }
  }

  void blend(const Eigen::VectorXd& learned) {
    weigh();
    for (Eigen::Index j = 0; j < weight.size(); ++j) {
      if (!std::isfinite(learned[j])) weight[j] = 0.0;
      if (weight[j] > 0.0) torque[j] += weight[j] * (learned[j] - torque[j]);
    }
  }

  /// `of_traced`: torque of the effects' model at this motion; null: there is none.
  const Eigen::VectorXd& total(const MotionPoint& motion, const Eigen::VectorXd* of_traced) {
    nominal.torque(motion.q, motion.dq, motion.ddq, torque);
    const Eigen::VectorXd* learned = of_traced;
    if (predictor) {
      const Eigen::VectorXd& mean = predictor->mean(motion.q, motion.dq, motion.ddq);
      if (learned == nullptr) learned = &mean;
    }
    if (learned != nullptr) blend(*learned);
    if (payload) {
      payload->torque(motion.q, motion.dq, motion.ddq, load);
      torque += load;
    }
    return torque;
  }
};

Compensation::Compensation(const KnownRobot& robot) : state_(std::make_unique<State>(robot)) {}
Compensation::~Compensation() = default;
Compensation::Compensation(Compensation&&) noexcept = default;
Compensation& Compensation::operator=(Compensation&&) noexcept = default;

const Eigen::VectorXd& Compensation::at(const MotionPoint& motion) {
  return state_->total(motion, state_->traced ? &state_->traced->at(motion) : nullptr);
}

const Eigen::VectorXd& Compensation::at_rest(const Eigen::VectorXd& q, double t_s) {
  State& own = *state_;
  own.still.t_s = t_s;
  own.still.q = q;
  return own.total(own.still, own.traced ? &own.traced->at_rest(q, t_s) : nullptr);
}

const Eigen::VectorXd& Compensation::weight() const { return state_->weight; }

double weight_of_doubt(double doubt, double nominal_error) {
  if (!std::isfinite(doubt)) return 0.0;
  if (doubt == 0.0) return 1.0;
  const double ratio = nominal_error / doubt;
  return ratio * ratio / (1.0 + ratio * ratio);
}

Eigen::VectorXd nominal_errors(const SavedTorqueModel& model, const RigidModel& nominal) {
  const Eigen::MatrixXd motions =
      model.processes.empty() ? within(model.learned, nominal.size()) : model.motions;
  TorquePredictor predictor(model);
  rigid::NewtonEuler newton_euler(nominal);
  const Eigen::Index n = nominal.size();
  Eigen::VectorXd torque(n);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd count = squares;
  for (Eigen::Index i = 0; i < motions.rows(); ++i) {
    const Eigen::VectorXd motion = motions.row(i);
    const Eigen::VectorXd mean =
        predictor.mean(motion.head(n), motion.segment(n, n), motion.tail(n));
    (void)predictor.sigma();
    newton_euler.torque(motion.head(n), motion.segment(n, n), motion.tail(n), torque);
    for (Eigen::Index j = 0; j < n; ++j) {
      if (!std::isfinite(predictor.model_sigma()[j])) continue;
      squares[j] += (mean[j] - torque[j]) * (mean[j] - torque[j]);
      count[j] += 1.0;
    }
  }
  return squares.cwiseQuotient(count.cwiseMax(1.0)).cwiseSqrt();
}

std::size_t last_body(const RigidModel& rigid) {
  std::size_t out = 0;
  std::size_t longest = 0;
  std::vector<std::size_t> depth(rigid.bodies.size(), 1);
  for (std::size_t k = 0; k < rigid.bodies.size(); ++k) {
    const int parent = rigid.bodies[k].parent;
    if (parent >= 0) depth[k] += depth[static_cast<std::size_t>(parent)];
    if (depth[k] < longest) continue;
    longest = depth[k];
    out = k;
  }
  return out;
}

RigidModel payload_alone(const RigidModel& rigid, const InertialParameters& payload) {
  RigidModel out = rigid;
  for (RigidBody& body : out.bodies) {
    body.inertia = {};
    body.motor_inertia = 0.0;
  }
  out.bodies[last_body(rigid)].inertia = payload;
  return out;
}

}  // namespace kinescope
