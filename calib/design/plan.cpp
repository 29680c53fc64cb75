// SPDX-License-Identifier: Apache-2.0
#include "calib/design/plan.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "calib/design/exchange.h"
#include "calib/design/information.h"
#include "calib/design/rivals.h"
#include "kinematics/core/error.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::design {
namespace {

constexpr int kDrawsACandidate = 50;  // before the ranges count as showing no marker
constexpr std::size_t kAtATime = 50;  // candidates that are linearised together
constexpr std::size_t kFewestStops = 2;
constexpr std::size_t kMostStops = 60;
constexpr std::size_t kUsualPairs = 200;  // of postures, from which the way between two is told

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

// Names and values of an effect's parameters.
struct NamedEffect {
  std::vector<std::string> names;
  Eigen::VectorXd values;
};

// Of the robot's effects and of their rivals, by what a recording shows of them.
struct Names {
  std::vector<NamedEffect> effects, rivals;
};

// By posture.
struct Rows {
  std::vector<Parameter> parameters;
  std::vector<Eigen::MatrixXd> information;  // of each
};

class Planner {
 public:
  Planner(const PlannedRobot& robot, const JointSpace& space, const Pairs& pairs,
          const PlanOptions& options)
      : robot_(robot),
        space_(space),
        pairs_(pairs),
        options_(options),
        // Postures at rest are far apart: their noise is not alike.
        widening_(options.postures > 0 ? 1.0 : robot.calibration.noise_widening.value_or(1.0)),
        rng_(Rng::from_name("plan", options.seed)) {}

  [[nodiscard]] RecordingPlan plan(const Progress& progress);

 private:
  void draw_candidates();
  [[nodiscard]] Rows rows_at(const std::vector<Eigen::VectorXd>& postures) const;
  [[nodiscard]] std::vector<Eigen::VectorXd> chosen(std::size_t count, double frames_each) const;
  [[nodiscard]] std::vector<std::size_t> parting_rivals(std::size_t count,
                                                        double frames_each) const;
  [[nodiscard]] RecordingPlan postures_plan() const;
  [[nodiscard]] RecordingPlan motion_plan(const Progress& progress) const;
  [[nodiscard]] std::size_t usual_stops() const;
  [[nodiscard]] std::vector<Eigen::VectorXd> stops_in_time(std::size_t count) const;
  void judge(const ExpectedRecording& recording, RecordingPlan& plan) const;
  void judge_rivals(const std::vector<Parameter>& parameters, const Eigen::MatrixXd& information,
                    const Names& names, RecordingPlan& plan) const;
  [[nodiscard]] Promise promise_of(const std::vector<Parameter>& parameters,
                                   const Eigen::MatrixXd& covariance) const;
  // Without the columns of rivals, which the model does not have.
  [[nodiscard]] static std::vector<Eigen::Index> own_columns(const std::vector<Parameter>& all,
                                                             const Names& names);
  [[nodiscard]] std::vector<Parameter> subset(const std::vector<Parameter>& all,
                                              const std::vector<Eigen::Index>& chosen) const;
  [[nodiscard]] std::vector<RivalColumns> columns_of_pairs(const std::vector<Parameter>& all,
                                                           const Names& names) const;

