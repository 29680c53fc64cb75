// SPDX-License-Identifier: Apache-2.0
//
// A linearised model as sums: everything that tests of effects need of thousands of rows, by
// stretch of time and by fold.
#pragma once

#include <utility>
#include <vector>

#include "calib/trace/local_elimination.h"
#include "calib/trace/partition.h"
#include "calib/trace/traced_model.h"
#include "kinematics/core/memo.h"

namespace kinescope::trace {

/// Directions of the model's own parameters below this (scaled) are not seen by the data.
inline constexpr double kUnseen = 1e-13;

/// Inverse of a symmetric positive semidefinite matrix whose directions below `floor` of the
/// largest (diagonal scaled to 1) are left out.
[[nodiscard]] Eigen::MatrixXd scaled_pseudo_inverse(const Eigen::MatrixXd& matrix, double floor);

class NormalSystem {
 public:
  /// Keeps a reference to `linear`.
  /// `linear` has to outlive it.
  NormalSystem(const Linearisation& linear, Partition partition);
  NormalSystem(const Linearisation&& linear, Partition partition) = delete;

  [[nodiscard]] const Linearisation& linear() const { return *linear_; }
  [[nodiscard]] const Partition& partition() const { return partition_; }
  [[nodiscard]] const std::vector<GroupSums>& stretches() const { return stretches_; }
  [[nodiscard]] const std::vector<GroupSums>& folds() const { return folds_; }
  [[nodiscard]] const GroupSums& total() const { return total_; }
  /// (J'J + prior)^-1, directions that the data do not show left out.
  [[nodiscard]] const Eigen::MatrixXd& inverse() const { return inverse_; }
  /// Of the model's own parameters to where the sum of squares is least.
  [[nodiscard]] const Eigen::VectorXd& step() const { return step_; }
  [[nodiscard]] Eigen::Index parameters() const { return total_.g.size(); }
  /// How many parameters the data determine, the local ones among them.
  [[nodiscard]] double spent() const;
  /// Rows beyond those; 1 at the least.
  [[nodiscard]] double freedom() const;
  /// Instants that say the same, in the mean, because noise lasts; 1 where it does not.
  [[nodiscard]] double memory() const;

  /// Sums over all rows.
  [[nodiscard]] EffectSums sums(const std::vector<EffectColumn>& columns) const;
  /// The same for several effects, which costs less than one after the other.
  [[nodiscard]] std::vector<EffectSums> sums(
      const std::vector<std::vector<EffectColumn>>& effects) const;
  /// Sums over each stretch.
  [[nodiscard]] std::vector<EffectSums> stretch_sums(
      const std::vector<EffectColumn>& columns) const;
  /// Sums over each fold.
  [[nodiscard]] std::vector<EffectSums> fold_sums(const std::vector<EffectColumn>& columns) const;
  /// By how much columns move the prediction where they take `gain` from the whitened sum of
  /// squares: the same shift of every row they touch would take as much; in the residual's unit.
  [[nodiscard]] double shift_of(double gain, const std::vector<EffectColumn>& columns) const;

  /// The same as a share of each row's own noise.
  [[nodiscard]] double noise_share_of(double gain, const std::vector<EffectColumn>& columns) const;

  /// Rows that the carriers of columns touch while their share is not zero, and the squares of the
  /// residual there where the model's parameters moved by `delta` and the columns have the size
  /// `theta`.
  struct Touched {
    double rows = 0.0;
    double squares = 0.0;
  };
  [[nodiscard]] Touched touched_after(const Eigen::VectorXd& delta,
                                      const std::vector<EffectColumn>& columns,
                                      const Eigen::VectorXd& theta) const;
  /// What columns of the size `theta` do to every row.
  [[nodiscard]] Eigen::VectorXd moved_by(const std::vector<EffectColumn>& columns,
                                         const Eigen::VectorXd& theta) const;
  /// Rows' values less what the local parameters make of them.
  [[nodiscard]] Eigen::VectorXd freed(Eigen::VectorXd rows) const {
    return local_.freed(std::move(rows));
  }

 private:
  // Of one carrier at each instant: carrier'residual, carrier'J, and of the rows it touches the
  // weight (in the inverse square of the residual's unit).
  struct CarrierSums {
    Eigen::VectorXd with_residual;
    RowMatrix with_jacobian;  // instants x parameters
    LocalProducts with_local;
    Eigen::VectorXd weight;
  };
  [[nodiscard]] const CarrierSums& carrier(int index) const;
  [[nodiscard]] CarrierSums carrier_sums(int index) const;
  [[nodiscard]] const Eigen::VectorXd& product(int a, int b) const;
  [[nodiscard]] Eigen::VectorXd products_of(int a, int b) const;
  [[nodiscard]] std::vector<EffectSums> grouped_sums(const std::vector<EffectColumn>& columns,
                                                     const std::vector<int>& group,
                                                     int groups) const;
  [[nodiscard]] std::vector<const LocalProducts*> local_products(
      const std::vector<EffectColumn>& columns) const;
  [[nodiscard]] Eigen::VectorXd share_of(const EffectColumn& column) const;
  [[nodiscard]] std::vector<bool> touches(const std::vector<EffectColumn>& columns) const;

  const Linearisation* linear_;
  Partition partition_;
  std::vector<int> instant_;  // of every row
  LocalElimination local_;
  std::vector<GroupSums> stretches_;
  std::vector<GroupSums> folds_;
  GroupSums total_;
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd step_;
  Memo<int, CarrierSums> carriers_;
  Memo<std::pair<int, int>, Eigen::VectorXd> products_;
};

}  // namespace kinescope::trace
