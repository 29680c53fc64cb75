// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/report/numbers.h"
#include "app/report/torque_summary.h"
#include "app/report/torque_unit.h"

namespace kinescope {
namespace {

// A joint whose best model leaves more than this share of the torque unexplained is spoken of, per
// cent.
constexpr double kPoor = 5.0;
// Of a payload: joints that disagree by less may do so by chance.
constexpr double kDisagree = 2.0;
// A 95 % band that holds fewer of the unseen samples than this is too narrow.
constexpr double kLeastCoverage = 0.90;

std::string percent(double value) {
  return value < 10.0 ? fmt::format("{:.2g} %", value) : fmt::format("{:.0f} %", value);
}

std::string words_of(const TorqueScore& score) {
  std::string name(name_of(score));
  std::ranges::replace(name, '_', '-');
  return name;
}

const TorqueScore* score_of(const TorqueSummary& summary, TorqueModelKind kind) {
  for (const TorqueScore& score : summary.scores) {
    if (score.kind == kind && !score.traced && score.failure.empty()) return &score;
  }
  return nullptr;
}

// Of those whose torque varies.
Eigen::Index worst_joint(const TorqueScore& score) {
  Eigen::Index worst = -1;
  for (Eigen::Index j = 0; j < score.nmse_percent.size(); ++j) {
    if (!std::isfinite(score.nmse_percent[j])) continue;
    if (worst < 0 || score.nmse_percent[j] > score.nmse_percent[worst]) worst = j;
  }
  return worst;
}

// How it was chosen, which the test has no part in.
std::string choice_words(const TorqueSummary& summary) {
  const auto fitted = std::ranges::count_if(
      summary.scores, [](const TorqueScore& score) { return score.failure.empty(); });
  if (fitted < 2) return "";
  const bool known =
      summary.scores[static_cast<std::size_t>(summary.best)].left_out_nmse_percent.size() > 0;
  return known ? fmt::format(", chosen of {} by motion left out of the training,", fitted)
               : fmt::format(", the first of {},", fitted);
}

std::string joint_names(const TorqueSummary& summary, const std::vector<int>& joints) {
  std::vector<std::string> names;
  for (const int joint : joints) names.push_back(summary.joints[static_cast<std::size_t>(joint)]);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string joints_words(const TorqueScore& score) {
  const auto varying = score.nmse_percent.array().isFinite().count();
  if (varying == score.nmse_percent.size()) return "the joints";
  return fmt::format("the {} of {} joints whose torque varies there", varying,
                     score.nmse_percent.size());
}

// Masses to the place of two digits of half their interval.
std::string kilograms(double mass_kg, const PayloadEstimate& found) {
  const double half = found.upper_kg - found.mass_kg;
  const int places = half > 0.0 ? static_cast<int>(std::ceil(1.0 - std::log10(half))) : 6;
  return fmt::format("{:.{}f}", mass_kg, std::clamp(places, 0, 6));
}

std::string interval_text(const PayloadEstimate& found) {
  return fmt::format("95 %: {} to {} kg", kilograms(found.lower_kg, found),
                     kilograms(found.upper_kg, found));
}

std::string payload_words(const PayloadSummary& payload) {
  const PayloadEstimate& found = payload.motion;
  std::string out =
      found.is_seen()
          ? fmt::format("{} carries {} kg more than {} ({})", found.link,
                        kilograms(found.mass_kg, found), payload.against, interval_text(found))
          : fmt::format("{} carries nothing that shows: {} kg against {} ({})", found.link,
                        kilograms(found.mass_kg, found), payload.against, interval_text(found));
  if (payload.at_rest) {
    out += fmt::format("; at rest, from the learned torque without friction: {} kg ({})",
                       kilograms(payload.at_rest->mass_kg, *payload.at_rest),
                       interval_text(*payload.at_rest));
  }
  out += ".";
  if (found.disagreement > kDisagree) {
    out += fmt::format(
        " The joints disagree about it {:.1f} times more than their noise lets "
        "them: torque scales or the geometry are wrong, and the interval is "
        "widened for that only as far as they differ.",
        found.disagreement);
  }
  if (payload.by_gains) {
    out += " Torques are logged values times declared factors: the mass is as right as these are.";
  }
  return out;
}

// At the middle horizon: the first is passed by almost any model, the last by almost none.
std::string rollout_words(const RolloutSummary& rollout) {
  const Rollout& found = rollout.found;
  if (!found.failure.empty()) return "No rollout of the traced model: " + found.failure + ".";
  const RolloutHorizon& horizon = found.horizons[found.horizons.size() / 2];
  const bool tool = !found.tip.empty();
  const auto size = [tool](const RolloutError& error) {
    const double value = tool ? error.tool_m : error.joints.maxCoeff();
    if (!std::isfinite(value)) return std::string("lost");
    return report::text_with_unit(value,
                                  tool ? report::Quantity::kLength : report::Quantity::kAngle);
  };
  return fmt::format(
      "Driven by the measured torques alone for {:.3g} s, the traced model is {} from the measured "
      "{}; without the effects {}; the motion itself is {}{}.",
      horizon.horizon_s, size(horizon.with_effects), tool ? found.tip : "posture (worst joint)",
      size(horizon.without_effects), size(horizon.held),
      rollout.seen_by_trace ? " (motion that tracing has seen; name another log with --test)" : "");
}

// Masses for its size that no robot has; empty where they are likely, or of currents.
std::string mass_words(const TorqueSummary& summary) {
  constexpr double kHeaviest = 1000.0;  // kg a metre of reach: three times a heavy foundry robot
  constexpr double kLightest = 0.03;    // a tenth of a toy's
  if (summary.train.torque_unit != "Nm") return "";
  const DynamicModel& model = summary.consistent.model;
  double mass = 0.0;
  for (const InertialParameters& link : model.links) mass += link.mass_kg;
  double reach = 0.0;
  for (const Joint& joint : model.tree.joints) reach += joint.T_parent_joint.translation.norm();
  if (!(reach > 0.0) || !(mass > 0.0)) return "";
  if (mass > kLightest * reach && mass < kHeaviest * reach) return "";
  return fmt::format(
      "The masses that these torques ask for add up to {:.3g} kg on a reach of {:.3g} m: check the "
      "unit of the torques (N m is taken; torque_unit, torque_factor) and of the lengths. ",
      mass, reach);
}

// "mcx(link2) + .." in words: what a combination is named after.
std::string plain_parameter(const std::string& combination) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kWords = {
      {{"m", "the mass"},
       {"mcx", "the centre of mass along x"},
       {"mcy", "the centre of mass along y"},
       {"mcz", "the centre of mass along z"},
       {"motor_inertia", "the motor inertia"},
       {"viscous", "the viscous friction"},
       {"coulomb", "the Coulomb friction"},
       {"offset", "the torque offset"}}};
  const std::size_t open = combination.find('(');
  if (open == std::string::npos) return combination;
  const std::string name = combination.substr(0, open);
  const std::string place = combination.substr(open + 1, combination.find(')') - open - 1);
  const auto found =
      std::ranges::find(kWords, name, &std::pair<std::string_view, std::string_view>::first);
  if (found != kWords.end()) return fmt::format("{} of {}", found->second, place);
  return name.starts_with("I") ? fmt::format("the inertia {} of {}", name, place) : combination;
}

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double cosine = std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0);
  return std::acos(cosine) * 180.0 / std::numbers::pi;
}

