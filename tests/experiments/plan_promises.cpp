// SPDX-License-Identifier: Apache-2.0
//
// What a plan promises against what its recording gives, on simulated robots:
//   plan_promises [--robots N] [--noises N] [--first-seed N] [--robot KIND] [--first S]
//                 [--seconds S] [--postures N] [--sigma PX]
// For every robot a short recording in a small part of its ranges, a plan from it, and the planned
// recording made and calibrated together with the first, once for every noise. Beside it a random
// motion of the same length, ranges and speeds. Uncertainty of the tip over the joints' ranges,
// rms, among one another (calib/design/goal.h):
//   promised   by the plan, of the first noise
//   claimed    by the covariance of both recordings together, rms over the noises
//   true       distance to the truth, rms over noises and postures
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "calib/design/information.h"
#include "calib/design/plan.h"
#include "tests/experiments/command_line.h"
#include "tests/truth/commanded_world.h"
#include "tests/truth/joined_recordings.h"

namespace kinescope {
namespace {

using truth::FilmedRobot;
using truth::RobotKind;
using truth::World;

constexpr double kRate_hz = 20.0;
constexpr double kTilt_rad = 1.3;  // the simulated tags are found up to 1.318

struct PlanRequest {
  int robots = 3;
  int noises = 8;
  int first_seed = 0;
  std::vector<RobotKind> kinds{truth::kRobotKinds.begin(), truth::kRobotKinds.end()};
  double first_s = 5.0;
  double seconds = 10.0;
  int postures = 0;
  double sigma_px = 0.1;
};

truth::FilmedRobotOptions robot_options(RobotKind kind, int seed, double seconds, double reach) {
  truth::FilmedRobotOptions out;
  out.seed = 9500 + static_cast<std::uint64_t>(seed);
  out.kind = kind;
  out.duration_s = seconds;
  out.amplitude_rad = reach;
  out.tag_size_m = 0.06;
  out.scale = 1.5;
  out.distance_m = 1.6;
  return out;
}

World filmed_world(const FilmedRobot& robot, const JointLog& log, double seconds, double clock_s,
                   std::uint64_t noise, const PlanRequest& request) {
  truth::CommandedOptions options;
  options.camera.rate_hz = kRate_hz;
  options.camera.clock_s = clock_s;
  options.camera.sigma_px = request.sigma_px;
  options.noise = noise;
  options.end_s = seconds;
  return commanded_world(robot, log, options);
}

Calibration calibrated_worlds(const std::vector<World>& worlds, std::uint64_t seed) {
  const truth::JoinedRecordings joined = truth::joined_recordings(worlds);
  CalibrateOptions options;
  options.folds = 0;
  return calibrate(joined.measurements, worlds.front().markers, joined.log,
                   truth::perturbed_starts(worlds, seed), options);
}

// Its residuals say how exact corners are.
double corner_sigma(const Calibration& calibration) {
  return calibration.final_rms / std::sqrt(2.0);
}

design::PlannedRobot planned_robot(Calibration calibration) {
  design::PlannedRobot out;
  out.noise.all_px = corner_sigma(calibration);
  out.sight.most_tilt_rad = kTilt_rad;
  out.calibration = std::move(calibration);
  return out;
}

// The ranges and the speeds of a motion: the plan keeps to what the random one does.
design::MotionLimits limits_of(const FilmedRobot& robot, const JointLog& log) {
  design::MotionLimits out;
  const auto joints = std::ssize(robot.tree.joints);
  out.velocity = Eigen::VectorXd::Zero(joints);
  out.acceleration = Eigen::VectorXd::Zero(joints);
  const Eigen::MatrixXd rates = resample_rates(log, log.times_s);
  for (Eigen::Index j = 0; j < joints; ++j) {
    out.range.push_back({log.values.col(j).minCoeff(), log.values.col(j).maxCoeff()});
    out.velocity[j] = rates.col(j).cwiseAbs().maxCoeff();
    for (Eigen::Index i = 1; i < rates.rows(); ++i) {
      const double step_s =
          log.times_s[static_cast<std::size_t>(i)] - log.times_s[static_cast<std::size_t>(i) - 1];
      out.acceleration[j] =
          std::max(out.acceleration[j], std::abs(rates(i, j) - rates(i - 1, j)) / step_s);
    }
  }
  return out;
}

JointLog log_of_plan(const design::PlannedRobot& robot, const design::JointSpace& space,
                     const design::RecordingPlan& plan) {
  return recording_along(robot, space, *plan.path, kRate_hz).log;
}

// Tips in the base, over the same postures as the goal's.
struct TipScale {
  std::vector<Eigen::VectorXd> postures;

