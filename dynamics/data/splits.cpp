// SPDX-License-Identifier: Apache-2.0
#include "dynamics/data/splits.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <fmt/format.h>

#include "dynamics/data/statistics.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"
#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

constexpr Eigen::Index kPathPoints = 100;      // looked at of each path
constexpr Eigen::Index kPathReference = 2000;  // looked for among
constexpr double kSamePath = 0.01;  // of the joints' ranges, root mean square over the joints
constexpr double kMostly = 0.9;
constexpr Eigen::Index kFewestInBlock = 4;

/// A trajectory: its rows and what identifies it, whatever its number.
struct Piece {
  Eigen::Index begin = 0, end = 0;
  [[nodiscard]] Eigen::Index size() const { return end - begin; }
};

std::vector<Piece> pieces_of(const TorqueSamples& samples) {
  std::vector<Piece> pieces;
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    if (row == 0 || samples.trajectory(row) != samples.trajectory(row - 1)) {
      pieces.push_back({row, row});
    }
    pieces.back().end = row + 1;
  }
  return pieces;
}

/// Postures of a piece, in parts of the joints' ranges; at most `count`.
Eigen::MatrixXd postures(const TorqueSamples& samples, const Piece& piece, Eigen::Index count,
                         const Eigen::RowVectorXd& scale) {
  const Eigen::Index n = std::min(count, piece.size());
  Eigen::MatrixXd out(n, samples.joints());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index row =
        piece.begin + k * (piece.size() - 1) / std::max<Eigen::Index>(1, n - 1);
    out.row(k) = samples.q.row(row).cwiseProduct(scale);
  }
  return out;
}

double share_on(const Eigen::MatrixXd& path, const Eigen::MatrixXd& reference) {
  const double limit =
      kSamePath * kSamePath * static_cast<double>(std::max<Eigen::Index>(1, path.cols()));
  Eigen::Index on = 0;
  for (Eigen::Index k = 0; k < path.rows(); ++k) {
    const double nearest = (reference.rowwise() - path.row(k)).rowwise().squaredNorm().minCoeff();
    if (nearest < limit) ++on;
  }
  return static_cast<double>(on) / static_cast<double>(std::max<Eigen::Index>(1, path.rows()));
}

Eigen::RowVectorXd range_scale(const TorqueSamples& samples) {
  const Eigen::RowVectorXd range = samples.q.colwise().maxCoeff() - samples.q.colwise().minCoeff();
  return range.unaryExpr([](double r) { return r > 0.0 ? 1.0 / r : 0.0; });
}

/// Trajectories in an order that does not depend on their numbers: by first stamp, then by posture.
std::vector<std::size_t> stable_order(const TorqueSamples& samples,
                                      const std::vector<Piece>& pieces) {
  std::vector<std::size_t> order(pieces.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto key = [&](std::size_t p) {
    const Piece& piece = pieces[p];
    std::vector<double> out = {static_cast<double>(piece.size()), samples.t_s(piece.begin)};
    for (Eigen::Index c = 0; c < samples.joints(); ++c) {
      out.push_back(samples.q(piece.begin, c));
      out.push_back(samples.q(piece.end - 1, c));
    }
    return out;
  };
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return key(a) > key(b); });
  return order;
}

/// Groups of pieces that must stay together, largest first.
std::vector<std::vector<std::size_t>> groups_of(const TorqueSamples& samples,
                                                const std::vector<Piece>& pieces,
                                                const std::vector<int>& same_as) {
  std::map<int, std::vector<std::size_t>> by_first;
  for (std::size_t p = 0; p < pieces.size(); ++p) by_first[same_as[p]].push_back(p);
  std::vector<std::vector<std::size_t>> groups;
  std::vector<char> taken(pieces.size(), 0);
  for (const std::size_t p : stable_order(samples, pieces)) {
    if (taken[p] != 0) continue;
    groups.push_back(by_first[same_as[p]]);
    for (const std::size_t member : groups.back()) taken[member] = 1;
  }
  const auto rows = [&](const std::vector<std::size_t>& group) {
    Eigen::Index sum = 0;
    for (const std::size_t p : group) sum += pieces[p].size();
    return sum;
  };
  std::ranges::stable_sort(groups, [&](const auto& a, const auto& b) { return rows(a) > rows(b); });
  return groups;
}

