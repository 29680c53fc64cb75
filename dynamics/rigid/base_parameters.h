// SPDX-License-Identifier: Apache-2.0
//
// The combinations of the inertial parameters that the torque depends on, and nothing else: the
// base parameters. Found numerically from the regressor at random states. Gautier 1991.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/rigid/rigid_model.h"

namespace kinescope {

/// Which columns of a matrix W are kept, and how the others are regrouped on them: W = W(:, kept) *
/// regroup, so W x = W(:, kept) (regroup x).
struct ColumnBasis {
  std::vector<int> kept;            ///< independent columns, increasing
  Eigen::MatrixXd regroup;          ///< kept x columns; the identity on the kept ones
  std::vector<int> without_effect;  ///< columns that are zero, or rounding beside the largest
  Eigen::VectorXd
      singular_values;  ///< of W with unit columns, decreasing; the gap shows how sure the rank is
};

/// Columns in the order of `preference` (all of them) are kept when they are independent of those
/// kept before; the rank is that of a column-pivoted QR of W with unit columns, relative
/// `tolerance`. Columns below `tolerance` of the largest have no effect.
[[nodiscard]] ColumnBasis independent_columns(const Eigen::MatrixXd& W,
                                              const std::vector<int>& preference, double tolerance);

/// Base parameters of a robot. base = regroup * body_parameters(model), and Y * body_parameters =
/// Y(:, kept) * base for every state.
struct BaseParameters {
  ColumnBasis basis;
  std::vector<std::string>
      names;  ///< formula of each in the bodies' parameters: "Izz(link2) + 0.16 m(link3)"

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(basis.kept.size()); }
};

struct BaseParameterOptions {
  /// Relative to the largest pivot. Rounding leaves about 1e-14 x columns; lengths of a millimetre
  /// in a robot of a metre enter squared, as 1e-6.
  double tolerance = 1e-9;
  std::uint64_t seed =
      1;  ///< of the random states; the result does not depend on it but for rounding
};

/// For the geometry and gravity of the model; masses do not matter. States: q within half a turn
/// (or 0.5 m), rates and accelerations within 1 (rad or m per s, s^2) times sqrt(gravity).
[[nodiscard]] BaseParameters base_parameters(const RigidModel& model,
                                             const BaseParameterOptions& options = {});

/// Order in which the columns of a regressor are kept: moments first, the mass last, links from the
/// base outwards, so that what depends on others is regrouped towards the base, as by hand (Khalil
/// and Dombre 2002, table 9.4).
[[nodiscard]] std::vector<int> usual_preference(const RigidModel& model);

/// Random states at which every term of the dynamics acts, samples x joints.
struct RandomMotion {
  Eigen::MatrixXd q;
  Eigen::MatrixXd dq;
  Eigen::MatrixXd ddq;
};
[[nodiscard]] RandomMotion random_motion(const RigidModel& model, Eigen::Index samples,
                                         std::uint64_t seed);

/// "Izz(link2) + 0.16 m(link3)": one row of a regrouping in words, coefficients with `digits`
/// digits.
[[nodiscard]] std::string combination_name(const Eigen::VectorXd& row,
                                           const std::vector<std::string>& names, int kept,
                                           int digits = 4);

/// "m(link1)", .. for all bodies, in the order of body_parameters().
[[nodiscard]] std::vector<std::string> body_parameter_names(const RigidModel& model);

}  // namespace kinescope
