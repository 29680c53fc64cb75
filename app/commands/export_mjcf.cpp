// SPDX-License-Identifier: Apache-2.0
//
// The robot with its masses and friction for MuJoCo.
#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/export_form.h"
#include "app/io/output_folder.h"
#include "app/io/torque_effects_file.h"
#include "app/report/result_values.h"
#include "kinematics/core/file.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/mjcf.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

/// What is exported, and which files say so.
struct Exported {
  fs::path urdf;
  DynamicModel model;
  MjcfOptions mjcf;
  std::vector<fs::path> inputs;
  std::vector<std::string> left_out;  ///< effects that MJCF has no element for
};

/// The trace of torques of a folder of `dynamics` or `run`; none where there is none.
std::optional<fs::path> trace_of(const fs::path& folder) {
  for (const char* name : {"dynamics_trace.json", "trace.json"}) {
    fs::path path = folder / name;
    if (!fs::exists(path)) continue;
    const auto document = nlohmann::json::parse(read_text_file(path), nullptr, false);
    if (document.is_object() && document.contains("base")) return path;
  }
  return std::nullopt;
}

/// robot_traced.urdf where its masses are those that the torques were traced on.
fs::path urdf_of(const fs::path& folder, bool traced) {
  const std::vector<const char*> names =
      traced ? std::vector{"robot_traced.urdf", "robot_dynamics.urdf", "robot.urdf"}
             : std::vector{"robot_dynamics.urdf", "robot.urdf"};
  for (const char* name : names) {
    if (fs::exists(folder / name)) return folder / name;
  }
  throw bad_input(folder.string(), "holds no robot_dynamics.urdf and no robot.urdf",
                  "give the folder of kinescope run or dynamics, or a URDF");
}

void put_spring(const TorqueEffect& effect, MjcfOptions& mjcf) {
  const auto value = [&effect](const char* name) {
    const auto found = std::ranges::find(effect.parameters, name, &EffectParameter::name);
    return found == effect.parameters.end() ? 0.0
                                            : effect.values[found - effect.parameters.begin()];
  };
  const double stiffness = value("stiffness");
  if (stiffness == 0.0) return;
  mjcf.springs[effect.id.place] = {stiffness, -value("torque_at_zero") / stiffness};
}

/// A payload is a body of its own where the link has a mass without it: its inertia is hardly
/// known, and may spoil the link's.
void put_payload(const TorqueEffect& effect, Exported& out) {
  const auto link = out.model.tree.link(effect.id.place);
  constexpr Eigen::Index kParameters = 10;
  if (!link || effect.values.size() != kParameters) return;
  const auto load = InertialParameters::from_vector(effect.values);
  InertialParameters& own = out.model.links[link->index()];
  const auto bare = InertialParameters::from_vector(own.vector() - effect.values);
  if (!(load.mass_kg > 0.0) || !(bare.mass_kg > 0.0) || !is_consistent(bare)) return;
  own = bare;
  out.mjcf.carried.push_back({"payload_" + effect.id.place, effect.id.place, load});
}

/// Gravity as the folder's dynamics.json has it.
void read_gravity(const fs::path& folder, DynamicModel& model, std::vector<fs::path>& inputs) {
  const fs::path path = folder / "dynamics.json";
  if (!fs::exists(path)) return;
  const auto document = nlohmann::json::parse(read_text_file(path), nullptr, false);
  if (!document.is_object()) throw bad_input(path.string(), "is no JSON", "run dynamics again");
  inputs.push_back(path);
  for (const char* key : {"gravity_m_s2", "traced_gravity_m_s2"}) {
    const auto found = document.find(key);
    if (found == document.end() || !found->is_array() || found->size() != 3) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!(*found)[k].is_number())
        throw bad_input(path.string(), "a gravity that is no number", "run dynamics again");
      model.gravity_m_s2[static_cast<Eigen::Index>(k)] = (*found)[k].get<double>();
    }
  }
}

Exported from_folder(const fs::path& folder) {
  Exported out;
  const std::optional<fs::path> trace = trace_of(folder);
  ListedEffects listed;
  if (trace) {
    listed = read_listed_effects(*trace);
    out.inputs.push_back(*trace);
  }
  const bool traced = trace && !listed.identified_masses;
  out.urdf = urdf_of(folder, traced);
  out.model = read_dynamic_urdf(out.urdf);
  read_gravity(folder, out.model, out.inputs);
  for (const ListedEffect& entry : listed.effects) {
    const TorqueEffect& effect = entry.effect;
    const bool in_model = entry.in_urdf || effect.id.effect == "gravity_direction";
    if (effect.id.effect == "spring") {
      put_spring(effect, out.mjcf);
    } else if (effect.id.effect == "payload" && in_model && traced) {
      put_payload(effect, out);
    } else if (!in_model) {
      out.left_out.push_back(fmt::format("{} at {}", effect.id.effect, effect.id.place));
    }
  }
  return out;
}

Exported what_to_export(const ExportOptions& options) {
  Exported out;
  if (fs::is_directory(options.source)) {
    out = from_folder(options.source);
  } else {
    out.urdf = options.source;
    out.model = read_dynamic_urdf(options.source);
  }
  out.inputs.push_back(out.urdf);
  if (options.gravity_m_s2) out.model.gravity_m_s2 = *options.gravity_m_s2;
  out.mjcf.notes.push_back(fmt::format("Written by Kinescope {} from {}. SI units.",
                                       program_version(), out.urdf.filename().string()));
  for (const std::string& effect : out.left_out) {
    out.mjcf.notes.push_back("Traced, but MuJoCo has no element for it: " + effect);
  }
  return out;
}

}  // namespace

ExportForm export_mjcf(const ExportOptions& options) {
  const Exported exported = what_to_export(options);
  require_new_file(options.mjcf, "--mjcf", exported.inputs, options.force);
  const std::size_t joints = moving_joints(exported.model.tree).size();
  ExportForm out;
  out.files.push_back({options.mjcf, write_mjcf(exported.model, exported.mjcf)});
  out.result = {{"urdf", report::text(exported.urdf.string())},
                {"mjcf", report::text(options.mjcf.string())},
                {"joints", joints},
                {"left_out", report::texts(exported.left_out)}};
  for (const std::string& effect : exported.left_out)
    out.warnings.push_back(fmt::format("{} is left out: MuJoCo has no element for it", effect));
  out.lines = {fmt::format("{} joints of {}", joints, exported.urdf.string()),
               fmt::format("mjcf    {}", options.mjcf.string())};
  return out;
}

}  // namespace kinescope
