// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/payload.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "dynamics/identify/block_jackknife.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identify::Block;
using identify::ScaledSolver;
using identify::StackedSystem;
using identify::WeightedFit;

constexpr Index kBodyParameters = 10;
constexpr double kSaysSomething = 0.5;  // relative sigma of a joint's own mass

int carrier_of(const RigidModel& rigid, const DynamicModel& model, const std::string& link) {
  std::vector<int> last;
  std::string names;
  for (int b = 0; b < static_cast<int>(rigid.bodies.size()); ++b) {
    if (std::ranges::count(rigid.bodies, b, &RigidBody::parent) > 0) continue;
    last.push_back(b);
    names += (names.empty() ? "" : ", ") + rigid.bodies[static_cast<std::size_t>(b)].name;
  }
  if (link.empty()) {
    if (last.size() == 1) return last.front();
    throw bad_request("payload", fmt::format("the robot ends in {} links", last.size()),
                      "say which one carries it: " + names);
  }
  for (std::size_t l = 0; l < model.tree.links.size(); ++l) {
    if (model.tree.links[l].name == link && rigid.links[l].body >= 0) return rigid.links[l].body;
  }
  throw bad_request("payload", fmt::format("no moving link '{}'", link),
                    "the robot ends in " + names);
}

/// The system of one or two logs; the payload's ten parameters come first.
struct PayloadSystem {
  StackedSystem system;
  Eigen::VectorXi trajectory;
  Index first_loaded = 0;        ///< row
  std::vector<MatrixXd> drives;  ///< of the loaded rows, each joint's own
};

/// Columns of the drives of every joint at one log: samples x (drive terms of all joints).
std::vector<MatrixXd> drive_columns(const RigidModel& rigid, const DriveTerms& drives,
                                    const TorqueSamples& log) {
  std::vector<TorqueTerm> terms = torque_terms(rigid, drives);
  std::erase_if(terms, [](const TorqueTerm& term) { return term.kind == TermKind::kInertial; });
  return term_columns(rigid, drives, terms, log.q, log.dq, log.ddq);
}

std::vector<MatrixXd> payload_columns(const RigidModel& rigid, int body, const MatrixXd& q,
                                      const MatrixXd& dq, const MatrixXd& ddq) {
  std::vector<MatrixXd> out;
  for (const MatrixXd& Y : regressors_of_samples(rigid, q, dq, ddq)) {
    out.emplace_back(Y.middleCols(kBodyParameters * body, kBodyParameters));
  }
  return out;
}

MatrixXd without_zero_columns(const MatrixXd& all) { return identify::compact_columns(all).W; }

/// Against the model's own masses: load and drives.
PayloadSystem against_model(const RigidModel& rigid, int body, const TorqueSamples& loaded,
                            const DriveTerms& drives) {
  PayloadSystem out;
  out.trajectory = loaded.trajectory;
  out.system.torque =
      loaded.torque - inverse_dynamics_of_samples(rigid, loaded.q, loaded.dq, loaded.ddq);
  const auto load = payload_columns(rigid, body, loaded.q, loaded.dq, loaded.ddq);
  const auto drive = drive_columns(rigid, drives, loaded);
  for (std::size_t j = 0; j < load.size(); ++j) {
    MatrixXd all(loaded.size(), kBodyParameters + drive[j].cols());
    all << load[j], drive[j];
    out.system.joints.push_back(identify::compact_columns(all));
    out.system.parameters = all.cols();
    out.drives.push_back(without_zero_columns(drive[j]));
  }
  return out;
}

/// Against a log without the load: base parameters for both, load and drives of their own for the
/// loaded one. The motors' inertia is no matter of load or warmth and stays common.
PayloadSystem against_log(const RigidModel& rigid, int body, const TorqueSamples& loaded,
                          const TorqueSamples& unloaded, const DriveTerms& drives) {
  const Index before = unloaded.size();
  const Index rows = before + loaded.size();
  PayloadSystem out;
  out.first_loaded = before;
  out.trajectory.resize(rows);
  const int next = before > 0 ? unloaded.trajectory.maxCoeff() + 1 : 0;
  out.trajectory << unloaded.trajectory, loaded.trajectory.array() + next;
  out.system.torque.resize(rows, loaded.joints());
  out.system.torque << unloaded.torque, loaded.torque;

  const std::vector<TorqueTerm> terms = torque_terms(rigid, drives);
  const ColumnBasis basis = independent_terms(rigid, drives, terms);
  std::vector<TorqueTerm> kept;
  for (const int k : basis.kept) kept.push_back(terms[static_cast<std::size_t>(k)]);
  const auto base_unloaded =
      term_columns(rigid, drives, kept, unloaded.q, unloaded.dq, unloaded.ddq);
  const auto base_loaded = term_columns(rigid, drives, kept, loaded.q, loaded.dq, loaded.ddq);
  DriveTerms changing = drives;
  changing.motor_inertia = false;
  const auto change = drive_columns(rigid, changing, loaded);
  const auto load = payload_columns(rigid, body, loaded.q, loaded.dq, loaded.ddq);
  const auto own = drive_columns(rigid, drives, loaded);
  for (std::size_t j = 0; j < load.size(); ++j) {
    const Index base = base_loaded[j].cols();
    MatrixXd all = MatrixXd::Zero(rows, kBodyParameters + base + change[j].cols());
    all.block(before, 0, loaded.size(), kBodyParameters) = load[j];
    all.block(0, kBodyParameters, before, base) = base_unloaded[j];
    all.block(before, kBodyParameters, loaded.size(), base) = base_loaded[j];
    all.block(before, kBodyParameters + base, loaded.size(), change[j].cols()) = change[j];
    out.system.joints.push_back(identify::compact_columns(all));
    out.system.parameters = all.cols();
    out.drives.push_back(without_zero_columns(own[j]));
  }
  return out;
}