std::vector<int> first_of_same(const TorqueSamples& samples, const std::vector<Piece>& pieces,
                               bool together) {
  if (together) return repeated_paths(samples);
  std::vector<int> own(pieces.size());
  std::iota(own.begin(), own.end(), 0);
  return own;
}

/// Test rows given: all others learn, except those within the guard of a test row of their
/// trajectory.
Fold fold_of(const TorqueSamples& samples, const std::vector<char>& test, double guard_s) {
  Fold fold;
  const Eigen::Index n = samples.size();
  std::vector<char> near(static_cast<std::size_t>(n), 0);
  for (const int direction : {1, -1}) {
    Eigen::Index last = -1;
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::Index row = direction > 0 ? k : n - 1 - k;
      if (test[static_cast<std::size_t>(row)] != 0)
        last = row;
      else if (last >= 0 && samples.trajectory(row) == samples.trajectory(last) &&
               std::abs(samples.t_s(row) - samples.t_s(last)) <= guard_s) {
        near[static_cast<std::size_t>(row)] = 1;
      }
    }
  }
  for (Eigen::Index row = 0; row < n; ++row) {
    const auto at = static_cast<std::size_t>(row);
    if (!samples.is_measured(row)) continue;
    if (test[at] != 0)
      fold.test.push_back(row);
    else if (near[at] == 0)
      fold.train.push_back(row);
  }
  return fold;
}

/// Groups dealt to the fold with the fewest rows so far.
std::vector<Fold> folds_by_group(const TorqueSamples& samples, const std::vector<Piece>& pieces,
                                 const std::vector<std::vector<std::size_t>>& groups, int count) {
  std::vector<std::vector<char>> test(
      static_cast<std::size_t>(count),
      std::vector<char>(static_cast<std::size_t>(samples.size()), 0));
  std::vector<Eigen::Index> load(static_cast<std::size_t>(count), 0);
  for (const std::vector<std::size_t>& group : groups) {
    const auto fold = static_cast<std::size_t>(std::ranges::min_element(load) - load.begin());
    for (const std::size_t p : group) {
      load[fold] += pieces[p].size();
      std::fill(test[fold].begin() + pieces[p].begin, test[fold].begin() + pieces[p].end, char{1});
    }
  }
  std::vector<Fold> folds;
  folds.reserve(test.size());
  for (const std::vector<char>& rows : test) folds.push_back(fold_of(samples, rows, 0.0));
  return folds;
}

/// Every trajectory cut into as many contiguous blocks as there are folds.
std::vector<Fold> folds_by_block(const TorqueSamples& samples, const std::vector<Piece>& pieces,
                                 int count, double guard_s) {
  std::vector<Fold> folds;
  for (int f = 0; f < count; ++f) {
    std::vector<char> test(static_cast<std::size_t>(samples.size()), 0);
    for (const Piece& piece : pieces) {
      const Eigen::Index begin = piece.begin + f * piece.size() / count;
      const Eigen::Index end = piece.begin + (f + 1) * piece.size() / count;
      std::fill(test.begin() + begin, test.begin() + end, char{1});
    }
    folds.push_back(fold_of(samples, test, guard_s));
  }
  return folds;
}

