// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/QR>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/median.h"

namespace kinescope::hand_eye {
namespace {

using Components = Eigen::Vector4d;  // variances: camera, its turns, the flange's turns, shifts

// Of the declared sigma: simulations without noise leave rounding.
constexpr double kLeastCamera = 1e-6;

// Orthonormal basis of the columns' span, rows x min(rows, columns).
Eigen::MatrixXd basis_of(const Eigen::MatrixXd& columns) {
  const Eigen::Index k = std::min(columns.rows(), columns.cols());
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(columns);
  return qr.householderQ() * Eigen::MatrixXd::Identity(columns.rows(), k);
}

// A frame in the span of what parameters and the controller do to it; the rest is camera noise.
struct Compressed {
  Eigen::VectorXd r;
  Eigen::MatrixXd J;
  std::array<Eigen::MatrixXd, 4> parts;  // of the covariance, beside Components
  double rest_squared = 0.0;
  double rest_rows = 0.0;
};

bool is_turn(Eigen::Index row) { return row % 6 < 3; }

void add_flange_parts(const Eigen::MatrixXd& G, Compressed& out) {
  out.parts[2] = G.leftCols<3>() * G.leftCols<3>().transpose();
  out.parts[3] = G.rightCols<3>() * G.rightCols<3>().transpose();
}

Compressed of_poses(const FrameRows& frame) {
  const Eigen::Index n = frame.residual.size();
  Compressed out{frame.residual, frame.by_parameter, {}, 0.0, 0.0};
  Eigen::VectorXd turn(n);
  for (Eigen::Index k = 0; k < n; ++k) turn[k] = is_turn(k) ? 1.0 : 0.0;
  out.parts[0] = (1.0 - turn.array()).matrix().asDiagonal();
  out.parts[1] = turn.asDiagonal();
  add_flange_parts(frame.by_flange, out);
  return out;
}

Compressed compress(const FrameRows& frame) {
  if (frame.poses) return of_poses(frame);
  Eigen::MatrixXd both(frame.residual.size(), 6 + frame.by_parameter.cols());
  both << frame.by_flange, frame.by_parameter;
  // Columns of targets that are not in this frame are zero.
  std::vector<Eigen::Index> there;
  for (Eigen::Index c = 0; c < both.cols(); ++c)
    if (both.col(c).squaredNorm() > 0.0) there.push_back(c);
  const Eigen::MatrixXd Q = basis_of(both(Eigen::all, there));
  Compressed out{Q.transpose() * frame.residual, Q.transpose() * frame.by_parameter, {}, 0.0, 0.0};
  out.parts[0] = Eigen::MatrixXd::Identity(Q.cols(), Q.cols());
  out.parts[1] = Eigen::MatrixXd::Zero(Q.cols(), Q.cols());
  add_flange_parts(Q.transpose() * frame.by_flange, out);
  out.rest_squared = std::max(0.0, frame.residual.squaredNorm() - out.r.squaredNorm());
  out.rest_rows = static_cast<double>(frame.residual.size() - Q.cols());
  return out;
}

// Likelihood, its slope and its expected curvature by the variances.
struct Restricted {
  double log_likelihood = -std::numeric_limits<double>::infinity();
  Components slope = Components::Zero();
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
};

class Likelihood {
 public:
  explicit Likelihood(const std::vector<FrameRows>& frames) {
    for (const FrameRows& frame : frames) frames_.push_back(compress(frame));
  }

  [[nodiscard]] Restricted at(const Components& v) const {
    std::vector<CholeskyFactor> factors;
    const Eigen::Index p = frames_.front().J.cols();
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(p, p);
    Eigen::VectorXd g = Eigen::VectorXd::Zero(p);
    double sum = 0.0;
    for (const Compressed& f : frames_) {
      factors.emplace_back(covariance(f, v));
      const CholeskyFactor& factor = factors.back();
      if (!factor.positive_definite()) return {};
      const Eigen::MatrixXd solved = factor.solve(f.J);
      H += f.J.transpose() * solved;
      g += solved.transpose() * f.r;
      sum -= factor.lower().diagonal().array().log().sum() + 0.5 * f.r.dot(factor.solve(f.r)) +
             0.5 * (f.rest_rows * std::log(v[0]) + f.rest_squared / v[0]);
    }
    const LdltFactor normal(H);
    const Eigen::VectorXd b = normal.solve(g);
    Restricted out;
    out.log_likelihood = sum + 0.5 * g.dot(b) - 0.5 * log_volume(H);
    for (std::size_t i = 0; i < frames_.size(); ++i)
      add_slopes(frames_[i], factors[i], normal, b, v, out);
    return out;
  }

