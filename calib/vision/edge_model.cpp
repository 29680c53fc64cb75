// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/edge_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "calib/vision/blurred_step.h"
#include "kinematics/core/median.h"

namespace kinescope::corner_fit {
namespace {

constexpr double kKnotSpacing =
    7.0;  // px, of the grey levels along an edge: shadows cross a marker
constexpr int kMaxKnots = 10;

// The light of the grey levels at the knots, by their place among the unknowns.
class Levels {
 public:
  Levels(const Layout& layout, const Eigen::VectorXd& unknowns, const ToneCurve& tone)
      : light_(unknowns.tail(layout.size - kLevelsIndex)),
        per_grey_(Eigen::VectorXd::Ones(light_.size())) {
    if (tone.is_linear()) return;
    for (Eigen::Index i = 0; i < light_.size(); ++i) {
      const double grey = std::max(light_(i), ToneCurve::kDarkest);
      light_(i) = tone.light(grey);
      per_grey_(i) = 1.0 / tone.slope(grey, light_(i));
    }
  }
  [[nodiscard]] double light(int index) const { return light_(index - kLevelsIndex); }
  [[nodiscard]] double per_grey(int index) const { return per_grey_(index - kLevelsIndex); }

 private:
  Eigen::VectorXd light_;
  Eigen::VectorXd per_grey_;
};

}  // namespace

Layout::Layout(const Corners& corners) {
  size = kLevelsIndex;
  for (std::size_t e = 0; e < 4; ++e) {
    const double length = (corners[(e + 1) % 4] - corners[e]).norm();
    knots[e] = std::clamp(static_cast<int>(std::lround(length / kKnotSpacing)), 2, kMaxKnots);
    inside[e] = size;
    outside[e] = size + knots[e];
    size += 2 * knots[e];
  }
}

std::vector<Prediction> predict(const Layout& layout, const Eigen::VectorXd& unknowns,
                                const std::vector<Sample>& samples, const ToneCurve& tone) {
  const BlurredStep& table = BlurredStep::table();
  const Levels levels(layout, unknowns, tone);
  std::array<int, 4> first_piece{};
  for (std::size_t e = 1; e < 4; ++e) first_piece[e] = first_piece[e - 1] + layout.knots[e - 1] - 1;
  std::vector<Prediction> out(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    Prediction& p = out[i];
    const auto e = static_cast<std::size_t>(s.edge);
    const int line = 3 * s.edge;
    const double per_blur = 1.0 / unknowns(kBlurIndex + s.edge % 2);
    const double sag = s.u * s.u - 1.0;
    const double d =
        s.distance - (unknowns(line) + unknowns(line + 1) * s.u + unknowns(line + 2) * sag);
    const double z = d * per_blur;
    const auto [step, bell] = table.at(z);
    const double place = std::clamp(0.5 * (s.u + 1.0), 0.0, 1.0) * (layout.knots[e] - 1);
    const int knot = std::min(static_cast<int>(place), layout.knots[e] - 2);
    const double part = place - knot;
    const int in = layout.inside[e] + knot;
    const int on = layout.outside[e] + knot;
    const double inside = (1.0 - part) * levels.light(in) + part * levels.light(in + 1);
    const double outside = (1.0 - part) * levels.light(on) + part * levels.light(on + 1);
    const double contrast = outside - inside;
    const double light = inside + contrast * step;
    p.grey = tone.grey(light);
    p.piece = first_piece[e] + knot;
    const double per_light = tone.is_linear() ? 1.0 : tone.slope(p.grey, light);
    const double slope = per_light * contrast * bell * per_blur;  // per px of distance
    const double in_share = per_light * (1.0 - step);
    const double on_share = per_light * step;
    p.slope << -slope, -slope * s.u, -slope * sag, -slope * z,
        in_share * (1.0 - part) * levels.per_grey(in), in_share * part * levels.per_grey(in + 1),
        on_share * (1.0 - part) * levels.per_grey(on), on_share * part * levels.per_grey(on + 1);
  }
  return out;
}

System make_system(const std::vector<Sample>& samples, const std::vector<Prediction>& predictions,
                   const Layout& layout, double noise) {
  struct Piece {
    Eigen::Matrix<double, 8, 8> H = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> g = Eigen::Matrix<double, 8, 1>::Zero();
  };
  const auto edge_pieces = [&](std::size_t e) {
    return static_cast<std::size_t>(layout.knots[e] - 1);
  };
  std::vector<Piece> pieces(edge_pieces(0) + edge_pieces(1) + edge_pieces(2) + edge_pieces(3));
  System system{Eigen::MatrixXd::Zero(layout.size, layout.size),
                Eigen::VectorXd::Zero(layout.size)};
  const double limit = kRobust * noise;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Prediction& p = predictions[i];
    const double r = samples[i].grey - p.grey;
    const double w = samples[i].weight * (std::abs(r) > limit ? limit / std::abs(r) : 1.0);
    system.cost += w * r * r;
    system.weight += w;
    Piece& piece = pieces[static_cast<std::size_t>(p.piece)];
    const Eigen::Matrix<double, 8, 1> weighted = w * p.slope;
    piece.H.noalias() += weighted * p.slope.transpose();
    piece.g.noalias() += r * weighted;
  }
  auto piece = pieces.begin();
  for (int e = 0; e < 4; ++e) {
    const auto edge = static_cast<std::size_t>(e);
    for (int knot = 0; knot + 1 < layout.knots[edge]; ++knot, ++piece) {
      const int in = layout.inside[edge] + knot;
      const int on = layout.outside[edge] + knot;
      // Ascending, so that the lower triangle goes to the lower triangle.
      const std::array<int, 8> index = {3 * e, 3 * e + 1, 3 * e + 2, kBlurIndex + e % 2,
                                        in,    in + 1,    on,        on + 1};
      for (int a = 0; a < 8; ++a) {
        const int row = index[static_cast<std::size_t>(a)];
        system.g(row) += piece->g(a);
        for (int b = 0; b <= a; ++b)
          system.H(row, index[static_cast<std::size_t>(b)]) += piece->H(a, b);
      }
    }
  }
  return system;
}

void add_belief(System& system, const Eigen::VectorXd& unknowns, int a, double row_a, int b,
                double row_b, double weight) {
  const double r = row_a * unknowns(a) + row_b * unknowns(b);
  system.g(a) -= weight * row_a * r;
  system.g(b) -= weight * row_b * r;
  system.H(a, a) += weight * row_a * row_a;
  system.H(b, b) += weight * row_b * row_b;
  system.H(std::max(a, b), std::min(a, b)) += weight * row_a * row_b;
}

double robust_noise(const std::vector<Sample>& samples,
                    const std::vector<Prediction>& predictions) {
  std::vector<double> size;
  size.reserve(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (samples[i].weight > 0.5) size.push_back(std::abs(samples[i].grey - predictions[i].grey));
  }
  if (size.empty()) return 0.0;
  return std::max(kMinNoise, kSigmaOverMedian * median_of(std::move(size)));
}

std::optional<std::array<double, 2>> guess_levels(const std::vector<Sample>& samples) {
  std::vector<double> inside;
  std::vector<double> outside;
  for (const Sample& s : samples) {
    if (s.distance < -0.8) inside.push_back(s.grey);
    if (s.distance > 0.8) outside.push_back(s.grey);
  }
  if (inside.size() < 8 || outside.size() < 8) return std::nullopt;
  return std::array<double, 2>{median_of(std::move(inside)), median_of(std::move(outside))};
}

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

}  // namespace kinescope::corner_fit
