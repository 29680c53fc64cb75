// SPDX-License-Identifier: Apache-2.0
//
// Structure that no known effect explains and that depends on a place which every row has of its
// own (a corner's in the image): a vector field, as a Gaussian process.
#pragma once

#include <optional>
#include <vector>

#include "calib/trace/field_grid.h"
#include "calib/trace/rest.h"

namespace kinescope::trace {

/// Probability that noise of zero mean, independent from one stretch to the next but one, agrees
/// over the stretches about a smooth field as much as the residual does; over all lengths of
/// smoothness tried. A kernel's U-statistic (Liu, Lin and Ghosh 2007) under changes of the
/// stretches' signs (Cameron, Gelbach and Miller 2008).
[[nodiscard]] double field_p_value(const NormalSystem& system, const FieldGrid& grid);

/// True where one of the fields is significant at `level` over all of them.
[[nodiscard]] bool shows_field(const NormalSystem& system, const std::vector<RestField>& fields,
                               double level);

/// The field that explains most, where it is significant at `level` over all of them, moves the
/// rows by more than its floor, and earns its place.
[[nodiscard]] std::optional<FoundRest> find_field(const NormalSystem& system,
                                                  const std::vector<RestField>& fields,
                                                  double level);

}  // namespace kinescope::trace
