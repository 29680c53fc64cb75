// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/torque_terms.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/data/rough_torque.h"
#include "dynamics/rigid/base_parameters.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

void check_drives(const RigidModel& model, const DriveTerms& drives) {
  if (!(drives.coulomb_width_rad_s >= 0.0) || !(drives.coulomb_width_m_s >= 0.0)) {
    throw bad_request("drive terms",
                      fmt::format("the width of Coulomb friction is {} rad/s, {} m/s",
                                  drives.coulomb_width_rad_s, drives.coulomb_width_m_s),
                      "give widths of 0 or more");
  }
  for (const Eigen::VectorXd& weights : drives.coupled_drives) {
    if (weights.size() == model.size() && weights.allFinite() && !weights.isZero()) continue;
    throw bad_request("drive terms", "a coupled drive has not one weight a joint",
                      fmt::format("give {} numbers, not all zero", model.size()));
  }
}

/// Smoothed sign; the sign itself (0 at rest) for width 0.
Eigen::ArrayXd friction_sign(const Eigen::ArrayXd& rate, double width) {
  if (width == 0.0) return rate.sign();
  return (rate / width).tanh();
}

double width_of(const RigidModel& model, const DriveTerms& drives, std::size_t joint) {
  return model.bodies[joint].type == JointType::kRevolute ? drives.coulomb_width_rad_s
                                                          : drives.coulomb_width_m_s;
}

/// A drive's width: that of the first joint it turns.
double width_of(const RigidModel& model, const DriveTerms& drives, const Eigen::VectorXd& weights) {
  Eigen::Index joint = 0;
  while (weights[joint] == 0.0) ++joint;
  return width_of(model, drives, static_cast<std::size_t>(joint));
}

/// A stretch of the log.
struct MotionRows {
  Eigen::MatrixXd q;
  Eigen::MatrixXd dq;
  Eigen::MatrixXd ddq;
};

/// The part of a term that acts on one joint.
Eigen::ArrayXd joint_column(const RigidModel& model, const DriveTerms& drives,
                            const TorqueTerm& term, const MotionRows& motion) {
  const Eigen::Index j = term.index;
  switch (term.kind) {
    case TermKind::kMotorInertia:
      return motion.ddq.col(j).array();
    case TermKind::kViscous:
      return motion.dq.col(j).array();
    case TermKind::kCoulomb:
      return friction_sign(motion.dq.col(j).array(),
                           width_of(model, drives, static_cast<std::size_t>(j)));
    case TermKind::kAsymmetricViscous:
      return motion.dq.col(j).array().abs();
    default:
      return Eigen::ArrayXd::Ones(motion.q.rows());
  }
}

/// What a coupled drive gives its own coordinate; each joint gets it times its weight.
Eigen::ArrayXd drive_column(const RigidModel& model, const DriveTerms& drives,
                            const TorqueTerm& term, const MotionRows& motion) {
  const Eigen::VectorXd& weights = drives.coupled_drives[static_cast<std::size_t>(term.index)];
  if (term.kind == TermKind::kCoupledInertia) return (motion.ddq * weights).array();
  Eigen::ArrayXd rate = (motion.dq * weights).array();
  if (term.kind == TermKind::kCoupledViscous) return rate;
  return friction_sign(rate, width_of(model, drives, weights));
}

bool is_coupled(TermKind kind) {
  return kind == TermKind::kCoupledInertia || kind == TermKind::kCoupledViscous ||
         kind == TermKind::kCoupledCoulomb;
}

void fill(const RigidModel& model, const DriveTerms& drives, const std::vector<TorqueTerm>& terms,
          const MotionRows& motion, Eigen::Index first, std::vector<Eigen::MatrixXd>& out) {
  const Eigen::Index rows = motion.q.rows();
  const std::vector<Eigen::MatrixXd> Y =
      regressors_of_samples(model, motion.q, motion.dq, motion.ddq);
  for (std::size_t k = 0; k < terms.size(); ++k) {
    const TorqueTerm& term = terms[k];
    const auto column = static_cast<Eigen::Index>(k);
    if (term.kind == TermKind::kInertial) {
      for (std::size_t j = 0; j < out.size(); ++j) {
        out[j].col(column).segment(first, rows) = Y[j].col(term.index);
      }
    } else if (is_coupled(term.kind)) {
      const Eigen::ArrayXd values = drive_column(model, drives, term, motion);
      const Eigen::VectorXd& weights = drives.coupled_drives[static_cast<std::size_t>(term.index)];
      for (std::size_t j = 0; j < out.size(); ++j) {
        out[j].col(column).segment(first, rows) = weights[static_cast<Eigen::Index>(j)] * values;
      }
    } else {
      out[static_cast<std::size_t>(term.index)].col(column).segment(first, rows) =
          joint_column(model, drives, term, motion);
    }
  }
}

}  // namespace

