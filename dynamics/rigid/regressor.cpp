// SPDX-License-Identifier: Apache-2.0
#include "dynamics/rigid/regressor.h"

#include <cassert>

#include "dynamics/rigid/body_motions.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using rigid::BodyMotion;
using rigid::BodyMotions;

/// A joint's unit motion seen from a body that it carries, about the body's origin.
struct CarriedAxis {
  Eigen::Vector3d angular;
  Eigen::Vector3d linear;
};

using Row10 = Eigen::Matrix<double, 1, 10>;

/// The virtual power of the body's inertial wrench on the joint's motion (w, v), ordered by
/// parameter: w.n + v.f with f = m a + alpha x h + omega x (omega x h), n = I alpha + omega x I
/// omega + h x a.
Row10 power_coefficients(const CarriedAxis& axis, const BodyMotion& body) {
  const Eigen::Vector3d& w = axis.angular;
  const Eigen::Vector3d& v = axis.linear;
  const Eigen::Vector3d& o = body.omega;
  const Eigen::Vector3d& al = body.alpha;
  const Eigen::Vector3d u = w.cross(o);
  const Eigen::Vector3d h =
      v.cross(al) + o.dot(v) * o - o.squaredNorm() * v + body.acceleration.cross(w);
  Row10 row;
  row << v.dot(body.acceleration), h.x(), h.y(), h.z(), w.x() * al.x() + u.x() * o.x(),
      w.x() * al.y() + w.y() * al.x() + u.x() * o.y() + u.y() * o.x(),
      w.x() * al.z() + w.z() * al.x() + u.x() * o.z() + u.z() * o.x(),
      w.y() * al.y() + u.y() * o.y(),
      w.y() * al.z() + w.z() * al.y() + u.y() * o.z() + u.z() * o.y(),
      w.z() * al.z() + u.z() * o.z();
  return row;
}

/// Fills regressors sample by sample.
class RegressorRecursion {
 public:
  explicit RegressorRecursion(const RigidModel& model)
      : motions_(model), axes_(model.bodies.size() * model.bodies.size()) {}

  /// `put(joint, body, row)` gets the ten coefficients of each joint for each body that it carries.
  template <typename In, typename Put>
  void fill(const In& q, const In& dq, const In& ddq, Put&& put) {
    motions_.move(q, dq, ddq);
    for (std::size_t k = 0; k < motions_.size(); ++k) {
      const int parent = motions_.parent(k);
      for (int j = parent; j >= 0; j = motions_.parent(static_cast<std::size_t>(j))) {
        const CarriedAxis& below = axis(static_cast<std::size_t>(parent), j);
        CarriedAxis& here = axis(k, j);
        const BodyMotion& motion = motions_[k];
        here.angular.noalias() = motion.R_parent_body.transpose() * below.angular;
        here.linear.noalias() = motion.R_parent_body.transpose() *
                                (below.linear + below.angular.cross(motion.p_parent_body));
        put(j, k, power_coefficients(here, motion));
      }
      CarriedAxis& own = axis(k, static_cast<int>(k));
      own.angular = motions_.turns(k) ? motions_.axis(k) : Eigen::Vector3d::Zero();
      own.linear = motions_.turns(k) ? Eigen::Vector3d::Zero() : motions_.axis(k);
      put(static_cast<int>(k), k, power_coefficients(own, motions_[k]));
    }
  }

 private:
  CarriedAxis& axis(std::size_t body, int joint) {
    return axes_[body * motions_.size() + static_cast<std::size_t>(joint)];
  }

  BodyMotions motions_;
  std::vector<CarriedAxis> axes_;  ///< bodies x joints
};

void check_sizes(const RigidModel& model, const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                 const Eigen::MatrixXd& ddq) {
  KINESCOPE_CHECK(q.cols() == model.size(), "one column a movable joint");
  KINESCOPE_CHECK(dq.rows() == q.rows() && dq.cols() == q.cols() && ddq.rows() == q.rows() &&
                      ddq.cols() == q.cols(),
                  "positions, rates and accelerations of the same samples");
}

}  // namespace

Eigen::MatrixXd regressor(const RigidModel& model, const Eigen::VectorXd& q,
                          const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  check_sizes(model, q.transpose(), dq.transpose(), ddq.transpose());
  return SampleRegressor(model).at(q, dq, ddq);
}

// Entries of joints that do not carry a body are never written and stay zero.
struct SampleRegressor::State {
  RegressorRecursion recursion;
  Eigen::MatrixXd Y;
};

SampleRegressor::SampleRegressor(const RigidModel& model)
    : state_(std::make_unique<State>(State{
          RegressorRecursion(model), Eigen::MatrixXd::Zero(model.size(), 10 * model.size())})) {}
SampleRegressor::~SampleRegressor() = default;
SampleRegressor::SampleRegressor(SampleRegressor&&) noexcept = default;
SampleRegressor& SampleRegressor::operator=(SampleRegressor&&) noexcept = default;

const Eigen::MatrixXd& SampleRegressor::at(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                           const Eigen::VectorXd& ddq) {
  Eigen::MatrixXd& Y = state_->Y;
  assert(q.size() == Y.rows() && dq.size() == Y.rows() && ddq.size() == Y.rows());
  state_->recursion.fill(q, dq, ddq, [&Y](int joint, std::size_t body, const Row10& row) {
    Y.block<1, 10>(joint, 10 * static_cast<Eigen::Index>(body)) = row;
  });
  return Y;
}

Eigen::MatrixXd link_regressor(const RigidModel& model, const Eigen::VectorXd& q,
                               const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
  return regressor(model, q, dq, ddq) * bodies_from_links(model);
}

std::vector<Eigen::MatrixXd> regressors_of_samples(const RigidModel& model,
                                                   const Eigen::MatrixXd& q,
                                                   const Eigen::MatrixXd& dq,
                                                   const Eigen::MatrixXd& ddq) {
  check_sizes(model, q, dq, ddq);
  const auto n = static_cast<std::size_t>(model.size());
  std::vector<Eigen::MatrixXd> out(n, Eigen::MatrixXd::Zero(q.rows(), 10 * model.size()));
  RegressorRecursion recursion(model);
  for (Eigen::Index t = 0; t < q.rows(); ++t) {
    recursion.fill(q.row(t), dq.row(t), ddq.row(t),
                   [&](int joint, std::size_t body, const Row10& row) {
                     out[static_cast<std::size_t>(joint)].block<1, 10>(
                         t, 10 * static_cast<Eigen::Index>(body)) = row;
                   });
  }
  return out;
}

}  // namespace kinescope
