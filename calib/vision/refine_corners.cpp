// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/refine_corners.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "calib/vision/edge_model.h"
#include "calib/vision/marker_edges.h"
#include "calib/vision/whole_tag.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope {
namespace {

using namespace corner_fit;

constexpr double kBlurStart = 0.8;  // px
constexpr double kBlurMin = 0.25;   // px, below the pixel's own 1/sqrt(12)
constexpr double kBlurMax = 5.0;    // px
constexpr double kCurvatureSigma =
    2e-4;  // 1/px: what lenses bend lines by, opposite edges alike ..
constexpr double kCurvatureScale = 400.0;  // px over which that bending changes by its own size
constexpr double kMinStep =
    0.001;  // of the contrast: how levels differ from knot to knot, at least ..
constexpr double kMaxStep = 0.3;    // .. and at most
constexpr double kBlurSigma = 0.6;  // px: what blurs are like, for tags too small to show their own
// A fit is over after so many rounds when its corners move by less, px.
struct Patience {
  int least_rounds;
  double converged_px;
};
constexpr Patience kUntilExact{4, 2e-3};  // the next step would be far smaller
constexpr Patience kUntilNear{2, 0.1};    // as a start for the cells
constexpr int kMaxRounds = 24;
constexpr int kFullSteps = 6;          // rounds before steps are halved
constexpr double kMaxResidual = 0.12;  // noise over contrast
constexpr double kMaxMove = 5.0;       // px in one round
constexpr int kMinPixels = 40;

class BorderFit {
 public:
  BorderFit(const ImageView& image, const Corners& start, const TagLayout& tag,
            const ToneCurve& tone, Patience patience)
      : image_(image),
        tag_(tag),
        tone_(tone),
        patience_(patience),
        start_(start),
        layout_(start),
        corners_(start),
        unknowns_(Eigen::VectorXd::Zero(layout_.size)) {}

  RefinedCorners run() {
    RefinedCorners out;
    out.corners_px = start_;
    out.status = iterate();
    if (out.status != RefineStatus::kDone) return out;
    out.contrast = contrast();
    out.noise = std::sqrt(variance_);
    out.blur_px = std::max(blur_[0], blur_[1]);
    out.status = judge();
    if (out.status != RefineStatus::kDone) return out;
    out.corners_px = corners_;
    out.sigma_px = std::hypot(predicted_sigma(), kFloorSigma);
    return out;
  }

 private:
  // Rounds of one Gauss-Newton step on newly collected pixels, until the corners rest.
  RefineStatus iterate() {
    for (int round = 0; round < kMaxRounds; ++round) {
      const std::optional<std::array<Edge, 4>> edges = make_edges(corners_, tag_, blur_);
      if (!edges) return RefineStatus::kTooFewPixels;
      samples_ = collect_samples(image_, *edges, corners_, blur_);
      if (const RefineStatus status = check_samples(); status != RefineStatus::kDone) return status;
      if (round == 0) {
        if (!guess()) return RefineStatus::kTooFewPixels;
        if (!right_contrast()) return RefineStatus::kWrongContrast;
      }
      // The edges were laid anew through the corners: lines start at zero, all else is kept.
      for (int e = 0; e < 4; ++e) unknowns_(3 * e) = unknowns_(3 * e + 1) = 0.0;
      predictions_ = predict(layout_, unknowns_, samples_, tone_);
      noise_ = robust_noise(samples_, predictions_);
      if (!step(*edges, round < kFullSteps ? 1.0 : 0.5)) return RefineStatus::kBadFit;
      if (round < kFullSteps) learn_steps();
      const double moved = take_corners(*edges);
      if (!(moved < kMaxMove)) return RefineStatus::kMoved;
      if (round + 1 >= patience_.least_rounds && moved < patience_.converged_px)
        return RefineStatus::kDone;
    }
    return RefineStatus::kNotConverged;
  }

  RefineStatus check_samples() const {
    std::array<int, 4> count{};
    for (const Sample& s : samples_) ++count[static_cast<std::size_t>(s.edge)];
    const bool enough = std::ranges::all_of(count, [](int n) { return n >= kMinPixels / 4; });
    return enough ? RefineStatus::kDone : RefineStatus::kTooFewPixels;
  }

