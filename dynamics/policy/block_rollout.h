// SPDX-License-Identifier: Apache-2.0
//
// One block of particles over the horizon, with its tape and reverse sweep; internal. Everything is
// allocated once; a block's rows are a multiple of eight.
#pragma once

#include <vector>

#include "dynamics/policy/particles.h"
#include "dynamics/policy/velocity_posterior.h"

namespace kinescope::policy {

/// The model as rollouts read it.
struct PreparedModel {
  explicit PreparedModel(const VelocityModel& model);
  StateLayout layout;
  std::vector<VelocityPosterior> posteriors;
  std::shared_ptr<const PhysicsFeatures> physics;
  Eigen::Index features = 0;  ///< F
  Eigen::Index columns = 0;   ///< D = F + U
  Eigen::Index linear = 0;    ///< of the kernels' linear factors; 0: none
};

/// What the random numbers of one evaluation are functions of.
struct RolloutDraws {
  std::uint64_t seed = 1;
  std::uint32_t step = 0;
  double dropout = 0.0;
};

class BlockRollout {
 public:
  BlockRollout(const PreparedModel& model, const PolicyTask& task, Eigen::Index basis_count,
               Eigen::Index rows);

  /// Particles first .. first + rows - 1. `with_tape`: for backward().
  void forward(const PreparedPolicy& policy, const RolloutDraws& draws, Eigen::Index first,
               bool with_tape);
  /// Adds the gradient of sum_i weights_i * sum over the time of the cost of particle i.
  void backward(const PreparedPolicy& policy, const Eigen::VectorXd& weights,
                PolicyGradient& gradient);

  /// rows x (steps + 1), of the last forward().
  [[nodiscard]] const Eigen::MatrixXd& costs() const { return costs_; }
  [[nodiscard]] const TrueStates& states(int time) const { return states_[as_index(time)]; }
  [[nodiscard]] const Eigen::MatrixXd& inputs(int time) const {
    return tape_[as_index(time)].input;
  }

 private:
  struct TimeTape {
    Eigen::MatrixXd seen_features;  // rows x F
    Eigen::MatrixXd scaled;         // rows x F, over the policy's length scales
    Eigen::MatrixXd basis;          // rows x even(B)
    Eigen::MatrixXd input;          // rows x U
    Eigen::MatrixXd model_input;    // rows x D
    Eigen::MatrixXd linear;         // rows x G, where physics has features
    Eigen::MatrixXd normals;        // rows x P
    std::vector<PosteriorTape> processes;
  };

  static std::size_t as_index(int time) { return static_cast<std::size_t>(time); }
  void draw_start(const RolloutDraws& draws, Eigen::Index first);
  void act(const PreparedPolicy& policy, const RolloutDraws& draws, Eigen::Index first, int time);
  void advance(const RolloutDraws& draws, Eigen::Index first, int time, bool with_tape);
  void pull_back_advance(int time);
  void pull_back_act(const PreparedPolicy& policy, int time, PolicyGradient& gradient);
  [[nodiscard]] ConstBlock linear_of(const TimeTape& tape) const;

  const PreparedModel& model_;
  const PolicyTask& task_;
  Eigen::Index rows_;
  ParticleFilter filter_;
  std::vector<TrueStates> states_;
  std::vector<TimeTape> tape_;
  SeenStates seen_;
  Eigen::MatrixXd costs_;
  Eigen::MatrixXd measurement_normals_;
  std::vector<PosteriorScratch> scratch_;  // one a process
  Eigen::MatrixXd d_state_;                // rows x 2 P
  Eigen::MatrixXd d_before_;
  Eigen::MatrixXd d_increment_;
  Eigen::MatrixXd d_mean_;
  Eigen::MatrixXd d_deviation_;
  Eigen::MatrixXd d_model_input_;
  Eigen::MatrixXd d_linear_;
  Eigen::MatrixXd d_scaled_;
  Eigen::MatrixXd d_input_;
  Eigen::MatrixXd d_seen_;
};

}  // namespace kinescope::policy
