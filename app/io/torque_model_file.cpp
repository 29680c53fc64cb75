// SPDX-License-Identifier: Apache-2.0
#include "app/io/torque_model_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;

constexpr const char* kSchema = "kinescope.torque_model";
constexpr int kVersion = 1;

json list(const Eigen::VectorXd& values) {
  return std::vector<double>(values.data(), values.data() + values.size());
}

json rows(const Eigen::MatrixXd& matrix) {
  json out = json::array();
  for (Index i = 0; i < matrix.rows(); ++i) out.push_back(list(matrix.row(i)));
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
          {"translation_m", list(body.p_parent_joint)},
          {"axis", list(body.axis)},
          {"inertia", list(body.inertia.vector())},
          {"motor_inertia", body.motor_inertia}};
}

json bodies_json(const RigidModel& rigid) {
  json out = json::array();
  for (const RigidBody& body : rigid.bodies) out.push_back(body_json(body));
  return out;
}

json drives_json(const DriveTerms& drives) {
  json coupled = json::array();
  for (const Eigen::VectorXd& weights : drives.coupled_drives) coupled.push_back(list(weights));
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
          {"parameters", list(parametric->parameters)},
          {"covariance", triangle(parametric->covariance)},
          {"undetermined", parametric->undetermined},
          {"acting", list(parametric->acting)},
          {"gains", list(parametric->gains)},
          {"sigma", list(parametric->sigma)}};
}

constexpr std::array<const char*, 3> kFeatures = {"none", "friction", "terms"};

json process_json(const SavedProcess& process) {
  const gp::CompactKernel& kernel = process.gp.kernel;
  const json rbf = kernel.rbf_rates.size() == 0
                       ? json()
                       : json{{"variance", kernel.rbf_variance}, {"rates", list(kernel.rbf_rates)}};
  const json gip = kernel.gip_joints.empty() ? json()
                                             : json{{"offset", kernel.gip_offset},
                                                    {"motion", list(kernel.gip_motion)},
                                                    {"first", list(kernel.gip_first)},
                                                    {"second", list(kernel.gip_second)}};
  return {{"features", kFeatures.at(static_cast<std::size_t>(process.features))},
          {"terms", process.terms},
          {"rbf", rbf},
          {"gip", gip},
          {"linear", list(kernel.linear)},
          {"shift", process.gp.shift},
          {"points", process.gp.points},
          {"weights", list(process.gp.weights)},
          {"root", triangle(process.gp.root)}};
}

json filter_json(const TorqueFilter& filter) {
  return {{"filter", to_string(filter.kind)}, {"cutoff_hz", filter.cutoff_hz}};
}

json traced_json(const std::optional<SavedTrace>& traced) {
  if (!traced) return nullptr;
  const CorrectedTorqueModel& corrected = traced->corrected;
  json effects = json::array();
  for (const TorqueEffect& effect : corrected.effects) {
    effects.push_back({{"effect", effect.id.effect},
                       {"place", effect.id.place},
                       {"at", effect.scan},
                       {"values", list(effect.values)}});
  }
  json travels = json::array();
  for (const JointTravel& travel : corrected.travels) {
    travels.push_back({{"range", travel.range},
                       {"rms_speed", travel.rms_speed},
                       {"high_speed", travel.high_speed}});
  }
  return {{"motion", filter_json(traced->filter)},
          {"gravity_m_s2", list(corrected.base.rigid.gravity_m_s2)},
          {"bodies", bodies_json(corrected.base.rigid)},
          {"widths", list(corrected.base.widths)},
          {"viscous", list(corrected.base.viscous)},
          {"coulomb", list(corrected.base.coulomb)},
          {"effects", effects},
          {"travels", travels},
          {"log",
           {{"begin_s", corrected.log.begin_s},
            {"duration_s", corrected.log.duration_s},
            {"lowest_c", corrected.log.lowest_c},
            {"range_c", corrected.log.range_c}}},
          {"sigma", list(traced->sigma)}};
}

