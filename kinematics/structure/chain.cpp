// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/chain.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "kinematics/structure/residual_scale.h"
#include "kinematics/structure/series.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

constexpr int kMaxParameters = 160;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, kMaxParameters>;

int geometry_size(JointType type) { return type == JointType::kRevolute ? 4 : 2; }

int joint_size(const ChainJoint& joint) {
  return geometry_size(joint.type) + static_cast<int>(joint.terms.size());
}

int parameter_count(const ChainModel& model) {
  int count = 6;
  for (const ChainJoint& joint : model.joints) count += joint_size(joint);
  return count;
}

bool is_free(const ChainModel& model) {
  return model.joints.size() == 1 && model.joints.front().terms.empty();
}

Pose motion_of(JointType type, double value) {
  if (type == JointType::kPrismatic) {
    return {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, value)};
  }
  return {Eigen::Quaterniond(std::cos(0.5 * value), 0.0, 0.0, std::sin(0.5 * value)),
          Eigen::Vector3d::Zero()};
}

// Ad(T^-1) v.
Vector6d seen_from(const Pose& T, const Eigen::Vector3d& rotation,
                   const Eigen::Vector3d& translation) {
  const Eigen::Quaterniond inverse = T.rotation.conjugate();
  Vector6d out;
  out << inverse * rotation, inverse * (translation - T.translation.cross(rotation));
  return out;
}

// Constants of the model that do not change from sample to sample.
struct Prepared {
  std::vector<Pose> links;  // F_1, F_1^-1 F_2, .., F_m^-1 M
};

Prepared prepare(const ChainModel& model) {
  Prepared p;
  Pose inverse;
  for (const ChainJoint& joint : model.joints) {
    p.links.push_back(inverse * joint.frame);
    inverse = joint.frame.inverse();
  }
  p.links.push_back(inverse * model.mount);
  return p;
}

double coordinate_of(const ChainModel& model, std::size_t k, std::size_t sample, int instant,
                     const Eigen::MatrixXd& readings) {
  if (is_free(model)) return model.coordinates[sample];
  return chain_coordinate(model.joints[k], readings, instant);
}

// Residual of the better branch, whitened, and that branch's penalty.
struct SampleResidual {
  Vector6d white;
  double penalty = 0.0;
};

SampleResidual residual_of(const MotionSample& sample, const Pose& predicted_inverse) {
  SampleResidual r{sample.whitening * fast_log(predicted_inverse * sample.pose), 0.0};
  if (!sample.alternative) return r;
  const Vector6d other = sample.whitening * fast_log(predicted_inverse * *sample.alternative);
  if (other.squaredNorm() + sample.alternative_cost < r.white.squaredNorm()) {
    r.white = other;
    r.penalty = std::max(0.0, sample.alternative_cost);
  }
  return r;
}

// Columns of d(right perturbation of the pose) / d(parameters): joints in order (tilts, shifts,
// scales), mount. `to_child[k]` is the moved frame of joint k seen to the child. Returns the axis
// of the last joint.
Vector6d fill_jacobian(const ChainModel& model, const std::vector<Pose>& to_child,
                       const std::vector<double>& values, const Eigen::MatrixXd& readings,
                       int instant, Jacobian& J) {
  Eigen::Index column = 0;
  Vector6d axis = Vector6d::Zero();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < model.joints.size(); ++k) {
    const ChainJoint& joint = model.joints[k];
    const Pose& S = to_child[k];
    const double v = values[k];
    if (joint.type == JointType::kRevolute) {
      // (Rot(-v) - 1) e_x and e_y, once as tilt and once as shift.
      const Eigen::Vector3d ex(std::cos(v) - 1.0, -std::sin(v), 0.0);
      const Eigen::Vector3d ey(std::sin(v), std::cos(v) - 1.0, 0.0);
      J.col(column) = seen_from(S, ex, zero);
      J.col(column + 1) = seen_from(S, ey, zero);
      J.col(column + 2) = seen_from(S, zero, ex);
      J.col(column + 3) = seen_from(S, zero, ey);
      axis = seen_from(S, Eigen::Vector3d::UnitZ(), zero);
    } else {
      J.col(column) = seen_from(S, zero, Eigen::Vector3d(0.0, -v, 0.0));
      J.col(column + 1) = seen_from(S, zero, Eigen::Vector3d(v, 0.0, 0.0));
      axis = seen_from(S, zero, Eigen::Vector3d::UnitZ());
    }
    column += geometry_size(joint.type);
    for (const ChainTerm& term : joint.terms)
      J.col(column++) = readings(instant, term.channel) * axis;
  }
  J.rightCols<6>().setIdentity();
  return axis;
}

