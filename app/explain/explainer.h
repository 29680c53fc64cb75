// SPDX-License-Identifier: Apache-2.0
//
// One account of one evidence, as explain.h says; which evidence, explain.cpp decides.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/explain/explain.h"

namespace kinescope {

/// The best account of this evidence.
[[nodiscard]] Explanation explained(const Evidence& evidence, const ExplainOptions& options,
                                    std::vector<std::string>& warnings);

/// The best structure with its parameters, effects apart.
[[nodiscard]] Explanation plainly_explained(const Evidence& evidence,
                                            const ExplainOptions& options);

/// The robot and the effects of an account of other evidence, fitted to this; nothing where that
/// found no robot.
[[nodiscard]] std::optional<Explanation> carried_over(const Evidence& evidence,
                                                      const ExplainOptions& options,
                                                      const Explanation& of);

/// Of one piece: nothing is in doubt, nothing is left.
[[nodiscard]] bool is_settled(const Explanation& of);

/// Clearly more probable, over all measurements that there are; of two that are about as probable,
/// the one that is of one piece, or else the plainer one.
[[nodiscard]] bool is_better(const Explanation& one, const Explanation& other,
                             const Measurements& measurements);

/// Which frames it had unseen together: those are what its rivals are to predict, too. Cuts of the
/// space of their own joints leave out other frames, and are worth as much as an effect (80 of log
/// odds: `undeclared`, 10097).
[[nodiscard]] std::vector<int> folds_of(const Calibration& calibration);

}  // namespace kinescope