  [[nodiscard]] static std::vector<Eigen::Vector3d> at(const KinematicTree& tree,
                                                       const std::vector<Eigen::VectorXd>& values) {
    std::vector<Eigen::Vector3d> out;
    for (const Eigen::VectorXd& q : values) {
      const auto links = forward_kinematics(tree, q);
      for (const Marker& marker : tree.markers) {
        const bool carries = std::ranges::any_of(
            tree.joints, [&](const Joint& joint) { return joint.parent == marker.link; });
        if (!carries && marker.link.value != 0)
          out.push_back((links[marker.link.index()] * marker.T_link_marker).translation);
      }
    }
    return out;
  }

  // Mean square distance after the rigid motion that makes it smallest (Umeyama 1991).
  [[nodiscard]] double square_m2(const KinematicTree& truth, const KinematicTree& found) const {
    const std::vector<Eigen::Vector3d> a = at(truth, postures);
    const std::vector<Eigen::Vector3d> b = at(found, postures);
    Eigen::Matrix3Xd A(3, std::ssize(a)), B(3, std::ssize(b));
    for (std::size_t i = 0; i < a.size(); ++i) {
      A.col(static_cast<Eigen::Index>(i)) = a[i];
      B.col(static_cast<Eigen::Index>(i)) = b[i];
    }
    const Eigen::Matrix4d T = Eigen::umeyama(B, A, false);
    const Eigen::Matrix3Xd moved =
        (T.topLeftCorner<3, 3>() * B).colwise() + T.topRightCorner<3, 1>();
    return (moved - A).colwise().squaredNorm().mean();
  }
};

struct Outcome {
  double claimed_square = 0.0, true_square = 0.0;
  std::vector<double> axis_ratios;  // claimed over promised, places among one another
  int count = 0;
  [[nodiscard]] double claimed() const { return std::sqrt(claimed_square / count); }
  [[nodiscard]] double truth() const { return std::sqrt(true_square / count); }
};

double goal_by(const Calibration& calibration, const design::PlannedRobot& robot,
               const design::JointSpace& space, std::vector<JointEstimate>* axes) {
  const Eigen::MatrixXd information =
      design::known_information(calibration, calibration.parameters);
  const Eigen::MatrixXd covariance = design::covariance_of(information);
  Rng rng = Rng::from_name("goal", 1);
  design::PlannedRobot own = robot;
  own.calibration = calibration;
  const Eigen::MatrixXd root =
      goal_root(design::Goal::kTip, own, space, calibration.parameters, rng);
  if (axes != nullptr)
    *axes = axes_by_covariance(calibration, calibration.parameters, covariance,
                               space.values(space.middle()));
  return std::sqrt(root.cwiseProduct(covariance * root).sum());
}

struct Case {
  FilmedRobot robot;
  JointLog first_log;
  const PlanRequest& request;
};

// The first recording with another one, once for every noise.
Outcome made(const Case& what, const JointLog& log, double seconds,
             const design::PlannedRobot& robot, const design::JointSpace& space,
             const TipScale& scale, const design::Promise* promise) {
  Outcome out;
  for (int n = 0; n < what.request.noises; ++n) {
    const auto seed = static_cast<std::uint64_t>(n);
    const std::vector<World> worlds{
        filmed_world(what.robot, what.first_log, what.request.first_s, 0.05, 2 * seed,
                     what.request),
        filmed_world(what.robot, log, seconds, -0.1, 2 * seed + 1, what.request)};
    const Calibration both = calibrated_worlds(worlds, seed);
    std::vector<JointEstimate> axes;
    const double claimed = goal_by(both, robot, space, &axes);
    out.claimed_square += claimed * claimed;
    out.true_square += scale.square_m2(what.robot.tree, both.tree);
    ++out.count;
    for (std::size_t j = 0; promise != nullptr && j < axes.size(); ++j) {
      const Sigma& now = axes[j].among_position_sigma_m;
      const Sigma& then = promise->axes[j].among_position_sigma_m;
      if (now && then && *then > 0.0) out.axis_ratios.push_back(*now / *then);
    }
  }
  return out;
}

struct Totals {
  std::vector<double> claimed, truth, gain;  // over the promise; random over planned
};

void one_robot(RobotKind kind, int seed, const PlanRequest& request, Totals& totals) {
  constexpr double kSmall = 0.4;  // of the ranges: the first recording
  Case what{draw_filmed_robot(robot_options(kind, seed, request.seconds, 1.0)),
            rig_log(draw_filmed_robot(robot_options(kind, seed, request.first_s, kSmall)), 200.0),
            request};
  const JointLog random = rig_log(what.robot, 200.0);
  const Calibration first = calibrated_worlds(
      {filmed_world(what.robot, what.first_log, request.first_s, 0.05, 0, request)}, 0);
  const std::string name = fmt::format("{}_{}", to_string(kind), seed);
  if (first.status != CalibrationStatus::kConverged) {
    fmt::print("{:10} first recording: {}\n", name, first.status_reason);
    return;
  }
  const design::PlannedRobot robot = planned_robot(first);
  const design::JointSpace space(first.tree, limits_of(what.robot, random));
  design::PlanOptions options;
  options.seconds = request.seconds;
  options.frame_rate_hz = kRate_hz;
  const design::RecordingPlan plan = plan_recording(robot, space, {}, options);
  TipScale scale;
  Rng rng = Rng::from_name("scale", 1);
  while (scale.postures.size() < 100)
    if (const auto draw = space.draw(rng)) scale.postures.push_back(space.values(*draw));
  const Outcome planned = made(what, log_of_plan(robot, space, plan), request.seconds, robot, space,
                               scale, &plan.after);
  const Outcome at_random = made(what, random, request.seconds, robot, space, scale, nullptr);
  const double promised = plan.after.goal_m;
  std::vector<double> ratios = planned.axis_ratios;
  std::ranges::sort(ratios);
  fmt::print(
      "{:10} {:3} stops  before {:8.4f} mm  promised {:7.4f}  claimed {:7.4f} ({:4.2f})  true "
      "{:7.4f} "
      "({:4.2f})  axes claimed/promised {:4.2f} to {:4.2f}  random: claimed {:7.4f} true {:7.4f}\n",
      name, plan.postures.size(), 1e3 * plan.before.goal_m, 1e3 * promised, 1e3 * planned.claimed(),
      planned.claimed() / promised, 1e3 * planned.truth(), planned.truth() / promised,
      ratios.empty() ? 0.0 : ratios.front(), ratios.empty() ? 0.0 : ratios.back(),
      1e3 * at_random.claimed(), 1e3 * at_random.truth());
  std::fflush(stdout);
  totals.claimed.push_back(planned.claimed() / promised);
  totals.truth.push_back(planned.truth() / promised);
  totals.gain.push_back(at_random.truth() / planned.truth());
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

void print_totals(const char* what, const std::vector<double>& ratios) {
  const auto within =
      std::ranges::count_if(ratios, [](double ratio) { return std::abs(ratio - 1.0) <= 0.2; });
  fmt::print("SUMMARY {} over promised: rms {:.3f}, {:.2f} to {:.2f}, within 20 % {} of {}\n", what,
             root_mean_square(ratios), std::ranges::min(ratios), std::ranges::max(ratios), within,
             ratios.size());
}

void run_plans(const PlanRequest& request) {
  Totals totals;
  for (int seed = request.first_seed; seed < request.first_seed + request.robots; ++seed)
    for (const RobotKind kind : request.kinds) one_robot(kind, seed, request, totals);
  if (totals.claimed.empty()) return;
  print_totals("claimed", totals.claimed);
  print_totals("true", totals.truth);
  fmt::print(
      "SUMMARY true error of a random motion of the same length over the planned one: rms "
      "{:.2f}, {:.2f} to {:.2f}\n",
      root_mean_square(totals.gain), std::ranges::min(totals.gain), std::ranges::max(totals.gain));
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  PlanRequest request;
  std::string kind;
  CLI::App app("What plans promise against what their recordings give");
  app.add_option("--robots", request.robots);
  app.add_option("--noises", request.noises);
  app.add_option("--first-seed", request.first_seed);
  app.add_option("--robot", kind);
  app.add_option("--first", request.first_s);
  app.add_option("--seconds", request.seconds);
  app.add_option("--sigma", request.sigma_px);
  return run_experiment(app, argc, argv, [&] {
    if (!kind.empty())
      std::erase_if(request.kinds, [&](RobotKind k) { return to_string(k) != kind; });
    run_plans(request);
  });
}