struct Normal {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  std::vector<Vector6d> white;  // residuals
  std::vector<double> lever;    // length of the whitened axis, one a sample (single joint)
  std::vector<Eigen::Matrix<double, 6, 1>> along;  // unit whitened axis
};

struct Workspace {
  std::vector<Pose> to_child;
  std::vector<double> values;
};

// Linearises every sample; weights are applied by the caller through `accumulate`.
template <typename Accumulate>
void for_each_sample(const Motion& motion, const ChainModel& model, const Eigen::MatrixXd& readings,
                     Accumulate&& accumulate) {
  const Prepared p = prepare(model);
  const std::size_t joints = model.joints.size();
  Workspace w{std::vector<Pose>(joints), std::vector<double>(joints)};
  for (std::size_t i = 0; i < motion.size(); ++i) {
    Pose tail = p.links[joints];
    for (std::size_t k = joints; k-- > 0;) {
      w.to_child[k] = tail;
      w.values[k] = coordinate_of(model, k, i, motion[i].instant, readings);
      tail = p.links[k] * (motion_of(model.joints[k].type, w.values[k]) * tail);
    }
    accumulate(i, tail, w);
  }
}

Normal linearise(const Motion& motion, const ChainModel& model, const Eigen::MatrixXd& readings,
                 double axis_weight, const std::vector<double>& weights) {
  const int size = parameter_count(model);
  Normal n;
  n.H = Eigen::MatrixXd::Zero(size, size);
  n.g = Eigen::VectorXd::Zero(size);
  Jacobian J(6, size);
  Jacobian WJ(6, size);
  const double keep = 1.0 - std::sqrt(axis_weight);
  for_each_sample(motion, model, readings,
                  [&](std::size_t i, const Pose& predicted, const Workspace& w) {
                    if (weights[i] <= 0.0) return;
                    const SampleResidual r = residual_of(motion[i], predicted.inverse());
                    const Vector6d axis =
                        fill_jacobian(model, w.to_child, w.values, readings, motion[i].instant, J);
                    WJ.noalias() = motion[i].whitening.triangularView<Eigen::Upper>() * J;
                    Vector6d white = r.white;
                    if (model.joints.size() == 1 && axis_weight < 1.0) {
                      const Vector6d u = (motion[i].whitening * axis).normalized();
                      white -= keep * u.dot(white) * u;
                      const Eigen::RowVectorXd along = u.transpose() * WJ;
                      WJ.noalias() -= (keep * u) * along;
                    }
                    n.H.selfadjointView<Eigen::Lower>().rankUpdate(WJ.transpose(), weights[i]);
                    n.g.noalias() += weights[i] * (WJ.transpose() * white);
                  });
  n.H.triangularView<Eigen::StrictlyUpper>() = n.H.transpose();
  return n;
}

struct Evaluation {
  ResidualParts parts;
  std::vector<Vector6d> white;
  std::vector<Vector6d> plain;  // unwhitened, without the part along the joint
};

