// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/contact_spans.h"

#include <algorithm>
#include <cmath>

#include "dynamics/data/statistics.h"
#include "kinematics/core/median.h"

namespace kinescope {
namespace {

/// Mean power within half a window to either side, at each instant.
Eigen::ArrayXd windowed_power(const Eigen::VectorXd& time_s, const Eigen::ArrayXd& power,
                              double window_s) {
  Eigen::ArrayXd out(power.size());
  Eigen::Index low = 0, high = 0;
  double sum = 0.0;
  for (Eigen::Index i = 0; i < power.size(); ++i) {
    while (high < power.size() && time_s[high] <= time_s[i] + 0.5 * window_s) sum += power[high++];
    while (time_s[low] < time_s[i] - 0.5 * window_s) sum -= power[low++];
    out[i] = std::max(sum, 0.0) / static_cast<double>(high - low);
  }
  return out;
}

}  // namespace

std::vector<ContactSpan> find_contact_spans(const EffectMotion& motion,
                                            const Eigen::MatrixXd& whitened,
                                            const Eigen::VectorXd& sigma,
                                            const ContactSpanOptions& options) {
  const Eigen::VectorXd time_s = motion.at_instants(motion.time_s());
  const Eigen::ArrayXd level =
      windowed_power(time_s, whitened.rowwise().squaredNorm().array(), options.window_s)
          .max(1e-12)
          .log();
  const double median = median_of(to_vector(level.matrix()));
  const double spread = kSigmaOverMedian * median_of(to_vector((level - median).abs().matrix()));
  std::vector<ContactSpan> out;
  if (!(spread > 0.0)) return out;
  const Eigen::ArrayXd height = (level - median) / spread;
  const auto trajectory = [&](Eigen::Index i) {
    return motion.samples().trajectory(motion.kept()[static_cast<std::size_t>(i)]);
  };
  Eigen::Index inside = 0;
  for (Eigen::Index i = 0; i < height.size(); ++i) {
    if (height[i] < options.level) continue;
    Eigen::Index first = i, last = i;
    const auto joined = [&](Eigen::Index next) {
      return next >= 0 && next < height.size() && height[next] > options.end_level &&
             trajectory(next) == trajectory(i);
    };
    while (joined(first - 1)) --first;
    while (joined(last + 1)) ++last;
    ContactSpan span{.from_s = time_s[first],
                     .to_s = time_s[last],
                     .from = motion.clock().moment(time_s[first]),
                     .to = motion.clock().moment(time_s[last]),
                     .peak = Eigen::VectorXd(sigma.size()),
                     .noise_ratio = Eigen::VectorXd(sigma.size())};
    for (Eigen::Index j = 0; j < sigma.size(); ++j) {
      Eigen::Index at = 0;
      const auto rows = whitened.col(j).segment(first, last - first + 1);
      span.noise_ratio[j] = rows.cwiseAbs().maxCoeff(&at);
      span.peak[j] = rows[at] * sigma[j];
    }
    inside += last - first + 1;
    out.push_back(std::move(span));
    i = last;
  }
  const double share = static_cast<double>(inside) / static_cast<double>(height.size());
  if (share > options.most_share) out.clear();
  return out;
}

std::vector<char> outside_spans(const EffectMotion& motion, const std::vector<ContactSpan>& spans,
                                double margin_s) {
  const Eigen::VectorXd& time_s = motion.time_s();
  std::vector<char> out(static_cast<std::size_t>(time_s.size()), 1);
  for (Eigen::Index row = 0; row < time_s.size(); ++row) {
    for (const ContactSpan& span : spans) {
      if (time_s[row] >= span.from_s - margin_s && time_s[row] <= span.to_s + margin_s) {
        out[static_cast<std::size_t>(row)] = 0;
      }
    }
  }
  return out;
}

}  // namespace kinescope