 private:
  static Eigen::MatrixXd covariance(const Compressed& f, const Components& v) {
    Eigen::MatrixXd V = v[0] * f.parts[0];
    for (std::size_t k = 1; k < f.parts.size(); ++k)
      V += v[static_cast<Eigen::Index>(k)] * f.parts[k];
    return V;
  }

  // log det of a matrix whose parameters have units, without the directions that nothing shows.
  static double log_volume(const Eigen::MatrixXd& H) {
    const Eigen::VectorXd s = unit_scale(H);
    const Eigen::VectorXd values = symmetric_eigenvalues(s.asDiagonal() * H * s.asDiagonal());
    double out = 0.0;
    for (Eigen::Index k = 0; k < s.size(); ++k) {
      if (s[k] > 0.0) out -= 2.0 * std::log(s[k]);
      if (values[k] > std::numeric_limits<double>::epsilon()) out += std::log(values[k]);
    }
    return out;
  }

  static void add_slopes(const Compressed& f, const CholeskyFactor& factor,
                         const LdltFactor& normal, const Eigen::VectorXd& b, const Components& v,
                         Restricted& out) {
    const Eigen::MatrixXd inverse = factor.inverse();
    const Eigen::VectorXd left = inverse * (f.r - f.J * b);
    const Eigen::MatrixXd VJ = inverse * f.J;
    const Eigen::MatrixXd leverage = VJ * normal.solve(Eigen::MatrixXd(VJ.transpose()));
    std::array<Eigen::MatrixXd, 4> weighted;
    for (std::size_t k = 0; k < f.parts.size(); ++k) weighted[k] = inverse * f.parts[k];
    for (std::size_t k = 0; k < f.parts.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      out.slope[row] += 0.5 * (left.dot(f.parts[k] * left) - weighted[k].trace() +
                               leverage.cwiseProduct(f.parts[k]).sum());
      for (std::size_t l = 0; l < f.parts.size(); ++l)
        out.information(row, static_cast<Eigen::Index>(l)) +=
            0.5 * weighted[k].cwiseProduct(weighted[l].transpose()).sum();
    }
    out.slope[0] += 0.5 * (f.rest_squared / v[0] - f.rest_rows) / v[0];
    out.information(0, 0) += 0.5 * f.rest_rows / (v[0] * v[0]);
  }

