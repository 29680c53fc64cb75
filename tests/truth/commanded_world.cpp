// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/commanded_world.h"

#include "tests/truth/seen_tag.h"

namespace kinescope::truth {
namespace {

std::vector<double> frame_times(const JointLog& log, const CommandedOptions& options) {
  if (options.postures) return log.times_s;
  std::vector<double> out;
  for (int f = 0;; ++f) {
    const double t = options.begin_s + f / options.camera.rate_hz;
    if (t > options.end_s) return out;
    out.push_back(t);
  }
}

}  // namespace

World commanded_world(const FilmedRobot& robot, const JointLog& log,
                      const CommandedOptions& options) {
  World world;
  world.tree = robot.tree;
  world.camera = robot.camera;
  world.markers = robot.markers;
  world.log = log;
  world.T_camera_base = robot.T_camera_base;
  Rng rng = Rng::from_name("commanded", options.noise);
  const std::vector<double> times_s = frame_times(log, options);
  const Eigen::MatrixXd logged = options.postures ? log.values : resample(log, times_s);
  world.joint_values = logged;
  for (Eigen::Index f = 0; f < logged.rows(); ++f) {
    const double t = times_s[static_cast<std::size_t>(f)];
    world.measurements.times_s.push_back(options.postures ? t : t - options.camera.clock_s);
    if (options.moved) world.joint_values.row(f) = options.moved(logged.row(f));
    const std::vector<Pose> links = forward_kinematics(robot.tree, world.joint_values.row(f));
    for (const Marker& marker : robot.tree.markers) {
      auto tag = seen_tag(world, marker,
                          world.T_camera_base * links[marker.link.index()] * marker.T_link_marker,
                          options.camera.sigma_px, rng);
      if (!tag) continue;
      tag->frame = static_cast<int>(f);
      world.measurements.corners.push_back(std::move(*tag));
    }
  }
  return world;
}

}  // namespace kinescope::truth