DriveTerms slow_enough(DriveTerms drives, const std::vector<JointType>& types,
                       const Eigen::MatrixXd& dq) {
  KINESCOPE_CHECK(dq.cols() == std::ssize(types), "one type a joint");
  for (Eigen::Index j = 0; j < dq.cols() && dq.rows() > 0; ++j) {
    const double narrow = narrow_width(dq.col(j));
    if (!(narrow > 0.0)) continue;
    double& width = types[static_cast<std::size_t>(j)] == JointType::kPrismatic
                        ? drives.coulomb_width_m_s
                        : drives.coulomb_width_rad_s;
    width = std::min(width, narrow);
  }
  return drives;
}

std::vector<TorqueTerm> torque_terms(const RigidModel& model, const DriveTerms& drives) {
  check_drives(model, drives);
  std::vector<TorqueTerm> terms;
  const auto add = [&](bool wanted, TermKind kind, int index, const std::string& name) {
    if (wanted) terms.push_back({.kind = kind, .index = index, .name = name});
  };
  int column = 0;
  for (const std::string& name : body_parameter_names(model)) {
    add(true, TermKind::kInertial, column++, name);
  }
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const auto joint = static_cast<int>(b);
    const std::string of = fmt::format("({})", model.bodies[b].joint);
    add(drives.motor_inertia, TermKind::kMotorInertia, joint, "motor_inertia" + of);
    add(drives.viscous, TermKind::kViscous, joint, "viscous" + of);
    add(drives.coulomb, TermKind::kCoulomb, joint, "coulomb" + of);
    add(drives.asymmetric_viscous, TermKind::kAsymmetricViscous, joint, "asymmetric_viscous" + of);
    add(drives.offset, TermKind::kOffset, joint, "offset" + of);
  }
  for (std::size_t d = 0; d < drives.coupled_drives.size(); ++d) {
    const auto drive = static_cast<int>(d);
    const std::string of = fmt::format("(coupled{})", d + 1);
    add(drives.motor_inertia, TermKind::kCoupledInertia, drive, "motor_inertia" + of);
    add(drives.viscous, TermKind::kCoupledViscous, drive, "viscous" + of);
    add(drives.coulomb, TermKind::kCoupledCoulomb, drive, "coulomb" + of);
  }
  return terms;
}

std::vector<Eigen::MatrixXd> term_columns(const RigidModel& model, const DriveTerms& drives,
                                          const std::vector<TorqueTerm>& terms,
                                          const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                                          const Eigen::MatrixXd& ddq) {
  // The full regressor of a stretch at a time: all columns of a long log would not fit the cache.
  constexpr Eigen::Index kRegressorRows = 512;
  const auto count = static_cast<Eigen::Index>(terms.size());
  std::vector<Eigen::MatrixXd> out(static_cast<std::size_t>(model.size()),
                                   Eigen::MatrixXd::Zero(q.rows(), count));
  for (Eigen::Index first = 0; first < q.rows(); first += kRegressorRows) {
    const Eigen::Index rows = std::min(kRegressorRows, q.rows() - first);
    fill(model, drives, terms,
         {.q = q.middleRows(first, rows),
          .dq = dq.middleRows(first, rows),
          .ddq = ddq.middleRows(first, rows)},
         first, out);
  }
  return out;
}

ColumnBasis independent_terms(const RigidModel& rigid, const DriveTerms& drives,
                              const std::vector<TorqueTerm>& terms) {
  // A right angle is often written as 1.5708: what depends on the rest (4e-6) no log can show.
  constexpr double kTolerance = 1e-5;
  const RandomMotion motion = random_motion(rigid, 60 + 4 * rigid.size(), 1);
  const std::vector<Eigen::MatrixXd> columns =
      term_columns(rigid, drives, terms, motion.q, motion.dq, motion.ddq);
  const Eigen::Index rows = motion.q.rows();
  Eigen::MatrixXd W(rows * rigid.size(), static_cast<Eigen::Index>(terms.size()));
  for (Eigen::Index j = 0; j < rigid.size(); ++j) {
    W.middleRows(rows * j, rows) = columns[static_cast<std::size_t>(j)];
  }
  std::vector<int> preference = usual_preference(rigid);
  for (std::size_t k = preference.size(); k < terms.size(); ++k) {
    preference.push_back(static_cast<int>(k));
  }
  return independent_columns(W, preference, kTolerance);
}

}  // namespace kinescope