  bool guess() {
    const auto levels = guess_levels(samples_);
    if (!levels) return false;
    for (std::size_t e = 0; e < 4; ++e) {
      unknowns_.segment(layout_.inside[e], layout_.knots[e]).setConstant((*levels)[0]);
      unknowns_.segment(layout_.outside[e], layout_.knots[e]).setConstant((*levels)[1]);
    }
    unknowns_(kBlurIndex) = blur_[0];
    unknowns_(kBlurIndex + 1) = blur_[1];
    return true;
  }

  // What is known beforehand: opposite edges bend alike and little, grey levels change slowly along
  // an edge.
  void add_beliefs(System& system, const std::array<Edge, 4>& edges) const {
    const double v = noise_ * noise_;
    for (std::size_t e = 0; e < 2; ++e) {
      const double a = 2.0 / (edges[e].half * edges[e].half);  // outward curvature per sagitta
      const double b = 2.0 / (edges[e + 2].half * edges[e + 2].half);
      const int ia = 3 * static_cast<int>(e) + 2;
      const int ib = ia + 6;
      const double size = edges[e].half + edges[e + 2].half;
      const double unlike = kCurvatureSigma * size / kCurvatureScale;
      add_belief(system, unknowns_, ia, 0.5 * a, ib, -0.5 * b, v / std::pow(kCurvatureSigma, 2));
      add_belief(system, unknowns_, ia, a, ib, b, v / std::pow(unlike, 2));
    }
    const double c = std::abs(contrast());
    const double inside = v / std::pow(c * inside_step_, 2);
    const double outside = v / std::pow(c * outside_step_, 2);
    for (std::size_t e = 0; e < 4; ++e) {
      for (int k = 0; k + 1 < layout_.knots[e]; ++k) {
        const int i = layout_.inside[e] + k;
        const int o = layout_.outside[e] + k;
        add_belief(system, unknowns_, i, -1.0, i + 1, 1.0, inside);
        add_belief(system, unknowns_, o, -1.0, o + 1, 1.0, outside);
      }
    }
    for (int i = kBlurIndex; i < kLevelsIndex; ++i) {
      system.H(i, i) += v / (kBlurSigma * kBlurSigma);
      system.g(i) -= v / (kBlurSigma * kBlurSigma) * (unknowns_(i) - kBlurStart);
    }
  }

  // How much the grey levels do change along the edges: small where light is even, so that they
  // cost nothing.
  void learn_steps() {
    std::array<double, 2> sum{};
    int count = 0;
    for (std::size_t e = 0; e < 4; ++e) {
      for (int k = 0; k + 1 < layout_.knots[e]; ++k, ++count) {
        const int i = layout_.inside[e] + k;
        const int o = layout_.outside[e] + k;
        sum[0] += std::pow(unknowns_(i + 1) - unknowns_(i), 2);
        sum[1] += std::pow(unknowns_(o + 1) - unknowns_(o), 2);
      }
    }
    const double c = std::abs(contrast());
    inside_step_ = std::clamp(std::sqrt(sum[0] / count) / c, kMinStep, kMaxStep);
    outside_step_ = std::clamp(std::sqrt(sum[1] / count) / c, kMinStep, kMaxStep);
  }

  bool step(const std::array<Edge, 4>& edges, double damping) {
    System system = make_system(samples_, predictions_, layout_, noise_);
    add_beliefs(system, edges);
    const double freedom = system.weight - layout_.size;
    if (!(freedom > 0.25 * kMinPixels)) return false;
    variance_ = std::max(system.cost / freedom, kMinNoise * kMinNoise);
    solver_ = CholeskyFactor(system.H);  // reads the lower triangle
    if (!solver_.positive_definite()) return false;
    Eigen::VectorXd delta = solver_.solve(system.g);
    if (!delta.allFinite()) return false;
    // No step longer than the model can carry.
    double longest = 0.0;
    for (int e = 0; e < 4; ++e) {
      longest = std::max({longest, std::abs(delta(3 * e)), std::abs(delta(3 * e + 1))});
    }
    longest = std::max({longest, 3.0 * std::abs(delta(kBlurIndex)) / blur_[0],
                        3.0 * std::abs(delta(kBlurIndex + 1)) / blur_[1]});
    unknowns_ += delta * damping / std::max(1.0, longest);
    for (int i = 0; i < 2; ++i) {
      double& blur = blur_[static_cast<std::size_t>(i)];
      blur = std::clamp(unknowns_(kBlurIndex + i), kBlurMin, kBlurMax);
      unknowns_(kBlurIndex + i) = blur;
    }
    return right_contrast();
  }