/// The share of the mass's own column that no other column can say.
double own_share_of_mass(const MatrixXd& H, double ridge) {
  const VectorXd unit = VectorXd::Unit(H.cols(), 0);
  const double inverse = ScaledSolver(H, ridge).solve(unit)(0, 0);
  return inverse > 0.0 && H(0, 0) > 0.0 ? 1.0 / (inverse * H(0, 0)) : 0.0;
}

void refuse_unseen_mass(const MatrixXd& H, double ridge, const std::string& link) {
  constexpr double kSeen = 1e-7;
  if (own_share_of_mass(H, ridge) > kSeen) return;
  throw undetermined("payload",
                     fmt::format("this motion does not show the mass that {} carries", link),
                     "move the joints that lift it, through postures that tilt the link all ways");
}

/// Standard deviation of a jackknife over groups.
double jackknife_sigma(const VectorXd& without) {
  const auto count = static_cast<double>(without.size());
  return std::sqrt((count - 1.0) / count * (without.array() - without.mean()).square().sum());
}

/// What each joint's torque says of the size of the load that all joints found together: the load's
/// torque, without what the joint's own drive can say, regressed on itself plus what is left.
std::vector<MassOfJoint> masses_by_joint(const PayloadSystem& data, const WeightedFit& fit,
                                         double mass_kg, const std::vector<Block>& blocks) {
  std::vector<MassOfJoint> out;
  const Index first = data.first_loaded;
  const Index rows = data.system.torque.rows() - first;
  for (std::size_t k = 0; k < data.system.joints.size(); ++k) {
    const auto j = static_cast<Index>(k);
    const identify::JointColumns& columns = data.system.joints[k];
    VectorXd load = VectorXd::Zero(rows);
    for (std::size_t c = 0; c < columns.parameters.size(); ++c) {
      if (columns.parameters[c] >= kBodyParameters) continue;
      load += fit.parameters[columns.parameters[c]] *
              columns.W.col(static_cast<Index>(c)).segment(first, rows);
    }
    const VectorXd weight = fit.final_weights.col(j).segment(first, rows);
    const MatrixXd& drive = data.drives[k];
    const MatrixXd weighted = weight.asDiagonal() * drive;
    const ScaledSolver solver(weighted.transpose() * drive, 1e-10);
    load -= drive * solver.solve(weighted.transpose() * load);
    const VectorXd rest = fit.residuals.col(j).segment(first, rows);
    const VectorXd top = weight.cwiseProduct(load).cwiseProduct(rest);
    const VectorXd bottom = weight.cwiseProduct(load.cwiseAbs2());
    if (!(bottom.sum() > 0.0)) continue;
    std::vector<double> parts;
    for (const Block& block : blocks) {
      if (block.first < first) continue;
      const Index at = block.first - first;
      parts.push_back((top.sum() - top.segment(at, block.rows).sum()) /
                      (bottom.sum() - bottom.segment(at, block.rows).sum()));
    }
    const double sigma =
        jackknife_sigma(Eigen::Map<const VectorXd>(parts.data(), static_cast<Index>(parts.size())));
    if (!(sigma < kSaysSomething)) continue;
    const double share = 1.0 + top.sum() / bottom.sum();
    out.push_back(
        {static_cast<int>(j), share * mass_kg, std::max(sigma, 1e-12) * std::abs(mass_kg)});
  }
  return out;
}

