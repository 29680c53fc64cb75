// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/torque_predictor.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "dynamics/rigid/regressor.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using Eigen::Index;

void require(bool holds, const char* what) {
  if (!holds) {
    throw bad_request("torque model", what, "make it with the program that reads it");
  }
}

bool all_within(const std::vector<int>& indices, std::size_t size) {
  return std::ranges::all_of(
      indices, [size](int k) { return k >= 0 && static_cast<std::size_t>(k) < size; });
}

void check_parametric(const SavedParametric& parametric, std::size_t terms, Index joints) {
  const auto count = std::ssize(parametric.terms);
  require(all_within(parametric.terms, terms) && parametric.parameters.size() == count &&
              parametric.covariance.rows() == count && parametric.covariance.cols() == count &&
              all_within(parametric.undetermined, parametric.terms.size()) &&
              (parametric.undetermined.empty() || parametric.acting.size() == count),
          "its parameters do not fit the robot");
  require(parametric.gains.size() == joints && parametric.sigma.size() == joints,
          "not one gain and one noise a joint");
}

void check(const SavedTorqueModel& model, std::size_t terms) {
  const Index joints = model.rigid.size();
  require(joints > 0, "no joint");
  require(model.parametric || !model.processes.empty(), "nothing that predicts");
  if (model.parametric) check_parametric(*model.parametric, terms, joints);
  if (!model.processes.empty()) {
    require(std::ssize(model.processes) == joints, "not one process a joint");
    require(model.motions.cols() == 3 * joints, "its points are not of this robot");
  }
  for (const SavedProcess& process : model.processes) {
    require(all_within(process.terms, terms), "a process of terms that the robot has not");
  }
  for (const Eigen::VectorXd* part : {&model.parts.model_factor, &model.parts.noise_sigma}) {
    require(part->size() == joints, "not one sigma a joint");
  }
  for (const Eigen::VectorXd* part : {&model.bands.of_90, &model.bands.of_95}) {
    require(part->size() == 0 || part->size() == joints, "not one band a joint");
  }
  require(all_within(model.constants.joints, static_cast<std::size_t>(joints)) &&
              model.constants.torque.size() == std::ssize(model.constants.joints) &&
              model.constants.sigma.size() == std::ssize(model.constants.joints),
          "its constants do not fit the robot");
}

// Columns of torque_terms() for one sample.
class TermColumns {
 public:
  TermColumns(const RigidModel& rigid, const DriveTerms& drives)
      : rigid_(rigid),
        drives_(drives),
        terms_(torque_terms(rigid, drives)),
        regressor_(rigid),
        dq_(rigid.size()),
        ddq_(rigid.size()) {}

  [[nodiscard]] std::size_t count() const { return terms_.size(); }

  void at(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq) {
    inertial_ = &regressor_.at(q, dq, ddq);
    dq_ = dq;
    ddq_ = ddq;
  }

  [[nodiscard]] double operator()(Index joint, int term) const {
    const TorqueTerm& own = terms_[static_cast<std::size_t>(term)];
    if (own.kind == TermKind::kInertial) return (*inertial_)(joint, own.index);
    if (own.kind >= TermKind::kCoupledInertia) return coupled(joint, own);
    if (own.index != joint) return 0.0;
    switch (own.kind) {
      case TermKind::kMotorInertia:
        return ddq_[joint];
      case TermKind::kViscous:
        return dq_[joint];
      case TermKind::kCoulomb:
        return sign(dq_[joint], width(joint));
      case TermKind::kAsymmetricViscous:
        return std::abs(dq_[joint]);
      default:
        return 1.0;
    }
  }

  [[nodiscard]] static double sign(double rate, double width) {
    if (width == 0.0) return rate > 0.0 ? 1.0 : rate < 0.0 ? -1.0 : 0.0;
    return std::tanh(rate / width);
  }

