// SPDX-License-Identifier: Apache-2.0
//
// Which column of a table is which joint's what.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamics/data/column_names.h"
#include "dynamics/data/torque_log.h"

namespace kinescope {

/// The columns of one quantity, one a joint.
struct SignalColumns {
  std::vector<Eigen::Index> columns;           ///< of the table; empty where not logged
  std::vector<std::vector<std::string>> keys;  ///< what the names call the joints
  std::vector<std::string> units;              ///< as the names say, empty where they do not
  LoggedOrigin origin = LoggedOrigin::kPlain;
  LoggedQuantity quantity = LoggedQuantity::kPosition;
  bool named = false;  ///< by the mapping

  [[nodiscard]] bool empty() const { return columns.empty(); }
};

/// The columns of a quantity: those that the mapping lists, else those that the names give, from
/// the best origin down to `worst`. Throws bad_request for a listed column that is not there.
[[nodiscard]] SignalColumns find_signal(const ChannelTable& table,
                                        const std::vector<std::string>& listed,
                                        LoggedQuantity quantity, LoggedOrigin worst);

/// The commanded positions, where the log has them.
[[nodiscard]] SignalColumns find_position_commands(const ChannelTable& table);

/// For each wanted joint the place among `keys`, or throws bad_input that names both lists and the
/// option.
struct JointMatch {
  std::vector<std::size_t> order;
  bool by_order = false;  ///< nothing but the order says which is which
};
[[nodiscard]] JointMatch match_joints(const std::vector<std::vector<std::string>>& keys,
                                      const std::vector<WantedJoint>& wanted,
                                      const LogMapping& mapping, const std::string& where);

/// What the log calls a joint, as text: "arm_1".
[[nodiscard]] std::string key_text(const std::vector<std::string>& key);

}  // namespace kinescope