/// Birge's ratio: how much more the joints scatter than their sigmas say, 1 at least.
double birge_ratio(const std::vector<MassOfJoint>& joints) {
  if (joints.size() < 2) return 1.0;
  double sum = 0.0;
  double weights = 0.0;
  for (const MassOfJoint& joint : joints) {
    sum += joint.mass_kg / (joint.sigma_kg * joint.sigma_kg);
    weights += 1.0 / (joint.sigma_kg * joint.sigma_kg);
  }
  double square = 0.0;
  for (const MassOfJoint& joint : joints) {
    square += std::pow((joint.mass_kg - sum / weights) / joint.sigma_kg, 2);
  }
  return std::max(1.0, std::sqrt(square / static_cast<double>(joints.size() - 1)));
}

void fill(const Vector10d& parameters, const Matrix10d& covariance, int freedom,
          PayloadEstimate& out) {
  out.parameters = parameters;
  out.freedom = freedom;
  out.mass_kg = parameters[0];
  out.sigma_kg = out.disagreement * std::sqrt(covariance(0, 0));
  const double half = student_point(freedom) * out.sigma_kg;
  out.lower_kg = out.mass_kg - half;
  out.upper_kg = out.mass_kg + half;
  if (out.mass_kg == 0.0) return;
  out.centre_m = parameters.segment<3>(1) / out.mass_kg;
  Eigen::Matrix<double, 3, 4> slope;
  slope << -out.centre_m / out.mass_kg, Eigen::Matrix3d::Identity() / out.mass_kg;
  out.centre_sigma_m =
      out.disagreement * (slope * covariance.topLeftCorner<4, 4>() * slope.transpose())
                             .diagonal()
                             .cwiseMax(0.0)
                             .cwiseSqrt();
}

PayloadEstimate solve(PayloadSystem data, std::string link, const PayloadOptions& options) {
  data.system.weights = MatrixXd::Ones(data.system.torque.rows(), data.system.torque.cols());
  if (data.system.torque.rows() < 2 * data.system.parameters) {
    throw undetermined("payload",
                       fmt::format("{} samples for {} parameters", data.system.torque.rows(),
                                   data.system.parameters),
                       "record a longer motion");
  }
  const WeightedFit fit = identify::weighted_fit(
      data.system, {.loss = options.loss, .ridge = options.ridge, .prior = {}});
  refuse_unseen_mass(identify::gram(data.system, fit.final_weights, 0, data.system.torque.rows()),
                     options.ridge, link);
  const MatrixXd whitened = fit.residuals.cwiseProduct(fit.final_weights.cwiseSqrt());
  const double memory = identify::correlation_samples(whitened, data.trajectory);
  const std::vector<Block> blocks = identify::make_blocks(
      data.trajectory, options.block_correlations * memory, options.fewest_blocks);
  const MatrixXd covariance =
      identify::jackknife_covariance(data.system, fit, options.ridge, blocks);
  PayloadEstimate out;
  out.link = std::move(link);
  out.joints = masses_by_joint(data, fit, fit.parameters[0], blocks);
  out.disagreement = birge_ratio(out.joints);
  fill(fit.parameters.head<10>(), covariance.topLeftCorner<10, 10>(),
       static_cast<int>(blocks.size()) - 1, out);
  return out;
}

void check_unit(const std::string& torque_unit) {
  if (torque_unit != "A") return;
  throw bad_request("payload", "the log holds currents, which say no mass",
                    "give the drives' gains in N m/A with --torque-factor");
}

/// Payload from differences of torque at rest: ten parameters and an offset a joint; and how large
/// each joint alone would have it, 1 being what all found. NaN for joints that do not feel it.
struct AtRest {
  Vector10d parameters;
  VectorXd shares;
};

AtRest at_rest(const std::vector<MatrixXd>& load, const MatrixXd& difference,
               const std::string& link, double ridge) {
  StackedSystem system;
  system.torque = difference;
  system.weights = MatrixXd::Ones(difference.rows(), difference.cols());
  system.parameters = kBodyParameters + difference.cols();
  for (std::size_t j = 0; j < load.size(); ++j) {
    MatrixXd all = MatrixXd::Zero(difference.rows(), system.parameters);
    all.leftCols(kBodyParameters) = load[j];
    all.col(kBodyParameters + static_cast<Index>(j)).setOnes();
    system.joints.push_back(identify::compact_columns(all));
  }
  const WeightedFit fit = identify::weighted_fit(system, {.ridge = ridge, .prior = {}});
  refuse_unseen_mass(identify::gram(system, fit.final_weights, 0, difference.rows()), ridge, link);
  AtRest out{fit.parameters.head<10>(), VectorXd(difference.cols())};
  for (std::size_t k = 0; k < load.size(); ++k) {
    const auto j = static_cast<Index>(k);
    VectorXd torque = load[k] * out.parameters;
    torque.array() -= torque.mean();
    const double square = torque.squaredNorm();
    out.shares[j] = square > 0.0 ? 1.0 + torque.dot(fit.residuals.col(j)) / square
                                 : std::numeric_limits<double>::quiet_NaN();
  }
  return out;
}

