// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "calib/effects/camera_effects.h"
#include "calib/effects/elsewhere.h"
#include "calib/effects/suspect.h"

namespace kinescope::effects {
namespace {

// Of every frame: 1 in a recording, 0 in the others. Recordings are numbered as their cameras.
Eigen::VectorXd within(const std::vector<int>& recording_of_frame, double recording) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(recording_of_frame.size()));
  for (Eigen::Index f = 0; f < out.size(); ++f)
    out[f] = recording_of_frame[static_cast<std::size_t>(f)] == std::lround(recording);
  return out;
}

// What may differ in one of these recordings, as the value of the scan. Of two, the one differs
// from the other as that from it.
void in_one_of(const EffectWorld& world, std::vector<int> recordings, Candidate& c) {
  if (recordings.size() == 2) recordings.erase(recordings.begin());
  c.scan.assign(recordings.begin(), recordings.end());
  c.scan_listed = true;
  c.scan_name = "in";
  c.scan_words = [cameras = world.cameras](double recording) {
    return cameras[static_cast<std::size_t>(std::lround(recording))].name;
  };
}

std::vector<int> all_recordings(const EffectWorld& world) {
  std::vector<int> out(world.cameras.size());
  for (std::size_t c = 0; c < out.size(); ++c) out[c] = static_cast<int>(c);
  return out;
}

// Of the correction of an effect in one recording.
std::string name_in(const std::vector<BundleCamera>& recordings, const std::string& name,
                    double recording) {
  return name + " in " + recordings[static_cast<std::size_t>(std::lround(recording))].name;
}

CameraEffect recording_zero(const EffectWorld& world, const Suspect& s) {
  CameraEffect out =
      effect(s, "recording_zero", fmt::format("the zero of {} is another one", s.name),
             {{"zero", s.unit}}, s.unit);
  in_one_of(world, all_recordings(world), out.candidate);
  out.candidate.check =
      "what was done to the joint between the recordings: referenced anew, motor or belt changed, "
      "steps lost";
  out.candidate.record = fmt::format("go to the reference of {} in every recording", s.name);
  out.corrections = [s, recordings = world.cameras,
                     frames = world.camera_of_frame](double recording) {
    return std::vector{
        turn(s, name_in(recordings, "zero", recording), s.unit, within(frames, recording))};
  };
  return out;
}

CameraEffect recording_mount(const EffectWorld& world, int marker, std::vector<int> recordings) {
  const std::string name = marker_name(world, marker);
  std::vector<EffectParameter> parameters{{"shift x", "m"}, {"shift y", "m"}, {"shift z", "m"}};
  const bool turns = world.kind != MeasurementKind::kPoint;
  if (turns)
    parameters.insert(parameters.begin(),
                      {{"turn x", "rad"}, {"turn y", "rad"}, {"turn z", "rad"}});
  CameraEffect out =
      effect("recording_mount", name, fmt::format("{} sits elsewhere on its link", name),
             std::move(parameters), "m");
  if (turns) out.candidate.size_weights.head<3>().setZero();
  in_one_of(world, std::move(recordings), out.candidate);
  out.candidate.check = "whether the marker was stuck on anew between the recordings";
  out.candidate.record = "leave the markers where they are between recordings";
  out.corrections = [like = out, marker, cameras = world.cameras,
                     frames = world.camera_of_frame](double recording) {
    std::vector<Correction> twists;
    const std::size_t count = like.candidate.parameters.size();
    for (std::size_t i = 0; i < count; ++i) {
      Correction twist = correct(CorrectedPart::kMarker, like, i, marker);
      twist.direction = Vector6d::Unit(static_cast<Eigen::Index>(6 - count + i));
      twist.name = name_in(cameras, twist.name, recording);
      twist.share = within(frames, recording);
      twists.push_back(std::move(twist));
    }
    return twists;
  };
  return out;
}

CameraEffect recording_growth(const EffectWorld& world) {
  CameraEffect out = effect("recording_growth", "robot", "the robot is larger (or smaller)",
                            {{"relative growth", "m/m"}}, "m/m");
  out.candidate.signed_words = {"the robot is larger", "the robot is smaller"};
  in_one_of(world, all_recordings(world), out.candidate);
  out.candidate.check =
      "temperature of the links: aluminium grows by 0.023 mm/m a kelvin, steel by 0.012 mm/m; "
      "sizes "
      "of the markers";
  out.candidate.record = "record at one temperature, or log it";
  out.corrections = [like = out, recordings = world.cameras,
                     frames = world.camera_of_frame](double recording) {
    Correction growth = correct(CorrectedPart::kGrowth, like, 0);
    growth.name = name_in(recordings, growth.name, recording);
    growth.share = within(frames, recording);
    return std::vector{growth};
  };
  out.nuisances = [like = out, frames = world.camera_of_frame](double recording) {
    return held_elsewhere(like, within(frames, recording));
  };
  return out;
}

}  // namespace

std::vector<CameraEffect> recording_effects(const EffectWorld& world) {
  std::vector<CameraEffect> out;
  if (!world.of_recordings) return out;
  for (const int marker : world.seen) {
    std::vector<int> recordings = world.seen_by.at(marker);
    if (recordings.size() < 2) continue;
    out.push_back(recording_mount(world, marker, std::move(recordings)));
  }
  out.push_back(recording_growth(world));
  for (const int joint : world.driven) out.push_back(recording_zero(world, suspect(world, joint)));
  return out;
}

}  // namespace kinescope::effects