  double take_corners(const std::array<Edge, 4>& edges) {
    Corners next;
    double moved = 0.0;
    for (std::size_t c = 0; c < 4; ++c) {
      meetings_[c] = meet(edges, unknowns_, c);
      next[c] = meetings_[c].point;
      moved = std::max(moved, (next[c] - corners_[c]).norm());
    }
    corners_ = next;
    return moved;
  }

  // Outside minus inside, mean over the edges.
  double contrast() const {
    double sum = 0.0;
    for (std::size_t e = 0; e < 4; ++e) {
      sum += unknowns_.segment(layout_.outside[e], layout_.knots[e]).mean() -
             unknowns_.segment(layout_.inside[e], layout_.knots[e]).mean();
    }
    return 0.25 * sum;
  }

  bool right_contrast() const {
    return (tag_.dark_inside ? contrast() : -contrast()) > kMinContrast;
  }

  RefineStatus judge() const {
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < 4; ++c) {
      shortest = std::min(shortest, (start_[c] - start_[(c + 1) % 4]).norm());
    }
    const double allowed = std::max(1.5, 0.06 * shortest);
    for (std::size_t c = 0; c < 4; ++c) {
      if (!((corners_[c] - start_[c]).norm() < allowed)) return RefineStatus::kMoved;
    }
    if (!(std::sqrt(variance_) < kMaxResidual * std::abs(contrast()))) return RefineStatus::kBadFit;
    return RefineStatus::kDone;
  }

  // By how much neighbouring pixels err together (compression, texture): the variance of the pull
  // on a piece of an edge, against that of independent pixels.
  double correlation() const {
    std::map<std::pair<int, int>, std::array<double, 2>> pieces;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Sample& s = samples_[i];
      const Prediction& p = predictions_[i];
      const double r = std::clamp(s.grey - p.grey, -kRobust * noise_, kRobust * noise_);
      const auto e = static_cast<std::size_t>(s.edge);
      const double length = (corners_[(e + 1) % 4] - corners_[e]).norm();
      const int piece = static_cast<int>(std::floor(0.5 * s.u * length / kCodecBlock));
      auto& [pull, expected] = pieces[{s.edge, piece}];
      pull += s.weight * p.slope[0] * r;
      expected += std::pow(s.weight * p.slope[0], 2);
    }
    double ratio = 0.0;
    for (const auto& [key, piece] : pieces) ratio += piece[0] * piece[0] / (piece[1] * variance_);
    constexpr double kPrior = 2.0;  // pieces' worth of belief in independence
    const double n = static_cast<double>(pieces.size());
    return std::max(1.0, (ratio + kPrior) / (n + kPrior));
  }

  double predicted_sigma() const {
    double sum = 0.0;
    for (const Meeting& meeting : meetings_) {
      Eigen::MatrixXd lever = Eigen::MatrixXd::Zero(layout_.size, 2);
      lever.topRows<12>() = meeting.slope.transpose();
      sum += variance_ * (lever.transpose() * solver_.solve(lever)).trace();
    }
    return std::sqrt(correlation() * sum / 8.0);
  }

  const ImageView& image_;
  const TagLayout& tag_;
  const ToneCurve& tone_;
  Patience patience_;
  const Corners& start_;
  Layout layout_;
  Corners corners_;
  std::array<double, 2> blur_ = {kBlurStart, kBlurStart};
  std::array<Meeting, 4> meetings_;
  std::vector<Sample> samples_;
  std::vector<Prediction> predictions_;  // before the last step
  Eigen::VectorXd unknowns_;
  CholeskyFactor solver_;
  double noise_ = 0.0;
  double variance_ = 0.0;
  double inside_step_ = 0.5 * kMaxStep;
  double outside_step_ = 0.5 * kMaxStep;
};

}  // namespace

RefinedCorners refine_border(const ImageView& image, const Corners& start, const TagLayout& layout,
                             const ToneCurve& tone) {
  return BorderFit(image, start, layout, tone, kUntilExact).run();
}

RefinedCorners refine_corners(const ImageView& image, const Corners& start, const TagLayout& layout,
                              const ToneCurve& tone, const CameraModel* lens) {
  if (lens != nullptr) {
    const RefinedCorners near = BorderFit(image, start, layout, tone, kUntilNear).run();
    const RefinedCorners found = refine_by_cells(image, near, layout, tone, *lens);
    if (found.by_cells) return found;
  }
  return refine_border(image, start, layout, tone);
}

}  // namespace kinescope
