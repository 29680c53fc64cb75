// SPDX-License-Identifier: Apache-2.0
//
// The last stretch of the accumulated imbalance I(t) = p(t) - p(0) - integral of drive dt, the
// impulse of everything that the balance does not know.
#pragma once

#include <vector>

#include "dynamics/contact/balance_filter.h"

namespace kinescope::contact {

struct RecordEntry {
  double stamp_s = 0.0;
  double sigma_steps_s2 = 0.0;  ///< sum of squared steps: times torque_sigma^2 the torque's noise
  Eigen::VectorXd imbalance;
  Eigen::MatrixXd momentum_covariance;
  Eigen::VectorXd model_variance;              ///< of the model's error in torque, unconditional
  Eigen::VectorXd error_mean, error_variance;  ///< of the model's error as filtered up to here
};

/// A ring of entries; index 0 is the oldest that is kept. Does not allocate after construction.
class ImbalanceRecord {
 public:
  ImbalanceRecord(Eigen::Index joints, std::size_t capacity);

  void clear() { size_ = 0; }
  /// After the filter has advanced to (or started at) the sample.
  void append(const BalanceSample& sample, const BalanceFilter& filter);
  /// For samples that the filter is not shown: repeats the last entry's model error.
  void append_unfiltered(const BalanceSample& sample, const BalanceNoise& noise);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] const RecordEntry& operator[](std::size_t k) const {
    return entries_[(begin_ + k) % entries_.size()];
  }
  [[nodiscard]] const RecordEntry& back() const { return (*this)[size_ - 1]; }
  /// Index of the last entry at or before the time; 0 when all are later.
  [[nodiscard]] std::size_t at_or_before(double stamp_s) const;

 private:
  RecordEntry& add(const BalanceSample& sample, const BalanceNoise& noise);

  std::vector<RecordEntry> entries_;
  std::size_t begin_ = 0;
  std::size_t size_ = 0;
  Eigen::VectorXd drive_, momentum_;  ///< of the last sample
};

}  // namespace kinescope::contact
