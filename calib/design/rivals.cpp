// SPDX-License-Identifier: Apache-2.0
#include "calib/design/rivals.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::design {
namespace {

// Added to the diagonal of a normal matrix of unit columns: what is unknown to eight digits counts
// as unknown, and takes nothing away by rounding.
constexpr double kRidge = 1e-10;

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

}  // namespace

double sigmas_apart(const Eigen::MatrixXd& information, const RivalColumns& columns) {
  const Eigen::MatrixXd own = information(columns.believed, columns.believed);
  Eigen::MatrixXd beside = information(columns.nuisance, columns.nuisance);
  const Eigen::VectorXd scale = unit_scale(beside);
  beside = scale.asDiagonal() * beside * scale.asDiagonal();
  beside.diagonal().array() += kRidge;
  const Eigen::VectorXd pull =
      scale.asDiagonal() * (information(columns.nuisance, columns.believed) * columns.values);
  const double all = columns.values.dot(own * columns.values);
  const double fitted = pull.dot(CholeskyFactor(beside).solve(pull));
  return std::sqrt(std::max(0.0, all - fitted));
}

RivalColumns rival_columns(const std::vector<Parameter>& parameters,
                           const std::vector<std::string>& own, const Eigen::VectorXd& values,
                           const std::vector<std::string>& others) {
  RivalColumns out;
  out.values = values;
  for (const std::string& name : own)
    out.believed.push_back(std::ranges::find(parameters, name, &Parameter::name) -
                           parameters.begin());
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string& name = parameters[i].name;
    if (!contains(own, name) && !contains(others, name))
      out.nuisance.push_back(static_cast<Eigen::Index>(i));
  }
  return out;
}

}  // namespace kinescope::design
