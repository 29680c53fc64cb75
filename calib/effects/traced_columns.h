// SPDX-License-Identifier: Apache-2.0
//
// Takes   a joint's value as two columns of a log say it, and where the other joints are.
// Gives   TracedColumns: how the other column differs from the used one, as calib/trace looks at
//         it. A constant is the model; delay, scale, dead band, droop and steps are what it may
//         lack.
// Units   rad or m; one row an instant, other minus used.
// Method  other(t) = used(t + delay) + droop(t) + half the band that the drive was pushed through:
//         Gauss-Newton for the delay and for the drive, which is the other column less the droop;
//         all else is linear. A drive with friction against a springy controller is such a play
//         operator (Visintin 1994, section III.2).
// Not here: which columns are copies (kinematics/structure/copied_channels.h), what a report says
//         of them (second_column.h).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/effects/joint_shares.h"
#include "calib/trace/traced_model.h"

namespace kinescope::effects {

/// A joint's value told twice.
struct ColumnPair {
  std::string column;     ///< name of the other one
  int joint = 0;          ///< of the tree
  JointMotion used;       ///< samples: all joints, as the columns say that the tree was made with
  Eigen::VectorXd other;  ///< samples: the joint's value by the other column
  bool postures = false;  ///< samples are taken at rest: time says nothing
};

class TracedColumns final : public TracedModel {
 public:
  /// `pair` and `tree` outlive this, which outlives its fits. At least one sample.
  TracedColumns(const ColumnPair& pair, const KinematicTree& tree,
                const std::optional<Eigen::Vector3d>& gravity_base);
  [[nodiscard]] TracedFit fit(const std::vector<AddedEffect>& effects) const override;

  /// Instants that are looked at: not all of a long log, none near its ends or gaps.
  [[nodiscard]] Eigen::Index rows() const { return std::ssize(row_s_); }
  /// Standard deviation by which neighbouring instants differ beyond what they share.
  [[nodiscard]] double noise() const { return noise_; }
  /// True where the droop in a fit goes against gravity: the joint is ahead of the other column
  /// where its load pulls it back. False without a known gravity.
  [[nodiscard]] bool is_lifted(const std::vector<AddedEffect>& effects) const;

 private:
  // What the fit is at: where the used column is read, and what the drive is less for the droop.
  struct State {
    double shift_s = 0.0;
    Eigen::VectorXd droop;  // rows
  };
  struct Used {
    Eigen::VectorXd value;  // rows
    Eigen::VectorXd rate;
  };
  // All that columns are made of, at a state.
  struct Shares {
    Used used;
    Eigen::VectorXd delay;         // what reading it later changes, per s
    Eigen::VectorXd acceleration;  // in the largest
    Eigen::MatrixXd loads;         // rows x loads, the largest of each is 1
    Eigen::VectorXd drive;         // samples: the other column less the droop
    std::vector<double> read_s;    // rows: where the used column is read
  };
  using SharesPtr = std::shared_ptr<const Shares>;
  struct Solution {
    SharesPtr shares;
    std::vector<Candidate> candidates;
    Eigen::MatrixXd columns;
    std::vector<Eigen::VectorXd> values;  // of the effects; of the delay a step
    Eigen::VectorXd residual;
  };

  struct Widest {
    Eigen::VectorXd left;  // rows
    double play = 0.0;     // positive where the other column follows
  };

  void choose_rows();
  void take_loads(const std::optional<Eigen::Vector3d>& gravity_base);
  void take_steps();
  void find_start();
  [[nodiscard]] Widest widest(const Shares& shares, double width) const;
  void fit_widest();
  [[nodiscard]] double noise_of(const Eigen::VectorXd& residual) const;

  [[nodiscard]] Shares shares_at(const State& state) const;
  [[nodiscard]] Used used_at(double shift_s) const;
  [[nodiscard]] Eigen::VectorXd acceleration_at(double shift_s) const;
  [[nodiscard]] Eigen::VectorXd at_rows(const Eigen::VectorXd& samples) const;
  [[nodiscard]] Candidate effect(std::string name, std::string words,
                                 std::vector<EffectParameter> parameters) const;
  [[nodiscard]] std::vector<Candidate> candidates(const SharesPtr& shares) const;
  [[nodiscard]] Candidate time_offset(const SharesPtr& shares) const;
  [[nodiscard]] Candidate encoder_scale(const SharesPtr& shares) const;
  [[nodiscard]] Candidate dead_band(const SharesPtr& shares) const;
  // Of a function of the leader and the width: play, or where it began.
  [[nodiscard]] Eigen::VectorXd band_share(const Shares& shares,
                                           Eigen::VectorXd (*share)(const Eigen::VectorXd&, double),
                                           double width) const;
  [[nodiscard]] Candidate droop(const SharesPtr& shares) const;
  [[nodiscard]] Candidate acceleration_lag(const SharesPtr& shares) const;
  [[nodiscard]] Candidate quantisation() const;
  [[nodiscard]] Eigen::MatrixXd own_columns(const Shares& shares,
                                            const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] Solution solve(const State& state, const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] State after(const State& state, const Solution& solution,
                            const std::vector<AddedEffect>& effects) const;
  [[nodiscard]] Linearisation linearise(const Eigen::MatrixXd& columns,
                                        const Eigen::VectorXd& residual) const;

  const ColumnPair* pair_;
  const KinematicTree* tree_;
  std::string name_;
  std::string unit_;
  JointLog used_;                  // the joint's value as a column, to be read between its samples
  std::vector<Eigen::Index> row_;  // samples
  std::vector<double> row_s_;
  double most_shift_s_ = 0.0;
  double bend_s_ = 0.0;  // between the samples that an acceleration is taken from
  double start_shift_s_ = 0.0;
  std::vector<std::string> load_names_;
  Eigen::MatrixXd loads_;       // rows x loads, where the start's shift reads them
  Eigen::VectorXd pull_;        // rows: the same of one mass in the middle of the links
  double step_ = 0.0;           // of the other column; 0: none
  Eigen::VectorXd steps_;       // rows: by how much its steps move it, in steps
  std::vector<double> widths_;  // of dead bands that this motion can show
  bool other_follows_ = false;  // of a dead band: it is the other column's
  double noise_ = 0.0;
};

}  // namespace kinescope::effects
