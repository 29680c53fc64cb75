// SPDX-License-Identifier: Apache-2.0
//
// Denavit-Hartenberg tables as files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/quality/dh_uncertainty.h"
#include "kinematics/model/denavit_hartenberg.h"

namespace kinescope {

struct DhTable {
  DhChain chain;
  std::optional<DhUncertainty> uncertainty;  ///< none: of a robot that no run calibrated
};

/// A number of a row, in the order of the file's columns.
struct DhCell {
  const char* name = "";  ///< "a", "alpha", "beta", "theta", "d"
  double value = 0.0;
  Sigma expanded;  ///< k = 2
};

struct DhTableRow {
  std::string joint;
  JointType type = JointType::kRevolute;
  std::vector<DhCell> cells;
  std::string note;  ///< what is ill-conditioned, held or not determined; may be empty
};

/// One row a joint of the chain.
[[nodiscard]] std::vector<DhTableRow> dh_table_rows(const KinematicTree& tree, const DhTable& table,
                                                    DhConvention convention);

/// Chains one after the other, each a row `base`, a row a joint and a row `tool`. The convention
/// stands in comments above. Forward kinematics follows from the file alone, to 1e-9.
[[nodiscard]] std::string dh_csv(const KinematicTree& tree, const std::vector<DhTable>& tables,
                                 DhConvention convention, std::string_view written_by);

}  // namespace kinescope
