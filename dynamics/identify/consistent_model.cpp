// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/consistent_model.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Cholesky>
#include <ceres/autodiff_cost_function.h>
#include <ceres/dynamic_autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <fmt/format.h>

#include "dynamics/identify/log_cholesky.h"
#include "dynamics/rigid/mass_matrix.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace identify {

LogCholesky log_cholesky(const InertialParameters& parameters) {
  // The upper factor U of J = U U' is the lower one of J with rows and columns in reverse.
  const Eigen::Matrix4d J = pseudo_inertia(parameters);
  const Eigen::LLT<Eigen::Matrix4d> factor(J.reverse());
  KINESCOPE_CHECK(factor.info() == Eigen::Success, "the pseudo-inertia is positive definite");
  const Eigen::Matrix4d L = factor.matrixL();
  const Eigen::Matrix4d U = L.reverse();
  const double scale = U(3, 3);
  LogCholesky theta;
  theta << std::log(scale), std::log(U(0, 0) / scale), std::log(U(1, 1) / scale),
      std::log(U(2, 2) / scale), U(0, 1) / scale, U(1, 2) / scale, U(0, 2) / scale, U(0, 3) / scale,
      U(1, 3) / scale, U(2, 3) / scale;
  return theta;
}

}  // namespace identify

namespace {

using identify::LogCholesky;

/// Least squares of the base parameters: root * (base_of(bodies, drives) - target). Parameter
/// blocks: ten numbers a body, then the drives' values.
class BaseMisfit {
 public:
  BaseMisfit(const Eigen::MatrixXd& root, const Eigen::MatrixXd& regroup,
             const Eigen::VectorXd& target, int bodies)
      : weighted_(root * regroup), offset_(root * target), bodies_(bodies) {}

  template <typename Scalar>
  bool operator()(Scalar const* const* blocks, Scalar* residual) const {
    const Eigen::Index drives = weighted_.cols() - 10 * Eigen::Index{bodies_};
    for (int b = 0; b < bodies_; ++b) {
      if (!identify::in_range(blocks[b])) return false;
    }
    Eigen::Matrix<Scalar, Eigen::Dynamic, 1> values(weighted_.cols());
    for (int b = 0; b < bodies_; ++b) {
      values.template segment<10>(10 * Eigen::Index{b}) = identify::inertial_vector(blocks[b]);
    }
    for (Eigen::Index k = 0; k < drives; ++k) {
      values[10 * Eigen::Index{bodies_} + k] = blocks[bodies_][k];
    }
    for (Eigen::Index r = 0; r < weighted_.rows(); ++r) {
      Scalar sum(-offset_[r]);
      for (Eigen::Index c = 0; c < weighted_.cols(); ++c) {
        if (weighted_(r, c) != 0.0) sum += weighted_(r, c) * values[c];
      }
      residual[r] = sum;
    }
    return true;
  }

 private:
  Eigen::MatrixXd weighted_;
  Eigen::VectorXd offset_;
  int bodies_;
};

/// The log-determinant divergence tr(X) - log det X - 4, X = U0^-1 J U0^-T, as ten squares / 2
/// times weight^2. With A = U0^-1 U (upper) it is the sum of a_ij^2 above the diagonal and of a^2 -
/// 1 - 2 log a on it.
struct BregmanPrior {
  Eigen::Matrix4d inverse_factor;  ///< U0^-1
  double weight = 1.0;

  /// The signed root of 2 (a^2 - 1 - 2 log a), smooth at 1, where it is 2 (a - 1).
  template <typename Scalar>
  static Scalar diagonal_root(const Scalar& a) {
    using std::log;
    using std::sqrt;
    const Scalar e = a - 1.0;
    // Series of the fourth order; the closed form loses its digits here.
    if (ceres::abs(e) < 1e-3) return 2.0 * e * (1.0 - e / 6.0 + e * e / 9.0);
    const Scalar root = sqrt(2.0 * (a * a - 1.0 - 2.0 * log(a)));
    return e > 0.0 ? root : Scalar(-root);
  }