  std::vector<Compressed> frames_;
};

// The camera's variances stay above zero, those of the flange may reach it.
Components bounded(Components v) {
  v = v.cwiseMax(0.0);
  v.head<2>() = v.head<2>().cwiseMax(kLeastCamera * kLeastCamera);
  return v;
}

// A variance at zero whose slope leads below stays there.
Components fisher_step(const Restricted& now, const Components& v) {
  Eigen::Matrix4d F = now.information;
  Components s = now.slope;
  for (Eigen::Index k = 2; k < v.size(); ++k) {
    if (v[k] > 0.0 || s[k] > 0.0) continue;
    F.row(k).setZero();
    F.col(k).setZero();
    s[k] = 0.0;
  }
  const Eigen::VectorXd scale = unit_scale(F);
  const Eigen::MatrixXd even = scale.asDiagonal() * F * scale.asDiagonal();
  return scale.asDiagonal() * solve_symmetric(even, Eigen::VectorXd(scale.asDiagonal() * s));
}

constexpr double kLittleFlange = 0.1;  // of the start

// Variance over the declared one, if the controller did not err.
double camera_alone(const std::vector<FrameRows>& frames) {
  double sum = 0.0;
  double rows = 0.0;
  for (const FrameRows& frame : frames) {
    sum += frame.residual.squaredNorm();
    rows += static_cast<double>(frame.residual.size());
  }
  return sum / rows;
}

struct Climbed {
  Components variances;
  double log_likelihood = 0.0;
};

Climbed climb(const Likelihood& likelihood, const Components& start) {
  constexpr int kMaxSteps = 50;
  constexpr double kSettled = 1e-6;  // of the log likelihood
  constexpr double kShortestStep = 1e-4;
  Components v = bounded(start);
  Restricted now = likelihood.at(v);
  for (int i = 0; i < kMaxSteps; ++i) {
    const Components step = fisher_step(now, v);
    double share = 1.0;
    Components tried = bounded(v + step);
    Restricted next = likelihood.at(tried);
    while (!(next.log_likelihood > now.log_likelihood) && share > kShortestStep) {
      share *= 0.25;
      tried = bounded(v + share * step);
      next = likelihood.at(tried);
    }
    if (!(next.log_likelihood > now.log_likelihood)) break;
    const bool settled = next.log_likelihood - now.log_likelihood < kSettled;
    v = tried;
    now = next;
    if (settled) break;
  }
  return {v, now.log_likelihood};
}

}  // namespace

Matrix6d Noise::flange_covariance() const {
  Vector6d variances;
  variances << Eigen::Vector3d::Constant(flange_rad * flange_rad),
      Eigen::Vector3d::Constant(flange_m * flange_m);
  return variances.asDiagonal();
}

Eigen::VectorXd camera_weights(const Noise& noise, const FrameRows& rows) {
  Eigen::VectorXd out = Eigen::VectorXd::Constant(rows.residual.size(), 1.0 / noise.camera);
  for (Eigen::Index k = 0; rows.poses && k < out.size(); ++k)
    if (is_turn(k)) out[k] = 1.0 / noise.camera_turn;
  return out;
}

Whitening::Whitening(const Noise& noise, const FrameRows& rows)
    : weights_(camera_weights(noise, rows)) {
  const Eigen::MatrixXd G = weights_.asDiagonal() * rows.by_flange;
  Q_ = basis_of(G);
  const Eigen::MatrixXd R = Q_.transpose() * G;
  Eigen::MatrixXd V = R * noise.flange_covariance() * R.transpose();
  V.diagonal().array() += 1.0;
  const SymmetricEigen eigen = symmetric_eigen(V);
  inner_ = eigen.vectors * eigen.values.cwiseSqrt().cwiseInverse().asDiagonal() *
           eigen.vectors.transpose();
  inner_.diagonal().array() -= 1.0;
  log_determinant_ = eigen.values.array().log().sum() - 2.0 * weights_.array().log().sum();
}

Eigen::MatrixXd Whitening::apply(const Eigen::MatrixXd& rows) const {
  const Eigen::MatrixXd weighted = weights_.asDiagonal() * rows;
  return weighted + Q_ * (inner_ * (Q_.transpose() * weighted));
}

FlangeError flange_error(const FrameRows& rows, const Noise& noise) {
  const Eigen::VectorXd weights = camera_weights(noise, rows);
  const Eigen::MatrixXd G = weights.asDiagonal() * rows.by_flange;
  Eigen::MatrixXd right(G.rows(), 1 + rows.by_parameter.cols());
  right << -rows.residual, rows.by_parameter;
  const Eigen::MatrixXd solved = least_squares(G, weights.asDiagonal() * right);
  FlangeError out;
  out.error = solved.col(0);
  // The residual that parameters leave asks for less of the error.
  out.by_parameter = -solved.rightCols(rows.by_parameter.cols());
  const Matrix6d normal = G.transpose() * G;
  out.covariance =
      noise.flange_covariance() + inverse_of_positive(normal).value_or(Matrix6d::Zero());
  return out;
}

Noise robust_noise(const std::vector<FrameRows>& frames) {
  constexpr double kMedianOf3 = 1.538;  // of the length of three standard normal numbers
  std::vector<double> turns;
  std::vector<double> shifts;
  std::vector<double> camera;
  for (const FrameRows& frame : frames) {
    const FlangeError e = flange_error(frame, {});
    turns.push_back(e.error.head<3>().norm() / kMedianOf3);
    shifts.push_back(e.error.tail<3>().norm() / kMedianOf3);
    const auto rest = frame.residual.size() - 6;
    if (rest <= 0) continue;
    const double squared = (frame.residual + frame.by_flange * e.error).squaredNorm();
    camera.push_back(std::sqrt(squared / static_cast<double>(rest)));
  }
  Noise out;
  out.flange_rad = median_of(turns);
  out.flange_m = median_of(shifts);
  if (!camera.empty()) out.camera = std::max(kLeastCamera, median_of(camera));
  out.camera_turn = out.camera;
  return out;
}

Noise estimate_noise(const std::vector<FrameRows>& frames, const Noise& start) {
  const Likelihood likelihood(frames);
  const auto square = [](double x) { return x * x; };
  // The likelihood may have two maxima: what turns and shifts the flange moves the targets, too.
  const double lower = kLittleFlange * kLittleFlange;
  const double camera = camera_alone(frames);
  const Climbed one = climb(likelihood, {square(start.camera), square(start.camera_turn),
                                         square(start.flange_rad), square(start.flange_m)});
  const Climbed other = climb(likelihood, {camera, camera, lower * square(start.flange_rad),
                                           lower * square(start.flange_m)});
  const Components& v = (other.log_likelihood > one.log_likelihood ? other : one).variances;
  return {std::sqrt(v[0]), std::sqrt(v[1]), std::sqrt(v[2]), std::sqrt(v[3])};
}

}  // namespace kinescope::hand_eye
