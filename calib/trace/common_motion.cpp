// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/common_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace kinescope::trace {
namespace {

Eigen::VectorXd dense(const Linearisation& linear, int carrier) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(linear.residual.size());
  if (carrier < 0) return out;
  for (Eigen::SparseMatrix<double>::InnerIterator entry(linear.carriers, carrier); entry; ++entry)
    out[entry.row()] = entry.value();
  return out;
}

// What `direction` explains of `of`, taken out.
void take_out(const Eigen::VectorXd& direction, Eigen::Ref<Eigen::VectorXd> of) {
  const double squares = direction.squaredNorm();
  if (squares > 0.0) of -= direction * (direction.dot(of) / squares);
}

// Of the largest share; chosen (0.48 and 0.59 of two joints where the first has a wave, and 0.32).
constexpr double kNearly = 0.5;

// Sums over instants in which a place moves two bodies or more.
struct Products {
  double between = 0.0;   // of carrier'residual, of different bodies
  double expected = 0.0;  // the same for a motion of variance 1
  double weight = 0.0;    // carrier'carrier
  double squares = 0.0;   // of the residual
};

Products products_of(const Linearisation& linear, const Eigen::VectorXd& carrier,
                     const Eigen::VectorXd& clock) {
  Products out;
  for (Eigen::Index i = 0; i < linear.instants(); ++i) {
    const Eigen::Index first = linear.first_row[static_cast<std::size_t>(i)];
    const Eigen::Index count = linear.first_row[static_cast<std::size_t>(i) + 1] - first;
    Eigen::VectorXd c = carrier.segment(first, count);
    if (c.isZero(0.0)) continue;
    Eigen::VectorXd r = linear.residual.segment(first, count);
    const Eigen::VectorXd time = clock.segment(first, count);
    take_out(time, c);
    take_out(time, r);
    for (Eigen::Index row = 0; row < count; ++row)
      if (carrier[first + row] == 0.0) c[row] = r[row] = 0.0;
    double s_sum = 0.0;
    double s_squares = 0.0;
    double n_sum = 0.0;
    double n_squares = 0.0;
    int bodies = 0;
    for (Eigen::Index begin = 0; begin < count;) {
      Eigen::Index end = begin + 1;
      const int body = linear.body[static_cast<std::size_t>(first + begin)];
      while (end < count && linear.body[static_cast<std::size_t>(first + end)] == body) ++end;
      const double s = c.segment(begin, end - begin).dot(r.segment(begin, end - begin));
      const double n = c.segment(begin, end - begin).squaredNorm();
      begin = end;
      if (n == 0.0) continue;
      s_sum += s;
      s_squares += s * s;
      n_sum += n;
      n_squares += n * n;
      ++bodies;
    }
    if (bodies < 2) continue;
    out.between += s_sum * s_sum - s_squares;
    out.expected += n_sum * n_sum - n_squares;
    out.weight += n_sum;
    out.squares += r.squaredNorm();
  }
  return out;
}

}  // namespace

std::optional<CommonMotion> find_common_motion(const NormalSystem& system,
                                               const std::vector<RestPlace>& places, int clock) {
  const Linearisation& linear = system.linear();
  if (linear.body.empty()) return std::nullopt;
  const Eigen::VectorXd time = dense(linear, clock);
  std::vector<std::pair<double, CommonMotion>> found;  // with what it explains
  double largest_share = 0.0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Products sums = products_of(linear, dense(linear, places[k].carrier), time);
    if (!(sums.expected > 0.0)) continue;
    const double variance = std::max(0.0, sums.between / sums.expected);
    const double explained = variance * sums.weight;
    const double share = explained / std::max(sums.squares, 1e-300);
    largest_share = std::max(largest_share, share);
    found.push_back({explained, {k, std::sqrt(variance), share}});
  }
  std::optional<CommonMotion> best;
  double most = 0.0;
  for (const auto& [explained, motion] : found) {
    if (motion.share < kNearly * largest_share || (best && explained <= most)) continue;
    most = explained;
    best = motion;
    best->largest_share = largest_share;
  }
  return best;
}

}  // namespace kinescope::trace