  template <typename Scalar>
  bool operator()(const Scalar* theta, Scalar* residual) const {
    if (!identify::in_range(theta)) return false;
    const identify::UpperFactor<Scalar> A =
        inverse_factor.cast<Scalar>() * identify::upper_factor(theta);
    int k = 0;
    for (int i = 0; i < 4; ++i) {
      residual[k++] = weight * diagonal_root(A(i, i));
      for (int j = i + 1; j < 4; ++j) residual[k++] = weight * std::sqrt(2.0) * A(i, j);
    }
    return true;
  }
};

/// Draws a value to its prior; for drives that the torques do not tell from the links.
struct ValuePrior {
  double value;
  double weight;
  int index;
  template <typename Scalar>
  bool operator()(Scalar const* const* block, Scalar* residual) const {
    residual[0] = weight * (block[0][index] - value);
    return true;
  }
};

/// A body for links of which nothing is known: of the others' mean mass, a ball of 5 cm half way to
/// what it carries.
InertialParameters plain_body(const RigidModel& rigid, std::size_t body) {
  double mass = 0.0;
  int known = 0;
  for (const RigidBody& other : rigid.bodies) {
    if (!(other.inertia.mass_kg > 0.0)) continue;
    mass += other.inertia.mass_kg;
    ++known;
  }
  mass = known > 0 ? mass / known : 1.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const RigidBody& other : rigid.bodies) {
    if (other.parent == static_cast<int>(body)) centre = 0.5 * other.p_parent_joint;
  }
  constexpr double kRadius = 0.05;
  return from_central(
      {.mass_kg = mass,
       .centre_m = centre,
       .inertia_kgm2 = 0.4 * mass * kRadius * kRadius * Eigen::Matrix3d::Identity()});
}

/// A plate or a rod is on the border, where the divergence is infinite: it gets a millimetre. So do
/// directions in which an impossible inertia is negative.
InertialParameters thickened(const InertialParameters& body) {
  constexpr double kThickness = 1e-3;
  const double least = body.mass_kg * kThickness * kThickness;
  Eigen::Matrix4d J = pseudo_inertia(body);
  J.topLeftCorner<3, 3>().diagonal().array() += least;
  if (!is_consistent(body)) {
    const SymmetricEigen eigen = symmetric_eigen(J);
    J = eigen.vectors * eigen.values.cwiseMax(least).asDiagonal() * eigen.vectors.transpose();
  }
  return from_pseudo_inertia(J);
}

/// The prior of each body; flat or impossible ones get thickness or are replaced.
std::vector<InertialParameters> prior_bodies(const RigidModel& rigid,
                                             std::vector<std::string>& replaced) {
  std::vector<InertialParameters> out;
  for (std::size_t b = 0; b < rigid.bodies.size(); ++b) {
    InertialParameters body = rigid.bodies[b].inertia;
    if (!(body.mass_kg > 0.0) || !is_consistent(body)) {
      body = plain_body(rigid, b);
      replaced.push_back(rigid.bodies[b].name);
    }
    out.push_back(thickened(body));
  }
  return out;
}

bool is_not_negative(TermKind kind) {
  return kind != TermKind::kOffset && kind != TermKind::kAsymmetricViscous &&
         kind != TermKind::kInertial;
}

/// How much wider than for white noise the parameters scatter: the median of their variance ratios.
/// The jackknife's matrix itself has too few blocks to be inverted.
double colour_of(const Identification& fit) {
  std::vector<double> ratios;
  for (Eigen::Index k = 0; k < fit.parameters.size(); ++k) {
    const double ratio = fit.covariance(k, k) / fit.white_covariance(k, k);
    if (std::isfinite(ratio)) ratios.push_back(ratio);
  }
  return std::max(1.0, median_of(std::move(ratios)));
}

/// R' R = information.
Eigen::MatrixXd square_root(const Eigen::MatrixXd& information) {
  const SymmetricEigen eigen = symmetric_eigen(information);
  return eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.vectors.transpose();
}

/// Root of the information that the base parameters carry: R' R = information / colour.
Eigen::MatrixXd information_root(const Identification& fit) {
  return square_root(fit.information / colour_of(fit));
}

/// Squares of how far a body is from its prior; the cost is the problem's.
void add_body_prior(double relative_sigma, LogCholesky& body, ceres::Problem& problem) {
  const Eigen::Matrix4d U = identify::upper_factor(body.data());
  problem.AddResidualBlock(
      new ceres::AutoDiffCostFunction<BregmanPrior, 10, 10>(  // owned by the problem
          new BregmanPrior{.inverse_factor = U.inverse(), .weight = 1.0 / relative_sigma}),
      nullptr, body.data());
}

