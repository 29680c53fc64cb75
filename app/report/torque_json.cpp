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
          {"split_at_random", summary.split_at_random},
          {"new_motion", report::texts(summary.new_motion)},
          {"inputs", inputs_json(summary.inputs)},
          {"findings", findings_json(summary.data.findings)}};
}

json scores_json(const std::vector<TorqueScore>& scores) {
  json out = json::array();
  for (const TorqueScore& score : scores) {
    out.push_back({{"model", name_of(score)},
                   {"samples", score.training_samples},
                   {"inducing_points", score.inducing_points},
                   {"nmse_percent", numbers(score.nmse_percent)},
                   {"left_out_nmse_percent", numbers(score.left_out_nmse_percent)},
                   {"rms", numbers(score.rms)},
                   {"coverage_90", numbers(score.coverage_90)},
                   {"coverage_95", numbers(score.coverage_95)},
                   {"extrapolated", numbers(score.extrapolated)},
                   {"band_residuals",
                    std::vector<int>(score.band_residuals.begin(), score.band_residuals.end())},
                   {"bands_by_trajectory", score.bands_by_trajectory},
                   {"plainer_joints", score.plainer_joints},
                   {"constant_joints", score.constant_joints},
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

json robust_json(const std::optional<RobustSummary>& robust) {
  if (!robust) return nullptr;
  json methods = json::array();
  for (std::size_t k = 0; k < robust->scores.size(); ++k) {
    const TorqueScore& score = robust->scores[k];
    methods.push_back({{"method", to_string(kRobustMethods[k])},
                       {"samples", score.training_samples},
                       {"nmse_percent", numbers(score.nmse_percent)},
                       {"rms", numbers(score.rms)},
                       {"coverage_90", numbers(score.coverage_90)},
                       {"coverage_95", numbers(score.coverage_95)}});
  }
  json joints = json::array();
  for (std::size_t j = 0; j < robust->joints.size(); ++j) {
    const RobustJoint& joint = robust->joints[j];
    const TorquePart& part = robust->parts[j];
    json profile = json::array();
    for (const FrictionBin& bin : part.profile) {
      profile.push_back({{"velocity", number(bin.velocity)},
                         {"friction", number(bin.friction)},
                         {"spread", number(bin.spread)},
                         {"samples", bin.samples}});
    }
    joints.push_back({{"bandwidth", numbers(joint.bandwidth)},
                      {"beyond", number(joint.beyond)},
                      {"noise", number(joint.noise)},
                      {"unseen_rms", number(joint.unseen_rms)},
                      {"down_weighted", number(joint.down_weighted)},
                      {"friction_rms", number(part.friction_rms)},
                      {"gravity_rms", number(part.gravity_rms)},
                      {"inertia_rms", number(part.inertia_rms)},
                      {"profile", std::move(profile)}});
  }
  return {{"folds", robust->folds},
          {"by_trajectory", robust->by_trajectory},
          {"methods", methods},
          {"joints", joints}};
}

json estimate_json(const PayloadEstimate& payload, const std::vector<std::string>& names) {
  json joints = json::array();
  for (const MassOfJoint& joint : payload.joints) {
    joints.push_back({{"joint", text(names[static_cast<std::size_t>(joint.joint)])},
                      {"mass_kg", number(joint.mass_kg)},
                      {"sigma_kg", number(joint.sigma_kg)}});
  }
  return {{"mass_kg", number(payload.mass_kg)},
          {"sigma_kg", number(payload.sigma_kg)},
          {"lower_kg", number(payload.lower_kg)},
          {"upper_kg", number(payload.upper_kg)},
          {"freedom", payload.freedom},
          {"centre_m", numbers(payload.centre_m)},
          {"centre_sigma_m", numbers(payload.centre_sigma_m)},
          {"disagreement", number(payload.disagreement)},
          {"joints", joints}};
}

json payload_json(const TorqueSummary& summary) {
  if (!summary.payload) return nullptr;
  const PayloadSummary& payload = *summary.payload;
  return {{"against", text(payload.against)},
          {"by_gains", payload.by_gains},
          {"link", text(payload.motion.link)},
          {"motion", estimate_json(payload.motion, summary.joints)},
          {"at_rest", payload.at_rest ? estimate_json(*payload.at_rest, summary.joints) : json()}};
}

json rollout_error_json(const RolloutError& error) {
  return {{"joints", numbers(error.joints)}, {"tool_m", number(error.tool_m)}};
}

json rollout_json(const TorqueSummary& summary) {
  if (!summary.rollout) return nullptr;
  const Rollout& rollout = summary.rollout->found;
  json horizons = json::array();
  for (const RolloutHorizon& horizon : rollout.horizons) {
    horizons.push_back({{"horizon_s", number(horizon.horizon_s)},
                        {"windows", horizon.windows},
                        {"with_effects", rollout_error_json(horizon.with_effects)},
                        {"without_effects", rollout_error_json(horizon.without_effects)},
                        {"held", rollout_error_json(horizon.held)}});
  }
  return {{"tip", text(rollout.tip)},
          {"seen_by_trace", summary.rollout->seen_by_trace},
          {"failure", text(rollout.failure)},
          {"horizons", std::move(horizons)}};
}

json best_model(const TorqueSummary& summary) {
  if (summary.scores.empty()) return {};
  const TorqueScore& best = summary.scores[static_cast<std::size_t>(summary.best)];
  const bool holds = std::isfinite(mean_nmse_percent(best)) && worse_than_constant(best).empty();
  return holds ? json(name_of(best)) : json();
}

}  // namespace

json torque_json(const TorqueSummary& summary) {
  json joints = json::array();
  for (std::size_t j = 0; j < summary.joints.size(); ++j) {
    joints.push_back({{"name", text(summary.joints[j])}, {"type", to_string(summary.types[j])}});
  }
  return {{"schema", "kinescope.dynamics"},
          {"schema_version", 1},
          {"robot", text(summary.robot)},
          {"version", text(summary.version)},
          {"unit", text(summary.train.torque_unit)},
          {"joints", joints},
          {"gravity_m_s2", numbers(summary.gravity_m_s2)},
          {"gravity_declared", summary.gravity_declared},
          {"traced_gravity_m_s2",
           summary.traced_gravity_m_s2 ? numbers(*summary.traced_gravity_m_s2) : json()},
          {"data", data_json(summary)},
          {"models", scores_json(summary.scores)},
          {"best", best_model(summary)},
          {"learning", learning_json(summary.learning)},
          {"parameters", parameters_json(summary.identification)},
          {"noise_sigma", numbers(summary.identification.sigma)},
          {"correlation_samples", number(summary.identification.correlation_samples)},
          {"drives", drives_json(summary.drives)},
          {"robust", robust_json(summary.robust)},
          {"payload", payload_json(summary)},
          {"rollout", rollout_json(summary)},
          {"consistent", consistent_json(summary.consistent)},
          {"trace", summary.trace ? trace_json(*summary.trace) : json(nullptr)},
          {"warnings", report::texts(summary.warnings)}};
}

}  // namespace kinescope
