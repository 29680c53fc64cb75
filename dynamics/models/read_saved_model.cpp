// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/models/joint_kinds.h"
#include "dynamics/models/saved_model_file.h"
#include "dynamics/models/saved_model_json.h"
#include "dynamics/models/saved_model_schema.h"
#include "dynamics/models/torque_model.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;

RigidBody body_of(const json& entry, int number, const JsonReader& read) {
  RigidBody out;
  out.name = read.word(entry, "name");
  out.joint = read.word(entry, "joint");
  const std::string type = read.word(entry, "type");
  if (type != to_string(JointType::kRevolute) && type != to_string(JointType::kPrismatic))
    throw read.wrong(fmt::format("'{}' is no joint that moves", type));
  out.type = type == to_string(JointType::kRevolute) ? JointType::kRevolute : JointType::kPrismatic;
  out.parent = read.integer(read.at(entry, "parent"), "parent");
  if (out.parent >= number) throw read.wrong("a body stands before the one that carries it");
  const Eigen::MatrixXd rotation = read.matrix(entry, "rotation", 3);
  constexpr double kRounding = 1e-6;
  if (rotation.rows() != 3 || !(rotation.transpose() * rotation).isIdentity(kRounding))
    throw read.wrong("'rotation' is none");
  out.R_parent_joint = rotation;
  out.p_parent_joint = read.vector(entry, "translation_m", 3);
  out.axis = read.vector(entry, "axis", 3);
  if (!(std::abs(out.axis.norm() - 1.0) < kRounding)) throw read.wrong("'axis' is no unit vector");
  out.inertia = InertialParameters::from_vector(Vector10d(read.vector(entry, "inertia", 10)));
  out.motor_inertia = read.number_at(entry, "motor_inertia");
  return out;
}

DriveTerms drives_of(const json& object, const JsonReader& read) {
  DriveTerms out;
  out.motor_inertia = read.flag(object, "motor_inertia");
  out.viscous = read.flag(object, "viscous");
  out.coulomb = read.flag(object, "coulomb");
  out.offset = read.flag(object, "offset");
  out.asymmetric_viscous = read.flag(object, "asymmetric_viscous");
  out.coulomb_width_rad_s = read.number_at(object, "coulomb_width_rad_s");
  out.coulomb_width_m_s = read.number_at(object, "coulomb_width_m_s");
  for (const json& weights : read.array(object, "coupled"))
    out.coupled_drives.push_back(read.vector_of(weights, "coupled"));
  return out;
}

std::optional<SavedParametric> parametric_of(const json& value, const JsonReader& read) {
  if (value.is_null()) return std::nullopt;
  SavedParametric out;
  out.terms = read.integers(value, "terms");
  const auto count = std::ssize(out.terms);
  out.parameters = read.vector(value, "parameters", count);
  out.covariance = read.triangle(value, "covariance", count);
  out.covariance.triangularView<Eigen::StrictlyLower>() = out.covariance.transpose();
  out.undetermined = read.integers(value, "undetermined");
  out.acting = read.vector(value, "acting");
  out.gains = read.vector(value, "gains");
  out.sigma = read.vector(value, "sigma");
  return out;
}

SavedProcess process_of(const json& value, const gp::JointKinds& joints, const JsonReader& read) {
  SavedProcess out;
  const std::string features = read.word(value, "features");
  const auto known = std::ranges::find(saved_model::kFeatures, features);
  if (known == saved_model::kFeatures.end())
    throw read.wrong(fmt::format("'{}' are no features", features));
  out.features = static_cast<SavedProcess::Features>(known - saved_model::kFeatures.begin());
  out.terms = read.integers(value, "terms");
  gp::CompactKernel& kernel = out.gp.kernel;
  if (const json& rbf = read.at(value, "rbf"); !rbf.is_null()) {
    kernel.rbf_variance = read.number_at(rbf, "variance");
    kernel.rbf_rates = read.vector(rbf, "rates");
  }
  if (const json& gip = read.at(value, "gip"); !gip.is_null()) {
    kernel.gip_joints = joints;
    kernel.gip_offset = read.number_at(gip, "offset");
    kernel.gip_motion = read.vector(gip, "motion");
    kernel.gip_first = read.vector(gip, "first");
    kernel.gip_second = read.vector(gip, "second");
  }
  kernel.linear = read.vector(value, "linear");
  out.gp.shift = read.number_at(value, "shift");
  out.gp.points = read.integers(value, "points");
  out.gp.weights = read.vector(value, "weights", std::ssize(out.gp.points));
  out.gp.root = read.triangle(value, "root", out.gp.weights.size());
  return out;
}

