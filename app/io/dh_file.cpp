// SPDX-License-Identifier: Apache-2.0
#include "app/io/dh_file.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/table_cell.h"

namespace kinescope {
namespace {

// Of DhStep and DhUncertainty::steps, in the columns' order.
struct DhColumn {
  const char* name;
  double DhStep::* value;
  std::size_t number;
  bool between;  // of two axes: in a modified row those of the joint and the one before it
};
constexpr std::array<DhColumn, 5> kDhColumns{{{"a", &DhStep::a, 2, true},
                                              {"alpha", &DhStep::alpha, 3, true},
                                              {"beta", &DhStep::beta, 4, true},
                                              {"theta", &DhStep::theta, 0, false},
                                              {"d", &DhStep::d, 1, false}}};

// The step that a column of a row is of; none: before the first.
std::optional<std::size_t> step_of_cell(std::size_t row, const DhColumn& column,
                                        DhConvention convention) {
  if (convention == DhConvention::kStandard || !column.between) return row;
  if (row == 0) return std::nullopt;
  return row - 1;
}

std::string normal_words(DhNormal normal) {
  switch (normal) {
    case DhNormal::kNone:
    case DhNormal::kCommon:
      return {};
    case DhNormal::kParallel:
      return "axes nearly parallel: no common normal worth the name: beta in place of d";
    case DhNormal::kOneLine:
      return "axes nearly one line: theta and a are ill-conditioned: beta in place of d";
    case DhNormal::kDirection:
      return "parallel to an axis that slides: beta for the direction";
  }
  return {};
}

std::string state_words(NumberState state) {
  switch (state) {
    case NumberState::kEstimated:
    case NumberState::kHeld:
    case NumberState::kOwnUnit:  // of two logs, never of one calibration
      return {};
    case NumberState::kUndetermined:
      return "not determined";
    case NumberState::kNoChannel:
      return "no channel says where it is zero";
  }
  return {};
}

std::string pose_cells(const Pose& pose, const Sigma& translation_m, const Sigma& rotation_rad) {
  const Eigen::Quaterniond& q = pose.rotation;
  const auto expanded = [](const Sigma& sigma) {
    return sigma ? fmt::format("{}", 2.0 * *sigma) : std::string();
  };
  return fmt::format("{},{},{},{},{},{},{},{},{}", pose.translation.x(), pose.translation.y(),
                     pose.translation.z(), q.x(), q.y(), q.z(), q.w(), expanded(translation_m),
                     expanded(rotation_rad));
}

std::string comments(DhConvention convention, bool known, std::string_view written_by) {
  const bool standard = convention == DhConvention::kStandard;
  return fmt::format(
      "# Denavit-Hartenberg parameters, {0} convention, written by {1}\n"
      "# T_base_tip = base T_0_1 .. T_n-1_n tool, {2}\n"
      "# q, the joint's value in the URDF, adds to theta (revolute) or d (prismatic); m and rad\n"
      "# beta (Hayati): of nearly parallel axes, whose d is 0; 0 of others\n"
      "# U_..: expanded uncertainty (k = 2), {3}\n",
      standard ? "standard (distal)" : "modified (Craig; proximal)", written_by,
      standard ? "T_i-1_i = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta)"
               : "T_i-1_i = Tx(a) Rx(alpha) Ry(beta) Rz(theta) Tz(d)",
      known ? "empty where a number was held, is so by construction, or is not determined; of base "
              "and tool of the error's length"
            : "empty: the robot comes from a URDF");
}

}  // namespace

std::vector<DhTableRow> dh_table_rows(const KinematicTree& tree, const DhTable& table,
                                      DhConvention convention) {
  const std::vector<DhStep> rows = dh_rows(table.chain.steps, convention);
  std::vector<DhTableRow> out;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Joint& joint = tree.joints[table.chain.joints[k].index()];
    DhTableRow row{joint.name, joint.type, {}, {}};
    std::vector<std::string> notes;
    if (std::string words = normal_words(rows[k].normal); !words.empty())
      notes.push_back(std::move(words));
    for (const DhColumn& column : kDhColumns) {
      DhCell cell{column.name, rows[k].*column.value, std::nullopt};
      const auto step = step_of_cell(k, column, convention);
      if (table.uncertainty && step) {
        const DhNumber& number = table.uncertainty->steps[*step][column.number];
        if (number.sigma) cell.expanded = 2.0 * *number.sigma;
        if (const std::string words = state_words(number.state); !words.empty())
          notes.push_back(fmt::format("{}: {}", column.name, words));
      }
      row.cells.push_back(cell);
    }
    row.note = fmt::format("{}", fmt::join(notes, "; "));
    out.push_back(std::move(row));
  }
  return out;
}

std::string dh_csv(const KinematicTree& tree, const std::vector<DhTable>& tables,
                   DhConvention convention, std::string_view written_by) {
  const bool known = std::ranges::any_of(
      tables, [](const DhTable& table) { return table.uncertainty.has_value(); });
  std::string out = comments(convention, known, written_by);
  out +=
      "chain,row,type,a,alpha,beta,theta,d,U_a,U_alpha,U_beta,U_theta,U_d,x,y,z,qx,qy,qz,qw,"
      "U_position,U_rotation,note\n";
  for (const DhTable& table : tables) {
    const std::string chain = table_cell(tree.links[table.chain.tip.index()].name);
    const DhUncertainty none;
    const DhUncertainty& u = table.uncertainty ? *table.uncertainty : none;
    out += fmt::format("{},,base,,,,,,,,,,,{},\n", chain,
                       pose_cells(table.chain.base, u.base_translation_m, u.base_rotation_rad));
    for (const DhTableRow& row : dh_table_rows(tree, table, convention)) {
      out += fmt::format("{},{},{}", chain, table_cell(row.joint), to_string(row.type));
      for (const DhCell& cell : row.cells) out += fmt::format(",{}", cell.value);
      for (const DhCell& cell : row.cells)
        out += cell.expanded ? fmt::format(",{}", *cell.expanded) : std::string(",");
      std::string note = row.note;
      std::ranges::replace(note, ';', ' ');
      out += fmt::format(",,,,,,,,,,{}\n", note);
    }
    out += fmt::format("{},,tool,,,,,,,,,,,{},\n", chain,
                       pose_cells(table.chain.tool, u.tool_translation_m, u.tool_rotation_rad));
  }
  return out;
}

}  // namespace kinescope