ceres::Solver::Summary solve_exactly(int max_iterations, ceres::Problem& problem) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = max_iterations;
  options.function_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

void require_prior_sigma(const ConsistentOptions& options) {
  if (options.prior_relative_sigma > 0.0) return;
  throw bad_request("consistent model", "the prior's relative sigma is not positive",
                    "give a number above 0; 1 is a loose prior");
}

/// The nonlinear least squares, its blocks and its answer.
class ConsistentProblem {
 public:
  ConsistentProblem(const Identification& fit, const ConsistentOptions& options)
      : fit_(fit), root_(information_root(fit)) {
    const std::vector<InertialParameters> priors = prior_bodies(fit.rigid, replaced_);
    for (const InertialParameters& prior : priors) {
      bodies_.push_back(identify::log_cholesky(prior));
    }
    add_drives();
    add_misfit();
    for (LogCholesky& body : bodies_) {
      add_body_prior(options.prior_relative_sigma, body, problem_);
    }
  }

  ConsistentModel solve(int max_iterations) {
    const ceres::Solver::Summary summary = solve_exactly(max_iterations, problem_);
    ConsistentModel out;
    out.converged = summary.termination_type == ceres::CONVERGENCE;
    out.iterations = static_cast<int>(summary.iterations.size());
    out.replaced_priors = replaced_;
    out.terms.resize(fit_.basis.regroup.cols());
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      out.terms.segment<10>(10 * static_cast<Eigen::Index>(b)) =
          identify::inertial_vector(bodies_[b].data());
    }
    out.terms.tail(drives_.size()) = drives_;
    out.parameters = fit_.basis.regroup * out.terms;
    out.misfit = (root_ * (out.parameters - fit_.parameters)).squaredNorm();
    return out;
  }

 private:
  /// The base fit's own values, moved into bounds.
  void add_drives() {
    const auto first = static_cast<Eigen::Index>(10 * fit_.rigid.bodies.size());
    drives_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(fit_.terms.size()) - first);
    for (std::size_t k = 0; k < fit_.basis.kept.size(); ++k) {
      const Eigen::Index at = fit_.basis.kept[k] - first;
      if (at >= 0) drives_[at] = fit_.parameters[static_cast<Eigen::Index>(k)];
    }
    if (drives_.size() == 0) return;
    problem_.AddParameterBlock(drives_.data(), static_cast<int>(drives_.size()));
    const Eigen::MatrixXd M = mass_matrix(fit_.rigid, Eigen::VectorXd::Zero(fit_.rigid.size()));
    for (Eigen::Index k = 0; k < drives_.size(); ++k) {
      const TorqueTerm& term = fit_.terms[static_cast<std::size_t>(first + k)];
      if (!is_not_negative(term.kind)) continue;
      problem_.SetParameterLowerBound(drives_.data(), static_cast<int>(k), 0.0);
      drives_[k] = std::max(drives_[k], 0.0);
      if (term.kind == TermKind::kMotorInertia) add_motor_prior(term.index, k, M);
    }
  }

  void add_motor_prior(int joint, Eigen::Index at, const Eigen::MatrixXd& M) {
    const double given = fit_.rigid.bodies[static_cast<std::size_t>(joint)].motor_inertia;
    const double size = std::max({given, std::abs(M(joint, joint)), 1e-3});
    auto* cost = new ceres::DynamicAutoDiffCostFunction<ValuePrior>(  // owned by the problem
        new ValuePrior{.value = given, .weight = 1.0 / size, .index = static_cast<int>(at)});
    cost->AddParameterBlock(static_cast<int>(drives_.size()));
    cost->SetNumResiduals(1);
    problem_.AddResidualBlock(cost, nullptr, drives_.data());
  }

  void add_misfit() {
    auto* cost = new ceres::DynamicAutoDiffCostFunction<BaseMisfit, 10>(  // owned by the problem
        new BaseMisfit(root_, fit_.basis.regroup, fit_.parameters,
                       static_cast<int>(bodies_.size())));
    std::vector<double*> blocks;
    for (LogCholesky& body : bodies_) {
      blocks.push_back(body.data());
      cost->AddParameterBlock(10);
    }
    if (drives_.size() > 0) {
      blocks.push_back(drives_.data());
      cost->AddParameterBlock(static_cast<int>(drives_.size()));
    }
    cost->SetNumResiduals(static_cast<int>(root_.rows()));
    problem_.AddResidualBlock(cost, nullptr, blocks);
  }

  const Identification& fit_;
  Eigen::MatrixXd root_;
  std::vector<LogCholesky> bodies_;
  Eigen::VectorXd drives_;
  std::vector<std::string> replaced_;
  ceres::Problem problem_;
};

