// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/torque_scale.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "dynamics/data/statistics.h"
#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

constexpr double kClearCorrelation = 0.7;  // a rough model reaches it; chance does not
constexpr double kThousandLow = 100.0;     // a model wrong by a factor 10 is still no factor 1000
// Of friction, rms: what its laws as they are fitted here leave of one that breaks away late and
// winds up (a wrist of a tenth of a newton metre beside 1.2 of friction had "the other sign").
constexpr double kLawsOfFriction = 0.2;
constexpr double kCommonFactor = 1.3;
constexpr double kCommonSpread = 0.15;
constexpr int kLargestLag = 8;          // samples
constexpr double kTorqueLagGain = 0.9;  // of the residual
constexpr double kCoulombSpeed = 0.02;  // of the largest speed: where Coulomb friction turns

/// Least squares of the torque on the model (taken `shift` samples earlier) and friction.
struct Fit {
  double factor = 0.0;
  double explained = 0.0;  ///< of what friction leaves
  double residual = 0.0;
  double model_rms = 0.0;     ///< of what friction leaves of it
  double friction_rms = 0.0;  ///< of the torque, without its offset
};

Fit fit_joint(const TorqueSamples& samples, const Eigen::MatrixXd& predicted, Eigen::Index joint,
              const std::vector<Eigen::Index>& rows, int shift) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd friction(n, 3);
  Eigen::VectorXd model(n), torque(n);
  const double slow = kCoulombSpeed * samples.dq.col(joint).cwiseAbs().maxCoeff() + 1e-12;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index row = rows[static_cast<std::size_t>(k)];
    const double speed = samples.dq(row - shift, joint);
    friction.row(k) << 1.0, speed, std::tanh(speed / slow);
    model(k) = predicted(row - shift, joint);
    torque(k) = samples.torque(row, joint);
  }
  Eigen::MatrixXd both(n, 2);
  both << model, torque;
  const Eigen::MatrixXd fitted = least_squares(friction, both);
  const Eigen::VectorXd model_rest = model - friction * fitted.col(0);
  const Eigen::VectorXd torque_rest = torque - friction * fitted.col(1);
  const double mm = model_rest.squaredNorm();
  const double tt = torque_rest.squaredNorm();
  const double mt = model_rest.dot(torque_rest);
  Fit fit;
  fit.residual = tt;
  if (mm <= 1e-12 * model.squaredNorm() || tt <= 0.0) return fit;
  fit.factor = mt / mm;
  fit.explained = mt / std::sqrt(mm * tt);
  fit.residual = tt - mt * mt / mm;
  const auto samples_root = std::sqrt(static_cast<double>(n));
  fit.model_rms = std::sqrt(mm) / samples_root;
  fit.friction_rms = (friction.rightCols(2) * fitted.col(1).tail(2)).norm() / samples_root;
  return fit;
}

/// Rows whose neighbours up to the largest lag lie in the same trajectory.
std::vector<Eigen::Index> inner_rows(const TorqueSamples& samples) {
  std::vector<Eigen::Index> rows;
  for (Eigen::Index row = kLargestLag; row + kLargestLag < samples.size(); ++row) {
    if (samples.trajectory(row - kLargestLag) == samples.trajectory(row + kLargestLag)) {
      rows.push_back(row);
    }
  }
  return rows;
}

double find_lag(const TorqueSamples& samples, const Eigen::MatrixXd& predicted, Eigen::Index joint,
                const std::vector<Eigen::Index>& rows, double step_s) {
  std::vector<double> residuals;
  for (int shift = -kLargestLag; shift <= kLargestLag; ++shift) {
    residuals.push_back(fit_joint(samples, predicted, joint, rows, shift).residual);
  }
  const auto best =
      static_cast<std::size_t>(std::ranges::min_element(residuals) - residuals.begin());
  if (best == 0 || best + 1 == residuals.size()) return 0.0;
  if (residuals[best] > kTorqueLagGain * residuals[kLargestLag]) return 0.0;
  const double curvature = residuals[best - 1] - 2.0 * residuals[best] + residuals[best + 1];
  const double within =
      curvature > 0.0 ? 0.5 * (residuals[best - 1] - residuals[best + 1]) / curvature : 0.0;
  return (static_cast<double>(best) - kLargestLag + within) * step_s;
}

std::string joint_name(const TorqueSamples& samples, Eigen::Index joint) {
  const auto at = static_cast<std::size_t>(joint);
  return at < samples.joint_names.size() ? samples.joint_names[at] : fmt::format("{}", joint + 1);
}

bool is_turned(const TorqueScale& scale) {
  const double size = std::abs(scale.factor);
  return !scale.of_friction && scale.correlation < -kClearCorrelation && size <= kThousandLow &&
         size >= 1.0 / kThousandLow;
}

/// A joint that moves next to no mass about its axis leaves the whole torque to friction. That of a
/// drive may be many times what it lifts (a light wrist), but a thousandth's unit is beyond it.
bool may_be_a_drives(const TorqueSamples& samples, Eigen::Index joint, double drive_scale) {
  const double rms =
      samples.torque.col(joint).norm() / std::sqrt(static_cast<double>(samples.size()));
  return rms <= kThousandLow * drive_scale;
}

/// "[1, -1, 1]": what turns the joints whose torque goes against the model, and no other. Where
/// several do and none goes with it, it is the log's sign, also of those that do not show it.
std::string turning_factors(const std::vector<TorqueScale>& scales) {
  const auto turned = std::ranges::count_if(scales, is_turned);
  const bool all = turned > 1 && std::ranges::none_of(scales, [](const TorqueScale& scale) {
                     return scale.correlation > kClearCorrelation;
                   });
  std::vector<int> factors;
  for (const TorqueScale& scale : scales) factors.push_back(all || is_turned(scale) ? -1 : 1);
  return fmt::format("[{}]", fmt::join(factors, ", "));
}

