// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/carrier_torques.h"

#include <algorithm>

#include "dynamics/effects/candidates.h"

namespace kinescope::effects {
namespace {

using Torques = std::vector<JointTorques>;

void put_joints(const EffectContext& context, const Carriers& carriers, Torques& out) {
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(context.instants());
  for (std::size_t j = 0; j < context.joints.size(); ++j) {
    out[static_cast<std::size_t>(carriers.joint(j))][j] = ones;
    if (j + 1 == context.joints.size()) continue;
    for (const bool sum : {true, false}) {
      JointTorques& both = out[static_cast<std::size_t>(carriers.pair(j, sum))];
      both[j] = ones;
      both[j + 1] = sum ? ones : -ones;
    }
  }
}

/// Torque a degree of tilt: d torque / d gravity times the way gravity moves.
void put_gravity(const EffectContext& context, const std::array<Eigen::MatrixXd, 3>& slopes,
                 const Carriers& carriers, Torques& out) {
  const Eigen::Vector3d& gravity = context.rigid.gravity_m_s2;
  if (!(gravity.norm() > 0.0)) return;
  Eigen::Matrix<double, 3, 2 + kGravityStarts> moves;
  moves.leftCols<2>() = context.gravity_moves;
  const auto starts = gravity_starts();
  for (int k = 0; k < kGravityStarts; ++k) {
    const Eigen::Vector2d& start = starts[static_cast<std::size_t>(k)];
    moves.col(2 + k) = (tilted(gravity, start) - gravity) / std::max(1.0, start.norm());
  }
  for (int k = 0; k < moves.cols(); ++k) {
    JointTorques& own = out[static_cast<std::size_t>(carriers.gravity(k))];
    for (std::size_t j = 0; j < own.size(); ++j) {
      const auto joint = static_cast<Eigen::Index>(j);
      own[j] = slopes[0].col(joint) * moves(0, k) + slopes[1].col(joint) * moves(1, k) +
               slopes[2].col(joint) * moves(2, k);
    }
  }
}

void put_bodies(const EffectContext& context, const std::vector<Eigen::MatrixXd>& regressors,
                const Carriers& carriers, Torques& out) {
  const std::vector<int> bodies = tips(context.rigid);
  for (std::size_t t = 0; t < bodies.size(); ++t) {
    for (int k = 0; k < 10; ++k) {
      JointTorques& own = out[static_cast<std::size_t>(carriers.body(static_cast<int>(t), k))];
      for (std::size_t j = 0; j < own.size(); ++j) {
        const auto column = regressors[j].col(10 * bodies[t] + k);
        if (!column.isZero(0.0)) own[j] = column;
      }
    }
  }
}

}  // namespace

std::vector<JointTorques> carrier_torques(const EffectContext& context,
                                          const std::array<Eigen::MatrixXd, 3>& slopes,
                                          const std::vector<Eigen::MatrixXd>& regressors) {
  const std::size_t joints = context.joints.size();
  const Carriers carriers{static_cast<Eigen::Index>(joints)};
  const int count = carriers.count(static_cast<int>(tips(context.rigid).size()));
  Torques out(static_cast<std::size_t>(count), JointTorques(joints));
  put_joints(context, carriers, out);
  put_gravity(context, slopes, carriers, out);
  put_bodies(context, regressors, carriers, out);
  return out;
}

Eigen::SparseMatrix<double> sparse_carriers(const std::vector<JointTorques>& torques,
                                            Eigen::Index instants) {
  const auto joints = std::ssize(torques.front());
  const Carriers carriers{joints};
  Eigen::SparseMatrix<double> out(instants * joints, std::ssize(torques));
  out.reserve(Eigen::VectorXi::Constant(out.cols(), static_cast<int>(out.rows())));
  for (int c = 0; c < out.cols(); ++c) {
    // Gravity acts at every instant, be it by nothing; rows are counted by the entries.
    const bool always = c >= carriers.gravity(0) && c < carriers.body(0, 0);
    const JointTorques& own = torques[static_cast<std::size_t>(c)];
    for (Eigen::Index i = 0; i < instants; ++i) {
      for (Eigen::Index j = 0; j < joints; ++j) {
        const Eigen::VectorXd& torque = own[static_cast<std::size_t>(j)];
        if (torque.size() == 0 || (torque[i] == 0.0 && !always)) continue;
        out.insert(i * joints + j, c) = torque[i];
      }
    }
  }
  out.makeCompressed();
  return out;
}

}  // namespace kinescope::effects
