// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/gravity_regressors.h"

#include "dynamics/rigid/regressor.h"

namespace kinescope::effects {
namespace {

constexpr Eigen::Index kOfBody = 10;
constexpr Eigen::Index kHeavy = 4;  // of them: mass and first moments

/// Where the columns that gravity acts on stand among all of a regressor.
Eigen::ArrayXi heavy_columns(Eigen::Index bodies) {
  Eigen::ArrayXi out(kHeavy * bodies);
  for (Eigen::Index k = 0; k < out.size(); ++k)
    out[k] = static_cast<int>(kOfBody * (k / kHeavy) + k % kHeavy);
  return out;
}

std::size_t pair_of(std::size_t a, std::size_t b) { return a * (a + 1) / 2 + b; }

void put_products(GravityRegressors& out) {
  for (std::size_t j = 0; j < out.declared.size(); ++j) {
    const Eigen::MatrixXd& Y = out.declared[j];
    out.squares.emplace_back(Y.transpose() * Y);
    for (std::size_t a = 0; a < 3; ++a) {
      out.mixed[a].emplace_back(Y.transpose() * out.along[a][j]);
      for (std::size_t b = 0; b <= a; ++b)
        out.along_squares[pair_of(a, b)].emplace_back(out.along[a][j].transpose() *
                                                      out.along[b][j]);
    }
  }
}

}  // namespace

Eigen::MatrixXd GravityRegressors::regressor(std::size_t joint,
                                             const Eigen::Vector3d& gravity_m_s2) const {
  Eigen::MatrixXd out = declared[joint];
  const Eigen::Vector3d more = gravity_m_s2 - declared_m_s2;
  if (more.isZero(0.0)) return out;
  const Eigen::ArrayXi heavy = heavy_columns(out.cols() / kOfBody);
  for (std::size_t a = 0; a < 3; ++a)
    out(Eigen::all, heavy) += more[static_cast<Eigen::Index>(a)] * along[a][joint];
  return out;
}

Eigen::MatrixXd GravityRegressors::normal(std::size_t joint,
                                          const Eigen::Vector3d& gravity_m_s2) const {
  Eigen::MatrixXd out = squares[joint];
  const Eigen::Vector3d more = gravity_m_s2 - declared_m_s2;
  if (more.isZero(0.0)) return out;
  const Eigen::ArrayXi heavy = heavy_columns(out.cols() / kOfBody);
  for (std::size_t a = 0; a < 3; ++a) {
    const double by_a = more[static_cast<Eigen::Index>(a)];
    out(Eigen::all, heavy) += by_a * mixed[a][joint];
    out(heavy, Eigen::all) += by_a * mixed[a][joint].transpose();
    for (std::size_t b = 0; b <= a; ++b) {
      const double by_both = by_a * more[static_cast<Eigen::Index>(b)];
      const Eigen::MatrixXd& product = along_squares[pair_of(a, b)][joint];
      out(heavy, heavy) += by_both * product;
      if (a != b) out(heavy, heavy) += by_both * product.transpose();
    }
  }
  return out;
}

std::array<Eigen::MatrixXd, 3> GravityRegressors::slopes(const RigidModel& model) const {
  const Eigen::ArrayXi heavy = heavy_columns(model.size());
  const Eigen::VectorXd bodies = body_parameters(model)(heavy);
  std::array<Eigen::MatrixXd, 3> out;
  for (std::size_t a = 0; a < 3; ++a) {
    out[a].resize(declared.front().rows(), model.size());
    for (std::size_t j = 0; j < declared.size(); ++j)
      out[a].col(static_cast<Eigen::Index>(j)).noalias() = along[a][j] * bodies;
  }
  return out;
}

GravityRegressors make_gravity_regressors(const RigidModel& model, const Eigen::MatrixXd& q,
                                          const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq) {
  GravityRegressors out;
  out.declared_m_s2 = model.gravity_m_s2;
  out.declared = regressors_of_samples(model, q, dq, ddq);
  const Eigen::ArrayXi heavy = heavy_columns(model.size());
  const Eigen::MatrixXd still = Eigen::MatrixXd::Zero(q.rows(), q.cols());
  RigidModel pulled = model;
  for (std::size_t a = 0; a < 3; ++a) {
    pulled.gravity_m_s2 = Eigen::Vector3d::Unit(static_cast<Eigen::Index>(a));
    for (const Eigen::MatrixXd& Y : regressors_of_samples(pulled, q, still, still))
      out.along[a].emplace_back(Y(Eigen::all, heavy));
  }
  put_products(out);
  return out;
}

}  // namespace kinescope::effects