 private:
  [[nodiscard]] double width(Index joint) const {
    return rigid_.bodies[static_cast<std::size_t>(joint)].type == JointType::kRevolute
               ? drives_.coulomb_width_rad_s
               : drives_.coulomb_width_m_s;
  }

  [[nodiscard]] double coupled(Index joint, const TorqueTerm& term) const {
    const Eigen::VectorXd& weights = drives_.coupled_drives[static_cast<std::size_t>(term.index)];
    if (term.kind == TermKind::kCoupledInertia) return weights[joint] * ddq_.dot(weights);
    const double rate = dq_.dot(weights);
    if (term.kind == TermKind::kCoupledViscous) return weights[joint] * rate;
    Index first = 0;
    while (weights[first] == 0.0) ++first;
    return weights[joint] * sign(rate, width(first));
  }

  RigidModel rigid_;
  DriveTerms drives_;
  std::vector<TorqueTerm> terms_;
  SampleRegressor regressor_;
  const Eigen::MatrixXd* inertial_ = nullptr;  // of the last sample
  Eigen::VectorXd dq_, ddq_;
};

Index feature_count(const SavedProcess& process) {
  switch (process.features) {
    case SavedProcess::Features::kFriction:
      return 2;
    case SavedProcess::Features::kTerms:
      return std::ssize(process.terms);
    default:
      return 0;
  }
}

void features_of(const SavedProcess& process, const TermColumns& columns, const DriveTerms& drives,
                 double rate, Index joint, Eigen::VectorXd& out) {
  if (process.features == SavedProcess::Features::kFriction) {
    out[0] = rate;
    out[1] = TermColumns::sign(rate, drives.coulomb_width_rad_s);
  } else if (process.features == SavedProcess::Features::kTerms) {
    for (Index k = 0; k < out.size(); ++k) {
      out[k] = columns(joint, process.terms[static_cast<std::size_t>(k)]);
    }
  }
}

}  // namespace

struct TorquePredictor::State {
  SavedTorqueModel model;
  TermColumns columns;
  bool needs_columns = false;
  std::optional<gp::CompactPredictor> processes;
  std::vector<Eigen::VectorXd> features;    // of each process
  std::vector<Eigen::VectorXd> parametric;  // columns of its parameters, one a joint
  Eigen::VectorXd motion;
  Eigen::VectorXd mean, sigma, model_sigma;

  explicit State(const SavedTorqueModel& given) : model(given), columns(model.rigid, model.drives) {
    check(model, columns.count());
    const Index joints = model.rigid.size();
    motion.resize(3 * joints);
    mean = sigma = model_sigma = Eigen::VectorXd::Zero(joints);
    needs_columns = model.parametric.has_value();
    for (const SavedProcess& process : model.processes) {
      needs_columns = needs_columns || process.features == SavedProcess::Features::kTerms;
    }
    if (model.parametric) {
      parametric.assign(static_cast<std::size_t>(joints),
                        Eigen::VectorXd::Zero(std::ssize(model.parametric->terms)));
    }
    make_processes();
    model.motions.resize(0, 0);  // the predictors have theirs
  }

  void make_processes() {
    std::vector<Eigen::MatrixXd> tables;
    for (const SavedProcess& process : model.processes) {
      features.emplace_back(Eigen::VectorXd::Zero(feature_count(process)));
      tables.emplace_back(model.motions.rows(), feature_count(process));
    }
    const Index joints = model.rigid.size();
    for (Index i = 0; i < model.motions.rows() && !tables.empty(); ++i) {
      const Eigen::VectorXd own = model.motions.row(i);
      if (needs_columns)
        columns.at(own.head(joints), own.segment(joints, joints), own.tail(joints));
      for (Index j = 0; j < joints; ++j) {
        const auto at = static_cast<std::size_t>(j);
        features_of(model.processes[at], columns, model.drives, own[joints + j], j, features[at]);
        tables[at].row(i) = features[at];
      }
    }
    std::vector<gp::CompactGp> compact;
    for (const SavedProcess& process : model.processes) compact.push_back(process.gp);
    if (!compact.empty()) processes.emplace(compact, model.motions, tables);
  }

