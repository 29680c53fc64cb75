// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/zero_phase_filter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr double kSettledPeriods = 5.0;  // of the cut-off, that the reflected ends are long

/// Angular frequency of the analogue filter whose two passes have fallen by 3 dB at the warped
/// cut-off: (1 + x^2n)^-1 = 2^-1/2.
double single_pass(double warped, int order) {
  return warped / std::pow(std::numbers::sqrt2 - 1.0, 1.0 / (2.0 * order));
}

/// b, a of w^2 / (s^2 + w s / quality + w^2) with s = (1 - z^-1) / (1 + z^-1).
FilterSection second_order(double w, double damping) {
  const double norm = 1.0 + damping * w + w * w;
  return {w * w / norm, 2.0 * w * w / norm, w * w / norm, 2.0 * (w * w - 1.0) / norm,
          (1.0 - damping * w + w * w) / norm};
}

FilterSection first_order(double w) {
  return {w / (1.0 + w), w / (1.0 + w), 0.0, (w - 1.0) / (1.0 + w), 0.0};
}

std::vector<FilterSection> sections(int order, double w) {
  std::vector<FilterSection> out;
  for (int k = 0; k < order / 2; ++k) {
    out.push_back(
        second_order(w, 2.0 * std::sin(std::numbers::pi * (2.0 * k + 1.0) / (2.0 * order))));
  }
  if (order % 2 == 1) out.push_back(first_order(w));
  return out;
}

/// A section (transposed direct form II) that has always seen `first`: at zero frequency its gain
/// is 1, so its state follows from that.
class RunningSection {
 public:
  RunningSection() = default;
  RunningSection(const FilterSection& section, double first)
      : s_(section), z1_((1.0 - section.b0) * first), z2_((section.b2 - section.a2) * first) {}

  double next(double x) {
    const double y = s_.b0 * x + z1_;
    z1_ = (s_.b1 * x + z2_) - s_.a1 * y;
    z2_ = s_.b2 * x - s_.a2 * y;
    return y;
  }

 private:
  FilterSection s_;
  double z1_ = 0.0;
  double z2_ = 0.0;
};

/// One pass along a column, starting as if the first value had always been there. All sections go
/// along together: each waits for its own last value, and they wait at the same time.
template <std::size_t kSections>
void pass(std::vector<double>& x, const std::vector<FilterSection>& filter) {
  std::array<RunningSection, kSections> running;
  double first = x.front();
  for (std::size_t k = 0; k < kSections; ++k) {
    running[k] = RunningSection(filter[k], first);
    first = RunningSection(running[k]).next(first);
  }
  for (double& value : x) {
    for (RunningSection& section : running) value = section.next(value);
  }
}

void pass(std::vector<double>& x, const std::vector<FilterSection>& filter) {
  switch (filter.size()) {
    case 1:
      return pass<1>(x, filter);
    case 2:
      return pass<2>(x, filter);
    case 3:
      return pass<3>(x, filter);
    default:
      return pass<4>(x, filter);  // orders 7 and 8
  }
}

}  // namespace

std::vector<FilterSection> butterworth(int order, double cutoff_hz, double rate_hz) {
  KINESCOPE_CHECK(order >= 1 && order <= 8, "order 1 to 8");
  KINESCOPE_CHECK(cutoff_hz > 0.0 && 2.0 * cutoff_hz < rate_hz, "0 < cutoff < rate / 2");
  return sections(order, std::tan(std::numbers::pi * cutoff_hz / rate_hz));
}

Eigen::MatrixXd filter_zero_phase(const Eigen::MatrixXd& values, int order, double cutoff_hz,
                                  double rate_hz) {
  KINESCOPE_CHECK(order >= 1 && order <= 8, "order 1 to 8");
  KINESCOPE_CHECK(cutoff_hz > 0.0 && 2.0 * cutoff_hz < rate_hz, "0 < cutoff < rate / 2");
  const std::vector<FilterSection> filter =
      sections(order, single_pass(std::tan(std::numbers::pi * cutoff_hz / rate_hz), order));
  const Eigen::Index n = values.rows();
  const auto wanted = static_cast<Eigen::Index>(std::ceil(kSettledPeriods * rate_hz / cutoff_hz));
  const Eigen::Index pad = std::clamp<Eigen::Index>(wanted, 0, n - 1);
  Eigen::MatrixXd out(n, values.cols());
  for (Eigen::Index c = 0; c < values.cols(); ++c) {
    std::vector<double> x;
    x.reserve(static_cast<std::size_t>(n + 2 * pad));
    for (Eigen::Index k = pad; k > 0; --k) x.push_back(2.0 * values(0, c) - values(k, c));
    for (Eigen::Index k = 0; k < n; ++k) x.push_back(values(k, c));
    for (Eigen::Index k = 1; k <= pad; ++k)
      x.push_back(2.0 * values(n - 1, c) - values(n - 1 - k, c));
    pass(x, filter);
    std::ranges::reverse(x);
    pass(x, filter);
    for (Eigen::Index k = 0; k < n; ++k) {
      out(k, c) = x[static_cast<std::size_t>(n + pad - 1 - k)];
    }
  }
  return out;
}

Eigen::MatrixXd central_differences(const Eigen::MatrixXd& values, double step_s) {
  // Weights of f(+k) - f(-k) for orders 2, 4, 6, 8.
  constexpr std::array<std::array<double, 4>, 4> kWeights = {
      {{1.0 / 2, 0, 0, 0},
       {2.0 / 3, -1.0 / 12, 0, 0},
       {3.0 / 4, -3.0 / 20, 1.0 / 60, 0},
       {4.0 / 5, -1.0 / 5, 4.0 / 105, -1.0 / 280}}};
  const Eigen::Index n = values.rows();
  KINESCOPE_CHECK(n >= 3, "differences want three samples");
  Eigen::MatrixXd out(n, values.cols());
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index reach = std::min<Eigen::Index>({4, i, n - 1 - i});
    if (reach == 0) {
      const double sign = i == 0 ? 1.0 : -1.0;
      const Eigen::Index inward = i == 0 ? 1 : -1;
      out.row(i) =
          sign / step_s *
          (-1.5 * values.row(i) + 2.0 * values.row(i + inward) - 0.5 * values.row(i + 2 * inward));
      continue;
    }
    out.row(i).setZero();
    for (Eigen::Index k = 1; k <= reach; ++k) {
      const double weight =
          kWeights[static_cast<std::size_t>(reach - 1)][static_cast<std::size_t>(k - 1)];
      out.row(i) += weight / step_s * (values.row(i + k) - values.row(i - k));
    }
  }
  return out;
}

}  // namespace kinescope