std::string gravity_words(const TorqueSummary& summary) {
  const Eigen::Vector3d& used = summary.gravity_m_s2;
  const std::string from =
      summary.gravity_declared ? std::string("Gravity was declared")
      : summary.default_gravity_m_s2
          ? fmt::format(
                "Nothing was declared about gravity; the torques say that it points along ({:.3f}, "
                "{:.3f}, {:.3f}) in the base frame, {:.0f} degrees from down along z, and so it "
                "was "
                "taken: declare it (gravity in recording.yaml, in the camera's frame)",
                used.normalized().x(), used.normalized().y(), used.normalized().z(),
                degrees_between(used, *summary.default_gravity_m_s2))
          : fmt::format(
                "Nothing was declared about gravity, which was taken as {:.4g} m/s^2 down "
                "along z of the base",
                used.norm());
  if (!summary.traced_gravity_m_s2) {
    if (summary.gravity_declared) return "";
    return from + (summary.default_gravity_m_s2 ? "." : " (--gravity).");
  }
  const Eigen::Vector3d& found = *summary.traced_gravity_m_s2;
  return fmt::format(
      "{}, but the torques say that it points {:.0f} degrees from there: is the base on a wall, a "
      "ceiling, a slope? Check how it stands and say --gravity={:.3g},{:.3g},{:.3g}; the models "
      "above were fitted with the wrong direction.",
      from, degrees_between(used, found), found.x(), found.y(), found.z());
}

}  // namespace

namespace {

// How the samples were divided, and what that says about the table.
std::vector<std::string> split_notes(const TorqueSummary& summary) {
  std::vector<std::string> out;
  if (summary.split_at_random) {
    out.emplace_back(
        "Held out are samples by lot: each has neighbours that were learned from, so that these "
        "figures flatter; they are for published tables that were made so.");
  }
  const auto chooses = [](const TorqueScore& score) {
    return score.failure.empty() && score.left_out_nmse_percent.size() > 0;
  };
  if (std::ranges::count_if(summary.scores, chooses) > 1) {
    out.push_back(fmt::format(
        "The model to rely on was chosen on the {} training samples, each predicted by a fit "
        "without its {}; no test sample had a part in it.",
        summary.train.size(),
        std::ranges::any_of(summary.scores, &TorqueScore::bands_by_trajectory) ? "trajectory"
                                                                               : "block of time"));
  }
  const auto traced = std::ranges::find_if(summary.scores, [](const TorqueScore& score) {
    return score.traced && score.failure.empty();
  });
  if (traced != summary.scores.end() && summary.rollout && summary.rollout->seen_by_trace) {
    out.emplace_back(
        "traced: which effects it has was chosen on the whole log, their sizes here on the "
        "training samples; name another log with --test to judge the choice, too.");
  }
  for (const std::string& words : summary.new_motion)
    out.push_back("New on the test: " + words + ".");
  return out;
}

}  // namespace

