// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/saved_model_json.h"

#include "dynamics/models/saved_model_schema.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;

json rows(const Eigen::MatrixXd& matrix) {
  json out = json::array();
  for (Index i = 0; i < matrix.rows(); ++i) out.push_back(list_json(matrix.row(i)));
  return out;
}

// Upper triangle, column after column.
json triangle(const Eigen::MatrixXd& matrix) {
  std::vector<double> out;
  for (Index j = 0; j < matrix.cols(); ++j) {
    for (Index i = 0; i <= j; ++i) out.push_back(matrix(i, j));
  }
  return out;
}

json ints(const Eigen::VectorXi& values) {
  return std::vector<int>(values.data(), values.data() + values.size());
}

json body_json(const RigidBody& body) {
  return {{"name", body.name},
          {"joint", body.joint},
          {"type", to_string(body.type)},
          {"parent", body.parent},
          {"rotation", rows(body.R_parent_joint)},
          {"translation_m", list_json(body.p_parent_joint)},
          {"axis", list_json(body.axis)},
          {"inertia", list_json(body.inertia.vector())},
          {"motor_inertia", body.motor_inertia}};
}

json drives_json(const DriveTerms& drives) {
  json coupled = json::array();
  for (const Eigen::VectorXd& weights : drives.coupled_drives)
    coupled.push_back(list_json(weights));
  return {{"motor_inertia", drives.motor_inertia},
          {"viscous", drives.viscous},
          {"coulomb", drives.coulomb},
          {"offset", drives.offset},
          {"asymmetric_viscous", drives.asymmetric_viscous},
          {"coulomb_width_rad_s", drives.coulomb_width_rad_s},
          {"coulomb_width_m_s", drives.coulomb_width_m_s},
          {"coupled", coupled}};
}

json parametric_json(const std::optional<SavedParametric>& parametric) {
  if (!parametric) return nullptr;
  return {{"terms", parametric->terms},
          {"parameters", list_json(parametric->parameters)},
          {"covariance", triangle(parametric->covariance)},
          {"undetermined", parametric->undetermined},
          {"acting", list_json(parametric->acting)},
          {"gains", list_json(parametric->gains)},
          {"sigma", list_json(parametric->sigma)}};
}

json process_json(const SavedProcess& process) {
  const gp::CompactKernel& kernel = process.gp.kernel;
  const json rbf = kernel.rbf_rates.size() == 0 ? json()
                                                : json{{"variance", kernel.rbf_variance},
                                                       {"rates", list_json(kernel.rbf_rates)}};
  const json gip = kernel.gip_joints.empty() ? json()
                                             : json{{"offset", kernel.gip_offset},
                                                    {"motion", list_json(kernel.gip_motion)},
                                                    {"first", list_json(kernel.gip_first)},
                                                    {"second", list_json(kernel.gip_second)}};
  return {{"features", saved_model::kFeatures.at(static_cast<std::size_t>(process.features))},
          {"terms", process.terms},
          {"rbf", rbf},
          {"gip", gip},
          {"linear", list_json(kernel.linear)},
          {"shift", process.gp.shift},
          {"points", process.gp.points},
          {"weights", list_json(process.gp.weights)},
          {"root", triangle(process.gp.root)}};
}

json bands_json(const BandFactors& bands) {
  return {{"of_90", list_json(bands.of_90)},
          {"of_95", list_json(bands.of_95)},
          {"folds", bands.folds},
          {"by_trajectory", bands.by_trajectory},
          {"residuals", ints(bands.residuals)},
          {"skipped", ints(bands.skipped)},
          {"seen_sigma", list_json(bands.seen_sigma)}};
}

}  // namespace

json list_json(const Eigen::VectorXd& values) {
  return std::vector<double>(values.data(), values.data() + values.size());
}

json bodies_json(const RigidModel& rigid) {
  json out = json::array();
  for (const RigidBody& body : rigid.bodies) out.push_back(body_json(body));
  return out;
}

json saved_model_json(const SavedTorqueModel& model) {
  json processes = json::array();
  for (const SavedProcess& process : model.processes) processes.push_back(process_json(process));
  return {{"schema", saved_model::kSchema},
          {"schema_version", saved_model::kVersion},
          {"robot", model.robot},
          {"model", to_string(model.kind)},
          {"unit", model.torque_unit},
          {"samples", model.samples},
          {"gravity_m_s2", list_json(model.rigid.gravity_m_s2)},
          {"bodies", bodies_json(model.rigid)},
          {"drives", drives_json(model.drives)},
          {"parametric", parametric_json(model.parametric)},
          {"points", rows(model.motions)},
          {"processes", processes},
          {"sigma",
           {{"model_factor", list_json(model.parts.model_factor)},
            {"noise", list_json(model.parts.noise_sigma)}}},
          {"bands", bands_json(model.bands)},
          {"constants",
           {{"joints", model.constants.joints},
            {"torque", list_json(model.constants.torque)},
            {"sigma", list_json(model.constants.sigma)}}},
          {"learned",
           {{"lower", list_json(model.learned.lower)},
            {"upper", list_json(model.learned.upper)},
            {"fastest", list_json(model.learned.fastest)},
            {"hardest", list_json(model.learned.hardest)}}}};
}

}  // namespace kinescope
