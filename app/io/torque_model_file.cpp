// SPDX-License-Identifier: Apache-2.0
#include "app/io/torque_model_file.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/json_text.h"
#include "dynamics/models/saved_model_json.h"

namespace kinescope {
namespace {

using Eigen::Index;
using nlohmann::json;

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
                       {"values", list_json(effect.values)}});
  }
  json travels = json::array();
  for (const JointTravel& travel : corrected.travels) {
    travels.push_back({{"range", travel.range},
                       {"rms_speed", travel.rms_speed},
                       {"high_speed", travel.high_speed}});
  }
  return {{"motion", filter_json(traced->filter)},
          {"gravity_m_s2", list_json(corrected.base.rigid.gravity_m_s2)},
          {"bodies", bodies_json(corrected.base.rigid)},
          {"widths", list_json(corrected.base.widths)},
          {"viscous", list_json(corrected.base.viscous)},
          {"coulomb", list_json(corrected.base.coulomb)},
          {"effects", effects},
          {"travels", travels},
          {"log",
           {{"begin_s", corrected.log.begin_s},
            {"duration_s", corrected.log.duration_s},
            {"lowest_c", corrected.log.lowest_c},
            {"range_c", corrected.log.range_c}}},
          {"sigma", list_json(traced->sigma)}};
}

TorqueFilter filter_of(const json& object, const JsonReader& read) {
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

MotionSource source_of(const json& object, const JsonReader& read) {
  const std::string name = read.word(object, "source");
  for (const MotionSource source : {MotionSource::kBest, MotionSource::kPosition,
                                    MotionSource::kVelocity, MotionSource::kLogged}) {
    if (to_string(source) == name) return source;
  }
  throw read.wrong(fmt::format("'{}' is no source of motion", name));
}

std::optional<SavedTrace> traced_of(const json& value, Index joints, const JsonReader& read) {
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

}  // namespace

std::string torque_model_json(const TorqueModelFile& file) {
  json document = saved_model_json(file.model);
  document["version"] = file.version;
  document["motion"] = filter_json(file.filter);
  document["motion"]["source"] = to_string(file.source);
  document["traced"] = traced_json(file.traced);
  return json_text(document, -1);
}

TorqueModelFile read_torque_model(const std::filesystem::path& path) {
  const JsonReader read(path);
  const json document = torque_model_document(path, read);
  TorqueModelFile out;
  out.version = read.word(document, "version");
  const json& motion = read.at(document, "motion");
  out.filter = filter_of(motion, read);
  out.source = source_of(motion, read);
  out.model = saved_model_of(document, read);
  out.traced = traced_of(read.at(document, "traced"), out.model.rigid.size(), read);
  return out;
}

TorquePrediction predict_traced_torque(const SavedTrace& traced, const TorqueSamples& samples) {
  TorquePrediction out;
  out.mean = predict_torque(traced.corrected, samples, traced.filter);
  out.model_sigma = Eigen::MatrixXd::Zero(out.mean.rows(), out.mean.cols());
  out.sigma = traced.sigma.transpose().replicate(out.mean.rows(), 1);
  return out;
}

}  // namespace kinescope
