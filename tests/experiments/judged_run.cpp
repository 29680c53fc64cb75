// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/judged_run.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/calibration_file.h"
#include "kinematics/core/file.h"
#include "tests/truth/axis_errors.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Links as joints on the way to each marker: what a structure says.
using Ways = std::map<int, std::vector<std::pair<std::string, bool>>>;

Ways ways_of(const KinematicTree& tree, const std::set<int>& ids) {
  Ways out;
  for (const Marker& marker : tree.markers) {
    if (!ids.contains(marker.id.value)) continue;
    auto& way = out[marker.id.value];
    for (const JointId id : tree.path_to(marker.link)) {
      const Joint& joint = tree.joints[id.index()];
      way.emplace_back(joint.channel, joint.type == JointType::kPrismatic);
    }
  }
  return out;
}

// The found axes beside the true ones, every channel at zero, in the base that one of its markers
// gives; nothing where joints are others.
std::optional<truth::AxisDifferences> compare_by(TagId base_id, KinematicTree truth,
                                                 const Calibration& found) {
  const auto base = std::ranges::find(truth.markers, base_id, &Marker::id);
  Calibration at_zero;
  at_zero.tree = found.tree;
  std::iter_swap(at_zero.tree.markers.begin(),
                 std::ranges::find(at_zero.tree.markers, base->id, &Marker::id));
  std::iter_swap(truth.markers.begin(), base);
  const auto zeros = [](const KinematicTree& tree) {
    return Eigen::VectorXd(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(tree.joints.size())));
  };
  at_zero.joint_values = zeros(truth).transpose();
  const std::vector<Pose> links = forward_kinematics(found.tree, zeros(found.tree));
  for (const Joint& joint : truth.joints) {
    const auto same = std::ranges::find(found.tree.joints, joint.channel, &Joint::channel);
    if (same == found.tree.joints.end()) return std::nullopt;
    const Pose T = links[same->parent.index()] * same->T_parent_joint;
    JointEstimate estimate;
    estimate.axis_base = T.rotation * same->axis;
    estimate.point_base = T.translation;
    at_zero.joints.push_back(estimate);
  }
  return truth::axis_differences(truth, at_zero);
}

std::optional<truth::AxisDifferences> compare(const KinematicTree& truth,
                                              const Calibration& found) {
  const auto base = std::ranges::find_if(truth.markers, [&](const Marker& marker) {
    return marker.link.value == 0 && found.tree.marker(marker.id) != nullptr;
  });
  if (base == truth.markers.end()) return std::nullopt;
  return compare_by(base->id, truth, found);
}

// Standard uncertainty of each axis' place among the axes, mm, by channel.
std::map<std::string, double> claims_of(const json& result) {
  std::map<std::string, double> out;
  for (const json& joint : result.at("calibration").at("joints")) {
    const json expanded = joint.value("among_position_expanded_m", json());
    if (expanded.is_number())
      out[joint.at("channel").get<std::string>()] = 1e3 * expanded.get<double>() / 2.0;
  }
  return out;
}

void judge_axes(const KinematicTree& truth, const Calibration& found, const json& result,
                JudgedRun& out) {
  const auto differences = compare(truth, found);
  if (!differences) return;
  std::vector<double> claimed, errors;
  const std::map<std::string, double> claims = claims_of(result);
  for (std::size_t j = 0; j < truth.joints.size(); ++j) {
    const auto claim = claims.find(truth.joints[j].channel);
    if (claim == claims.end() || !differences->among[j].position_m) continue;
    claimed.push_back(claim->second);
    errors.push_back(1e3 * *differences->among[j].position_m);
    ++out.axes;
    out.within += errors.back() <= 2.0 * claimed.back();
  }
  out.claimed_mm = rms(claimed);
  out.true_mm = rms(errors);
}

JudgedRun judge(int code, const fs::path& run, const KinematicTree& truth, Markers markers) {
  JudgedRun out;
  out.code = code;
  if (!fs::exists(run / "calibration.json")) return out;
  const json result = json::parse(read_text_file(run / "result.json"));
  const Calibration found = read_calibration(run / "calibration.json");
  std::set<int> ids;
  // A marker that was stuck on anew is there twice, once under another id.
  for (const Marker& marker : found.tree.markers)
    if (truth.marker(marker.id) != nullptr) ids.insert(marker.id.value);
  const bool all = ids.size() == truth.markers.size() || markers == Markers::kThoseFound;
  out.structure = all && found.tree.joints.size() >= truth.joints.size() &&
                  ways_of(truth, ids) == ways_of(found.tree, ids);
  out.held_out_px = result.at("calibration").at("held_out_rms").get<double>();
  if (out.structure) judge_axes(truth, found, result, out);
  const json trace = json::parse(read_text_file(run / "trace.json"));
  out.verdict = trace.at("verdict").get<std::string>();
  for (const json& effect : trace.at("accepted"))
    out.effects += fmt::format(" {} at {}", effect.at("effect").get<std::string>(),
                               effect.at("place").get<std::string>());
  return out;
}

}  // namespace

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(values.size()));
}

JudgedRun judged_run(RunOptions options, const fs::path& folder, const KinematicTree& truth,
                     Markers markers) {
  options.output = folder;
  Console console;
  console.quiet = true;
  try {
    return judge(static_cast<int>(run_command(options, console)), folder, truth, markers);
  } catch (const Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return judge(static_cast<int>(error.code()), folder, truth, markers);
  }
}

void print_header(const std::string& first) {
  fmt::print("TABLE {:28} {:4} {:9} {:8} {:10} {:8} {:5} {}\n", first, "exit", "structure",
             "held, px", "U(k=1), mm", "true, mm", "in 2U", "trace");
}

void print_line(const std::string& what, const JudgedRun& o) {
  fmt::print("TABLE {:28} {:4} {:9} {:8.4f} {:10.4f} {:8.4f} {:2}/{:<2} {}{}\n", what, o.code,
             o.structure ? "right" : "wrong", o.held_out_px, o.claimed_mm, o.true_mm, o.within,
             o.axes, o.verdict, o.effects);
  std::fflush(stdout);
}

}  // namespace kinescope
