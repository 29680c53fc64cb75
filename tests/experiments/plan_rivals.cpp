// SPDX-License-Identifier: Apache-2.0
//
// Two effects that a short recording cannot tell apart, and the recording that was planned to part
// them: plan_rivals [--robots N] [--size S]
// The second joint's encoder tells S less of every turn; believed is that, the rival is an encoder
// out of centre. How far the fit with the rival is from the fit with the truth, as the root of the
// difference of chi-square: in the first recording, in the planned one, in a random motion of the
// same length, ranges and speeds; and what the plan promises ("at least").
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <fmt/format.h>

#include "calib/design/plan.h"
#include "tests/experiments/command_line.h"
#include "tests/truth/commanded_world.h"

namespace kinescope {
namespace {

using truth::FilmedRobot;
using truth::RobotKind;
using truth::World;

constexpr double kRate_hz = 20.0;
constexpr double kSigma_px = 0.1;
constexpr double kFirst_s = 5.0, kSecond_s = 10.0;
constexpr double kSmall = 0.3;  // of the ranges: the first recording

FilmedRobot parted_robot(RobotKind kind, int seed, double seconds, double reach) {
  truth::FilmedRobotOptions options;
  options.seed = 9700 + static_cast<std::uint64_t>(seed);
  options.kind = kind;
  options.duration_s = seconds;
  options.amplitude_rad = reach;
  options.tag_size_m = 0.06;
  options.scale = 1.5;
  options.distance_m = 1.6;
  return draw_filmed_robot(options);
}

World with_scale(const FilmedRobot& robot, const JointLog& log, double seconds, double size,
                 std::uint64_t noise) {
  truth::CommandedOptions options;
  options.camera.rate_hz = kRate_hz;
  options.camera.sigma_px = kSigma_px;
  options.noise = noise;
  options.end_s = seconds;
  options.moved = [size](const Eigen::VectorXd& logged) {
    Eigen::VectorXd out = logged;
    out[1] *= 1.0 + size;
    return out;
  };
  return commanded_world(robot, log, options);
}

design::ConsideredEffect scale_of(const std::string& joint) {
  return {{"encoder_scale", joint}, 0.0, {}, {}};
}

design::ConsideredEffect out_of_centre(const std::string& joint) {
  return {{"eccentricity", joint}, 1.0, {}, {}};
}

// The fit of a recording with one effect in it; nothing is an outlier.
Calibration fitted_with(const World& world, const design::ConsideredEffect& effect) {
  design::PlannedRobot robot;
  robot.calibration.tree = world.tree;
  robot.calibration.camera = world.camera;
  ExpectedRecording recording;
  recording.measurements = world.measurements;
  recording.log = world.log;
  CalibrationStart start = truth::perturbed_start(world, 0.003, 0.003, 1);
  start.corrections = corrections_of(robot, recording, effect);
  CalibrateOptions options;
  options.folds = 0;
  options.reject_sigma = 1e3;
  return calibrate(world.measurements, world.markers, world.log, start, options);
}

double chi_square(const Calibration& calibration) {
  double sum = 0.0;
  for (const SightingResidual& residual : calibration.residuals)
    for (const Eigen::Vector2d& corner : residual.corners_px) sum += corner.squaredNorm();
  return sum / (kSigma_px * kSigma_px);
}

// Standard deviations between the two; below zero: the rival fits better.
double apart(const World& world, const std::string& joint) {
  const double difference = chi_square(fitted_with(world, out_of_centre(joint))) -
                            chi_square(fitted_with(world, scale_of(joint)));
  return std::copysign(std::sqrt(std::abs(difference)), difference);
}

design::MotionLimits limits_of(const JointLog& log) {
  design::MotionLimits out;
  const Eigen::MatrixXd rates = resample_rates(log, log.times_s);
  out.velocity = rates.cwiseAbs().colwise().maxCoeff().transpose();
  out.acceleration = 4.0 * out.velocity;  // 1/s: as quick as the sines of a random motion
  for (Eigen::Index j = 0; j < log.values.cols(); ++j)
    out.range.push_back({log.values.col(j).minCoeff(), log.values.col(j).maxCoeff()});
  return out;
}

void one_pair(RobotKind kind, int seed, double size) {
  const FilmedRobot robot = parted_robot(kind, seed, kSecond_s, 1.0);
  const JointLog first_log = rig_log(parted_robot(kind, seed, kFirst_s, kSmall), 200.0);
  const JointLog random_log = rig_log(robot, 200.0);
  const std::string joint = robot.tree.joints[1].name;
  const World first = with_scale(robot, first_log, kFirst_s, size, 1);
  design::PlannedRobot planned;
  planned.calibration = fitted_with(first, scale_of(joint));
  design::ConsideredEffect believed = scale_of(joint);
  believed.values = Eigen::VectorXd::Constant(1, size);
  believed.references = Eigen::VectorXd::Ones(1);
  planned.effects = {believed};
  planned.rivals = {out_of_centre(joint)};
  planned.noise.all_px = kSigma_px;
  planned.sight.most_tilt_rad = 1.3;
  const design::JointSpace space(planned.calibration.tree, limits_of(random_log));
  design::PlanOptions options;
  options.seconds = kSecond_s;
  options.frame_rate_hz = kRate_hz;
  const design::RecordingPlan plan = plan_recording(planned, space, {{0, 0}}, options);
  const JointLog log = recording_along(planned, space, *plan.path, kRate_hz).log;
  fmt::print("{:7}_{}  first {:6.1f}  promised at least {:6.1f}  planned {:6.1f}  random {:6.1f}\n",
             to_string(kind), seed, apart(first, joint),
             plan.rivals.front().sigmas_apart.value_or(0.0),
             apart(with_scale(robot, log, kSecond_s, size, 2), joint),
             apart(with_scale(robot, random_log, kSecond_s, size, 3), joint));
  std::fflush(stdout);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  using namespace kinescope;
  int robots = 2;
  double size = 0.02;
  CLI::App app("Rival effects before and after a planned recording");
  app.add_option("--robots", robots);
  app.add_option("--size", size);
  return run_experiment(app, argc, argv, [&] {
    for (int seed = 0; seed < robots; ++seed)
      for (const RobotKind kind : {RobotKind::kArm3, RobotKind::kArm6, RobotKind::kScara})
        one_pair(kind, seed, size);
  });
}
