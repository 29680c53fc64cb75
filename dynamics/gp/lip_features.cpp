// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/lip_features.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace kinescope::gp {
namespace {

using Eigen::Index;

LipLayout::Position next_position(JointKind kind, Index& count) {
  LipLayout::Position out;
  out.cosine = count++;
  if (kind == JointKind::kRevolute) out.sine = count++;
  return out;
}

// Functions of the positions: values and derivatives by every joint, samples x functions.
struct Functions {
  Eigen::MatrixXd value;
  std::vector<Eigen::MatrixXd> by_joint;
  Eigen::MatrixXd exponents;  // functions x parameters
};

Functions one_function(Index samples, std::size_t joints, Index parameters) {
  return {Eigen::MatrixXd::Ones(samples, 1),
          std::vector<Eigen::MatrixXd>(joints, Eigen::MatrixXd::Zero(samples, 1)),
          Eigen::MatrixXd::Zero(1, parameters)};
}

// Monomials of (1 + w . p)^degree of one joint, degree 1 or 2.
Functions joint_functions(JointKind kind, const Eigen::VectorXd& q, std::size_t joint,
                          std::size_t joints, const LipLayout::Position& at, int degree,
                          Index parameters) {
  const bool turns = kind == JointKind::kRevolute;
  const Eigen::ArrayXd c = turns ? Eigen::ArrayXd(q.array().cos()) : Eigen::ArrayXd(q.array());
  const Eigen::ArrayXd dc =
      turns ? Eigen::ArrayXd(-q.array().sin()) : Eigen::ArrayXd(Eigen::ArrayXd::Ones(q.size()));
  const Eigen::ArrayXd s = q.array().sin();
  const Eigen::ArrayXd ds = q.array().cos();
  struct Term {
    Eigen::ArrayXd value;
    Eigen::ArrayXd slope;
    int cosine;
    int sine;
  };
  const double root = degree == 2 ? std::numbers::sqrt2 : 1.0;
  std::vector<Term> terms = {{Eigen::ArrayXd::Ones(q.size()), Eigen::ArrayXd::Zero(q.size()), 0, 0},
                             {root * c, root * dc, 1, 0}};
  if (turns) terms.push_back({root * s, root * ds, 0, 1});
  if (degree == 2) {
    terms.push_back({c * c, 2.0 * c * dc, 2, 0});
    if (turns) {
      terms.push_back({root * c * s, root * (dc * s + c * ds), 1, 1});
      terms.push_back({s * s, 2.0 * s * ds, 0, 2});
    }
  }
  const auto count = static_cast<Index>(terms.size());
  Functions out{Eigen::MatrixXd(q.size(), count),
                std::vector<Eigen::MatrixXd>(joints, Eigen::MatrixXd::Zero(q.size(), count)),
                Eigen::MatrixXd::Zero(count, parameters)};
  for (Index k = 0; k < count; ++k) {
    const Term& term = terms[static_cast<std::size_t>(k)];
    out.value.col(k) = term.value;
    out.by_joint[joint].col(k) = term.slope;
    out.exponents(k, at.cosine) += term.cosine;
    if (at.sine >= 0) out.exponents(k, at.sine) += term.sine;
  }
  return out;
}

Functions product_functions(const Functions& a, const Functions& b) {
  const Index count = a.value.cols() * b.value.cols();
  const Index samples = a.value.rows();
  Functions out{Eigen::MatrixXd(samples, count),
                std::vector<Eigen::MatrixXd>(a.by_joint.size(), Eigen::MatrixXd(samples, count)),
                Eigen::MatrixXd(count, a.exponents.cols())};
  Index at = 0;
  for (Index i = 0; i < a.value.cols(); ++i) {
    for (Index k = 0; k < b.value.cols(); ++k, ++at) {
      out.value.col(at) = a.value.col(i).cwiseProduct(b.value.col(k));
      out.exponents.row(at) = a.exponents.row(i) + b.exponents.row(k);
      for (std::size_t j = 0; j < a.by_joint.size(); ++j) {
        out.by_joint[j].col(at) = a.by_joint[j].col(i).cwiseProduct(b.value.col(k)) +
                                  a.value.col(i).cwiseProduct(b.by_joint[j].col(k));
      }
    }
  }
  return out;
}

Functions position_functions(const JointKinds& joints,
                             const std::vector<LipLayout::Position>& positions, int degree,
                             const Inputs& inputs, Index parameters) {
  Functions out = one_function(inputs.rows(), joints.size(), parameters);
  for (std::size_t j = 0; j < positions.size(); ++j) {
    out = product_functions(out, joint_functions(joints[j], inputs.col(static_cast<Index>(j)), j,
                                                 joints.size(), positions[j], degree, parameters));
  }
  return out;
}

}  // namespace