void name_repeats(const TorqueSamples& samples, const std::vector<Piece>& pieces,
                  const std::vector<int>& same_as, std::vector<LogFinding>& findings) {
  const auto name = [&](std::size_t p) {
    return samples.trajectory_name(samples.trajectory(pieces[p].begin));
  };
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (same_as[p] == static_cast<int>(p)) continue;
    findings.push_back(
        {LogFault::kRepeatedPath, FaultWeight::kNote, "", 0.0, 0.0, name(p),
         fmt::format("follows the path of '{}'", name(static_cast<std::size_t>(same_as[p]))),
         "kept in one fold: judging one by the other says nothing about new motions"});
  }
}

}  // namespace

std::vector<int> repeated_paths(const TorqueSamples& samples) {
  const std::vector<Piece> pieces = pieces_of(samples);
  const Eigen::RowVectorXd scale = range_scale(samples);
  std::vector<Eigen::MatrixXd> few, many;
  for (const Piece& piece : pieces) {
    few.push_back(postures(samples, piece, kPathPoints, scale));
    many.push_back(postures(samples, piece, kPathReference, scale));
  }
  std::vector<int> same_as(pieces.size());
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    same_as[p] = static_cast<int>(p);
    for (std::size_t other = 0; other < p; ++other) {
      if (same_as[other] != static_cast<int>(other)) continue;
      if (share_on(few[p], many[other]) < kMostly || share_on(few[other], many[p]) < kMostly)
        continue;
      same_as[p] = static_cast<int>(other);
      break;
    }
  }
  return same_as;
}

Folds split_folds(const TorqueSamples& samples, const SplitOptions& options) {
  const bool sound = options.folds >= 2 && options.guard_s >= 0.0;
  if (!sound) {
    throw bad_request("dynamics.folds", fmt::format("{} folds", options.folds),
                      "give 2 or more, and a guard of 0 s or more");
  }
  const std::vector<Piece> pieces = pieces_of(samples);
  const std::vector<int> same_as = first_of_same(samples, pieces, options.keep_repeats_together);
  const auto groups = groups_of(samples, pieces, same_as);
  Folds out;
  name_repeats(samples, pieces, same_as, out.findings);
  if (groups.size() >= 2) {
    out.by_trajectory = true;
    out.folds = folds_by_group(samples, pieces, groups,
                               std::min(options.folds, static_cast<int>(groups.size())));
    return out;
  }
  const auto most = static_cast<int>(std::min<Eigen::Index>(
      options.folds, pieces.empty() ? 0 : samples.size() / (kFewestInBlock * std::ssize(pieces))));
  if (most < 2) {
    throw undetermined("cross-validation", fmt::format("{} samples are too few", samples.size()),
                       "record longer");
  }
  out.folds = folds_by_block(samples, pieces, most, options.guard_s);
  const bool learns =
      std::ranges::none_of(out.folds, [](const Fold& f) { return f.train.empty(); });
  if (!learns) {
    throw undetermined(
        "cross-validation",
        fmt::format("a guard of {:.3g} s leaves nothing to learn from", options.guard_s),
        "record longer, or lower the guard");
  }
  return out;
}

Fold split_at_random(const TorqueSamples& samples, double share, std::uint64_t seed) {
  const bool sound = share > 0.0 && share < 1.0;
  if (!sound) throw bad_request("dynamics.test_share", fmt::format("{}", share), "between 0 and 1");
  std::vector<Eigen::Index> rows = measured_rows(samples);
  Rng rng = Rng::from_name("split_at_random", seed);
  for (std::size_t k = rows.size(); k > 1; --k) {
    std::swap(rows[k - 1], rows[static_cast<std::size_t>(rng.index(static_cast<int>(k)))]);
  }
  const auto held =
      static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(rows.size())));
  Fold fold{{rows.begin() + std::min(held, std::ssize(rows)), rows.end()},
            {rows.begin(), rows.begin() + std::min(held, std::ssize(rows))}};
  if (fold.train.empty() || fold.test.empty()) {
    throw undetermined("hold-out", fmt::format("{} samples are too few", samples.size()),
                       "record longer");
  }
  std::ranges::sort(fold.train);
  std::ranges::sort(fold.test);
  return fold;
}