void name_scale(const std::string& name, const TorqueScale& scale, bool of_a_drive,
                const std::string& turning, std::vector<LogFinding>& findings) {
  const auto add = [&](FaultWeight weight, double value, std::string what, std::string remedy) {
    findings.push_back(
        {LogFault::kTorqueScale, weight, name, 1.0, value, "", std::move(what), std::move(remedy)});
  };
  if (std::abs(scale.correlation) < kClearCorrelation) return;
  const double size = std::abs(scale.factor);
  if ((size > kThousandLow && of_a_drive) || scale.of_friction) {
    add(FaultWeight::kNote, scale.factor,
        fmt::format("torque of joint '{}' is hardly the model's, as where friction is far more; "
                    "its scale and its sign are not checked",
                    name),
        "nothing to do if the torque is in Nm");
    return;
  }
  if (size > kThousandLow) {
    add(FaultWeight::kRefusal, scale.factor,
        fmt::format("torque of joint '{}' is {:.3g} times what the model says: mNm, or motor units",
                    name, scale.factor),
        "say so in recording.yaml, dynamics: {torque_unit: [mNm]} or {torque_factor: [..]}");
  } else if (size < 1.0 / kThousandLow) {
    add(FaultWeight::kRefusal, scale.factor,
        fmt::format("torque of joint '{}' is {:.3g} times what the model says: kNm, or motor side",
                    name, scale.factor),
        "say so in recording.yaml, dynamics: {torque_unit: [kNm]} or {torque_factor: [..]}");
  } else if (scale.factor < 0.0) {
    add(FaultWeight::kRefusal, scale.factor,
        fmt::format("torque of joint '{}' has the other sign than the model", name),
        fmt::format("say so in recording.yaml, dynamics: {{torque_factor: {0}}}, or "
                    "{{position_factor: {0}}} where it is the position that turns the other way",
                    turning));
  }
  if (scale.lag_s != 0.0) {
    findings.push_back(
        {LogFault::kLag, FaultWeight::kNote, name, 1.0, scale.lag_s, "",
         fmt::format("torque of joint '{}' comes {:.3g} ms {} the model's", name,
                     1e3 * std::abs(scale.lag_s), scale.lag_s > 0 ? "after" : "before"),
         "a delay of the drive or of the recorder"});
  }
}

/// One factor for all joints is a unit or a drive gain, no wrong mass.
void name_common_factor(const std::vector<TorqueScale>& scales, std::vector<LogFinding>& findings) {
  std::vector<double> logs;
  for (const TorqueScale& scale : scales) {
    if (scale.correlation > kClearCorrelation) logs.push_back(std::log(scale.factor));
  }
  if (logs.size() < 3) return;
  const double middle = median_of(logs);
  const double spread = quantile(logs, 0.75) - quantile(logs, 0.25);
  const double size = std::abs(middle);
  if (spread > kCommonSpread || size < std::log(kCommonFactor) || size > std::log(kThousandLow))
    return;
  findings.push_back(
      {LogFault::kTorqueScale, FaultWeight::kWarning, "", 1.0, std::exp(middle), "",
       fmt::format("all torques are {:.3g} times what the model says", std::exp(middle)),
       "a drive gain or torque constant; give it as torque_factor"});
}

}  // namespace

TorqueScales compare_torque_scale(const TorqueSamples& samples, const Eigen::MatrixXd& predicted,
                                  const Eigen::VectorXd& drive_scale) {
  KINESCOPE_CHECK(
      predicted.rows() == samples.torque.rows() && predicted.cols() == samples.torque.cols(),
      "one predicted torque a measured one");
  KINESCOPE_CHECK(drive_scale.size() == 0 || drive_scale.size() == predicted.cols(),
                  "one scale a joint");
  TorqueScales out;
  const std::vector<Eigen::Index> rows = inner_rows(samples);
  const double step_s = median_of(steps_of(samples.t_s, samples.trajectory));
  for (Eigen::Index joint = 0; joint < predicted.cols(); ++joint) {
    TorqueScale scale;
    if (!rows.empty()) {
      const Fit fit = fit_joint(samples, predicted, joint, rows, 0);
      scale.factor = fit.factor;
      scale.correlation = fit.explained;
      const double lag_s = find_lag(samples, predicted, joint, rows, step_s);
      scale.lag_s = std::abs(lag_s) > 0.5 * step_s ? lag_s : 0.0;
      const double rms = predicted.col(joint).norm();
      scale.size_ratio = rms > 0.0 ? samples.torque.col(joint).norm() / rms : 0.0;
      scale.of_friction = fit.model_rms < kLawsOfFriction * fit.friction_rms;
    }
    out.joints.push_back(scale);
  }
  // In another unit friction is as many times the model's torque, on all joints.
  const auto clear = [](const TorqueScale& scale) {
    return std::abs(scale.correlation) >= kClearCorrelation;
  };
  const auto other_unit = std::ranges::count_if(out.joints, [&](const TorqueScale& scale) {
    return clear(scale) && std::abs(scale.factor) > kThousandLow;
  });
  if (2 * other_unit > std::ranges::count_if(out.joints, clear))
    for (TorqueScale& scale : out.joints) scale.of_friction = false;
  const std::string turning = turning_factors(out.joints);
  for (Eigen::Index joint = 0; joint < predicted.cols(); ++joint) {
    name_scale(joint_name(samples, joint), out.joints[static_cast<std::size_t>(joint)],
               drive_scale.size() > 0 && may_be_a_drives(samples, joint, drive_scale[joint]),
               turning, out.findings);
  }
  name_common_factor(out.joints, out.findings);
  return out;
}

}  // namespace kinescope
