// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/one_clock.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/error.h"

namespace kinescope {

OneClock::OneClock(const Eigen::VectorXd& t_s, const Eigen::VectorXi& trajectory,
                   const OneClockOptions& options)
    : time_s_(t_s) {
  KINESCOPE_CHECK(t_s.size() == trajectory.size(), "one trajectory number a stamp");
  Eigen::Index end = 0;
  for (Eigen::Index begin = 0; begin < t_s.size(); begin = end) {
    while (end < t_s.size() && trajectory[end] == trajectory[begin]) ++end;
    const Eigen::Index rows = end - begin;
    const double step_s =
        rows > 1 ? (t_s[end - 1] - t_s[begin]) / static_cast<double>(rows - 1) : 0.0;
    double late_s = 0.0;
    if (begin > 0 && t_s[begin] <= time_s_[begin - 1] + options.least_gap_s) {
      const double gap_s = std::max(options.gap_s, options.gap_steps * step_s);
      late_s = time_s_[begin - 1] + gap_s - t_s[begin];
    }
    time_s_.segment(begin, rows).array() += late_s;
    stretches_.push_back({trajectory[begin], time_s_[begin], late_s});
  }
}

LogMoment OneClock::moment(double time_s) const {
  KINESCOPE_CHECK(!stretches_.empty(), "a clock of some samples");
  const auto after = std::ranges::upper_bound(stretches_, time_s, {}, &Stretch::begin_s);
  const Stretch& at = after == stretches_.begin() ? *after : *std::prev(after);
  if (at.late_s == 0.0) return {at.trajectory, time_s};
  // Without the rounding of there and back.
  constexpr double kDigits = 1e9;
  return {at.trajectory, std::round((time_s - at.late_s) * kDigits) / kDigits};
}

std::vector<double> OneClock::begins_s() const {
  std::vector<double> out;
  for (const Stretch& stretch : stretches_) out.push_back(stretch.begin_s);
  return out;
}

bool OneClock::moved() const {
  return std::ranges::any_of(stretches_, [](const Stretch& s) { return s.late_s != 0.0; });
}

}  // namespace kinescope