  const PlannedRobot& robot_;
  const JointSpace& space_;
  const Pairs& pairs_;
  const PlanOptions& options_;
  double widening_;
  mutable Rng rng_;
  double seen_share_ = 0.0;
  std::vector<Eigen::VectorXd> postures_;  // candidates
  Rows candidates_;
  Eigen::MatrixXd root_;  // of the goal, by the candidates' own parameters
  Names names_;           // by the candidates
};

std::vector<NamedEffect> named_effects(const PlannedRobot& robot,
                                       const ExpectedRecording& recording,
                                       const std::vector<ConsideredEffect>& effects) {
  std::vector<NamedEffect> out;
  for (const ConsideredEffect& effect : effects) {
    NamedEffect& one = out.emplace_back();
    for (const Correction& correction : corrections_of(robot, recording, effect))
      one.names.push_back(correction.name);
    one.values = effect.values;
  }
  return out;
}

void Planner::draw_candidates() {
  int draws = 0, within = 0, seen = 0;
  while (std::ssize(postures_) < options_.candidates &&
         draws < kDrawsACandidate * options_.candidates) {
    ++draws;
    auto readings = space_.draw(rng_);
    if (!readings) continue;
    ++within;
    if (expected_sightings(robot_.calibration, space_.values(*readings), robot_.sight, robot_.noise)
            .empty())
      continue;
    ++seen;
    postures_.push_back(std::move(*readings));
  }
  if (within == 0) {
    throw undetermined("plan", "no posture keeps the ranges of joints that one channel moves",
                       "give wider ranges with --limits or --range");
  }
  if (postures_.empty()) {
    throw undetermined("plan", "no posture within the joints' ranges shows a marker",
                       "give wider limits, or move the camera and record anew");
  }
  seen_share_ = static_cast<double>(seen) / within;
}

Rows Planner::rows_at(const std::vector<Eigen::VectorXd>& postures) const {
  const std::size_t parts = (postures.size() + kAtATime - 1) / kAtATime;
  std::vector<ExpectedRows> part(parts);
  parallel_for(parts, [&](std::size_t p) {
    const auto first = postures.begin() + static_cast<std::ptrdiff_t>(p * kAtATime);
    const auto last = postures.begin() +
                      static_cast<std::ptrdiff_t>(std::min(postures.size(), (p + 1) * kAtATime));
    part[p] = expected_rows(robot_.calibration, recording_at(robot_, space_, {first, last}));
  });
  Rows out{part.front().parameters, {}};
  for (const ExpectedRows& one : part)
    for (const Eigen::MatrixXd& J : one.J) out.information.push_back(information_of(J, widening_));
  return out;
}

std::vector<Eigen::Index> Planner::own_columns(const std::vector<Parameter>& all,
                                               const Names& names) {
  std::vector<Eigen::Index> out;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool is_rival = std::ranges::any_of(names.rivals, [&](const NamedEffect& rival) {
      return std::ranges::find(rival.names, all[i].name) != rival.names.end();
    });
    if (!is_rival) out.push_back(static_cast<Eigen::Index>(i));
  }
  return out;
}

std::vector<Parameter> Planner::subset(const std::vector<Parameter>& all,
                                       const std::vector<Eigen::Index>& chosen) const {
  std::vector<Parameter> out;
  for (const Eigen::Index i : chosen) out.push_back(all[static_cast<std::size_t>(i)]);
  return out;
}

// Empty columns: the effects say nothing in such a recording.
std::vector<RivalColumns> Planner::columns_of_pairs(const std::vector<Parameter>& all,
                                                    const Names& names) const {
  std::vector<RivalColumns> out;
  for (const auto& [believed, other] : pairs_) {
    const NamedEffect& own = names.effects[believed];
    RivalColumns& columns = out.emplace_back();
    if (own.names.empty() || names.rivals[other].names.empty() ||
        own.values.size() != std::ssize(own.names))
      continue;
    std::vector<std::string> others;
    for (std::size_t r = 0; r < names.rivals.size(); ++r)
      if (r != other)
        others.insert(others.end(), names.rivals[r].names.begin(), names.rivals[r].names.end());
    columns = rival_columns(all, own.names, own.values, others);
  }
  return out;
}

// The search counts what is known of the robot, so that the first postures have a value; the
// promise does not (judge_rivals).
std::vector<std::size_t> Planner::parting_rivals(std::size_t count, double frames_each) const {
  std::vector<RivalColumns> pairs = columns_of_pairs(candidates_.parameters, names_);
  std::erase_if(pairs, [](const RivalColumns& one) { return one.believed.empty(); });
  if (pairs.empty() || count == 0) return {};
  std::vector<Parameter> robot = candidates_.parameters;
  for (Parameter& parameter : robot)
    if (parameter.block == "effects") parameter.name.clear();  // not as the calibration knows them
  DesignProblem problem{known_information(robot_.calibration, robot), candidates_.information, {}};
  for (Eigen::MatrixXd& one : problem.candidates) one *= frames_each;
  problem.criterion = [&pairs](const Eigen::MatrixXd& information) {
    double least = std::numeric_limits<double>::infinity();
    for (const RivalColumns& pair : pairs) least = std::min(least, sigmas_apart(information, pair));
    return -least;
  };
  return choose_candidates(problem, count);
}