// Reads a document and says where in it what is wrong.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : path_(path.string()) {}

  [[nodiscard]] Error wrong(std::string_view what) const {
    return bad_input(path_, what, "give a file of kinescope dynamics --save-model");
  }

  [[nodiscard]] const json& at(const json& object, const char* key) const {
    if (!object.is_object() || !object.contains(key))
      throw wrong(fmt::format("'{}' is missing", key));
    return object.at(key);
  }
  [[nodiscard]] const json& array(const json& object, const char* key) const {
    const json& out = at(object, key);
    if (!out.is_array()) throw wrong(fmt::format("'{}' is no list", key));
    return out;
  }
  [[nodiscard]] double number(const json& value, const char* key) const {
    if (!value.is_number() || !std::isfinite(value.get<double>()))
      throw wrong(fmt::format("'{}' holds what is no number", key));
    return value.get<double>();
  }
  [[nodiscard]] double number_at(const json& object, const char* key) const {
    return number(at(object, key), key);
  }
  [[nodiscard]] bool flag(const json& object, const char* key) const {
    const json& out = at(object, key);
    if (!out.is_boolean()) throw wrong(fmt::format("'{}' is neither true nor false", key));
    return out.get<bool>();
  }
  [[nodiscard]] std::string word(const json& object, const char* key) const {
    const json& out = at(object, key);
    if (!out.is_string()) throw wrong(fmt::format("'{}' is no text", key));
    return out.get<std::string>();
  }
  [[nodiscard]] int integer(const json& value, const char* key) const {
    const bool fits = value.is_number_integer() && value.get<double>() >= -1.0 &&
                      value.get<double>() <= std::numeric_limits<int>::max();
    if (!fits) throw wrong(fmt::format("'{}' holds what is no number of anything", key));
    return value.get<int>();
  }
  [[nodiscard]] std::vector<int> integers(const json& object, const char* key) const {
    std::vector<int> out;
    for (const json& value : array(object, key)) out.push_back(integer(value, key));
    return out;
  }
  [[nodiscard]] Eigen::VectorXi integer_vector(const json& object, const char* key) const {
    const std::vector<int> values = integers(object, key);
    return Eigen::Map<const Eigen::VectorXi>(values.data(), std::ssize(values));
  }
  [[nodiscard]] Eigen::VectorXd vector_of(const json& values, const char* key) const {
    if (!values.is_array()) throw wrong(fmt::format("'{}' is no list", key));
    Eigen::VectorXd out(std::ssize(values));
    Index next = 0;
    for (const json& value : values) out[next++] = number(value, key);
    return out;
  }
  [[nodiscard]] Eigen::VectorXd vector(const json& object, const char* key) const {
    return vector_of(at(object, key), key);
  }
  [[nodiscard]] Eigen::VectorXd vector(const json& object, const char* key, Index size) const {
    Eigen::VectorXd out = vector(object, key);
    if (out.size() != size)
      throw wrong(fmt::format("'{}' holds {} numbers, not {}", key, out.size(), size));
    return out;
  }
  [[nodiscard]] Eigen::MatrixXd matrix(const json& object, const char* key, Index columns) const {
    const json& list = array(object, key);
    Eigen::MatrixXd out(std::ssize(list), columns);
    Index next = 0;
    for (const json& row : list) {
      const Eigen::VectorXd values = vector_of(row, key);
      if (values.size() != columns)
        throw wrong(
            fmt::format("'{}' has a row of {} numbers, not {}", key, values.size(), columns));
      out.row(next++) = values;
    }
    return out;
  }
  // Upper triangle, column after column.
  [[nodiscard]] Eigen::MatrixXd triangle(const json& object, const char* key, Index most) const {
    const Eigen::VectorXd packed = vector(object, key);
    Index size = 0;
    while (size * (size + 1) / 2 < packed.size()) ++size;
    if (size * (size + 1) / 2 != packed.size() || size > most)
      throw wrong(fmt::format("'{}' is no triangle of at most {} columns", key, most));
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
    Index next = 0;
    for (Index j = 0; j < size; ++j) {
      for (Index i = 0; i <= j; ++i) out(i, j) = packed[next++];
    }
    return out;
  }

 private:
  std::string path_;
};

