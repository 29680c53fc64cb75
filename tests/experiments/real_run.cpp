// SPDX-License-Identifier: Apache-2.0
#include "tests/experiments/real_run.h"

#include <chrono>
#include <cmath>
#include <exception>

#include <fmt/format.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/file.h"
#include "tests/truth/temporary_path.h"

namespace kinescope::real {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr double kMillimetres = 1e3;
constexpr double kDegrees = 57.29577951308232;

json read_json(const fs::path& file) {
  return fs::exists(file) ? json::parse(read_text_file(file)) : json(nullptr);
}

double value_or_zero(const json& statistics, const char* name) {
  const auto found = statistics.find(name);
  return found != statistics.end() && found->is_number() ? found->get<double>() : 0.0;
}

Length length(const json& row, const std::string& which, const char* statistic) {
  return {kMillimetres * value_or_zero(row[which + "_m"], statistic),
          kDegrees * value_or_zero(row[which + "_rad"], statistic)};
}

// Over every row of residuals.csv, rejected or not.
Length held_out_of_all(const fs::path& file) {
  if (!fs::exists(file)) return {};
  const CsvTable table = read_csv(file);
  if (!table.column("held_out_x")) return {};
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto square = [&](const std::string& name) {
      return std::pow(table.number(row, table.require_column("held_out_" + name)), 2);
    };
    sum += Eigen::Vector2d(square("x") + square("y") + square("z"),
                           square("rx") + square("ry") + square("rz"));
  }
  sum /= static_cast<double>(std::max<std::size_t>(1, table.rows.size()));
  return {kMillimetres * std::sqrt(sum[0]), kDegrees * std::sqrt(sum[1])};
}

void read_structure(const json& structure, Outcome& out) {
  if (structure.is_null()) return;
  out.status = structure["status"].get<std::string>();
  out.probability =
      structure["probability"].is_number() ? structure["probability"].get<double>() : 0.0;
  for (const json& joint : structure["joints"]) {
    out.joints.push_back({joint["type"], joint["parent"], joint["child"],
                          joint["channel"].is_string() ? joint["channel"].get<std::string>() : "",
                          value_or_zero(joint, "scale")});
  }
  for (const json& link : structure["links"])
    out.links.push_back(link["tags"].get<std::vector<int>>());
  out.free_tags = structure["free_markers"].get<std::vector<int>>();
  for (const json& doubt : structure["doubts"]) {
    out.doubts.push_back(fmt::format("{} ({})", doubt["what"].get<std::string>(),
                                     doubt["remedy"].get<std::string>()));
  }
}

void read_errors(const json& result, const fs::path& residuals, Outcome& out) {
  if (result.is_null()) return;
  out.calibrated = true;
  const json& all = result["errors"]["all"];
  Errors& e = out.errors;
  e.before = length(all, "before", "rms");
  e.fit = length(all, "training", "rms");
  e.held_out = length(all, "held_out", "rms");
  e.held_out_median = length(all, "held_out", "median");
  e.held_out_all = held_out_of_all(residuals);
  e.held_out_px = value_or_zero(all["held_out_px"], "rms");
  for (const json& marker : result["calibration"]["markers"]) {
    e.sightings += marker["used"].get<int>() + marker["rejected"].get<int>();
    e.rejected += marker["rejected"].get<int>();
  }
}

std::string joined(const std::vector<FoundJoint>& joints, std::string FoundJoint::* member) {
  std::string out;
  for (const FoundJoint& joint : joints) out += (out.empty() ? "" : " ") + joint.*member;
  return out;
}

}  // namespace

std::string Outcome::types() const { return joined(joints, &FoundJoint::type); }
std::string Outcome::order() const { return joined(joints, &FoundJoint::channel); }

Outcome run_recording(const RecordingPaths& paths, const fs::path& output,
                      const CalibrateOptions& options, bool trace) {
  Outcome out;
  const auto begin = std::chrono::steady_clock::now();
  RunOptions run;
  run.recording = paths;
  run.output = output;
  run.calibrate = options;
  // Of a nominal robot all levels are fitted where none is asked for.
  if (options.free != FreeGeometry::kGeometry) run.free = options.free;
  run.trace = trace;
  run.force = true;
  try {
    out.code = run_command(run, {.json = false, .quiet = true, .progress = {}});
  } catch (const Error& error) {
    out.code = error.code();
    out.message = error.what();
  } catch (const std::exception& error) {
    out.message = fmt::format("internal error: {}", error.what());
  }
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  read_structure(read_json(output / "structure.json"), out);
  out.result = read_json(output / "result.json");
  out.trace = read_json(output / "trace.json");
  read_errors(out.result, output / "residuals.csv", out);
  return out;
}

ScratchFolder::ScratchFolder(const std::string& name) : path_(truth::temporary_path(name)) {
  fs::create_directories(path_);
}

ScratchFolder::~ScratchFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

}  // namespace kinescope::real
