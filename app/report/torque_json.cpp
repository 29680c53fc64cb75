// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "app/report/result_values.h"
#include "app/report/torque_summary.h"
#include "app/report/trace_json.h"

namespace kinescope {
namespace {

using nlohmann::json;
using report::inputs_json;
using report::number;
using report::numbers;
using report::text;

json findings_json(const std::vector<LogFinding>& findings) {
  json out = json::array();
  for (const LogFinding& finding : findings) {
    out.push_back({{"fault", to_string(finding.fault)},
                   {"weight", to_string(finding.weight)},
                   {"channel", text(finding.channel)},
                   {"share", number(finding.share)},
                   {"value", number(finding.value)},
                   {"place", text(finding.place)},
                   {"what", text(finding.what)},
                   {"remedy", text(finding.remedy)}});
  }
  return out;
}

json data_json(const TorqueSummary& summary) {
  return {{"rows_read", summary.data.rows_read},
          {"rows_used", summary.data.rows_used},
          {"log_rate_hz", number(summary.data.log_rate_hz)},
          {"rate_hz", number(summary.data.rate_hz)},
          {"filter", to_string(summary.data.filter)},
          {"source", to_string(summary.data.source)},
          {"cutoff_hz", number(summary.data.cutoff.cutoff_hz)},
          {"training", summary.train.size()},
          {"test", summary.test.size()},
          {"split", text(summary.split)},
          {"inputs", inputs_json(summary.inputs)},
          {"findings", findings_json(summary.data.findings)}};
}

json scores_json(const std::vector<TorqueScore>& scores) {
  json out = json::array();
  for (const TorqueScore& score : scores) {
    out.push_back({{"model", to_string(score.kind)},
                   {"samples", score.training_samples},
                   {"nmse_percent", numbers(score.nmse_percent)},
                   {"rms", numbers(score.rms)},
                   {"coverage_90", numbers(score.coverage_90)},
                   {"coverage_95", numbers(score.coverage_95)},
                   {"failure", text(score.failure)}});
  }
  return out;
}

json learning_json(const std::vector<LearningCurve>& curves) {
  json out = json::array();
  for (const LearningCurve& curve : curves) {
    json points = json::array();
    for (const LearningPoint& point : curve.points) {
      points.push_back({{"samples", point.samples}, {"nmse_percent", number(point.nmse_percent)}});
    }
    out.push_back({{"model", to_string(curve.kind)}, {"points", points}});
  }
  return out;
}

json parameters_json(const Identification& found) {
  json out = json::array();
  for (Eigen::Index i = 0; i < found.parameters.size(); ++i) {
    out.push_back({{"name", text(found.names[static_cast<std::size_t>(i)])},
                   {"value", number(found.parameters[i])},
                   {"sigma", number(found.sigma_of(i))},
                   {"sigma_white", number(std::sqrt(found.white_covariance(i, i)))}});
  }
  return out;
}

json drives_json(const std::vector<DriveEstimate>& drives) {
  json out = json::array();
  for (const DriveEstimate& drive : drives) {
    out.push_back({{"term", drive.term},
                   {"joint", text(drive.joint)},
                   {"value", number(drive.value)},
                   {"sigma", number(drive.sigma)}});
  }
  return out;
}

json consistent_json(const ConsistentModel& consistent) {
  json links = json::array();
  json joints = json::array();
  const DynamicModel& model = consistent.model;
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    const InertialParameters& link = model.links[l];
    const Eigen::Matrix3d& I = link.inertia_kgm2;
    Eigen::VectorXd moments(6);
    moments << I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2);
    links.push_back({{"name", text(model.tree.links[l].name)},
                     {"mass_kg", number(link.mass_kg)},
                     {"first_moment_kg_m", numbers(link.first_moment_kgm)},
                     {"inertia_kg_m2", numbers(moments)}});
  }
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (model.tree.joints[j].type == JointType::kFixed) continue;
    joints.push_back({{"name", text(model.tree.joints[j].name)},
                      {"viscous", number(model.joints[j].viscous)},
                      {"coulomb", number(model.joints[j].coulomb)},
                      {"motor_inertia", number(model.joints[j].motor_inertia)}});
  }
  return {{"links", links}, {"joints", joints}, {"misfit", number(consistent.misfit)}};
}

}  // namespace

json torque_json(const TorqueSummary& summary) {
  json joints = json::array();
  for (std::size_t j = 0; j < summary.joints.size(); ++j) {
    joints.push_back({{"name", text(summary.joints[j])}, {"type", to_string(summary.types[j])}});
  }
  return {
      {"schema", "kinescope.dynamics"},
      {"schema_version", 1},
      {"robot", text(summary.robot)},
      {"version", text(summary.version)},
      {"unit", text(summary.train.torque_unit)},
      {"joints", joints},
      {"gravity_m_s2", numbers(summary.gravity_m_s2)},
      {"data", data_json(summary)},
      {"models", scores_json(summary.scores)},
      {"best", summary.scores.empty()
                   ? json()
                   : json(to_string(summary.scores[static_cast<std::size_t>(summary.best)].kind))},
      {"learning", learning_json(summary.learning)},
      {"parameters", parameters_json(summary.identification)},
      {"noise_sigma", numbers(summary.identification.sigma)},
      {"correlation_samples", number(summary.identification.correlation_samples)},
      {"drives", drives_json(summary.drives)},
      {"consistent", consistent_json(summary.consistent)},
      {"trace", summary.trace ? trace_json(*summary.trace) : json(nullptr)},
      {"warnings", report::texts(summary.warnings)}};
}

}  // namespace kinescope
