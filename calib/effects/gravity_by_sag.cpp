// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/gravity_by_sag.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "calib/effects/joint_shares.h"
#include "calib/trace/score_test.h"
#include "calib/trace/stage.h"
#include "kinematics/core/error.h"

namespace kinescope::effects {
namespace {

constexpr double kFirstStep = 0.4;    // rad, of half the way between the directions tried first
constexpr double kLastStep = 0.0005;  // rad: axes that stand nearly upright show little more of it

// The columns of a joint's sag for any gravity: loads are linear in it.
class SagColumns {
 public:
  SagColumns(const EffectWorld& world, const Linearisation& linear, int joint, int carrier)
      : carrier_(carrier) {
    for (std::size_t k = 0; k < loads_.size(); ++k) {
      const Eigen::Vector3d along = Eigen::Vector3d::Unit(static_cast<Eigen::Index>(k));
      for (const Load& load : gravity_loads(world.tree, world.loaded, joint, along))
        loads_[k].push_back(read_at(world.frames.times_s, load.arm_m,
                                    {linear.time_s.begin(), linear.time_s.end()}));
    }
  }

  [[nodiscard]] std::vector<EffectColumn> under(const Eigen::Vector3d& gravity) const {
    std::vector<EffectColumn> out;
    for (std::size_t p = 0; p < loads_[0].size(); ++p) {
      out.push_back({carrier_, gravity.x() * loads_[0][p] + gravity.y() * loads_[1][p] +
                                   gravity.z() * loads_[2][p]});
    }
    return out;
  }

 private:
  int carrier_;
  std::array<std::vector<Eigen::VectorXd>, 3> loads_;  // under gravity along x, y, z
};

// Half of the directions to a cube's corners, edges and faces: the other half says the same.
std::vector<Eigen::Vector3d> first_directions() {
  std::vector<Eigen::Vector3d> out;
  for (const int z : {0, 1}) {
    for (const int y : {-1, 0, 1}) {
      for (const int x : {-1, 0, 1}) {
        if (z == 1 || y == 1 || (y == 0 && x == 1))
          out.push_back(Eigen::Vector3d(x, y, z).normalized());
      }
    }
  }
  return out;
}

}  // namespace

GravityBySag gravity_by_sag(const TracedBundle& bundle, const std::vector<AddedEffect>& start,
                            const EffectId& sag) {
  const trace::StagePtr stage = trace::make_stage(bundle, start);
  std::vector<AddedEffect> with_sag = start;
  with_sag.push_back({sag, 0.0});
  const EffectWorld world = bundle.world_of(with_sag);
  const std::optional<JointId> joint = world.tree.joint(sag.place);
  const Candidate* one_mass = trace::find_candidate(stage->fit, sag);
  KINESCOPE_CHECK(joint && one_mass != nullptr, "a joint of the tree sags");
  const std::vector<EffectColumn> lumped = one_mass->columns(0.0);
  const SagColumns columns(world, stage->fit.linear, joint->value, lumped.front().carrier);
  const auto gain = [&](const Eigen::Vector3d& gravity) {
    return trace::gain_of(stage->system, columns.under(gravity));
  };
  Eigen::Vector3d best = Eigen::Vector3d::UnitZ();
  double most = -1.0;
  const auto take = [&](const Eigen::Vector3d& gravity) {
    const double explained = gain(gravity);
    if (explained <= most) return false;
    most = explained;
    best = gravity;
    return true;
  };
  for (const Eigen::Vector3d& direction : first_directions()) take(direction);
  for (double step = kFirstStep; step > kLastStep;) {
    const Eigen::Quaterniond R = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), best);
    bool moved = false;
    for (const auto& [x, y] : {std::pair{step, 0.0}, {-step, 0.0}, {0.0, step}, {0.0, -step}})
      moved = take((R * Eigen::Vector3d(x, y, 1.0)).normalized()) || moved;
    if (!moved) step *= 0.5;
  }
  const FittedEffect single = bundle.corrected(with_sag, {}).effects.back();
  const Eigen::VectorXd pull = single.values.cwiseQuotient(single.references);
  return {pull.dot(best) < 0.0 ? Eigen::Vector3d(-best) : best, most};
}

}  // namespace kinescope::effects
