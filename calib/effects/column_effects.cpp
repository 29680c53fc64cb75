// SPDX-License-Identifier: Apache-2.0
//
// Candidates of TracedColumns: how a second column may differ from the one that is used.
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "calib/effects/suspect.h"
#include "calib/effects/traced_columns.h"

namespace kinescope::effects {

Candidate TracedColumns::effect(std::string name, std::string words,
                                std::vector<EffectParameter> parameters) const {
  Candidate out;
  out.id = {std::move(name), name_};
  out.words = std::move(words);
  out.size_weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(parameters.size()));
  out.size_unit = parameters.front().unit;
  out.parameters = std::move(parameters);
  out.possible = [limit = largest_size(out.size_unit)](const Eigen::VectorXd& theta) {
    return theta.norm() < limit;
  };
  return out;
}

Candidate TracedColumns::time_offset(const SharesPtr& shares) const {
  Candidate out =
      effect("time_offset", fmt::format("{} is ahead of {} (or behind)", pair_->column, name_),
             {{"offset", "s"}});
  out.possible = [most = most_shift_s_](const Eigen::VectorXd& offset) {
    return std::abs(offset[0]) < most;
  };
  out.check = "lag of the controller behind its command, filters and bus cycles of the drive";
  out.record = fmt::format("move {} faster, and at changing speed", name_);
  out.columns = [shares](double) { return std::vector<EffectColumn>{{0, shares->delay}}; };
  return out;
}

Candidate TracedColumns::encoder_scale(const SharesPtr& shares) const {
  Candidate out =
      effect("encoder_scale",
             fmt::format("{} says more (or less) than {}, in proportion", pair_->column, name_),
             {{"scale", ""}});
  out.check = "gear ratio and ticks a turn on either side of the driver's configuration";
  out.record = fmt::format("move {} over a larger range", name_);
  out.columns = [share = Eigen::VectorXd(shares->used.value.array() - shares->used.value.mean())](
                    double) { return std::vector<EffectColumn>{{0, share}}; };
  return out;
}

// Of the joint behind the other column, or of that behind the joint.
Candidate TracedColumns::dead_band(const SharesPtr& shares) const {
  const std::string& follower = other_follows_ ? pair_->column : name_;
  const std::string& leader = other_follows_ ? name_ : pair_->column;
  Candidate out =
      effect("dead_band",
             fmt::format("{} follows {} only once that has moved by the band", follower, leader),
             {{"width", unit_}});
  out.id.place = follower;
  // Ahead of its command it has none.
  out.possible = [limit = largest_size(unit_)](const Eigen::VectorXd& width) {
    return width[0] > 0.0 && width[0] < limit;
  };
  out.scan = widths_;
  out.scan_is_size = true;
  out.scan_name = "band";
  out.scan_unit = unit_;
  out.check = "dead band of the controller, friction that it has no integrator against";
  out.record = fmt::format("move {} to the same places from both sides", name_);
  out.columns = [this, shares](double width) {
    return std::vector<EffectColumn>{{0, band_share(*shares, play_state, width)}};
  };
  return out;
}

Candidate TracedColumns::droop(const SharesPtr& shares) const {
  std::vector<EffectParameter> parameters;
  for (const std::string& load : load_names_) parameters.push_back({"droop by " + load, unit_});
  Candidate out =
      effect("droop", fmt::format("{} stays behind {} under its load", name_, pair_->column),
             std::move(parameters));
  out.size = [shares](const Eigen::VectorXd& theta) {
    return (shares->loads * theta).cwiseAbs().maxCoeff();
  };
  // Loads can be alike: large parts of either sign may stand for a small droop.
  out.possible = [size = out.size, limit = largest_size(unit_)](const Eigen::VectorXd& theta) {
    return size(theta) < limit;
  };
  out.check = "gain of the position controller, which has no integrator; weight of the payload";
  out.record = fmt::format("the arm stretched out and folded, at the same values of {}", name_);
  out.columns = [shares](double) {
    std::vector<EffectColumn> columns;
    for (Eigen::Index k = 0; k < shares->loads.cols(); ++k)
      columns.push_back({0, shares->loads.col(k)});
    return columns;
  };
  return out;
}

// A controller that is a spring and a damper is behind by its delay, and by this.
Candidate TracedColumns::acceleration_lag(const SharesPtr& shares) const {
  Candidate out = effect(
      "acceleration_lag",
      fmt::format("{} stays behind {} (or ahead) while it gains speed", name_, pair_->column),
      {{"lag at the largest acceleration", unit_}});
  out.check = "gain and damping of the position controller, its feed-forward";
  out.record = fmt::format("move {} with harder and softer starts and stops", name_);
  out.columns = [share = shares->acceleration](double) {
    return std::vector<EffectColumn>{{0, share}};
  };
  return out;
}

Candidate TracedColumns::quantisation() const {
  Candidate out =
      effect("quantisation", fmt::format("{} comes in steps", pair_->column), {{"step", unit_}});
  out.possible = as_the_log_shows(step_);
  out.check = "digits that the log is written with, resolution of the command";
  out.record = fmt::format("log {} with more digits", pair_->column);
  out.columns = [share = steps_](double) { return std::vector<EffectColumn>{{0, share}}; };
  return out;
}

std::vector<Candidate> TracedColumns::candidates(const SharesPtr& shares) const {
  std::vector<Candidate> out{encoder_scale(shares)};
  if (loads_.cols() > 0) out.push_back(droop(shares));
  if (pair_->postures) return out;
  out.push_back(time_offset(shares));
  out.push_back(acceleration_lag(shares));
  if (!widths_.empty()) out.push_back(dead_band(shares));
  if (step_ > 0.0) out.push_back(quantisation());
  return out;
}

}  // namespace kinescope::effects
