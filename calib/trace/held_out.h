// SPDX-License-Identifier: Apache-2.0
//
// Errors on instants that the parameters have not seen. Leaving a fold out is one Gauss-Newton step
// from the solution, taken with the sums of the others.
#pragma once

#include "calib/trace/normal_system.h"
#include "calib/trace/trace.h"

namespace kinescope::trace {

/// Squared errors of every instant, its fold held out.
struct HeldOutInstants {
  Eigen::VectorXd whitened;
  Eigen::VectorXd squared;  ///< in the square of the residual's unit
  Eigen::VectorXd points;
};
/// With an effect's columns beside the model's own.
[[nodiscard]] HeldOutInstants held_out_instants(const NormalSystem& system,
                                                const std::vector<EffectColumn>& columns = {});

/// Root mean square distance with a 95 % interval from the scatter of the stretches.
[[nodiscard]] HeldOutError held_out_error(const NormalSystem& system,
                                          const HeldOutInstants& errors);

/// Student's t of the stretches' differences `worse - better`; 0 where they do not differ. Values
/// are by instant.
[[nodiscard]] double paired_t(const Partition& partition, const Eigen::VectorXd& worse,
                              const Eigen::VectorXd& better);
/// Of that t by chance, one side.
[[nodiscard]] double paired_p_value(const Partition& partition, const Eigen::VectorXd& worse,
                                    const Eigen::VectorXd& better);
/// The first of two, by whitened squared errors of every instant: no refit need say so.
[[nodiscard]] bool predicts_clearly_worse(const Partition& partition, const Eigen::VectorXd& one,
                                          const Eigen::VectorXd& other);
/// The first of two traces of the same measurements, by what their effects leave.
[[nodiscard]] bool predicts_clearly_worse(const Trace& one, const Trace& other);

}  // namespace kinescope::trace
