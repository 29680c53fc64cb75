// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_inputs.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/sha256.h"
#include "dynamics/rigid/inverse_dynamics.h"
#include "dynamics/rigid/mass_matrix.h"
#include "kinematics/core/error.h"
#include "kinematics/recorded/container.h"
#include "kinematics/urdf/dynamic_urdf.h"

namespace kinescope {

namespace fs = std::filesystem;

namespace {

/// Such a link is no body, and the robot that was learnt could not be written.
void refuse_massless_moments(const DynamicModel& model, const fs::path& urdf) {
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    const InertialParameters& link = model.links[l];
    if (link.mass_kg > 0.0 || link.vector().isZero(0.0)) continue;
    throw bad_input(
        urdf.string(),
        fmt::format("link '{}' has moments of inertia and no mass", model.tree.links[l].name),
        "give it its mass, or take its <inertial> away");
  }
}

}  // namespace

TorqueRobot read_torque_robot(const fs::path& urdf,
                              const std::optional<Eigen::Vector3d>& gravity_m_s2) {
  TorqueRobot out;
  out.model = read_dynamic_urdf(urdf);
  refuse_massless_moments(out.model, urdf);
  if (gravity_m_s2) out.model.gravity_m_s2 = *gravity_m_s2;
  const KinematicTree& tree = out.model.tree;
  for (const JointId id : moving_joints(tree)) {
    const Joint& joint = tree.joints[id.index()];
    out.joints.push_back(joint.name);
    out.links.push_back(tree.links[joint.child.index()].name);
    out.types.push_back(joint.type);
  }
  return out;
}

bool has_masses(const DynamicModel& model) {
  return std::ranges::any_of(model.links,
                             [](const InertialParameters& link) { return link.mass_kg > 0.0; });
}

TorqueScales torque_scales(const RigidModel& rigid, const TorqueSamples& samples,
                           const std::vector<fs::path>& logs) {
  TorqueScales out = compare_torque_scale(
      samples, inverse_dynamics_of_samples(rigid, samples.q, samples.dq, samples.ddq),
      weight_scale(rigid, samples.q.colwise().mean().transpose()));
  put_into_place(logs, out.findings);
  return out;
}

void put_into_place(const std::vector<fs::path>& logs, std::vector<LogFinding>& findings) {
  std::vector<std::string> names;
  for (const fs::path& log : logs) names.push_back(log.string());
  for (LogFinding& finding : findings) {
    if (finding.place.empty()) finding.place = fmt::format("{}", fmt::join(names, ", "));
  }
}

std::string file_list(const std::vector<fs::path>& files) {
  std::string out;
  for (const fs::path& file : files) out += (out.empty() ? "" : ", ") + recorded::short_name(file);
  return out;
}

std::vector<InputFile> hashed_inputs(const std::vector<std::vector<fs::path>>& lists) {
  std::vector<InputFile> out;
  for (const auto& files : lists) {
    for (const fs::path& file : files) {
      for (const fs::path& part : recorded::parts_of(file))
        out.push_back({part.filename().string(), sha256_of_file(part)});
    }
  }
  return out;
}

std::vector<std::string> warnings_of(const std::vector<LogFinding>& findings) {
  std::vector<std::string> out;
  for (const LogFinding& finding : findings) {
    if (finding.weight == FaultWeight::kWarning || finding.fault == LogFault::kAssignment) {
      out.push_back(to_line(finding));
    }
  }
  return out;
}

}  // namespace kinescope
