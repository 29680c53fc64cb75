// SPDX-License-Identifier: Apache-2.0
#include "dynamics/contact/imbalance_record.h"

namespace kinescope::contact {

ImbalanceRecord::ImbalanceRecord(Eigen::Index joints, std::size_t capacity)
    : entries_(capacity, RecordEntry{.imbalance = Eigen::VectorXd::Zero(joints),
                                     .momentum_covariance = Eigen::MatrixXd::Zero(joints, joints),
                                     .model_variance = Eigen::VectorXd::Zero(joints),
                                     .error_mean = Eigen::VectorXd::Zero(joints),
                                     .error_variance = Eigen::VectorXd::Zero(joints)}),
      drive_(Eigen::VectorXd::Zero(joints)),
      momentum_(Eigen::VectorXd::Zero(joints)) {}

void ImbalanceRecord::append(const BalanceSample& sample, const BalanceFilter& filter) {
  RecordEntry& entry = add(sample, filter.noise());
  entry.error_mean = filter.error_mean();
  entry.error_variance = filter.error_covariance().diagonal();
}

void ImbalanceRecord::append_unfiltered(const BalanceSample& sample, const BalanceNoise& noise) {
  const RecordEntry& last = back();
  RecordEntry& entry = add(sample, noise);
  entry.error_mean = last.error_mean;
  entry.error_variance = last.error_variance;
}

RecordEntry& ImbalanceRecord::add(const BalanceSample& sample, const BalanceNoise& noise) {
  const std::size_t place = (begin_ + size_) % entries_.size();
  RecordEntry& entry = entries_[place];
  entry.stamp_s = sample.stamp_s;
  momentum_covariance(sample, noise, entry.momentum_covariance);
  if (size_ == 0) {
    // Momentum itself, so that the numbers stay small: only differences are used.
    entry.imbalance = sample.momentum;
    entry.sigma_steps_s2 = 0.0;
  } else {
    const RecordEntry& last = back();
    const double step = sample.stamp_s - last.stamp_s;
    entry.sigma_steps_s2 = last.sigma_steps_s2 + step * step;
    entry.imbalance =
        last.imbalance + sample.momentum - momentum_ - 0.5 * step * (drive_ + sample.drive);
  }
  entry.model_variance = noise.model_sigma.cwiseProduct(sample.sigma).cwiseAbs2();
  drive_ = sample.drive;
  momentum_ = sample.momentum;
  if (size_ < entries_.size()) {
    ++size_;
  } else {
    begin_ = (begin_ + 1) % entries_.size();
  }
  return entry;
}

std::size_t ImbalanceRecord::at_or_before(double stamp_s) const {
  std::size_t low = 0;
  std::size_t high = size_;
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    ((*this)[middle].stamp_s <= stamp_s ? low : high) = middle;
  }
  return low;
}

}  // namespace kinescope::contact