Evaluation evaluate(const Motion& motion, const ChainModel& model,
                    const Eigen::MatrixXd& readings) {
  Evaluation e;
  const bool split = model.joints.size() == 1;
  e.parts.split = split;
  e.parts.free_axis = is_free(model);
  for_each_sample(
      motion, model, readings, [&](std::size_t i, const Pose& predicted, const Workspace& w) {
        const SampleResidual r = residual_of(motion[i], predicted.inverse());
        e.white.push_back(r.white);
        double along = 0.0;
        if (split) {
          const JointType type = model.joints.front().type;
          const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
          const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
          const Vector6d axis = type == JointType::kRevolute ? seen_from(w.to_child[0], z, zero)
                                                             : seen_from(w.to_child[0], zero, z);
          const Vector6d white_axis = motion[i].whitening * axis;
          const double lever = white_axis.norm();
          along = white_axis.dot(r.white) / lever;
          e.parts.lever.push_back(lever);
        }
        e.parts.along.push_back(along);
        e.parts.across.push_back(std::max(0.0, r.white.squaredNorm() - along * along));
        e.parts.penalty.push_back(r.penalty);
      });
  return e;
}

void apply_step(ChainModel& model, const Eigen::VectorXd& step) {
  Eigen::Index column = 0;
  for (ChainJoint& joint : model.joints) {
    Vector6d d = Vector6d::Zero();
    d.head<2>() = step.segment<2>(column);
    if (joint.type == JointType::kRevolute) d.segment<2>(3) = step.segment<2>(column + 2);
    joint.frame = joint.frame * exp_pose(d);
    column += geometry_size(joint.type);
    for (ChainTerm& term : joint.terms) term.scale += step(column++);
  }
  model.mount = model.mount * exp_pose(step.segment<6>(column));
}

// Moves every free coordinate to where its sighting wants it (one Gauss-Newton step).
void update_coordinates(ChainModel& model, const Evaluation& e) {
  double mean = 0.0;
  for (std::size_t i = 0; i < model.coordinates.size(); ++i) {
    const double step = e.parts.along[i] / e.parts.lever[i];
    const double limit = model.joints.front().type == JointType::kRevolute ? 0.7 : 1e3;
    model.coordinates[i] += std::clamp(step, -limit, limit);
    mean += model.coordinates[i];
  }
  static_cast<void>(mean);
}

Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& H, double variance) {
  const Eigen::MatrixXd damped =
      H + 1e-9 * Eigen::MatrixXd(H.diagonal().cwiseMax(1e-12).asDiagonal());
  return variance * damped.ldlt().solve(Eigen::MatrixXd::Identity(H.rows(), H.cols()));
}

std::vector<double> scale_sigmas(const ChainModel& model, const Eigen::MatrixXd& covariance) {
  std::vector<double> sigma;
  Eigen::Index column = 0;
  for (const ChainJoint& joint : model.joints) {
    column += geometry_size(joint.type);
    for (std::size_t t = 0; t < joint.terms.size(); ++t, ++column) {
      sigma.push_back(std::sqrt(std::max(0.0, covariance(column, column))));
    }
  }
  return sigma;
}

void describe(const Motion& motion, const Evaluation& e, const ResidualScale& scale,
              ChainFit& fit) {
  std::vector<double> rotation;
  std::vector<double> translation;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    const Vector6d plain = motion[i].whitening.triangularView<Eigen::Upper>().solve(e.white[i]);
    rotation.push_back(plain.head<3>().squaredNorm());
    translation.push_back(plain.tail<3>().squaredNorm());
  }
  // The median of three squared normals of variance 1 is 2.366.
  fit.rotation_rms = std::sqrt(3.0 * median_of(std::move(rotation)) / 2.366);
  fit.translation_rms = std::sqrt(3.0 * median_of(std::move(translation)) / 2.366);
  fit.variance = scale.across;
  fit.raw_variance = scale.raw_across;
  fit.axis_variance = scale.along;
  fit.cost = scale.cost;
  fit.correlation = integrated_autocorrelation(e.white);
}

}  // namespace

double chain_coordinate(const ChainJoint& joint, const Eigen::MatrixXd& readings, int instant) {
  double value = 0.0;
  for (const ChainTerm& term : joint.terms) value += term.scale * readings(instant, term.channel);
  return value;
}

