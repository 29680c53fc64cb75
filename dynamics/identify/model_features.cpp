// SPDX-License-Identifier: Apache-2.0
#include "dynamics/identify/model_features.h"

#include <memory>
#include <numeric>

#include "dynamics/rigid/base_parameters.h"

namespace kinescope {

Eigen::MatrixXd motion_inputs(const Eigen::MatrixXd& q, const Eigen::MatrixXd& dq,
                              const Eigen::MatrixXd& ddq) {
  Eigen::MatrixXd inputs(q.rows(), 3 * q.cols());
  inputs << q, dq, ddq;
  return inputs;
}

namespace {

ModelFeatures features_of(const std::shared_ptr<const RigidModel>& rigid, const DriveTerms& drives,
                          const std::vector<TorqueTerm>& all, const Eigen::MatrixXd& columns,
                          std::size_t at) {
  constexpr double kIndependent = 1e-7;  // relative to the largest pivot
  std::vector<int> order(all.size());
  std::iota(order.begin(), order.end(), 0);
  const ColumnBasis basis = independent_columns(columns, order, kIndependent);
  ModelFeatures out;
  out.terms = basis.kept;
  const auto count = static_cast<Eigen::Index>(basis.kept.size());
  out.prior = Eigen::MatrixXd::Zero(count, count);
  std::vector<TorqueTerm> kept;
  for (Eigen::Index i = 0; i < count; ++i) {
    const int column = basis.kept[static_cast<std::size_t>(i)];
    kept.push_back(all[static_cast<std::size_t>(column)]);
    out.prior(i, i) = static_cast<double>(columns.rows()) / columns.col(column).squaredNorm();
    out.map.names.push_back(kept.back().name);
  }
  const Eigen::Index n = rigid->size();
  out.map.input_columns = static_cast<int>(3 * n);
  out.map.map = [rigid, drives, kept, at, n](const gp::Inputs& inputs, gp::Features features) {
    features = term_columns(*rigid, drives, kept, inputs.leftCols(n), inputs.middleCols(n, n),
                            inputs.middleCols(2 * n, n))[at];
  };
  return out;
}

}  // namespace

ModelFeatures model_features(const DynamicModel& model, const TorqueSamples& samples, int joint,
                             const DriveTerms& drives) {
  const auto rigid = std::make_shared<const RigidModel>(make_rigid_model(model));
  const auto at = static_cast<std::size_t>(joint);
  const std::vector<TorqueTerm> all = torque_terms(*rigid, drives);
  const Eigen::MatrixXd columns =
      term_columns(*rigid, drives, all, samples.q, samples.dq, samples.ddq)[at];
  return features_of(rigid, drives, all, columns, at);
}

std::vector<ModelFeatures> model_features_of_joints(const DynamicModel& model,
                                                    const TorqueSamples& samples,
                                                    const DriveTerms& drives) {
  const auto rigid = std::make_shared<const RigidModel>(make_rigid_model(model));
  const std::vector<TorqueTerm> all = torque_terms(*rigid, drives);
  const std::vector<Eigen::MatrixXd> columns =
      term_columns(*rigid, drives, all, samples.q, samples.dq, samples.ddq);
  std::vector<ModelFeatures> out;
  for (std::size_t j = 0; j < columns.size(); ++j) {
    out.push_back(features_of(rigid, drives, all, columns[j], j));
  }
  return out;
}

}  // namespace kinescope
