// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/elsewhere.h"

#include <fmt/format.h>

namespace kinescope::effects {

CameraEffect effect(std::string name, std::string place, std::string words,
                    std::vector<EffectParameter> parameters, std::string size_unit) {
  CameraEffect out;
  Candidate& c = out.candidate;
  c.id = {std::move(name), std::move(place)};
  c.words = std::move(words);
  c.size_weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(parameters.size()));
  c.parameters = std::move(parameters);
  c.size_unit = std::move(size_unit);
  return out;
}

Correction correct(CorrectedPart part, const CameraEffect& effect, std::size_t parameter,
                   int index) {
  Correction out;
  out.block = effect.candidate.id.place;
  out.name = out.block + " " + effect.candidate.id.effect + " " +
             effect.candidate.parameters[parameter].name;
  out.unit = effect.candidate.parameters[parameter].unit;
  out.part = part;
  out.index = index;
  return out;
}

Eigen::VectorXd frame_times(const EffectWorld& world) {
  return Eigen::Map<const Eigen::VectorXd>(world.frames.times_s.data(),
                                           static_cast<Eigen::Index>(world.frames.times_s.size()));
}

std::string marker_name(const EffectWorld& world, int marker) {
  return fmt::format("tag_{}", world.tree.markers[static_cast<std::size_t>(marker)].id.value);
}

bool rests(const EffectWorld& world, int marker) {
  return world.tree.path_to(world.tree.markers[static_cast<std::size_t>(marker)].link).empty();
}

}  // namespace kinescope::effects