/// As masses_by_joint(), from the fits without a fold (columns: shares of each joint).
std::vector<MassOfJoint> masses_at_rest(const AtRest& whole, const MatrixXd& shares) {
  std::vector<MassOfJoint> out;
  const double mass_kg = whole.parameters[0];
  for (Index j = 0; j < whole.shares.size(); ++j) {
    const double sigma = jackknife_sigma(shares.row(j));
    if (!(sigma < kSaysSomething)) continue;
    out.push_back({static_cast<int>(j), whole.shares[j] * mass_kg,
                   std::max(sigma, 1e-12) * std::abs(mass_kg)});
  }
  return out;
}

}  // namespace

double student_point(int freedom) {
  constexpr double kX = 1.959964;
  const double x3 = kX * kX * kX;
  const double x5 = x3 * kX * kX;
  const double x7 = x5 * kX * kX;
  const double n = std::max(1, freedom);
  return kX + (x3 + kX) / (4.0 * n) + (5.0 * x5 + 16.0 * x3 + 3.0 * kX) / (96.0 * n * n) +
         (3.0 * x7 + 19.0 * x5 + 17.0 * x3 - 15.0 * kX) / (384.0 * n * n * n);
}

void require_payload_question(const DynamicModel& model, const std::string& torque_unit,
                              const PayloadOptions& options) {
  check_unit(torque_unit);
  static_cast<void>(carrier_of(make_rigid_model(model), model, options.link));
}

PayloadEstimate estimate_payload(const DynamicModel& model, const TorqueSamples& loaded,
                                 const PayloadOptions& options) {
  check_unit(loaded.torque_unit);
  const RigidModel rigid = make_rigid_model(model);
  const int body = carrier_of(rigid, model, options.link);
  return solve(against_model(rigid, body, loaded, options.drives),
               rigid.bodies[static_cast<std::size_t>(body)].name, options);
}

PayloadEstimate estimate_payload(const DynamicModel& model, const TorqueSamples& loaded,
                                 const TorqueSamples& unloaded, const PayloadOptions& options) {
  check_unit(loaded.torque_unit);
  const RigidModel rigid = make_rigid_model(model);
  const int body = carrier_of(rigid, model, options.link);
  return solve(against_log(rigid, body, loaded, unloaded, options.drives),
               rigid.bodies[static_cast<std::size_t>(body)].name, options);
}

PayloadEstimate payload_at_rest(const DynamicModel& model, const RobustTorque& loaded,
                                const RobustTorque* unloaded, const PayloadOptions& options) {
  check_unit(loaded.samples.torque_unit);
  const RigidModel rigid = make_rigid_model(model);
  const int body = carrier_of(rigid, model, options.link);
  const std::string& link = rigid.bodies[static_cast<std::size_t>(body)].name;
  const MatrixXd& q = loaded.samples.q;
  const MatrixXd& dq = loaded.samples.dq;
  const MatrixXd still = MatrixXd::Zero(q.rows(), q.cols());
  const auto load = payload_columns(rigid, body, q, dq, still);
  const MatrixXd declared = inverse_dynamics_of_samples(rigid, q, dq, still);
  const auto even = [&](const std::vector<gp::FittedGp>& fits, int threads) {
    return split_torque(fits, q, dq, still, threads).gravity;
  };
  const auto student = static_cast<std::size_t>(RobustMethod::kStudent);
  const MatrixXd reference =
      unloaded == nullptr ? declared : even(unloaded->fits[student], unloaded->threads);
  const AtRest whole =
      at_rest(load, even(loaded.fits[student], loaded.threads) - reference, link, options.ridge);
  const int folds = unloaded == nullptr ? loaded.folds : std::min(loaded.folds, unloaded->folds);
  MatrixXd without(10, folds);
  MatrixXd shares(q.cols(), folds);
  for (int k = 0; k < folds; ++k) {
    const MatrixXd other =
        unloaded == nullptr ? declared : even(without_fold(*unloaded, k), unloaded->threads);
    const AtRest one =
        at_rest(load, even(without_fold(loaded, k), loaded.threads) - other, link, options.ridge);
    without.col(k) = one.parameters;
    shares.col(k) = one.shares;
  }
  const VectorXd mean = without.rowwise().mean();
  without.colwise() -= mean;
  const double factor = static_cast<double>(folds - 1) / folds;
  PayloadEstimate out;
  out.link = link;
  out.joints = masses_at_rest(whole, shares);
  out.disagreement = birge_ratio(out.joints);
  fill(whole.parameters, factor * without * without.transpose(), folds - 1, out);
  return out;
}

}  // namespace kinescope
