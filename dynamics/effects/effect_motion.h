// SPDX-License-Identifier: Apache-2.0
//
// A logged motion as effects see it: finely between the samples, then through the low-pass that the
// torque went through. Friction is no smooth function of the speed; what a filtered log shows of it
// is its low-passed torque, not the friction of the low-passed speed (Gautier 1997, section IV: the
// regressor is filtered as the torque is).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/data/motion.h"
#include "dynamics/data/one_clock.h"
#include "dynamics/data/torque_samples.h"
#include "kinematics/core/memo.h"

namespace kinescope {

/// What motion and torque were filtered with.
struct TorqueFilter {
  LowPass kind = LowPass::kNone;
  double cutoff_hz = 0.0;  ///< -3 dB
};

struct EffectMotionOptions {
  TorqueFilter filter = {};
  int most_instants = 2500;  ///< samples kept, evenly
  /// Rate of the samples that are kept, in cut-offs: what the low-pass has left is then independent
  /// enough to count.
  double samples_per_cutoff = 4.0;
  bool every_sample = false;  ///< all are kept, those at the ends too
};

/// One joint on one trajectory, finely.
struct FinePath {
  Eigen::ArrayXd q;
  Eigen::ArrayXd dq;
  Eigen::ArrayXd ddq;
  Eigen::ArrayXd time_s;  ///< on the laid-out clock (EffectMotion::time_s)
};

class EffectMotion {
 public:
  /// Throws bad_request for arrays that do not fit.
  EffectMotion(TorqueSamples samples, const EffectMotionOptions& options);

  [[nodiscard]] const TorqueSamples& samples() const { return samples_; }
  /// Rows of samples() that are kept: none whose torque is missing, but where every sample is.
  [[nodiscard]] const std::vector<Eigen::Index>& kept() const { return kept_; }
  [[nodiscard]] Eigen::Index instants() const { return static_cast<Eigen::Index>(kept_.size()); }
  [[nodiscard]] Eigen::Index joints() const { return samples_.joints(); }
  [[nodiscard]] const TorqueFilter& filter() const { return options_.filter; }
  /// Of filter_response() (dynamics/data/cutoff.h).
  [[nodiscard]] int filter_order() const;

  /// Of every sample, increasing: trajectories whose clocks start anew are laid one behind the
  /// other.
  [[nodiscard]] const Eigen::VectorXd& time_s() const { return clock_.time_s(); }

  /// Back from it to the log's own clocks.
  [[nodiscard]] const OneClock& clock() const { return clock_; }

  /// A torque that depends on one joint's path, low-passed, at the instants kept. `torque` is
  /// called once a trajectory.
  [[nodiscard]] Eigen::VectorXd column(
      Eigen::Index joint, const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const;
  /// The same of a combination of the joints (weights), as a coupled drive turns.
  [[nodiscard]] Eigen::VectorXd column(
      const Eigen::VectorXd& weights,
      const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const;
  /// A row of every sample, at the instants kept.
  [[nodiscard]] Eigen::VectorXd at_instants(const Eigen::VectorXd& samples) const;
  [[nodiscard]] Eigen::MatrixXd rows_at_instants(const Eigen::MatrixXd& samples) const;
  /// d/dt of a signal of every sample, within trajectories.
  [[nodiscard]] Eigen::VectorXd rate(const Eigen::VectorXd& samples) const;
  /// The signal as it is `later_s` after each sample (cubic between samples; the ends are held).
  [[nodiscard]] Eigen::VectorXd shifted(const Eigen::VectorXd& samples, double later_s) const;

  /// Signals of every sample behind a first-order low-pass (first_order_lag.h), and before it.
  [[nodiscard]] Eigen::VectorXd lagged(const Eigen::VectorXd& samples, double constant_s) const;
  [[nodiscard]] Eigen::VectorXd before_lag(const Eigen::VectorXd& samples, double constant_s) const;
  /// The same of signals at the instants kept (instants x signals).
  [[nodiscard]] Eigen::MatrixXd lagged_at_instants(const Eigen::MatrixXd& signals,
                                                   double constant_s) const;

  /// Instants kept are those for which `wanted` (a sample each) is not 0.
  void leave_out(const std::vector<char>& wanted);

 private:
  struct Piece {
    Eigen::Index begin = 0;
    Eigen::Index rows = 0;
    double step_s = 0.0;
  };
  [[nodiscard]] FinePath fine(const Piece& piece, const Eigen::VectorXd& weights) const;
  [[nodiscard]] std::vector<FinePath> fine_paths(const Eigen::VectorXd& weights) const;
  [[nodiscard]] Eigen::VectorXd column_of(
      const std::vector<FinePath>& paths,
      const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const;
  void lay_out();
  void choose_instants();

  TorqueSamples samples_;
  EffectMotionOptions options_;
  std::vector<Piece> pieces_;
  std::vector<Eigen::Index> kept_;
  OneClock clock_;
  int parts_ = 1;  ///< of a step between samples
  // Of each joint, by piece; made when it is first asked for.
  Memo<Eigen::Index, std::vector<FinePath>> paths_;
};

}  // namespace kinescope