std::vector<Eigen::VectorXd> Planner::chosen(std::size_t count, double frames_each) const {
  const std::vector<std::size_t> first = parting_rivals(count / 2, frames_each);
  const std::vector<Eigen::Index> own = own_columns(candidates_.parameters, names_);
  DesignProblem problem{
      known_information(robot_.calibration, subset(candidates_.parameters, own)), {}, {}};
  for (const Eigen::MatrixXd& one : candidates_.information)
    problem.candidates.push_back(frames_each * one(own, own));
  problem.criterion = [this](const Eigen::MatrixXd& information) {
    return variance_of(information, root_);
  };
  std::vector<Eigen::VectorXd> out;
  for (const std::size_t i : first) out.push_back(postures_[i]);
  for (const std::size_t i : choose_candidates(problem, count - first.size(), first))
    out.push_back(postures_[i]);
  return out;
}

Promise Planner::promise_of(const std::vector<Parameter>& parameters,
                            const Eigen::MatrixXd& covariance) const {
  Rng rng = Rng::from_name("goal", options_.seed);
  const Eigen::MatrixXd root = goal_root(options_.goal, robot_, space_, parameters, rng);
  Promise out;
  out.goal_m = std::sqrt(root.cwiseProduct(covariance * root).sum());
  out.axes = axes_by_covariance(robot_.calibration, parameters, covariance,
                                space_.values(space_.middle()));
  return out;
}

void Planner::judge_rivals(const std::vector<Parameter>& parameters,
                           const Eigen::MatrixXd& information, const Names& names,
                           RecordingPlan& plan) const {
  const std::vector<RivalColumns> columns = columns_of_pairs(parameters, names);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    RivalPromise& one = plan.rivals.emplace_back();
    one.believed = robot_.effects[pairs_[p].first].id;
    one.other = robot_.rivals[pairs_[p].second].id;
    if (!columns[p].believed.empty()) one.sigmas_apart = sigmas_apart(information, columns[p]);
  }
}

void Planner::judge(const ExpectedRecording& recording, RecordingPlan& plan) const {
  // A motion shows effects that postures do not: its rivals have names of its own.
  const Names names{named_effects(robot_, recording, robot_.effects),
                    named_effects(robot_, recording, robot_.rivals)};
  ExpectedRows expected = expected_rows(robot_.calibration, recording);
  const auto width = std::ssize(expected.parameters);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(width, width);
  for (Eigen::MatrixXd& J : expected.J) {
    information += information_of(J, widening_);
    J.resize(0, 0);
  }
  const std::vector<Eigen::Index> own = own_columns(expected.parameters, names);
  plan.parameters = subset(expected.parameters, own);
  const Eigen::MatrixXd known = known_information(robot_.calibration, plan.parameters);
  plan.covariance = covariance_of(known + information(own, own));
  plan.before = promise_of(plan.parameters, covariance_of(known));
  plan.after = promise_of(plan.parameters, plan.covariance);
  judge_rivals(expected.parameters, information, names, plan);
  plan.frames = static_cast<int>(recording.measurements.times_s.size());
  for (const Marker& marker : robot_.calibration.tree.markers) plan.sightings[marker.id] = 0;
  for (const TagObservation& seen : recording.measurements.corners) ++plan.sightings[seen.id];
  plan.seen_share = seen_share_;
}

RecordingPlan Planner::postures_plan() const {
  RecordingPlan out;
  out.postures = in_short_order(space_, chosen(static_cast<std::size_t>(options_.postures), 1.0));
  judge(recording_at(robot_, space_, out.postures), out);
  return out;
}

