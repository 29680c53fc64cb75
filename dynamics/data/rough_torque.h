// SPDX-License-Identifier: Apache-2.0
//
// A model of a joint's torque that needs no robot, good enough to judge filters by.
#pragma once

#include <Eigen/Core>

namespace kinescope {

/// Columns of a linear model of the torque of `joint` without its inertia: offset, viscous and
/// Coulomb friction (tanh of the speed over `width`), and gravity as sines and cosines of all
/// positions. `q`, `dq`: samples x joints. Samples x (3 + 2 joints).
[[nodiscard]] Eigen::MatrixXd rough_torque_features(const Eigen::MatrixXd& q,
                                                    const Eigen::MatrixXd& dq, Eigen::Index joint,
                                                    double width);

/// Speed within which the friction of a joint with these speeds may turn round and be told from
/// viscous friction: a tenth of what it exceeds a tenth of the time. 0 of a joint at rest.
[[nodiscard]] double narrow_width(const Eigen::VectorXd& speed);

}  // namespace kinescope