  void set_parametric_sigma() {
    const SavedParametric& own = *model.parametric;
    for (Index j = 0; j < mean.size(); ++j) {
      const Eigen::VectorXd& column = parametric[static_cast<std::size_t>(j)];
      double variance = 0.0;
      for (Index k = 0; k < column.size(); ++k) {
        if (column[k] == 0.0) continue;
        double sum = 0.0;
        for (Index l = 0; l < column.size(); ++l) sum += own.covariance(l, k) * column[l];
        variance += column[k] * sum;
      }
      for (const int k : own.undetermined) {
        if (std::abs(column[k]) > own.acting[k]) variance = std::numeric_limits<double>::infinity();
      }
      if (std::isnan(variance)) variance = std::numeric_limits<double>::infinity();  // overflow
      model_sigma[j] = std::abs(own.gains[j]) * std::sqrt(std::max(0.0, variance));
    }
  }
};

TorquePredictor::TorquePredictor(const SavedTorqueModel& model)
    : state_(std::make_unique<State>(model)) {}
TorquePredictor::~TorquePredictor() = default;

const Eigen::VectorXd& TorquePredictor::mean(const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                                             const Eigen::VectorXd& ddq) {
  State& state = *state_;
  const Index joints = state.mean.size();
  KINESCOPE_CHECK(q.size() == joints && dq.size() == joints && ddq.size() == joints,
                  "one entry a joint");
  if (state.needs_columns) state.columns.at(q, dq, ddq);
  state.motion << q, dq, ddq;
  for (Index j = 0; j < joints; ++j) {
    const auto at = static_cast<std::size_t>(j);
    state.mean[j] = 0.0;
    if (state.model.parametric) {
      const SavedParametric& own = *state.model.parametric;
      Eigen::VectorXd& column = state.parametric[at];
      double torque = 0.0;
      for (Index k = 0; k < column.size(); ++k) {
        column[k] = state.columns(j, own.terms[static_cast<std::size_t>(k)]);
        torque += column[k] * own.parameters[k];
      }
      state.mean[j] = own.gains[j] * torque;
    }
    if (!state.processes) continue;
    features_of(state.model.processes[at], state.columns, state.model.drives, dq[j], j,
                state.features[at]);
  }
  if (state.processes) state.mean += state.processes->mean(state.motion, state.features);
  for (std::size_t k = 0; k < state.model.constants.joints.size(); ++k) {
    state.mean[state.model.constants.joints[k]] =
        state.model.constants.torque[static_cast<Index>(k)];
  }
  return state.mean;
}

const Eigen::VectorXd& TorquePredictor::sigma() {
  State& state = *state_;
  if (!state.processes) {
    state.set_parametric_sigma();
  } else {
    for (Index j = 0; j < state.mean.size(); ++j) {
      state.model_sigma[j] = std::sqrt(state.processes->variance(j));
    }
  }
  const SigmaParts& parts = state.model.parts;
  for (Index j = 0; j < state.mean.size(); ++j) {
    // Not 0 times infinity: a model without any idea stays without.
    if (std::isfinite(state.model_sigma[j])) state.model_sigma[j] *= parts.model_factor[j];
    state.sigma[j] = std::isfinite(state.model_sigma[j])
                         ? std::hypot(state.model_sigma[j], parts.noise_sigma[j])
                         : state.model_sigma[j];
  }
  for (std::size_t k = 0; k < state.model.constants.joints.size(); ++k) {
    const int joint = state.model.constants.joints[k];
    state.model_sigma[joint] = 0.0;
    state.sigma[joint] = state.model.constants.sigma[static_cast<Index>(k)];
  }
  return state.sigma;
}

const Eigen::VectorXd& TorquePredictor::model_sigma() const { return state_->model_sigma; }

}  // namespace kinescope
