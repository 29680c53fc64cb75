// SPDX-License-Identifier: Apache-2.0
#include "app/report/facts.h"

#include <algorithm>
#include <cmath>

namespace kinescope::report {
namespace {

std::string spaced(std::string_view name) {
  std::string words(name);
  std::ranges::replace(words, '_', ' ');
  return words;
}

}  // namespace

Facts gather_facts(const RunSummary& run) {
  Analysis analysis = analyse(run);
  Verdict verdict = make_verdict(run, analysis);
  nlohmann::json result = make_result(run, analysis, verdict);
  return {.run = run,
          .analysis = std::move(analysis),
          .verdict = std::move(verdict),
          .result = std::move(result)};
}

std::string marker_name(TagId id) { return "tag_" + std::to_string(id.value); }

std::string marker_link(const KinematicTree& tree, TagId id) {
  const Marker* marker = tree.marker(id);
  if (marker == nullptr || marker->link.index() >= tree.links.size()) return "none";
  return tree.links[marker->link.index()].name;
}

std::string structure_link_name(const RunSummary& run, int link) {
  const KinematicTree& tree = run.calibration.tree;
  if (run.structure && tree.links.size() == run.structure->links.size() && link >= 0 &&
      static_cast<std::size_t>(link) < tree.links.size()) {
    return tree.links[static_cast<std::size_t>(link)].name;
  }
  return "link" + std::to_string(link);
}

double correlation(const Calibration& calibration, std::size_t a, std::size_t b) {
  const auto i = static_cast<Eigen::Index>(a);
  const auto j = static_cast<Eigen::Index>(b);
  const Eigen::MatrixXd& covariance = calibration.covariance;
  if (i >= covariance.rows() || j >= covariance.rows() || i >= covariance.cols() ||
      j >= covariance.cols()) {
    return 0.0;
  }
  const double scale = std::sqrt(covariance(i, i) * covariance(j, j));
  if (!(scale > 0.0) || !std::isfinite(scale)) return 0.0;
  return std::clamp(covariance(i, j) / scale, -1.0, 1.0);
}

double held_out_ratio(const Calibration& calibration) {
  if (calibration.folds < 2 || !(calibration.training_rms > 0.0)) return 0.0;
  const double ratio = calibration.held_out_rms / calibration.training_rms;
  return std::isfinite(ratio) ? ratio : 0.0;
}

Quantity joint_quantity(JointType type) {
  return type == JointType::kPrismatic ? Quantity::kLength : Quantity::kAngle;
}

std::string status_words(StructureStatus status) { return spaced(kinescope::to_string(status)); }

std::string status_words(CalibrationStatus status) { return spaced(kinescope::to_string(status)); }

std::string_view to_string(MeasurementKind kind) {
  switch (kind) {
    case MeasurementKind::kCorners:
      return "corners";
    case MeasurementKind::kPose:
      return "poses";
    case MeasurementKind::kPoint:
      return "points";
  }
  return "unknown";
}

}  // namespace kinescope::report
