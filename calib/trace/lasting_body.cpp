// SPDX-License-Identifier: Apache-2.0
#include "calib/trace/lasting_body.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace kinescope::trace {
namespace {

// Fewer tell too little: the ratio of n pairs scatters by 1 / sqrt(n).
constexpr Eigen::Index kFewestPairs = 100;

struct Sums {
  double squares = 0.0;  // of what is left
  double rows = 0.0;
  double differences = 0.0;  // squares of them, halved
  Eigen::Index pairs = 0;    // of rows
  double distances = 0.0;    // squares, in the residual's unit
  double points = 0.0;
  Eigen::Index instant = -1;  // the last one in which it was seen, and where
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

void add(const Linearisation& linear, Eigen::Index instant, Eigen::Index first, Eigen::Index count,
         Sums& sums) {
  const auto now = linear.residual.segment(first, count);
  if (sums.instant == instant - 1 && sums.instant >= 0 && sums.count == count) {
    const auto before = linear.residual.segment(sums.first, count);
    sums.differences += 0.5 * (now - before).squaredNorm();
    sums.pairs += count;
  }
  sums.squares += now.squaredNorm();
  sums.rows += static_cast<double>(count);
  sums.distances += now.cwiseProduct(linear.unit.segment(first, count)).squaredNorm();
  sums.points += linear.points(first, count);
  sums.instant = instant;
  sums.first = first;
  sums.count = count;
}

std::map<int, Sums> sums_of_bodies(const Linearisation& linear) {
  std::map<int, Sums> out;
  for (Eigen::Index i = 0; i < linear.instants(); ++i) {
    const Eigen::Index end = linear.first_row[static_cast<std::size_t>(i) + 1];
    for (Eigen::Index row = linear.first_row[static_cast<std::size_t>(i)]; row < end;) {
      const int body = linear.body[static_cast<std::size_t>(row)];
      Eigen::Index count = 1;
      while (row + count < end && linear.body[static_cast<std::size_t>(row + count)] == body)
        ++count;
      add(linear, i, row, count, out[body]);
      row += count;
    }
  }
  return out;
}

}  // namespace

std::optional<LastingBody> find_lasting_body(const Linearisation& linear, double freedom,
                                             double least) {
  if (linear.body.empty() || linear.independent_instants) return std::nullopt;
  const double of_rows =
      freedom / static_cast<double>(std::max<Eigen::Index>(1, linear.residual.size()));
  std::optional<LastingBody> most;
  for (const auto& [body, sums] : sums_of_bodies(linear)) {
    if (sums.pairs < kFewestPairs || !(sums.differences > 0.0)) continue;
    const double mean = sums.squares / sums.rows;
    const LastingBody found{
        body, std::sqrt(mean / (sums.differences / static_cast<double>(sums.pairs))),
        std::sqrt(mean / of_rows), std::sqrt(sums.distances / std::max(1.0, sums.points))};
    if (found.over_differences <= least || found.over_noise <= least) continue;
    if (!most || found.over_noise > most->over_noise) most = found;
  }
  return most;
}

}  // namespace kinescope::trace