double mean_nmse_percent(const TorqueScore& score) {
  const auto varies = score.nmse_percent.array().isFinite();
  const auto count = varies.count();
  if (count == 0) return std::numeric_limits<double>::quiet_NaN();
  return varies.select(score.nmse_percent.array(), 0.0).sum() / static_cast<double>(count);
}

std::vector<std::string> model_notes(const TorqueSummary& summary) {
  std::vector<std::string> out = split_notes(summary);
  for (const TorqueScore& score : summary.scores) {
    const std::string name = words_of(score);
    if (const auto worse = worse_than_constant(score); !worse.empty()) {
      out.push_back(fmt::format("{} is worse than a constant at {}: of no use there.", name,
                                joint_names(summary, worse)));
    }
    if (!score.constant_joints.empty()) {
      out.push_back(
          fmt::format("{} is a constant at {}: it predicted motion left out of the training worse "
                      "than one.",
                      name, joint_names(summary, score.constant_joints)));
    }
    if (!score.plainer_joints.empty()) {
      out.push_back(fmt::format(
          "{} is the parametric one at {}: what it learned beside that predicted motion left out "
          "of the training worse.",
          name, joint_names(summary, score.plainer_joints)));
    }
  }
  return out;
}

TorqueVerdict torque_verdict(const TorqueSummary& summary) {
  TorqueVerdict out;
  if (summary.payload) out.payload = payload_words(*summary.payload);
  out.gravity = gravity_words(summary);
  if (summary.rollout) out.rollout = rollout_words(*summary.rollout);
  const Identification& found = summary.identification;
  out.found = fmt::format(
      "{} joints; {} base and drive parameters from {} samples; noise cut at {:.3g} Hz.",
      summary.joints.size(), found.parameters.size(), summary.train.size(),
      summary.data.cutoff.cutoff_hz);
  if (summary.scores.empty()) return out;
  const TorqueScore& best = summary.scores[static_cast<std::size_t>(summary.best)];
  if (!best.failure.empty()) {
    out.accurate = "No model could be fitted: " + best.failure;
    return out;
  }
  const Eigen::Index worst = worst_joint(best);
  if (worst < 0) {
    out.accurate =
        fmt::format("On {} no joint's torque varies: it judges no model.", summary.split);
    return out;
  }
  out.accurate = fmt::format(
      "On {} the {} model{} leaves {} of the torque's variance unexplained (mean over {}; worst "
      "{} with {}).",
      summary.split, words_of(best), choice_words(summary), percent(mean_nmse_percent(best)),
      joints_words(best), summary.joints[static_cast<std::size_t>(worst)],
      percent(best.nmse_percent[worst]));
  const TorqueScore* parametric = score_of(summary, TorqueModelKind::kParametric);
  if (parametric != nullptr && parametric != &best) {
    out.accurate +=
        fmt::format(" The parametric model leaves {}.", percent(mean_nmse_percent(*parametric)));
  }
  if (best.nmse_percent[worst] > kPoor) {
    const auto at = static_cast<std::size_t>(worst);
    const std::string unit = report::joint_unit(summary.train.torque_unit, summary.types[at]);
    out.limits = fmt::format(
        "The torque of {} is explained worst: its noise is {:.3g} {}, its "
        "error {:.3g} {}. ",
        summary.joints[at], found.sigma[worst], unit, best.rms[worst], unit);
  }
  if (best.nmse_percent[worst] > 100.0) {
    out.limits += fmt::format(
        "On motion it has not seen it predicts {} worse than a constant would: nothing of it was "
        "learned; record longer, moving all joints at changing speeds. ",
        summary.joints[static_cast<std::size_t>(worst)]);
  }
  out.limits += mass_words(summary);
  Eigen::Index narrow = 0;
  if (best.coverage_95.minCoeff(&narrow) < kLeastCoverage) {
    out.limits += fmt::format(
        "The 95 % band of {} holds only {:.0f} % of the unseen samples: the model lacks something "
        "there. ",
        summary.joints[static_cast<std::size_t>(narrow)], 100.0 * best.coverage_95[narrow]);
  }
  if (!found.undetermined.empty()) {
    out.limits += fmt::format(
        "{} parameters are not moved by this motion, the first being {}: record a richer one. ",
        found.undetermined.size(),
        plain_parameter(found.names[static_cast<std::size_t>(found.undetermined[0])]));
  }
  if (out.limits.empty()) out.limits = "No joint stands out.";
  return out;
}

}  // namespace kinescope
