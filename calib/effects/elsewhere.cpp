// SPDX-License-Identifier: Apache-2.0
#include "calib/effects/elsewhere.h"

#include <algorithm>
#include <cmath>

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

std::string place_at(const EffectWorld& world, std::size_t camera, const std::string& place) {
  constexpr std::string_view kCamera = "camera";
  if (world.cameras.size() < 2) return place;
  return fmt::format("{} {}{}", kCamera, world.cameras[camera].name, place.substr(kCamera.size()));
}

CameraEffect at_camera(const EffectWorld& world, std::size_t camera, CameraEffect of) {
  if (world.cameras.size() < 2) return of;
  const std::string before = of.candidate.id.place;
  const std::string place = place_at(world, camera, before);
  of.candidate.id.place = place;
  of.candidate.words += fmt::format(" (camera {})", world.cameras[camera].name);
  Eigen::VectorXd own(static_cast<Eigen::Index>(world.camera_of_frame.size()));
  for (Eigen::Index f = 0; f < own.size(); ++f)
    own[f] = world.camera_of_frame[static_cast<std::size_t>(f)] == static_cast<int>(camera);
  const auto in_own = [&](std::function<std::vector<Correction>(double)> everywhere) {
    return [all = std::move(everywhere), own, before, place](double scan) {
      std::vector<Correction> out = all(scan);
      for (Correction& correction : out) {
        correction.block = place;
        correction.name.replace(0, before.size(), place);
        correction.share = correction.share.size() == 0
                               ? own
                               : Eigen::VectorXd(correction.share.cwiseProduct(own));
      }
      return out;
    };
  };
  of.corrections = in_own(std::move(of.corrections));
  if (of.nuisances) of.nuisances = in_own(std::move(of.nuisances));
  return of;
}

std::vector<Correction> held_elsewhere(const CameraEffect& like, const Eigen::VectorXd& share) {
  constexpr double kMostShift = 1e-3;  // m
  std::vector<Correction> out;
  for (int axis = 0; axis < 3; ++axis) {
    Correction shift = correct(CorrectedPart::kCarried, like, 0);
    shift.name = fmt::format("{} held elsewhere {}", like.candidate.id.place, "xyz"[axis]);
    shift.unit = "m";
    shift.direction = Vector6d::Unit(3 + axis);
    shift.share = share;
    shift.is_nuisance = true;
    shift.prior_sigma = kMostShift;
    out.push_back(std::move(shift));
  }
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
  const LinkId link = world.tree.markers[static_cast<std::size_t>(marker)].link;
  if (world.is_carried) return false;
  if (world.camera_link.value != 0) return link == world.camera_link;
  return world.tree.path_to(link).empty();
}

std::vector<int> movers_of(const EffectWorld& world, int marker) {
  std::vector<int> out;
  for (const JointId joint :
       world.tree.path_to(world.tree.markers[static_cast<std::size_t>(marker)].link))
    out.push_back(joint.value);
  return out;
}

Interval motion_span(const EffectWorld& world, const std::vector<int>& joints) {
  constexpr double kStill = 0.1;  // of its travel: seen much as before
  const std::vector<double>& times = world.frames.times_s;
  std::size_t first = times.size() - 1;
  std::size_t last = 0;
  for (const int joint : joints) {
    const Eigen::VectorXd value = world.frames.value.col(joint);
    const double still = kStill * (value.maxCoeff() - value.minCoeff());
    for (std::size_t i = 0; i < times.size(); ++i) {
      const double reading = value[static_cast<Eigen::Index>(i)];
      if (std::abs(reading - value[0]) > still) first = std::min(first, i);
      if (std::abs(reading - value[value.size() - 1]) > still) last = std::max(last, i);
    }
  }
  return {times[first], times[last]};
}

}  // namespace kinescope::effects
