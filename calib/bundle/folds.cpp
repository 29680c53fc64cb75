// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/folds.h"

#include <algorithm>
#include <numeric>

#include "kinematics/core/rng.h"

namespace kinescope::bundle {
namespace {

// Boxes per fold: enough that every fold holds several regions, few enough that a region is a
// region.
constexpr int kBoxesPerFold = 3;

Eigen::MatrixXd normalised(const Eigen::MatrixXd& features) {
  Eigen::MatrixXd out = features;
  for (Eigen::Index c = 0; c < out.cols(); ++c) {
    const double low = out.col(c).minCoeff();
    const double range = out.col(c).maxCoeff() - low;
    if (range > 0.0) out.col(c) = (out.col(c).array() - low) / range;
  }
  return out;
}

void cut(const Eigen::MatrixXd& features, std::vector<int> frames, int boxes,
         std::vector<std::vector<int>>& out) {
  if (boxes <= 1 || frames.size() < 2) {
    out.push_back(std::move(frames));
    return;
  }
  Eigen::Index widest = 0;
  double width = -1.0;
  for (Eigen::Index c = 0; c < features.cols(); ++c) {
    double low = features(frames[0], c);
    double high = low;
    for (const int f : frames) {
      low = std::min(low, features(f, c));
      high = std::max(high, features(f, c));
    }
    if (high - low > width) {
      width = high - low;
      widest = c;
    }
  }
  std::ranges::stable_sort(frames, {}, [&](int f) { return features(f, widest); });
  const int left_boxes = boxes / 2;
  const auto middle = static_cast<std::ptrdiff_t>(
      frames.size() * static_cast<std::size_t>(left_boxes) / static_cast<std::size_t>(boxes));
  cut(features, {frames.begin(), frames.begin() + middle}, left_boxes, out);
  cut(features, {frames.begin() + middle, frames.end()}, boxes - left_boxes, out);
}

}  // namespace

std::vector<int> assign_folds(const Eigen::MatrixXd& features, int folds) {
  const auto count = static_cast<std::size_t>(features.rows());
  std::vector<int> fold(count, 0);
  if (folds < 2 || count == 0) return fold;
  Eigen::MatrixXd space = normalised(features);
  if (space.cols() == 0) {
    space = Eigen::VectorXd::LinSpaced(features.rows(), 0.0, 1.0);
  }
  std::vector<int> frames(count);
  std::iota(frames.begin(), frames.end(), 0);
  std::vector<std::vector<int>> boxes;
  cut(space, frames, std::min<int>(kBoxesPerFold * folds, static_cast<int>(count)), boxes);
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    for (const int f : boxes[b]) fold[static_cast<std::size_t>(f)] = static_cast<int>(b) % folds;
  }
  return fold;
}

std::vector<int> deal_folds(std::size_t frames, int folds) {
  std::vector<int> fold(frames, 0);
  if (folds < 2) return fold;
  for (std::size_t f = 0; f < frames; ++f) {
    fold[f] = static_cast<int>(f % static_cast<std::size_t>(folds));
  }
  Rng rng = Rng::from_name("folds by lot", frames);
  for (std::size_t f = frames; f > 1; --f) {
    std::swap(fold[f - 1], fold[static_cast<std::size_t>(rng.index(static_cast<int>(f)))]);
  }
  return fold;
}

}  // namespace kinescope::bundle
