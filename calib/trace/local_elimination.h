// SPDX-License-Identifier: Apache-2.0
//
// Takes   a linearised model with local parameters (where in its step an encoder stands), and the
//         groups in which its rows are summed.
// Gives   what is left of sums over rows when the local parameters follow whatever is asked of the
//         others.
// Method  Schur complement, part by part: the instants of one stretch and one fold. One that bears
//         on two parts is two.
#pragma once

#include <utility>
#include <vector>

#include "calib/trace/partition.h"

namespace kinescope::trace {

/// J'J, J'r and r'r over the rows of a group; over all of them J'r less what priors pull.
struct GroupSums {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  double rr = 0.0;
};

/// The same of an effect's columns E beside the model's own J: J'E, E'E, E'r.
struct EffectSums {
  Eigen::MatrixXd JE;
  Eigen::MatrixXd EE;
  Eigen::VectorXd Er;
};

/// Products of a carrier with the local parameters: instants x local parameters.
using LocalProducts = Eigen::SparseMatrix<double, Eigen::RowMajor>;

class LocalElimination {
 public:
  /// Instants of one stretch and one fold.
  struct Part {
    int stretch = 0;
    int fold = 0;
    std::vector<std::size_t> instants;
  };

  LocalElimination() = default;
  /// Keeps a reference to `linear`.
  LocalElimination(const Linearisation& linear, std::vector<Part> parts);

  [[nodiscard]] bool empty() const { return parts_.empty(); }
  [[nodiscard]] std::size_t parts() const { return parts_.size(); }
  [[nodiscard]] const Part& part(std::size_t p) const { return parts_[p].part; }
  /// How many of them the data determine: what they take of the rows' freedom.
  [[nodiscard]] double determined() const { return determined_; }

  /// Of the sums over a part's rows.
  void eliminate(std::size_t p, GroupSums& sums) const;
  /// What a part's local parameters take of columns whose carriers have these products, `shares`
  /// instants x columns: here x columns, for take().
  [[nodiscard]] Eigen::MatrixXd taken(std::size_t p,
                                      const std::vector<const LocalProducts*>& products,
                                      const Eigen::MatrixXd& shares) const;
  /// Of the sums over a part's rows of such columns.
  void take(std::size_t p, const Eigen::Ref<const Eigen::MatrixXd>& taken, EffectSums& sums) const;
  /// Rows' values less what the local parameters make of them.
  [[nodiscard]] Eigen::VectorXd freed(Eigen::VectorXd rows) const;
  /// The residual with the local parameters at their best beside what it holds now.
  [[nodiscard]] Eigen::VectorXd residual() const;

 private:
  struct Local {
    Part part;
    std::vector<Eigen::Index> rows;
    std::vector<int> of_local;  ///< number here of every local parameter; -1: not here
    Eigen::MatrixXd L;          ///< Cholesky factor of C'C with the priors
    Eigen::MatrixXd K;          ///< rows x here: C L^-T; they take K K' of the rows
    Eigen::MatrixXd KJ;         ///< here x parameters
    Eigen::VectorXd Ks;         ///< of what the residual holds beyond their best
  };
  [[nodiscard]] Local local_of(Part part) const;

  const Linearisation* linear_ = nullptr;
  std::vector<Local> parts_;
  double determined_ = 0.0;
};

}  // namespace kinescope::trace