RigidBody body_of(const json& entry, int number, const Reader& read) {
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

RigidModel rigid_of(const json& object, const Reader& read) {
  RigidModel out;
  for (const json& entry : read.array(object, "bodies"))
    out.bodies.push_back(body_of(entry, static_cast<int>(out.bodies.size()), read));
  if (out.bodies.empty()) throw read.wrong("a robot without a joint");
  out.gravity_m_s2 = read.vector(object, "gravity_m_s2", 3);
  return out;
}

DriveTerms drives_of(const json& object, const Reader& read) {
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

std::optional<SavedParametric> parametric_of(const json& value, const Reader& read) {
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

SavedProcess process_of(const json& value, const gp::JointKinds& joints, const Reader& read) {
  SavedProcess out;
  const std::string features = read.word(value, "features");
  const auto known = std::ranges::find(kFeatures, features);
  if (known == kFeatures.end()) throw read.wrong(fmt::format("'{}' are no features", features));
  out.features = static_cast<SavedProcess::Features>(known - kFeatures.begin());
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

TorqueFilter filter_of(const json& object, const Reader& read) {
  TorqueFilter out;
  const std::string name = read.word(object, "filter");
  const std::array kinds{LowPass::kSmoothingSpline, LowPass::kButterworth, LowPass::kNone};
  const auto found =
      std::ranges::find_if(kinds, [&](LowPass kind) { return to_string(kind) == name; });
  if (found == kinds.end()) throw read.wrong(fmt::format("'{}' is no filter", name));
  out.kind = *found;
  out.cutoff_hz = read.number_at(object, "cutoff_hz");
  if (out.cutoff_hz < 0.0) throw read.wrong("'cutoff_hz' is below 0");
  return out;
}

MotionSource source_of(const json& object, const Reader& read) {
  const std::string name = read.word(object, "source");
  for (const MotionSource source : {MotionSource::kBest, MotionSource::kPosition,
                                    MotionSource::kVelocity, MotionSource::kLogged}) {
    if (to_string(source) == name) return source;
  }
  throw read.wrong(fmt::format("'{}' is no source of motion", name));
}

std::optional<SavedTrace> traced_of(const json& value, Index joints, const Reader& read) {
  if (value.is_null()) return std::nullopt;
  SavedTrace out;
  out.filter = filter_of(read.at(value, "motion"), read);
  CorrectedTorqueModel& corrected = out.corrected;
  corrected.base.rigid = rigid_of(value, read);
  if (corrected.base.rigid.size() != joints) throw read.wrong("'traced' is of another robot");
  corrected.base.widths = read.vector(value, "widths", joints);
  corrected.base.viscous = read.vector(value, "viscous", joints);
  corrected.base.coulomb = read.vector(value, "coulomb", joints);
  for (const json& entry : read.array(value, "effects")) {
    TorqueEffect effect;
    effect.id = {read.word(entry, "effect"), read.word(entry, "place")};
    effect.scan = read.number_at(entry, "at");
    effect.values = read.vector(entry, "values");
    if (effect.values.size() == 0) throw read.wrong("an effect without values");
    corrected.effects.push_back(std::move(effect));
  }
  for (const json& entry : read.array(value, "travels")) {
    corrected.travels.push_back({read.number_at(entry, "range"), read.number_at(entry, "rms_speed"),
                                 read.number_at(entry, "high_speed")});
  }
  if (std::ssize(corrected.travels) != joints) throw read.wrong("'travels' is not one a joint");
  const json& log = read.at(value, "log");
  corrected.log = {read.number_at(log, "begin_s"), read.number_at(log, "duration_s"),
                   read.number_at(log, "lowest_c"), read.number_at(log, "range_c")};
  out.sigma = read.vector(value, "sigma", joints);
  return out;
}

void read_uncertainty(const json& document, Index joints, const Reader& read,
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

TorqueModelFile file_of(const json& document, const Reader& read) {
  if (!document.is_object() || document.value("schema", json()) != kSchema)
    throw read.wrong("this is no torque model");
  if (document.value("schema_version", json()) != kVersion)
    throw read.wrong(fmt::format("this program reads version {} of torque models, not {}", kVersion,
                                 document.value("schema_version", json()).dump()));
  TorqueModelFile out;
  out.version = read.word(document, "version");
  SavedTorqueModel& model = out.model;
  const auto kind = torque_model_kind(read.word(document, "model"));
  if (!kind) throw read.wrong("'model' is of no kind");
  model.kind = *kind;
  model.robot = read.word(document, "robot");
  model.torque_unit = read.word(document, "unit");
  model.samples = read.integer(read.at(document, "samples"), "samples");
  const json& motion = read.at(document, "motion");
  out.filter = filter_of(motion, read);
  out.source = source_of(motion, read);
  model.rigid = rigid_of(document, read);
  const Index joints = model.rigid.size();
  model.drives = drives_of(read.at(document, "drives"), read);
  model.parametric = parametric_of(read.at(document, "parametric"), read);
  model.motions = read.matrix(document, "points", 3 * joints);
  gp::JointKinds kinds;
  for (const RigidBody& body : model.rigid.bodies) {
    kinds.push_back(body.type == JointType::kRevolute ? gp::JointKind::kRevolute
                                                      : gp::JointKind::kPrismatic);
  }
  for (const json& process : read.array(document, "processes"))
    model.processes.push_back(process_of(process, kinds, read));
  read_uncertainty(document, joints, read, model);
  out.traced = traced_of(read.at(document, "traced"), joints, read);
  return out;
}

}  // namespace

std::string torque_model_json(const TorqueModelFile& file) {
  const SavedTorqueModel& model = file.model;
  json processes = json::array();
  for (const SavedProcess& process : model.processes) processes.push_back(process_json(process));
  json motion = filter_json(file.filter);
  motion["source"] = to_string(file.source);
  const json document{{"schema", kSchema},
                      {"schema_version", kVersion},
                      {"version", file.version},
                      {"robot", model.robot},
                      {"model", to_string(model.kind)},
                      {"unit", model.torque_unit},
                      {"samples", model.samples},
                      {"motion", motion},
                      {"gravity_m_s2", list(model.rigid.gravity_m_s2)},
                      {"bodies", bodies_json(model.rigid)},
                      {"drives", drives_json(model.drives)},
                      {"parametric", parametric_json(model.parametric)},
                      {"points", rows(model.motions)},
                      {"processes", processes},
                      {"sigma",
                       {{"model_factor", list(model.parts.model_factor)},
                        {"noise", list(model.parts.noise_sigma)}}},
                      {"bands",
                       {{"of_90", list(model.bands.of_90)},
                        {"of_95", list(model.bands.of_95)},
                        {"folds", model.bands.folds},
                        {"by_trajectory", model.bands.by_trajectory},
                        {"residuals", ints(model.bands.residuals)},
                        {"skipped", ints(model.bands.skipped)},
                        {"seen_sigma", list(model.bands.seen_sigma)}}},
                      {"constants",
                       {{"joints", model.constants.joints},
                        {"torque", list(model.constants.torque)},
                        {"sigma", list(model.constants.sigma)}}},
                      {"learned",
                       {{"lower", list(model.learned.lower)},
                        {"upper", list(model.learned.upper)},
                        {"fastest", list(model.learned.fastest)},
                        {"hardest", list(model.learned.hardest)}}},
                      {"traced", traced_json(file.traced)}};
  return document.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

TorqueModelFile read_torque_model(const std::filesystem::path& path) {
  const Reader read(path);
  const json document = json::parse(read_text_file(path), nullptr, false);
  if (document.is_discarded()) throw read.wrong("this is no JSON, or not all of it");
  TorqueModelFile out = file_of(document, read);
  try {
    const TorquePredictor whole(out.model);
  } catch (const Error& error) {
    throw read.wrong(error.what());
  }
  return out;
}

}  // namespace kinescope