LipLayout::LipLayout(const JointKinds& joints) {
  for (std::size_t i = 0; i < joints.size(); ++i) {
    Link link;
    for (std::size_t j = 0; j <= i; ++j) link.velocity.push_back(count++);
    for (std::size_t j = 0; j <= i; ++j) link.positions.push_back(next_position(joints[j], count));
    links.push_back(std::move(link));
  }
  scale = count++;
  for (const JointKind kind : joints) potential.push_back(next_position(kind, count));
}

double lip_feature_count(const JointKinds& joints) {
  double total = 0.0;
  double squares = 1.0;
  double lines = 1.0;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const bool turns = joints[i] == JointKind::kRevolute;
    squares *= turns ? 6.0 : 3.0;
    lines *= turns ? 3.0 : 2.0;
    const auto pairs = static_cast<double>((i + 1) * (i + 2)) / 2.0;
    total += pairs * squares;
  }
  return total + lines;
}

// For an energy m dq_b dq_c R(q): the operator gives, for torque a,
//   (d/dt m_a) R + m_a dR/dt - m dR/dq_a,  m_a = d(m dq_b dq_c)/d(dq_a).
Basis lip_features(const JointKinds& joints, const LipLayout& layout, const Inputs& inputs) {
  const auto n = static_cast<Index>(joints.size());
  const Index samples = inputs.rows();
  const auto features = static_cast<Index>(lip_feature_count(joints));
  Basis out{Eigen::MatrixXd::Zero(samples * n, features),
            Eigen::MatrixXd::Zero(features, layout.count)};
  const auto velocity = inputs.middleCols(n, n).array();
  const auto acceleration = inputs.middleCols(2 * n, n).array();
  Index at = 0;
  for (const LipLayout::Link& link : layout.links) {
    const Functions r = position_functions(joints, link.positions, 2, inputs, layout.count);
    const auto moved = static_cast<Index>(link.velocity.size());
    for (Index b = 0; b < moved; ++b) {
      for (Index c = b; c < moved; ++c) {
        const double m = b == c ? 1.0 : std::numbers::sqrt2;
        for (Index f = 0; f < r.value.cols(); ++f, ++at) {
          out.exponents.row(at) = r.exponents.row(f);
          out.exponents(at, link.velocity[static_cast<std::size_t>(b)]) += 1.0;
          out.exponents(at, link.velocity[static_cast<std::size_t>(c)]) += 1.0;
          Eigen::ArrayXd rate = Eigen::ArrayXd::Zero(samples);
          for (Index j = 0; j < moved; ++j) {
            rate += velocity.col(j) * r.by_joint[static_cast<std::size_t>(j)].col(f).array();
          }
          for (Index a = 0; a < moved; ++a) {
            auto torque = out.values.col(at).segment(a * samples, samples).array();
            torque -= m * velocity.col(b) * velocity.col(c) *
                      r.by_joint[static_cast<std::size_t>(a)].col(f).array();
            for (const auto& [own, other] : {std::pair(b, c), std::pair(c, b)}) {
              if (a != own) continue;
              torque += m * (acceleration.col(other) * r.value.col(f).array() +
                             velocity.col(other) * rate);
            }
          }
        }
      }
    }
  }
  const Functions v = position_functions(joints, layout.potential, 1, inputs, layout.count);
  for (Index f = 0; f < v.value.cols(); ++f, ++at) {
    out.exponents.row(at) = v.exponents.row(f);
    out.exponents(at, layout.scale) += 1.0;
    for (Index a = 0; a < n; ++a) {
      out.values.col(at).segment(a * samples, samples) =
          v.by_joint[static_cast<std::size_t>(a)].col(f);
    }
  }
  return out;
}

}  // namespace kinescope::gp