// As many as fit by the usual way between two candidates.
std::size_t Planner::usual_stops() const {
  double sum = 0.0;
  const std::size_t pairs = std::min(kUsualPairs, postures_.size() - 1);
  for (std::size_t i = 0; i < pairs; ++i) sum += space_.shortest_s(postures_[i], postures_[i + 1]);
  const double usual_s = pairs > 0 ? sum / static_cast<double>(pairs) : 0.0;
  if (!(usual_s > 0.0)) return kMostStops;
  const double stops = options_.seconds / usual_s + 1.0;
  return std::clamp(static_cast<std::size_t>(std::min(stops, 1e6)), kFewestStops, kMostStops);
}

// Fewer where the way through so many takes too long.
std::vector<Eigen::VectorXd> Planner::stops_in_time(std::size_t count) const {
  for (;;) {
    const double frames = options_.seconds * options_.frame_rate_hz / static_cast<double>(count);
    std::vector<Eigen::VectorXd> stops = in_short_order(space_, chosen(count, frames));
    // One that is chosen twice stands beside itself.
    stops.erase(std::unique(stops.begin(), stops.end()), stops.end());
    if (stops.size() < kFewestStops) {
      throw undetermined("plan", "no second posture tells more than one and the same",
                         "give wider ranges with --limits or --range, or plan --postures");
    }
    const double shortest_s = RestToRestPath::shortest_s(space_, stops);
    if (shortest_s <= options_.seconds) return stops;
    if (count <= kFewestStops) {
      throw undetermined(
          "plan",
          fmt::format("{:g} s are too short for a motion from one posture to another ({:.1f} s)",
                      options_.seconds, shortest_s),
          "give more --seconds, or a higher --speed");
    }
    const auto fitting =
        static_cast<std::size_t>(static_cast<double>(count) * options_.seconds / shortest_s);
    count = std::max(kFewestStops, std::min(count - 1, fitting));
  }
}

RecordingPlan Planner::motion_plan(const Progress& progress) const {
  // As fast as allowed, and slower through fewer postures: which tells more depends on the robot.
  std::vector<RecordingPlan> tried;
  std::size_t stops = usual_stops();
  for (int t = 0; t < 2; ++t) {
    report_progress(progress, "plan", t, 2);
    RecordingPlan& one = tried.emplace_back();
    one.postures = stops_in_time(stops);
    one.path.emplace(space_, one.postures, options_.seconds);
    judge(recording_along(robot_, space_, *one.path, options_.frame_rate_hz), one);
    stops = one.postures.size() / 2;
    if (stops < kFewestStops || !pairs_.empty()) break;
  }
  report_progress(progress, "", 0, 0);
  return std::move(*std::ranges::min_element(
      tried, {}, [](const RecordingPlan& one) { return one.after.goal_m; }));
}

RecordingPlan Planner::plan(const Progress& progress) {
  draw_candidates();
  const ExpectedRecording first = recording_at(robot_, space_, {postures_.front()});
  names_ = {named_effects(robot_, first, robot_.effects),
            named_effects(robot_, first, robot_.rivals)};
  candidates_ = rows_at(postures_);
  Rng rng = Rng::from_name("goal", options_.seed);
  const std::vector<Parameter> own =
      subset(candidates_.parameters, own_columns(candidates_.parameters, names_));
  root_ = goal_root(options_.goal, robot_, space_, own, rng);
  return options_.postures > 0 ? postures_plan() : motion_plan(progress);
}

}  // namespace

RecordingPlan plan_recording(const PlannedRobot& robot, const JointSpace& space,
                             const std::vector<std::pair<std::size_t, std::size_t>>& pairs,
                             const PlanOptions& options, const Progress& progress) {
  KINESCOPE_CHECK((options.postures > 0) != (options.seconds > 0.0), "postures, or a motion");
  return Planner(robot, space, pairs, options).plan(progress);
}

}  // namespace kinescope::design
