// SPDX-License-Identifier: Apache-2.0
//
// The LIP kernel's finitely many features, internal: the Lagrange operator on every monomial of the
// energies. Few for two joints (about a hundred), too many beyond three.
#pragma once

#include "dynamics/gp/kernel_node.h"
#include "dynamics/gp/lip_kernel.h"

namespace kinescope::gp {

/// Where each parameter of the kernel stands.
struct LipLayout {
  struct Position {
    Eigen::Index cosine = 0;  ///< of q itself where the joint slides
    Eigen::Index sine = -1;   ///< -1 where it slides
  };
  struct Link {
    std::vector<Eigen::Index> velocity;
    std::vector<Position> positions;
  };

  explicit LipLayout(const JointKinds& joints);

  std::vector<Link> links;
  Eigen::Index scale = 0;
  std::vector<Position> potential;
  Eigen::Index count = 0;
};

[[nodiscard]] double lip_feature_count(const JointKinds& joints);
[[nodiscard]] Basis lip_features(const JointKinds& joints, const LipLayout& layout,
                                 const Inputs& inputs);

}  // namespace kinescope::gp
