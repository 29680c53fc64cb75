// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/family.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/trace/distribution.h"
#include "kinematics/core/error.h"
#include "kinematics/core/golden_section.h"
#include "kinematics/core/parallel_for.h"

namespace kinescope::trace {
namespace {

// Golden-section steps around the best value of a scan: to a hundredth of its spacing, and to a
// tenth where it is only tested.
constexpr int kRefinements = 10;
constexpr int kTestRefinements = 4;
// Between two listed values an effect explains at most this many times what it explains at the
// better of them.
constexpr double kMostRefined = 2.0;

double refine(const NormalSystem& system, const Candidate& candidate, std::size_t best,
              int refinements) {
  const std::vector<double>& scan = candidate.scan;
  double low = scan[best == 0 ? 0 : best - 1];
  double high = scan[std::min(best + 1, scan.size() - 1)];
  const auto gain = [&](double value) { return gain_of(system, candidate.columns(value)); };
  if (candidate.scan_step > 0.0) {
    double value = scan[best];
    double most = gain(value);
    const auto steps = static_cast<int>((high - low) / candidate.scan_step);
    for (int k = 0; k <= steps; ++k) {
      const double tried = low + candidate.scan_step * k;
      const double gained = gain(tried);
      if (gained > most) {
        most = gained;
        value = tried;
      }
    }
    return value;
  }
  const Maximum found = golden_section(gain, low, high, refinements);
  return found.value > gain(scan[best]) ? found.at : scan[best];
}

// The best of the listed values.
struct CoarseScan {
  std::size_t best = 0;
  double gain = 0.0;
  [[nodiscard]] double value(const Candidate& candidate) const {
    return candidate.scan.empty() ? 0.0 : candidate.scan[best];
  }
};

CoarseScan coarse_scan(const NormalSystem& system, const Candidate& candidate) {
  if (candidate.scan.empty()) return {0, gain_of(system, candidate.columns(0.0))};
  std::vector<std::vector<EffectColumn>> values;
  for (const double value : candidate.scan) values.push_back(candidate.columns(value));
  const std::vector<double> gains = gains_of(system, values);
  const auto best = std::ranges::max_element(gains);
  return {static_cast<std::size_t>(best - gains.begin()), *best};
}

bool is_refined(const Candidate& candidate) {
  return !candidate.scan.empty() && !candidate.scan_listed;
}

// Could a value between the listed ones be significant?
bool may_pass(const Score& score, double tests) {
  constexpr double kLoose = 0.05;
  return !score.hidden() &&
         tests * f_survival(kMostRefined * score.statistic, score.rank, score.freedom) < kLoose;
}

TestedMember tested(const NormalSystem& system, const Candidate& candidate, double scan) {
  TestedMember out;
  out.scan = scan;
  out.columns = candidate.columns(scan);
  KINESCOPE_CHECK(out.columns.size() == candidate.parameters.size(), "one column a parameter");
  out.score = score_test(system, out.columns);
  return out;
}

}  // namespace

double best_scan(const NormalSystem& system, const Candidate& candidate) {
  if (candidate.scan.empty()) return 0.0;
  const CoarseScan coarse = coarse_scan(system, candidate);
  return is_refined(candidate) ? refine(system, candidate, coarse.best, kRefinements)
                               : coarse.value(candidate);
}

double number_of_tests(const std::vector<Candidate>& candidates, const Candidate& candidate) {
  const auto named =
      std::ranges::count_if(candidates, [](const Candidate& c) { return !c.is_curve(); });
  return static_cast<double>(named) *
         static_cast<double>(std::max<std::size_t>(1, candidate.scan.size()));
}

std::vector<TestedMember> test_family(const NormalSystem& system,
                                      const std::vector<Candidate>& candidates, double least_gain) {
  std::vector<std::optional<TestedMember>> members(candidates.size());
  parallel_for(candidates.size(), [&](std::size_t i) {
    const Candidate& candidate = candidates[i];
    if (candidate.is_curve()) return;
    const CoarseScan coarse = coarse_scan(system, candidate);
    const bool refined = is_refined(candidate);
    if ((refined ? kMostRefined : 1.0) * coarse.gain < least_gain) return;
    const double tests = number_of_tests(candidates, candidate);
    TestedMember member = tested(system, candidate, coarse.value(candidate));
    if (refined && may_pass(member.score, tests)) {
      const double scan = refine(system, candidate, coarse.best, kTestRefinements);
      if (scan != member.scan) member = tested(system, candidate, scan);
    }
    member.index = i;
    member.tests = tests;
    member.p_value = std::min(1.0, member.score.p_value * tests);
    members[i] = std::move(member);
  });
  std::vector<TestedMember> out;
  for (std::optional<TestedMember>& member : members) {
    if (member) out.push_back(std::move(*member));
  }
  return out;
}

double size_of(const Candidate& candidate, const Eigen::VectorXd& theta) {
  if (candidate.size) return candidate.size(theta);
  if (theta.size() == 1) return theta[0];
  return std::sqrt(candidate.size_weights.dot(theta.cwiseAbs2()));
}

double size_sigma(const Candidate& candidate, const Eigen::VectorXd& theta,
                  const Eigen::MatrixXd& covariance) {
  if (theta.size() == 1) return std::sqrt(std::max(0.0, covariance(0, 0)));
  const double size = size_of(candidate, theta);
  if (size == 0.0) return 0.0;
  Eigen::VectorXd slope = candidate.size_weights.cwiseProduct(theta) / size;
  if (candidate.size) {
    for (Eigen::Index k = 0; k < theta.size(); ++k) {
      Eigen::VectorXd moved = theta;
      const double step = 1e-4 * std::max(std::abs(size), std::abs(theta[k]));
      moved[k] += step;
      slope[k] = (candidate.size(moved) - size) / step;
    }
  }
  return std::sqrt(std::max(0.0, slope.dot(covariance * slope)));
}

double smallest_size(const Candidate& candidate, const Score& score, double p_value,
                     double least_size) {
  // The one-sided 95 % quantile of the normal distribution.
  constexpr double kPower = 1.645;
  const double k = score.rank;
  const double threshold = std::sqrt(k * f_quantile(p_value, k, std::max(2.0, score.freedom)));
  double variance = score.covariance(0, 0);
  if (candidate.parameters.size() > 1) {
    double counted = 0.0;
    variance = 0.0;
    for (Eigen::Index i = 0; i < candidate.size_weights.size(); ++i) {
      if (!(candidate.size_weights[i] > 0.0)) continue;
      variance += candidate.size_weights[i] * score.covariance(i, i);
      counted += 1.0;
    }
    variance /= std::max(1.0, counted);
  }
  const double sigma = std::sqrt(std::max(0.0, variance));
  return std::max(threshold * sigma, least_size) + kPower * sigma;
}

}  // namespace kinescope::trace
