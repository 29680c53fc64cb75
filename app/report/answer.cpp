// SPDX-License-Identifier: Apache-2.0
#include "app/report/answer.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "app/report/numbers.h"
#include "app/report/prediction.h"
#include "app/report/verdict_words.h"
#include "calib/quality/unknown_axes.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

using report::Quantity;

Answer no_answer(std::string where, std::string what, std::string remedy) {
  return {false, std::move(where), std::move(what), std::move(remedy)};
}

// A geometry that is held says how far it is off; where the user holds it, that is what was asked.
bool is_geometry_held(const Calibration& calibration) {
  return std::ranges::none_of(calibration.tree.joints, [&](const Joint& joint) {
    return is_axis_estimated(calibration, joint);
  });
}

// How far a model is from the measurements it did not leave out, and how far those move: root mean
// squares, as one coordinate of a corner (px) or as a distance (m).
struct Missed {
  double by = 0.0;
  double of = 0.0;
  bool px = false;
};

Missed missed_motion(const Calibration& calibration) {
  const report::Predictor predictor(calibration);
  struct Places {
    std::vector<Eigen::VectorXd> seen;
    double squares = 0.0;
  };
  std::map<std::pair<TagId, std::size_t>, Places> markers;  // and cameras
  const bool px = calibration.kind == MeasurementKind::kCorners;
  for (const SightingResidual& sighting : calibration.residuals) {
    const std::vector<Pose>& links = predictor.links(sighting.frame);
    const Marker* marker = calibration.tree.marker(sighting.id);
    if (!sighting.used || links.empty() || marker == nullptr) continue;
    Eigen::VectorXd place;
    double squares = 0.0;
    if (px) {
      const std::vector<Eigen::Vector2d> corners = predictor.corners(sighting);
      if (corners.empty() || corners.size() != sighting.corners_px.size()) continue;
      place = Eigen::VectorXd::Zero(2);
      for (std::size_t k = 0; k < corners.size(); ++k) {
        place += (corners[k] + sighting.corners_px[k]) / static_cast<double>(corners.size());
        squares += sighting.corners_px[k].squaredNorm() / static_cast<double>(corners.size());
      }
    } else {
      const Pose T = links[marker->link.index()] * marker->T_link_marker;
      place = calibration.moving
                  ? camera_from_base(calibration, sighting.frame, links) * T.translation
                  : T.translation;
      squares = sighting.displacement.tail<3>().squaredNorm();
    }
    Places& places = markers[{sighting.id, calibration.camera_at(sighting.frame)}];
    places.seen.push_back(std::move(place));
    places.squares += squares;
  }
  Missed out{0.0, 0.0, px};
  double count = 0.0;
  for (const auto& [id, places] : markers) {
    Eigen::VectorXd mean = Eigen::VectorXd::Zero(places.seen.front().size());
    for (const Eigen::VectorXd& place : places.seen)
      mean += place / static_cast<double>(places.seen.size());
    for (const Eigen::VectorXd& place : places.seen) out.of += (place - mean).squaredNorm();
    out.by += places.squares;
    count += static_cast<double>(places.seen.size());
  }
  if (count == 0.0) return out;
  out.by = std::sqrt(out.by / count);
  out.of = std::sqrt(out.of / count);
  return out;
}

// A robot that misses its markers by this share of their motion is another one than was filmed.
constexpr double kAnotherRobot = 0.1;

std::string words_of(const Missed& missed, double value) {
  return report::text_with_unit(value, missed.px ? Quantity::kPixels : Quantity::kLength);
}

Answer structure_answer(const Structure& structure) {
  if (structure.status == StructureStatus::kDetermined) return {};
  if (!structure.doubts.empty())
    return no_answer("structure", structure.doubts.front().what, structure.doubts.front().remedy);
  return no_answer("structure",
                   "another structure explains the recording as well: " + structure.runner_up,
                   "record every joint moving at its own time");
}

// Joints without a channel, where those are most of a robot whose log does move: it is the log of
// something else.
std::vector<std::string> undriven_joints(const RunSummary& run) {
  std::vector<std::string> out;
  if (!run.structure || run.log.empty() || run.structure->idle_channels.empty()) return out;
  std::size_t moving = 0;
  for (const Joint& joint : run.calibration.tree.joints) {
    if (joint.type == JointType::kFixed) continue;
    ++moving;
    if (joint.channel.empty()) out.push_back(joint.name);
  }
  if (2 * out.size() <= moving) out.clear();
  return out;
}

}  // namespace

Answer judge(const RunSummary& run) {
  const Calibration& calibration = run.calibration;
  if (calibration.status == CalibrationStatus::kUndetermined)
    return no_answer("calibration", calibration.status_reason, calibration.status_remedy);
  const Missed missed = missed_motion(calibration);
  if (missed.by > kAnotherRobot * missed.of && !(run.free_asked && is_geometry_held(calibration))) {
    return no_answer(
        "calibration",
        fmt::format("the robot misses its markers by {} where they move by {}",
                    words_of(missed, missed.by), words_of(missed, missed.of)),
        run.nominal ? "check the lengths and axes of the nominal robot, that the columns are those "
                      "of its joints, and the units of both"
                    : "check the units of the log and the sizes of the markers, and that each "
                      "reading belongs to its frame");
  }
  if (calibration.status == CalibrationStatus::kNotConverged) {
    return no_answer("calibration", "the fit did not settle: " + calibration.status_reason,
                     "record more different postures; check units and nominal values");
  }
  if (run.trace && !run.trace->converged) {
    return no_answer("calibration", run.trace->reason,
                     "check that log, markers and camera belong together; record more different "
                     "postures");
  }
  if (const std::vector<std::string> undriven = undriven_joints(run); !undriven.empty()) {
    return no_answer("structure",
                     fmt::format("no channel of the log drives {}", report::joined(undriven)),
                     "check that the log belongs to this recording, and its clock");
  }
  if (const std::vector<std::string> unknown = unknown_axes(calibration); !unknown.empty()) {
    return no_answer("calibration",
                     fmt::format("nothing is known of the ax{} of {}",
                                 unknown.size() == 1 ? "is" : "es", report::joined(unknown)),
                     "record more different postures: every joint through its range");
  }
  return run.structure ? structure_answer(*run.structure) : Answer{};
}

}  // namespace kinescope
