// SPDX-License-Identifier: Apache-2.0
//
// Notation: x the strip, y the sample; v, a velocity and acceleration of x, v', a' of y;
//   u = sum w v v',  ua = sum w v' a (d/dt of u along x),  ub = sum w v a' (along y), uab = sum w a
//   a'; R_a = dR/dq_a, R'_b = dR/dq'_b, R_ab both; Rd = sum v_a R_a, Re = sum v'_b R'_b, Rd_b =
//   sum_a v_a R_ab, Re_a = sum_b v'_b R_ab, Rde = sum v_a v'_b R_ab.
// The Lagrange operator on both arguments of u^2 R gives
//   k_ab = 2 w_a delta_ab D + w_a v'_a m_b + w_a a'_a l_b - h_a w_b v_b + u^2 R_ab,
//   D = R uab + Re ua + Rd ub + Rde u,   m_b = 2 w_b (Re a_b + Rde v_b) - 2 ua R'_b - 2 u Rd_b,
//   l_b = 2 w_b (R a_b + Rd v_b),        h_a = 2 ub R_a + 2 u Re_a.
#include "dynamics/gp/lip_pairs.h"

#include "dynamics/gp/simd.h"

namespace kinescope::gp::lip_pairs {
namespace {

#define KINESCOPE_INLINE inline __attribute__((always_inline))

KINESCOPE_INLINE Lane operator+(const Lane& a, const Lane& b) {
  Lane out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a.v[i] + b.v[i];
  return out;
}
KINESCOPE_INLINE Lane operator-(const Lane& a, const Lane& b) {
  Lane out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a.v[i] - b.v[i];
  return out;
}
KINESCOPE_INLINE Lane operator*(const Lane& a, const Lane& b) {
  Lane out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a.v[i] * b.v[i];
  return out;
}
KINESCOPE_INLINE Lane operator*(double a, const Lane& b) {
  Lane out;
  for (int i = 0; i < kLanes; ++i) out.v[i] = a * b.v[i];
  return out;
}
KINESCOPE_INLINE void add(Lane& to, const Lane& a) {
  for (int i = 0; i < kLanes; ++i) to.v[i] += a.v[i];
}
KINESCOPE_INLINE void add(Lane& to, const Lane& a, const Lane& b) {
  for (int i = 0; i < kLanes; ++i) to.v[i] += a.v[i] * b.v[i];
}
KINESCOPE_INLINE void add(Lane& to, double a, const Lane& b) {
  for (int i = 0; i < kLanes; ++i) to.v[i] += a * b.v[i];
}
KINESCOPE_INLINE Lane all(double value) {
  Lane out;
  for (double& v : out.v) v = value;
  return out;
}

// A joint's factor r(q, q') and its derivatives by q, by q', by both.
struct Factor {
  Lane r, x, y, z;
};

// g = 1 + wc c c' + ws s s', or 1 + w q q'.
KINESCOPE_INLINE Factor base_factor(bool turns, double wc, double ws, const Lane& c, const Lane& s,
                                    double c2, double s2) {
  if (!turns) return {all(1.0) + (wc * c2) * c, all(wc * c2), wc * c, all(wc)};
  return {all(1.0) + (wc * c2) * c + (ws * s2) * s, (ws * s2) * c - (wc * c2) * s,
          (ws * c2) * s - (wc * s2) * c, (wc * s2) * s + (ws * c2) * c};
}

KINESCOPE_INLINE Factor squared(const Factor& g) {
  return {g.r * g.r, 2.0 * (g.r * g.x), 2.0 * (g.r * g.y), 2.0 * (g.x * g.y + g.r * g.z)};
}

// Adjoint of g from that of g^2.
KINESCOPE_INLINE Factor squared_adjoint(const Factor& g, const Factor& d) {
  return {2.0 * (g.r * d.r + g.x * d.x + g.y * d.y + g.z * d.z), 2.0 * (g.r * d.x + g.y * d.z),
          2.0 * (g.r * d.y + g.x * d.z), 2.0 * (g.r * d.z)};
}

KINESCOPE_INLINE void add_base_adjoint(bool turns, const Lane& c, const Lane& s, double c2,
                                       double s2, const Factor& d, Lane& by_wc, Lane& by_ws) {
  if (!turns) {
    add(by_wc, c2 * (c * d.r) + c2 * d.x + c * d.y + d.z);
    return;
  }
  add(by_wc, c2 * (c * d.r) - c2 * (s * d.x) - s2 * (c * d.y) + s2 * (s * d.z));
  add(by_ws, s2 * (s * d.r) + s2 * (c * d.x) + c2 * (s * d.y) + c2 * (c * d.z));
}

// R and its derivatives for joints 0 .. n-1, with what the reverse sweep needs.
struct Product {
  std::array<Factor, kMax> base;
  std::array<Factor, kMax> f;
  std::array<Lane, kMax + 1> before;  // r_0 .. r_(j-1)
  std::array<Lane, kMax + 1> after;   // r_j .. r_(n-1)
  std::array<Lane, kMax> without;     // all but j
  std::array<std::array<Lane, kMax>, kMax> without_two;
  Lane r;
  std::array<Lane, kMax> x, y;
  std::array<std::array<Lane, kMax>, kMax> xy;
};

KINESCOPE_INLINE void make_product(const JointKinds& kinds, int n, const Weights& w, bool square,
                                   const Strip& s, const Sample& t, Product& out) {
  out.before[0] = all(1.0);
  for (int j = 0; j < n; ++j) {
    const auto k = static_cast<unsigned>(j);
    out.base[k] = base_factor(kinds[k] == JointKind::kRevolute, w.cosine[k], w.sine[k], s.cosine[k],
                              s.sine[k], t.cosine[k], t.sine[k]);
    out.f[k] = square ? squared(out.base[k]) : out.base[k];
    out.before[k + 1] = out.before[k] * out.f[k].r;
  }
  out.after[static_cast<unsigned>(n)] = all(1.0);
  for (auto k = static_cast<unsigned>(n); k-- > 0;) out.after[k] = out.f[k].r * out.after[k + 1];
  out.r = out.before[static_cast<unsigned>(n)];
  for (unsigned a = 0; a < static_cast<unsigned>(n); ++a) {
    const Factor& fa = out.f[a];
    out.without[a] = out.before[a] * out.after[a + 1];
    out.x[a] = fa.x * out.without[a];
    out.y[a] = fa.y * out.without[a];
    out.xy[a][a] = fa.z * out.without[a];
    Lane between = out.before[a];
    for (unsigned b = a + 1; b < static_cast<unsigned>(n); ++b) {
      const Lane rest = between * out.after[b + 1];
      out.without_two[a][b] = rest;
      out.xy[a][b] = fa.x * out.f[b].y * rest;
      out.xy[b][a] = out.f[b].x * fa.y * rest;
      between = between * out.f[b].r;
    }
  }
}

// Weights of R and its derivatives in a sum.
struct ProductAdjoint {
  Lane r;
  std::array<Lane, kMax> x, y;
  std::array<std::array<Lane, kMax>, kMax> xy;
};

// The sum is multilinear in each joint's (r, x, y, z):
//   F = A r + sum_b d_b E_b + sum_(b<k) c_bk E_bk,  d_b = X_b x_b + Y_b y_b + XY_bb z_b,
//   c_bk = XY_bk x_b y_k + XY_kb x_k y_b, E_b and E_bk products without b, without b and k.
// Derivatives by r_j come from running the prefix, suffix and inner products backwards.
KINESCOPE_INLINE void reverse_product(const JointKinds& kinds, int joints, bool square,
                                      const Strip& s, const Sample& t, const Product& p,
                                      const ProductAdjoint& d, WeightGradient& gradient) {
  const auto n = static_cast<unsigned>(joints);
  std::array<Factor, kMax> adjoint;
  std::array<Lane, kMax + 1> by_before;
  std::array<Lane, kMax + 1> by_after;
  for (unsigned a = 0; a < n; ++a) {
    by_after[a] = all(0.0);
    adjoint[a].r = all(0.0);
    adjoint[a].x = d.x[a] * p.without[a];
    adjoint[a].y = d.y[a] * p.without[a];
    adjoint[a].z = d.xy[a][a] * p.without[a];
  }
  by_after[n] = all(0.0);
  by_before[n] = d.r;
  for (unsigned b = 0; b < n; ++b) {
    const Factor& fb = p.f[b];
    const Lane single = d.x[b] * fb.x + d.y[b] * fb.y + d.xy[b][b] * fb.z;
    add(by_after[b + 1], p.before[b], single);
    std::array<Lane, kMax> pair;
    std::array<Lane, kMax + 1> inner;
    inner[n] = all(0.0);
    for (unsigned k = n; k-- > b + 1;) {
      const Factor& fk = p.f[k];
      pair[k] = d.xy[b][k] * fb.x * fk.y + d.xy[k][b] * fk.x * fb.y;
      inner[k] = pair[k] * p.after[k + 1] + fk.r * inner[k + 1];
      const Lane& rest = p.without_two[b][k];
      add(adjoint[b].x, d.xy[b][k] * rest, fk.y);
      add(adjoint[b].y, d.xy[k][b] * rest, fk.x);
      add(adjoint[k].x, d.xy[k][b] * rest, fb.y);
      add(adjoint[k].y, d.xy[b][k] * rest, fb.x);
    }
    by_before[b] = single * p.after[b + 1] + inner[b + 1];
    Lane running = p.before[b];
    for (unsigned k = b + 1; k < n; ++k) {
      add(by_after[k + 1], running, pair[k]);
      add(adjoint[k].r, running, inner[k + 1]);
      running = running * p.f[k].r;
    }
  }
  for (unsigned j = 0; j < n; ++j) {
    add(adjoint[j].r, by_after[j], p.after[j + 1]);
    add(by_after[j + 1], by_after[j], p.f[j].r);
  }
  for (unsigned j = n; j-- > 0;) {
    add(adjoint[j].r, by_before[j + 1], p.before[j]);
    add(by_before[j], by_before[j + 1], p.f[j].r);
    const Factor by_base = square ? squared_adjoint(p.base[j], adjoint[j]) : adjoint[j];
    add_base_adjoint(kinds[j] == JointKind::kRevolute, s.cosine[j], s.sine[j], t.cosine[j],
                     t.sine[j], by_base, gradient.cosine[j], gradient.sine[j]);
  }
}

// The scalars and vectors of the file's head.
struct Kinetic {
  Lane u, ua, ub, uab, rd, re, rde, diagonal;
  std::array<Lane, kMax> rd_b, re_a, m, l, h;
};

KINESCOPE_INLINE void make_kinetic(unsigned n, const Weights& w, const Strip& x, const Sample& y,
                                   const Product& p, Kinetic& out) {
  out.u = out.ua = out.ub = out.uab = out.rd = out.re = out.rde = all(0.0);
  for (unsigned a = 0; a < n; ++a) {
    const double wv = w.velocity[a] * y.velocity[a];
    const double wa = w.velocity[a] * y.acceleration[a];
    add(out.u, wv, x.velocity[a]);
    add(out.ua, wv, x.acceleration[a]);
    add(out.ub, wa, x.velocity[a]);
    add(out.uab, wa, x.acceleration[a]);
    add(out.rd, x.velocity[a], p.x[a]);
    add(out.re, y.velocity[a], p.y[a]);
    out.rd_b[a] = out.re_a[a] = all(0.0);
    for (unsigned b = 0; b < n; ++b) {
      add(out.rd_b[a], x.velocity[b], p.xy[b][a]);
      add(out.re_a[a], y.velocity[b], p.xy[a][b]);
    }
    add(out.rde, y.velocity[a], out.rd_b[a]);
  }
  out.diagonal = p.r * out.uab + out.re * out.ua + out.rd * out.ub + out.rde * out.u;
  for (unsigned b = 0; b < n; ++b) {
    const double w2 = 2.0 * w.velocity[b];
    out.m[b] = w2 * (out.re * x.acceleration[b] + out.rde * x.velocity[b]) -
               2.0 * (out.ua * p.y[b] + out.u * out.rd_b[b]);
    out.l[b] = w2 * (p.r * x.acceleration[b] + out.rd * x.velocity[b]);
    out.h[b] = 2.0 * (out.ub * p.x[b] + out.u * out.re_a[b]);
  }
}

}  // namespace

KINESCOPE_WIDE void add_kinetic(const JointKinds& kinds, int link, const Weights& weights,
                                const Strip& x, const Sample& y, Torques& k) {
  const auto n = static_cast<unsigned>(link + 1);
  Product p;
  make_product(kinds, link + 1, weights, true, x, y, p);
  Kinetic t;
  make_kinetic(n, weights, x, y, p, t);
  const Lane square = t.u * t.u;
  for (unsigned a = 0; a < n; ++a) {
    const double wv = weights.velocity[a] * y.velocity[a];
    const double wa = weights.velocity[a] * y.acceleration[a];
    for (unsigned b = 0; b < n; ++b) {
      add(k[a][b], wv * t.m[b] + wa * t.l[b] - weights.velocity[b] * (t.h[a] * x.velocity[b]) +
                       square * p.xy[a][b]);
    }
    add(k[a][a], 2.0 * weights.velocity[a], t.diagonal);
  }
}

KINESCOPE_WIDE void contract_kinetic(const JointKinds& kinds, int link, const Weights& weights,
                                     const Strip& x, const Sample& y, const Torques& q,
                                     WeightGradient& gradient) {
  const auto n = static_cast<unsigned>(link + 1);
  Product p;
  make_product(kinds, link + 1, weights, true, x, y, p);
  Kinetic t;
  make_kinetic(n, weights, x, y, p, t);
  // Adjoints of what q meets first: the vectors m, l, h and those in front of them.
  std::array<Lane, kMax> by_m, by_l, by_h, by_front_m, by_front_l, by_front_h;
  Lane by_diagonal = all(0.0);
  Lane q_xy = all(0.0);
  for (unsigned a = 0; a < n; ++a) {
    by_m[a] = by_l[a] = by_front_h[a] = all(0.0);
    by_h[a] = by_front_m[a] = by_front_l[a] = all(0.0);
  }
  for (unsigned a = 0; a < n; ++a) {
    const double wv = weights.velocity[a] * y.velocity[a];
    const double wa = weights.velocity[a] * y.acceleration[a];
    for (unsigned b = 0; b < n; ++b) {
      const Lane& weight = q[a][b];
      add(by_m[b], wv, weight);
      add(by_l[b], wa, weight);
      add(by_h[a], -weights.velocity[b], weight * x.velocity[b]);
      add(by_front_m[a], weight, t.m[b]);
      add(by_front_l[a], weight, t.l[b]);
      add(by_front_h[b], weight, t.h[a]);
      add(q_xy, weight, p.xy[a][b]);
    }
    add(by_diagonal, 2.0 * weights.velocity[a], q[a][a]);
  }
  Lane by_u = t.rde * by_diagonal + 2.0 * (t.u * q_xy);
  Lane by_ua = t.re * by_diagonal;
  Lane by_ub = t.rd * by_diagonal;
  const Lane by_uab = p.r * by_diagonal;
  Lane by_rd = t.ub * by_diagonal;
  Lane by_re = t.ua * by_diagonal;
  Lane by_rde = t.u * by_diagonal;
  ProductAdjoint d;
  d.r = t.uab * by_diagonal;
  for (unsigned b = 0; b < n; ++b) {
    const double w2 = 2.0 * weights.velocity[b];
    add(by_u, 2.0 * (by_h[b] * t.re_a[b] - by_m[b] * t.rd_b[b]));
    add(by_ua, -2.0, by_m[b] * p.y[b]);
    add(by_ub, 2.0, by_h[b] * p.x[b]);
    add(d.r, w2, by_l[b] * x.acceleration[b]);
    add(by_rd, w2, by_l[b] * x.velocity[b]);
    add(by_re, w2, by_m[b] * x.acceleration[b]);
    add(by_rde, w2, by_m[b] * x.velocity[b]);
  }
  const Lane square = t.u * t.u;
  for (unsigned b = 0; b < n; ++b) {
    d.x[b] = x.velocity[b] * by_rd + 2.0 * (t.ub * by_h[b]);
    d.y[b] = y.velocity[b] * by_re - 2.0 * (t.ua * by_m[b]);
    for (unsigned k = 0; k < n; ++k) {
      // R_bk is in Rde, Rd_k, Re_b and by itself.
      d.xy[b][k] = square * q[b][k] +
                   x.velocity[b] * (y.velocity[k] * by_rde - 2.0 * (t.u * by_m[k])) +
                   (2.0 * y.velocity[k]) * (t.u * by_h[b]);
    }
    const Lane direct = 2.0 * (t.diagonal * q[b][b]) + y.velocity[b] * by_front_m[b] +
                        y.acceleration[b] * by_front_l[b] - x.velocity[b] * by_front_h[b] +
                        2.0 * (by_m[b] * (t.re * x.acceleration[b] + t.rde * x.velocity[b]) +
                               by_l[b] * (p.r * x.acceleration[b] + t.rd * x.velocity[b]));
    const Lane through_sums =
        y.velocity[b] * (by_u * x.velocity[b] + by_ua * x.acceleration[b]) +
        y.acceleration[b] * (by_ub * x.velocity[b] + by_uab * x.acceleration[b]);
    add(gradient.velocity[b], direct + through_sums);
  }
  reverse_product(kinds, link + 1, true, x, y, p, d, gradient);
}

KINESCOPE_WIDE void add_potential(const JointKinds& kinds, const Weights& weights, double scale,
                                  const Strip& x, const Sample& y, Torques& k) {
  Product p;
  make_product(kinds, static_cast<int>(kinds.size()), weights, false, x, y, p);
  for (unsigned a = 0; a < kinds.size(); ++a) {
    for (unsigned b = 0; b < kinds.size(); ++b) add(k[a][b], scale, p.xy[a][b]);
  }
}

KINESCOPE_WIDE void contract_potential(const JointKinds& kinds, const Weights& weights,
                                       double scale, const Strip& x, const Sample& y,
                                       const Torques& q, WeightGradient& gradient, Lane& by_scale) {
  Product p;
  make_product(kinds, static_cast<int>(kinds.size()), weights, false, x, y, p);
  ProductAdjoint d;
  d.r = all(0.0);
  for (unsigned a = 0; a < kinds.size(); ++a) {
    d.x[a] = d.y[a] = all(0.0);
    for (unsigned b = 0; b < kinds.size(); ++b) {
      d.xy[a][b] = scale * q[a][b];
      add(by_scale, q[a][b], p.xy[a][b]);
    }
  }
  reverse_product(kinds, static_cast<int>(kinds.size()), false, x, y, p, d, gradient);
}

}  // namespace kinescope::gp::lip_pairs