/// Gives each body's parameters to its links.
void write_links(const RigidModel& rigid, const Eigen::VectorXd& terms, DynamicModel& model) {
  for (std::size_t b = 0; b < rigid.bodies.size(); ++b) {
    const InertialParameters whole =
        InertialParameters::from_vector(terms.segment<10>(10 * static_cast<Eigen::Index>(b)));
    InertialParameters others;
    std::size_t moving = 0;
    std::vector<std::size_t> tied;
    for (std::size_t l = 0; l < rigid.links.size(); ++l) {
      if (rigid.links[l].body != static_cast<int>(b)) continue;
      if (model.tree.links[l].name == rigid.bodies[b].name) {
        moving = l;
      } else {
        tied.push_back(l);
        others += in_frame(rigid.links[l].T_body_link, model.links[l]);
      }
    }
    const InertialParameters left =
        InertialParameters::from_vector(whole.vector() - others.vector());
    if (left.mass_kg > 0.0 && is_consistent(left, 0.0)) {
      model.links[moving] = left;
      continue;
    }
    model.links[moving] = whole;
    for (const std::size_t l : tied) model.links[l] = {};
  }
}

void write_joints(const Identification& fit, const Eigen::VectorXd& terms, DynamicModel& model) {
  const std::vector<JointId> joints = moving_joints(model.tree);
  for (const JointId id : joints) model.joints[id.index()] = {};
  for (std::size_t k = 0; k < fit.terms.size(); ++k) {
    const TorqueTerm& term = fit.terms[k];
    if (term.kind == TermKind::kInertial || term.kind > TermKind::kCoulomb) continue;
    JointDynamics& joint = model.joints[joints[static_cast<std::size_t>(term.index)].index()];
    const double value = terms[static_cast<Eigen::Index>(k)];
    if (term.kind == TermKind::kMotorInertia) joint.motor_inertia = value;
    if (term.kind == TermKind::kViscous) joint.viscous = value;
    if (term.kind == TermKind::kCoulomb) joint.coulomb = value;
  }
}

}  // namespace

ConsistentModel consistent_model(const Identification& identification,
                                 const ConsistentOptions& options) {
  KINESCOPE_CHECK(identification.status != IdentifyStatus::kNotRun, "an identification that ran");
  require_prior_sigma(options);
  ConsistentModel out = ConsistentProblem(identification, options).solve(options.max_iterations);
  out.model = identification.prior;
  write_links(identification.rigid, out.terms, out.model);
  write_joints(identification, out.terms, out.model);
  return out;
}

InertialParameters consistent_body(const InertialParameters& target, const Matrix10d& information,
                                   const InertialParameters& prior,
                                   const ConsistentOptions& options) {
  require_prior_sigma(options);
  if (!(prior.mass_kg > 0.0)) {
    throw bad_request("consistent body", fmt::format("the prior's mass is {} kg", prior.mass_kg),
                      "give the link a mass");
  }
  constexpr int kParameters = 10;
  LogCholesky body = identify::log_cholesky(thickened(prior));
  ceres::Problem problem;
  add_body_prior(options.prior_relative_sigma, body, problem);
  auto* cost = new ceres::DynamicAutoDiffCostFunction<BaseMisfit, kParameters>(  // the problem's
      new BaseMisfit(square_root(information), Matrix10d::Identity(), target.vector(), 1));
  cost->AddParameterBlock(kParameters);
  cost->SetNumResiduals(kParameters);
  problem.AddResidualBlock(cost, nullptr, body.data());
  (void)solve_exactly(options.max_iterations, problem);
  return InertialParameters::from_vector(identify::inertial_vector(body.data()));
}

}  // namespace kinescope
