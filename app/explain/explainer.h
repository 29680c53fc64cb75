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

/// The same of a part of it, which may lack what was declared: then only why.
[[nodiscard]] Explanation explained_part(const Evidence& part, const ExplainOptions& options,
                                         std::vector<std::string>& warnings);

}  // namespace kinescope
