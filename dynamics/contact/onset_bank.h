// SPDX-License-Identifier: Apache-2.0
//
// Did a contact begin, and when? For each candidate onset the likelihood that an external torque
// has acted since, constant or growing steadily, against none, maximised over the torque: the
// generalised likelihood ratio on the innovations of a Kalman filter. Willsky and Jones 1976.
#pragma once

#include <vector>

#include "dynamics/contact/balance_filter.h"

namespace kinescope::contact {

/// Ages of candidates in samples fall into octaves, 1, 2 to 3, 4 to 7, ..; in each octave four
/// onsets of constant torques are kept and two of growing ones. The best of each octave:
struct OctaveBest {
  double statistic = 0.0;  ///< twice the log of the likelihood ratio, see octave()
  int age = 0;             ///< samples since the candidate's onset; 0: no candidate yet
};

class OnsetBank {
 public:
  OnsetBank(Eigen::Index joints, int longest_age);

  /// Forgets all candidates.
  void clear();
  /// After BalanceFilter::advance(): one more sample, one more candidate. Does not allocate.
  void advance(const BalanceFilter& filter);

  [[nodiscard]] int octaves() const { return static_cast<int>(best_.size()); }
  /// A contact on link k moves joints 1..k only; the ratio with the remaining torques zero is s_k,
  /// chi-square with k degrees of freedom without contact. The statistic is the largest of
  /// s_k + (q_n - q_k), q the quantiles that a chi-square variable passes with probability 1e-7.
  [[nodiscard]] const OctaveBest& octave(int k) const { return best_[static_cast<std::size_t>(k)]; }

 private:
  struct Candidate {
    long long onset = 0;
    bool grows = false;
    int age = 1;
  };

  void age_candidates();
  void add_candidate(bool grows);
  [[nodiscard]] double evaluate(Eigen::Index slot, const Eigen::VectorXd& innovation);

  Eigen::Index n_;
  int longest_age_;
  Eigen::Index used_ = 0;
  long long now_ = 0;
  std::vector<Candidate> candidates_;
  /// n x n blocks side by side, one a candidate: what a unit torque since the onset has done to
  /// p and d beyond what the filter has followed, and its information.
  Eigen::MatrixXd error_p_, error_d_, information_, white_;
  Eigen::MatrixXd score_;   ///< one column a candidate
  Eigen::MatrixXd factor_;  ///< work space of evaluate()
  Eigen::VectorXd c_;
  Eigen::VectorXd bonus_;  ///< q_n - q_k
  std::vector<OctaveBest> best_;
};

}  // namespace kinescope::contact
