// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/leave_out.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "dynamics/gp/posterior.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {

using Eigen::Index;

LeaveOut leave_out(const FittedGp& fitted, const Dataset& dataset, const std::vector<int>& fold_of,
                   int threads) {
  KINESCOPE_CHECK(dataset.samples() == fitted.samples, "the dataset of the fit");
  KINESCOPE_CHECK(static_cast<Index>(fold_of.size()) == fitted.samples, "a fold for each sample");
  std::map<int, std::vector<Index>> members;
  for (std::size_t i = 0; i < fold_of.size(); ++i) {
    if (fold_of[i] >= 0) members[fold_of[i]].push_back(static_cast<Index>(i));
  }
  std::vector<std::vector<Index>> folds;
  folds.reserve(members.size());
  for (auto& [fold, samples] : members) folds.push_back(std::move(samples));
  Workers workers(threads);
  const LeftOut left = fitted.posterior->leave_out(workers, folds);

  const Index outputs = fitted.model.kernel.outputs();
  const Normalisation& normalisation = fitted.model.normalisation;
  Eigen::RowVectorXd scale = normalisation.target_scale;
  if (scale.size() == 0) scale = Eigen::RowVectorXd::Ones(outputs);
  LeaveOut out;
  out.log_density = left.log_density;
  out.mean = by_sample(left.mean, outputs).array().rowwise() * scale.array();
  if (normalisation.target_shift.size() > 0) out.mean.rowwise() += normalisation.target_shift;
  if (dataset.prior_mean.size() > 0) out.mean += dataset.prior_mean;
  out.variance = by_sample(left.variance, outputs).array().rowwise() * scale.array().square();
  out.residual = dataset.targets - out.mean;
  // Samples that are never left out have no prediction: residual and variance are 0 there.
  out.z = (out.variance.array() > 0.0)
              .select(out.residual.array() / out.variance.array().max(1e-300).sqrt(), 0.0);
  const Eigen::MatrixXd centred = dataset.targets.rowwise() - dataset.targets.colwise().mean();
  out.nmse = out.residual.colwise().squaredNorm().array() / centred.colwise().squaredNorm().array();
  return out;
}

LeaveOut leave_one_out(const FittedGp& fitted, const Dataset& dataset, int threads) {
  std::vector<int> fold_of(static_cast<std::size_t>(fitted.samples));
  std::iota(fold_of.begin(), fold_of.end(), 0);
  return leave_out(fitted, dataset, fold_of, threads);
}

std::vector<int> consecutive_folds(Index samples, int folds) {
  KINESCOPE_CHECK(folds >= 2, "at least two folds");
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(samples));
  for (Index i = 0; i < samples; ++i) out.push_back(static_cast<int>(i * folds / samples));
  return out;
}

}  // namespace kinescope::gp
