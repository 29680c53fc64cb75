// SPDX-License-Identifier: Apache-2.0
//
// One account of one evidence, as explain.h says; which evidence, explain.cpp decides.
#pragma once

#include <string>
#include <vector>

#include "app/explain/explain.h"

namespace kinescope {

/// The best account of this evidence.
[[nodiscard]] Explanation explained(const Evidence& evidence, const ExplainOptions& options,
                                    std::vector<std::string>& warnings);

}  // namespace kinescope