Pose chain_pose_at(const ChainModel& model, const std::vector<double>& coordinates) {
  const Prepared p = prepare(model);
  Pose out = p.links.front();
  for (std::size_t k = 0; k < model.joints.size(); ++k) {
    out = out * motion_of(model.joints[k].type, coordinates[k]) * p.links[k + 1];
  }
  return out;
}

Pose chain_pose(const ChainModel& model, const Eigen::MatrixXd& readings, int instant) {
  std::vector<double> coordinates;
  for (const ChainJoint& joint : model.joints) {
    coordinates.push_back(chain_coordinate(joint, readings, instant));
  }
  return chain_pose_at(model, coordinates);
}

Eigen::MatrixXd chain_jacobian(const ChainModel& model, const std::vector<double>& coordinates,
                               const Eigen::MatrixXd& readings, int instant) {
  const Prepared p = prepare(model);
  const std::size_t joints = model.joints.size();
  std::vector<Pose> to_child(joints);
  Pose tail = p.links[joints];
  for (std::size_t k = joints; k-- > 0;) {
    to_child[k] = tail;
    tail = p.links[k] * (motion_of(model.joints[k].type, coordinates[k]) * tail);
  }
  Jacobian J(6, parameter_count(model));
  static_cast<void>(fill_jacobian(model, to_child, coordinates, readings, instant, J));
  return J;
}

Vector6d axis_in_child(const ChainModel& model, double coordinate) {
  static_cast<void>(coordinate);  // the joint's own motion leaves its axis where it is in the child
  const ChainJoint& joint = model.joints.back();
  const Pose to_child = joint.frame.inverse() * model.mount;
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  return joint.type == JointType::kRevolute ? seen_from(to_child, z, zero)
                                            : seen_from(to_child, zero, z);
}

ChainFit fit_chain(const Motion& motion, const Eigen::MatrixXd& readings, ChainModel start,
                   const ChainFitOptions& options) {
  ChainFit fit;
  fit.samples = static_cast<int>(motion.size());
  fit.parameters = parameter_count(start);
  const bool free = is_free(start);
  const double axis_weight = free ? 0.0 : options.axis_weight;
  ChainModel model = std::move(start);
  Evaluation e = evaluate(motion, model, readings);
  ResidualScale scale = residual_scale(e.parts, options.outlier_cost);
  double damping = model.joints.size() > 1 ? 1e-3 : 1e-7;
  Normal normal;
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    normal = linearise(motion, model, readings, axis_weight, robust_weights(e.parts, scale));
    ChainModel next = model;
    Eigen::MatrixXd damped = normal.H;
    damped.diagonal() += damping * normal.H.diagonal().cwiseMax(1e-6);
    const Eigen::VectorXd step = damped.ldlt().solve(normal.g);
    if (!step.allFinite()) break;
    apply_step(next, step);
    if (free) update_coordinates(next, evaluate(motion, next, readings));
    Evaluation e_next = evaluate(motion, next, readings);
    const ResidualScale scale_next = residual_scale(e_next.parts, options.outlier_cost);
    const double gain = scale.cost - scale_next.cost;
    if (gain > 0.0) {
      model = std::move(next);
      e = std::move(e_next);
      scale = scale_next;
      damping = std::max(damping * 0.1, 1e-9);
      if (gain < 0.05 + 1e-4 * std::abs(scale.cost)) break;
    } else {
      if (gain > -1e-3 && damping < 1e-2) break;
      damping *= 30.0;
      if (damping > 1e3) break;
    }
  }
  if (normal.H.size() == 0) {
    normal = linearise(motion, model, readings, axis_weight, robust_weights(e.parts, scale));
  }
  fit.covariance = covariance_of(normal.H, std::max(scale.across, scale.along));
  fit.scale_sigma = scale_sigmas(model, fit.covariance);
  fit.model = std::move(model);
  describe(motion, e, scale, fit);
  if (options.with_residuals) fit.residuals = std::move(e.white);
  return fit;
}

}  // namespace kinescope::structure_search