void read_uncertainty(const json& document, Index joints, const JsonReader& read,
                      SavedTorqueModel& model) {
  const json& sigma = read.at(document, "sigma");
  model.parts = {read.vector(sigma, "model_factor", joints), read.vector(sigma, "noise", joints)};
  const json& bands = read.at(document, "bands");
  model.bands.of_90 = read.vector(bands, "of_90");
  model.bands.of_95 = read.vector(bands, "of_95");
  model.bands.folds = read.integer(read.at(bands, "folds"), "folds");
  model.bands.by_trajectory = read.flag(bands, "by_trajectory");
  model.bands.residuals = read.integer_vector(bands, "residuals");
  model.bands.skipped = read.integer_vector(bands, "skipped");
  model.bands.seen_sigma = read.vector(bands, "seen_sigma");
  const json& constants = read.at(document, "constants");
  model.constants.joints = read.integers(constants, "joints");
  model.constants.torque = read.vector(constants, "torque", std::ssize(model.constants.joints));
  model.constants.sigma = read.vector(constants, "sigma", std::ssize(model.constants.joints));
  const json& learned = read.at(document, "learned");
  model.learned = {read.vector(learned, "lower", joints), read.vector(learned, "upper", joints),
                   read.vector(learned, "fastest", joints),
                   read.vector(learned, "hardest", joints)};
}

}  // namespace

RigidModel rigid_of(const json& object, const JsonReader& read) {
  RigidModel out;
  for (const json& entry : read.array(object, "bodies"))
    out.bodies.push_back(body_of(entry, static_cast<int>(out.bodies.size()), read));
  if (out.bodies.empty()) throw read.wrong("a robot without a joint");
  out.gravity_m_s2 = read.vector(object, "gravity_m_s2", 3);
  return out;
}

json torque_model_document(const std::filesystem::path& path, const JsonReader& read) {
  json document = json::parse(read_text_file(path), nullptr, false);
  if (document.is_discarded()) throw read.wrong("this is no JSON, or not all of it");
  if (!document.is_object() || document.value("schema", json()) != saved_model::kSchema)
    throw read.wrong("this is no torque model");
  const json version = document.value("schema_version", json());
  if (version != saved_model::kVersion)
    throw read.wrong(fmt::format("this program reads version {} of torque models, not {}",
                                 saved_model::kVersion, version.dump()));
  return document;
}

SavedTorqueModel saved_model_of(const json& document, const JsonReader& read) {
  SavedTorqueModel model;
  const auto kind = torque_model_kind(read.word(document, "model"));
  if (!kind) throw read.wrong("'model' is of no kind");
  model.kind = *kind;
  model.robot = read.word(document, "robot");
  model.torque_unit = read.word(document, "unit");
  model.samples = read.integer(read.at(document, "samples"), "samples");
  model.rigid = rigid_of(document, read);
  model.drives = drives_of(read.at(document, "drives"), read);
  model.parametric = parametric_of(read.at(document, "parametric"), read);
  model.motions = read.matrix(document, "points", 3 * model.rigid.size());
  const gp::JointKinds kinds = models::joint_kinds(model.rigid);
  for (const json& process : read.array(document, "processes"))
    model.processes.push_back(process_of(process, kinds, read));
  read_uncertainty(document, model.rigid.size(), read, model);
  try {
    const TorquePredictor whole(model);
  } catch (const Error& error) {
    throw read.wrong(error.what());
  }
  return model;
}

SavedModelFile read_saved_model(const std::filesystem::path& path) {
  const JsonReader read(path);
  const json document = torque_model_document(path, read);
  return {saved_model_of(document, read), !read.at(document, "traced").is_null()};
}

}  // namespace kinescope
