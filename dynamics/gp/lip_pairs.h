// SPDX-License-Identifier: Apache-2.0
//
// The arithmetic of the LIP kernel for one sample against a strip of eight, internal. Energies are
// products P(dq, dq') R(q, q'), R a product over joints; derivatives of R come from prefix and
// suffix products, so that a pair costs 3 to 5 kflop at seven joints, and the gradient by all
// parameters about three times that (one reverse sweep).
#pragma once

#include <array>

#include "dynamics/gp/lip_kernel.h"

namespace kinescope::gp::lip_pairs {

inline constexpr int kLanes = 8;
inline constexpr int kMax = kLipMaxJoints;

struct alignas(64) Lane {
  double v[kLanes];
};

/// Eight samples side by side; `cosine` is q and `sine` unused for joints that slide.
struct Strip {
  std::array<Lane, kMax> cosine;
  std::array<Lane, kMax> sine;
  std::array<Lane, kMax> velocity;
  std::array<Lane, kMax> acceleration;
};

/// One sample.
struct Sample {
  std::array<double, kMax> cosine;
  std::array<double, kMax> sine;
  std::array<double, kMax> velocity;
  std::array<double, kMax> acceleration;
};

/// Weights of one energy: (cos, sin) of every joint, or (q, 0).
struct Weights {
  std::array<double, kMax> velocity;
  std::array<double, kMax> cosine;
  std::array<double, kMax> sine;
};

/// Derivatives by those weights, summed lane by lane.
struct WeightGradient {
  std::array<Lane, kMax> velocity;
  std::array<Lane, kMax> cosine;
  std::array<Lane, kMax> sine;
};

using Torques = std::array<std::array<Lane, kMax>, kMax>;  ///< [torque of strip][torque of sample]

/// k += torque covariance from the kinetic energy of link `link`, which joints 0 .. link move.
void add_kinetic(const JointKinds& kinds, int link, const Weights& weights, const Strip& x,
                 const Sample& y, Torques& k);
/// gradient += d/d weights of sum_ab q_ab k_ab.
void contract_kinetic(const JointKinds& kinds, int link, const Weights& weights, const Strip& x,
                      const Sample& y, const Torques& q, WeightGradient& gradient);
/// The same for potential energy, of unit scale.
void add_potential(const JointKinds& kinds, const Weights& weights, double scale, const Strip& x,
                   const Sample& y, Torques& k);
/// `by_scale` += d/d scale.
void contract_potential(const JointKinds& kinds, const Weights& weights, double scale,
                        const Strip& x, const Sample& y, const Torques& q, WeightGradient& gradient,
                        Lane& by_scale);

}  // namespace kinescope::gp::lip_pairs
