// SPDX-License-Identifier: Apache-2.0
//
// Denavit-Hartenberg tables of a run's robot, with uncertainties, or of a URDF's.
#include <algorithm>

#include <fmt/format.h>

#include "app/commands/export_form.h"
#include "app/io/dh_file.h"
#include "app/io/nearest_name.h"
#include "app/io/output_folder.h"
#include "app/report/result_values.h"
#include "kinematics/urdf/urdf.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

// The robot, and how well its numbers are known where a run calibrated it.
struct DescribedRobot {
  KinematicTree tree;
  std::optional<Calibration> calibration;
  fs::path file;
};

DescribedRobot described_robot(const fs::path& source) {
  std::error_code error;
  if (!fs::is_directory(source, error)) return {read_urdf(source), std::nullopt, source};
  Calibration calibration = read_stored_run(source).calibration;
  KinematicTree tree = calibration.tree;
  return {std::move(tree), std::move(calibration), source / "calibration.json"};
}

bool is_moved(const KinematicTree& tree, LinkId link) {
  return std::ranges::any_of(tree.path_to(link),
                             [&](JointId id) { return is_movable(tree.joints[id.index()]); });
}

std::vector<LinkId> described_tips(const KinematicTree& tree, const std::string& tip,
                                   const fs::path& source) {
  if (tip.empty()) {
    std::vector<LinkId> out = chain_tips(tree);
    if (!out.empty()) return out;
    throw bad_input(source.string(), "the robot has no joint that moves",
                    "give a robot with revolute or prismatic joints");
  }
  std::vector<std::string> names;
  for (const Link& link : tree.links) names.push_back(link.name);
  const auto link = tree.link(tip);
  if (!link)
    throw bad_request("--tip", fmt::format("no link is named '{}'", tip), did_you_mean(tip, names));
  if (!is_moved(tree, *link))
    throw bad_request("--tip", fmt::format("no joint moves the link '{}'", tip),
                      "name a link behind a joint that moves");
  return {*link};
}

nlohmann::json chain_json(const KinematicTree& tree, const DhTable& table,
                          DhConvention convention) {
  nlohmann::json rows = nlohmann::json::array();
  for (const DhTableRow& row : dh_table_rows(tree, table, convention)) {
    nlohmann::json one{{"joint", report::text(row.joint)},
                       {"type", std::string(to_string(row.type))},
                       {"note", row.note}};
    for (const DhCell& cell : row.cells) {
      one[cell.name] = report::number(cell.value);
      one[fmt::format("U_{}", cell.name)] =
          cell.expanded ? report::number(*cell.expanded) : nlohmann::json(nullptr);
    }
    rows.push_back(std::move(one));
  }
  return {{"tip", report::text(tree.links[table.chain.tip.index()].name)},
          {"base", report::pose(table.chain.base)},
          {"rows", rows},
          {"tool", report::pose(table.chain.tool)}};
}

}  // namespace

ExportForm export_dh(const ExportOptions& options) {
  const DescribedRobot robot = described_robot(options.source);
  require_new_file(options.dh, "--dh", {robot.file}, options.force);
  std::vector<DhTable> tables;
  nlohmann::json chains = nlohmann::json::array();
  ExportForm out;
  for (const LinkId tip : described_tips(robot.tree, options.tip, robot.file)) {
    DhTable table{dh_chain(robot.tree, tip), std::nullopt};
    if (robot.calibration)
      table.uncertainty = dh_uncertainty(value_of(robot.calibration), table.chain);
    for (std::size_t k = 0; k < table.chain.steps.size(); ++k) {
      if (table.chain.steps[k].normal != DhNormal::kOneLine) continue;
      out.warnings.push_back(fmt::format(
          "the axes of {} and {} are nearly one line: theta and a between them are ill-conditioned",
          robot.tree.joints[table.chain.joints[k].index()].name,
          robot.tree.joints[table.chain.joints[k + 1].index()].name));
    }
    chains.push_back(chain_json(robot.tree, table, options.dh_convention));
    tables.push_back(std::move(table));
  }
  out.files.push_back({options.dh, dh_csv(robot.tree, tables, options.dh_convention,
                                          "Kinescope " + program_version())});
  const std::string convention =
      options.dh_convention == DhConvention::kStandard ? "standard" : "modified";
  out.result["dh"] = {
      {"file", report::text(options.dh.string())}, {"convention", convention}, {"chains", chains}};
  out.lines = {fmt::format("dh      {} ({} chain{}, {} convention{})", options.dh.string(),
                           tables.size(), tables.size() == 1 ? "" : "s", convention,
                           robot.calibration ? ", with uncertainties" : "")};
  return out;
}

}  // namespace kinescope
