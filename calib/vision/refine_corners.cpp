// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/refine_corners.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace kinescope {
namespace {

// The unknowns: shift, turn and sagitta of each edge (px), two blurs (px), then the grey levels
// beside each edge at knots along it, inside and outside.
constexpr int kBlurIndex = 12;
constexpr int kLevelsIndex = 14;

constexpr double kBlurStart = 0.8;     // px
constexpr double kBlurMin = 0.25;      // px, below the pixel's own 1/sqrt(12)
constexpr double kBlurMax = 5.0;       // px
constexpr double kReach = 2.0;         // blurs at which a neighbouring step has faded to 2 %
constexpr double kCornerReach = 2.5;   // the same at corners, where two edges meet
constexpr double kMinHalfWidth = 1.1;  // px, of the strip beside an edge
constexpr double kMaxHalfWidth = 3.0;  // px, at blurs below 1 px; beyond, in blurs
constexpr double kTaper = 0.7;  // px over which a strip's weight fades out, so that the result does
                                // not jump when a pixel enters it
constexpr double kCurvatureSigma =
    2e-4;  // 1/px: what lenses bend lines by, opposite edges alike ..
constexpr double kCurvatureScale = 400.0;  // px over which that bending changes by its own size
constexpr double kKnotSpacing =
    7.0;  // px, of the grey levels along an edge: shadows cross a marker
constexpr int kMaxKnots = 10;
constexpr double kMinStep =
    0.004;  // of the contrast: how levels differ from knot to knot, at least ..
constexpr double kMaxStep = 0.3;    // .. and at most
constexpr double kBlurSigma = 0.6;  // px: what blurs are like, for tags too small to show their own
constexpr double kRobust = 3.0;     // noise units beyond which a pixel's weight falls
constexpr double kMinNoise = 0.3;   // grey levels, rounding
constexpr double kConverged = 5e-4;  // px
constexpr int kMaxRounds = 24;
constexpr int kFullSteps = 6;          // rounds before steps are halved
constexpr double kMinContrast = 12.0;  // grey levels
constexpr double kMaxResidual = 0.12;  // noise over contrast
constexpr double kFloorSigma = 0.006;  // px, measured: tests/experiments, corners on renders
constexpr double kMaxMove = 5.0;       // px in one round
constexpr int kMinPixels = 40;

struct Edge {
  Eigen::Vector2d middle;
  Eigen::Vector2d along;     // unit, from corner e to e + 1
  Eigen::Vector2d outward;   // unit
  double half = 0.0;         // px, half its length
  double inner_width = 0.0;  // px, strip inside
  double outer_width = 0.0;  // px, strip outside
};

struct Sample {
  int edge = 0;
  double u = 0.0;         // along the edge, -1..1 at the corners
  double distance = 0.0;  // outward from the chord, px
  double grey = 0.0;
  double weight = 0.0;
};

// Homography from the square (-1,1), (1,1), (1,-1), (-1,-1) to the corners.
std::optional<Eigen::Matrix3d> tag_to_image(const Corners& corners) {
  constexpr std::array<std::array<double, 2>, 4> kSquare = {
      {{-1.0, 1.0}, {1.0, 1.0}, {1.0, -1.0}, {-1.0, -1.0}}};
  Eigen::Matrix<double, 8, 8> A;
  Eigen::Matrix<double, 8, 1> b;
  for (int i = 0; i < 4; ++i) {
    const auto [x, y] = kSquare[static_cast<std::size_t>(i)];
    const Eigen::Vector2d& p = corners[static_cast<std::size_t>(i)];
    A.row(2 * i) << x, y, 1.0, 0.0, 0.0, 0.0, -x * p.x(), -y * p.x();
    A.row(2 * i + 1) << 0.0, 0.0, 0.0, x, y, 1.0, -x * p.y(), -y * p.y();
    b(2 * i) = p.x();
    b(2 * i + 1) = p.y();
  }
  const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(A);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::Matrix<double, 8, 1> h = lu.solve(b);
  Eigen::Matrix3d H;
  H << h(0), h(1), h(2), h(3), h(4), h(5), h(6), h(7), 1.0;
  return H;
}

Eigen::Vector2d mapped(const Eigen::Matrix3d& H, double x, double y) {
  return (H * Eigen::Vector3d(x, y, 1.0)).hnormalized();
}

double strip_width(double cell_px, double blur_px) {
  const double wanted = std::max(kMaxHalfWidth, kMaxHalfWidth * blur_px);
  return std::max(kMinHalfWidth, std::min(wanted, cell_px - kReach * blur_px));
}

// Edges of the quadrangle, with strips as wide as the neighbouring cells allow.
std::optional<std::array<Edge, 4>> make_edges(const Corners& corners, const TagLayout& layout,
                                              const std::array<double, 2>& blur) {
  const std::optional<Eigen::Matrix3d> H = tag_to_image(corners);
  if (!H) return std::nullopt;
  std::array<Edge, 4> edges;
  const double cell = 2.0 / layout.cells;
  for (std::size_t e = 0; e < 4; ++e) {
    const Eigen::Vector2d& a = corners[e];
    const Eigen::Vector2d& b = corners[(e + 1) % 4];
    Edge& edge = edges[e];
    edge.half = 0.5 * (b - a).norm();
    if (!(edge.half > 2.0)) return std::nullopt;
    edge.middle = 0.5 * (a + b);
    edge.along = (b - a) / (2.0 * edge.half);
    edge.outward = {-edge.along.y(), edge.along.x()};
    const auto depth = [&](double offset) {  // distance of the line one cell in or out, nearer end
      constexpr std::array<std::array<double, 4>, 4> kEnds = {
          {{-1, 1, 1, 1}, {1, 1, 1, -1}, {1, -1, -1, -1}, {-1, -1, -1, 1}}};
      const auto& [x0, y0, x1, y1] = kEnds[e];
      const bool vertical = e % 2 == 1;  // x is constant
      const double scale = 1.0 + offset;
      const Eigen::Vector2d p = vertical ? mapped(*H, scale * x0, y0) : mapped(*H, x0, scale * y0);
      const Eigen::Vector2d q = vertical ? mapped(*H, scale * x1, y1) : mapped(*H, x1, scale * y1);
      return std::min(std::abs(edge.outward.dot(p - edge.middle)),
                      std::abs(edge.outward.dot(q - edge.middle)));
    };
    edge.inner_width = strip_width(depth(-cell), blur[e % 2]);
    edge.outer_width = strip_width(depth(cell), blur[e % 2]);
  }
  return edges;
}

double faded(double width, double distance) {
  const double t = std::clamp((width - distance) / kTaper, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Pixels in the strips, with the weight of their place.
std::vector<Sample> collect(const ImageView& image, const std::array<Edge, 4>& edges,
                            const Corners& corners, const std::array<double, 2>& blur) {
  Eigen::Vector2d low = corners[0];
  Eigen::Vector2d high = corners[0];
  double reach = 0.0;
  for (std::size_t e = 0; e < 4; ++e) {
    low = low.cwiseMin(corners[e]);
    high = high.cwiseMax(corners[e]);
    reach = std::max({reach, edges[e].inner_width, edges[e].outer_width});
  }
  const int x0 = std::max(0, static_cast<int>(std::floor(low.x() - reach)));
  const int x1 = std::min(image.width - 1, static_cast<int>(std::ceil(high.x() + reach)));
  const int y0 = std::max(0, static_cast<int>(std::floor(low.y() - reach)));
  const int y1 = std::min(image.height - 1, static_cast<int>(std::ceil(high.y() + reach)));
  std::vector<Sample> samples;
  for (int y = y0; y <= y1; ++y) {
    const std::uint8_t* row = image.data + static_cast<std::ptrdiff_t>(image.stride) * y;
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2d p(x, y);
      std::array<double, 4> out{};  // distance outward of every edge
      for (std::size_t e = 0; e < 4; ++e) out[e] = edges[e].outward.dot(p - edges[e].middle);
      for (std::size_t e = 0; e < 4; ++e) {
        const Edge& edge = edges[e];
        const double width = out[e] > 0.0 ? edge.outer_width : edge.inner_width;
        if (std::abs(out[e]) >= width) continue;
        // Away from both neighbouring edges by the reach of their blur.
        const double clear = kCornerReach * blur[(e + 1) % 2];
        const double nearest = -std::max(out[(e + 1) % 4], out[(e + 3) % 4]);
        if (nearest <= clear || nearest < std::abs(out[e]) * 0.5) continue;
        Sample s;
        s.edge = static_cast<int>(e);
        s.u = edge.along.dot(p - edge.middle) / edge.half;
        s.distance = out[e];
        s.grey = static_cast<double>(row[x]);
        s.weight = faded(width, std::abs(out[e])) * std::min(1.0, (nearest - clear) / kTaper);
        samples.push_back(s);
      }
    }
  }
  return samples;
}

// How the unknowns are stored.
struct Layout {
  std::array<int, 4> knots{};   // of each edge, on each side
  std::array<int, 4> inside{};  // where each edge's levels begin
  std::array<int, 4> outside{};
  int size = 0;

  explicit Layout(const Corners& corners) {
    size = kLevelsIndex;
    for (std::size_t e = 0; e < 4; ++e) {
      const double length = (corners[(e + 1) % 4] - corners[e]).norm();
      knots[e] = std::clamp(static_cast<int>(std::lround(length / kKnotSpacing)), 2, kMaxKnots);
      inside[e] = size;
      outside[e] = size + knots[e];
      size += 2 * knots[e];
    }
  }
};

// The model's grey value and its derivatives, stored as (index, value) of the eight that are not
// zero.
struct Prediction {
  double grey = 0.0;
  std::array<int, 8> index{};
  std::array<double, 8> slope{};
};

Prediction predict(const Layout& layout, const Eigen::VectorXd& unknowns, const Sample& s) {
  Prediction out;
  const auto e = static_cast<std::size_t>(s.edge);
  const int line = 3 * s.edge;
  const int blur_index = kBlurIndex + s.edge % 2;
  const double blur = unknowns(blur_index);
  const double sag = s.u * s.u - 1.0;
  const double d =
      s.distance - (unknowns(line) + unknowns(line + 1) * s.u + unknowns(line + 2) * sag);
  const double z = d / blur;
  const double step = 0.5 * std::erfc(-z * std::numbers::sqrt2 / 2.0);
  const double bell = std::exp(-0.5 * z * z) / (blur * std::sqrt(2.0 * std::numbers::pi));
  const double place = std::clamp(0.5 * (s.u + 1.0), 0.0, 1.0) * (layout.knots[e] - 1);
  const int knot = std::min(static_cast<int>(place), layout.knots[e] - 2);
  const double part = place - knot;
  const int in = layout.inside[e] + knot;
  const int on = layout.outside[e] + knot;
  const double inside = (1.0 - part) * unknowns(in) + part * unknowns(in + 1);
  const double outside = (1.0 - part) * unknowns(on) + part * unknowns(on + 1);
  const double contrast = outside - inside;
  out.grey = inside + contrast * step;
  const double slope = contrast * bell;  // per px of distance
  out.index = {line, line + 1, line + 2, blur_index, in, in + 1, on, on + 1};
  out.slope = {-slope,
               -slope * s.u,
               -slope * sag,
               -slope * z,
               (1.0 - step) * (1.0 - part),
               (1.0 - step) * part,
               step * (1.0 - part),
               step * part};
  return out;
}

struct System {
  Eigen::MatrixXd H;  // lower triangle
  Eigen::VectorXd g;
  double cost = 0.0;    // weighted sum of squares
  double weight = 0.0;  // sum of weights
};

System make_system(const std::vector<Sample>& samples, const Layout& layout,
                   const Eigen::VectorXd& unknowns, double noise) {
  System system{Eigen::MatrixXd::Zero(layout.size, layout.size),
                Eigen::VectorXd::Zero(layout.size)};
  for (const Sample& s : samples) {
    const Prediction p = predict(layout, unknowns, s);
    const double r = s.grey - p.grey;
    const double limit = kRobust * noise;
    const double w = s.weight * (std::abs(r) > limit ? limit / std::abs(r) : 1.0);
    system.cost += w * r * r;
    system.weight += w;
    for (std::size_t i = 0; i < 8; ++i) {
      const double wj = w * p.slope[i];
      system.g(p.index[i]) += wj * r;
      for (std::size_t j = 0; j <= i; ++j) system.H(p.index[i], p.index[j]) += wj * p.slope[j];
    }
  }
  return system;
}

// Adds the belief that (row . unknowns) is zero with standard deviation sigma, in units of the
// noise.
void add_belief(System& system, const Eigen::VectorXd& unknowns, int a, double row_a, int b,
                double row_b, double weight) {
  const double r = row_a * unknowns(a) + row_b * unknowns(b);
  system.g(a) -= weight * row_a * r;
  system.g(b) -= weight * row_b * r;
  system.H(a, a) += weight * row_a * row_a;
  system.H(b, b) += weight * row_b * row_b;
  system.H(std::max(a, b), std::min(a, b)) += weight * row_a * row_b;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double robust_noise(const std::vector<Sample>& samples, const Layout& layout,
                    const Eigen::VectorXd& unknowns) {
  std::vector<double> size;
  size.reserve(samples.size());
  for (const Sample& s : samples) {
    if (s.weight > 0.5) size.push_back(std::abs(s.grey - predict(layout, unknowns, s).grey));
  }
  if (size.empty()) return 0.0;
  return std::max(kMinNoise, 1.4826 * median(std::move(size)));
}

// A first guess of the grey values: medians of the pixels well inside and well outside.
std::optional<std::array<double, 2>> guess_levels(const std::vector<Sample>& samples) {
  std::vector<double> inside;
  std::vector<double> outside;
  for (const Sample& s : samples) {
    if (s.distance < -0.8) inside.push_back(s.grey);
    if (s.distance > 0.8) outside.push_back(s.grey);
  }
  if (inside.size() < 8 || outside.size() < 8) return std::nullopt;
  return std::array<double, 2>{median(std::move(inside)), median(std::move(outside))};
}

// Where the chord of edge e - 1 meets that of edge e, as the corner e, with the lever of each
// edge's unknowns.
struct Meeting {
  Eigen::Vector2d point;
  Eigen::Matrix<double, 2, 12> slope = Eigen::Matrix<double, 2, 12>::Zero();
};

Meeting meet(const std::array<Edge, 4>& edges, const Eigen::VectorXd& unknowns,
             std::size_t corner) {
  const std::array<std::size_t, 2> pair = {(corner + 3) % 4, corner};
  Eigen::Matrix2d A;
  Eigen::Vector2d b;
  for (int i = 0; i < 2; ++i) {
    const std::size_t e = pair[static_cast<std::size_t>(i)];
    const Edge& edge = edges[e];
    const double turn = unknowns(3 * static_cast<int>(e) + 1) / edge.half;
    const Eigen::Vector2d normal = edge.outward - turn * edge.along;
    A.row(i) = normal.transpose();
    b(i) = unknowns(3 * static_cast<int>(e)) + normal.dot(edge.middle);
  }
  const Eigen::Matrix2d inverse = A.inverse();
  Meeting out;
  out.point = inverse * b;
  for (int i = 0; i < 2; ++i) {
    const int e = static_cast<int>(pair[static_cast<std::size_t>(i)]);
    out.slope.col(3 * e) = inverse.col(i);
    out.slope.col(3 * e + 1) = inverse.col(i) * (i == 0 ? 1.0 : -1.0);  // u at the corner
  }
  return out;
}

class Fit {
 public:
  Fit(const ImageView& image, const Corners& start, const TagLayout& tag)
      : image_(image),
        tag_(tag),
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
      samples_ = collect(image_, *edges, corners_, blur_);
      if (const RefineStatus status = check_samples(); status != RefineStatus::kDone) return status;
      if (round == 0) {
        if (!guess()) return RefineStatus::kTooFewPixels;
        if (!right_contrast()) return RefineStatus::kWrongContrast;
      }
      // The edges were laid anew through the corners: lines start at zero, all else is kept.
      for (int e = 0; e < 4; ++e) unknowns_(3 * e) = unknowns_(3 * e + 1) = 0.0;
      noise_ = robust_noise(samples_, layout_, unknowns_);
      if (!step(*edges, round < kFullSteps ? 1.0 : 0.5)) return RefineStatus::kBadFit;
      if (round < kFullSteps) learn_steps();
      const double moved = take_corners(*edges);
      if (!(moved < kMaxMove)) return RefineStatus::kMoved;
      if (round > 2 && moved < kConverged) return RefineStatus::kDone;
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
    System system = make_system(samples_, layout_, unknowns_, noise_);
    add_beliefs(system, edges);
    const double freedom = system.weight - layout_.size;
    if (!(freedom > 0.25 * kMinPixels)) return false;
    variance_ = std::max(system.cost / freedom, kMinNoise * kMinNoise);
    solver_.compute(system.H);  // reads the lower triangle
    if (solver_.info() != Eigen::Success) return false;
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
    constexpr double kPiece = 8.0;  // px, a block of the usual video codecs
    std::map<std::pair<int, int>, std::array<double, 2>> pieces;
    for (const Sample& s : samples_) {
      const Prediction p = predict(layout_, unknowns_, s);
      const double r = std::clamp(s.grey - p.grey, -kRobust * noise_, kRobust * noise_);
      const auto e = static_cast<std::size_t>(s.edge);
      const double length = (corners_[(e + 1) % 4] - corners_[e]).norm();
      const int piece = static_cast<int>(std::floor(0.5 * s.u * length / kPiece));
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
  const Corners& start_;
  Layout layout_;
  Corners corners_;
  std::array<double, 2> blur_ = {kBlurStart, kBlurStart};
  std::array<Meeting, 4> meetings_;
  std::vector<Sample> samples_;
  Eigen::VectorXd unknowns_;
  Eigen::LLT<Eigen::MatrixXd> solver_;
  double noise_ = 0.0;
  double variance_ = 0.0;
  double inside_step_ = 0.5 * kMaxStep;
  double outside_step_ = 0.5 * kMaxStep;
};

}  // namespace

RefinedCorners refine_corners(const ImageView& image, const Corners& start,
                              const TagLayout& layout) {
  return Fit(image, start, layout).run();
}

}  // namespace kinescope