Fold split_last(const TorqueSamples& samples, double share, const SplitOptions& options) {
  const bool sound = share > 0.0 && share < 1.0;
  if (!sound) throw bad_request("dynamics.test_share", fmt::format("{}", share), "between 0 and 1");
  const std::vector<Piece> pieces = pieces_of(samples);
  const std::vector<int> same_as = first_of_same(samples, pieces, options.keep_repeats_together);
  const auto wanted =
      static_cast<Eigen::Index>(std::ceil(share * static_cast<double>(samples.size())));
  std::vector<char> test(static_cast<std::size_t>(samples.size()), 0);
  const bool one_path = std::ranges::all_of(same_as, [](int first) { return first == 0; });
  Eigen::Index count = 0;
  for (std::size_t p = pieces.size(); !one_path && p-- > 0 && count < wanted;) {
    for (std::size_t other = 0; other < pieces.size(); ++other) {
      if (same_as[other] != same_as[p] || same_as[p] == same_as[0]) continue;
      if (test[static_cast<std::size_t>(pieces[other].begin)] != 0) continue;
      std::fill(test.begin() + pieces[other].begin, test.begin() + pieces[other].end, char{1});
      count += pieces[other].size();
    }
  }
  if (one_path) {
    for (const Piece& piece : pieces) {
      const auto part =
          static_cast<Eigen::Index>(std::ceil(share * static_cast<double>(piece.size())));
      std::fill(test.begin() + piece.end - part, test.begin() + piece.end, char{1});
    }
  }
  Fold fold = fold_of(samples, test, options.guard_s);
  if (fold.train.empty() || fold.test.empty()) {
    throw undetermined("hold-out", fmt::format("{} samples are too few", samples.size()),
                       "record longer");
  }
  return fold;
}

TorqueSamples select_rows(const TorqueSamples& samples, const std::vector<Eigen::Index>& rows) {
  TorqueSamples out = samples;
  out.t_s = samples.t_s(rows);
  out.q = samples.q(rows, Eigen::all);
  out.dq = samples.dq(rows, Eigen::all);
  out.ddq = samples.ddq(rows, Eigen::all);
  out.torque = samples.torque(rows, Eigen::all);
  out.trajectory = samples.trajectory(rows);
  if (samples.torque_missing.size() > 0)
    out.torque_missing = samples.torque_missing(rows, Eigen::all);
  return out;
}

std::vector<Eigen::Index> measured_rows(const TorqueSamples& samples) {
  std::vector<Eigen::Index> out;
  for (Eigen::Index row = 0; row < samples.size(); ++row)
    if (samples.is_measured(row)) out.push_back(row);
  return out;
}

TorqueSamples split_at_gaps(TorqueSamples samples) {
  constexpr double kGap = 1.5;  // median steps; filtered samples are even
  const double most_s = kGap * median_of(steps_of(samples.t_s, samples.trajectory));
  Eigen::VectorXi trajectory = samples.trajectory;
  std::vector<std::string> names;
  for (Eigen::Index row = 0; row < samples.size(); ++row) {
    const bool begins = row == 0 || samples.trajectory(row) != samples.trajectory(row - 1) ||
                        samples.t_s(row) - samples.t_s(row - 1) > most_s;
    if (begins) names.push_back(samples.trajectory_name(samples.trajectory(row)));
    trajectory(row) = static_cast<int>(names.size()) - 1;
  }
  samples.trajectory = std::move(trajectory);
  samples.trajectory_names = std::move(names);
  return samples;
}

TorqueSamples measured_part(const TorqueSamples& samples) {
  if (samples.torque_missing.size() == 0) return samples;
  TorqueSamples out = select_rows(samples, measured_rows(samples));
  out.torque_missing.resize(0, 0);
  return out;
}

}  // namespace kinescope
