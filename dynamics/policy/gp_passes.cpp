// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/gp_passes.h"

#include "dynamics/gp/simd.h"
#include "dynamics/policy/lanes.h"
#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

// Columns of one group of eight particles, which stay in registers or the first cache.
constexpr Index kMaxColumns = 64;
constexpr std::size_t column_capacity(int columns) {
  if (columns < 0) return static_cast<std::size_t>(kMaxColumns);
  return columns == 0 ? 1 : static_cast<std::size_t>(columns);
}
template <int kColumns>
using Columns = std::array<Lanes, column_capacity(kColumns)>;

struct SamplePass {
  Index samples;
  Index columns;  // D
  const double* scaled_samples;
  const double* half_squares;  // -1/2 |y|^2
  double variance;
  const double* weights;
  Index factors;
  Index linear_columns;  // G
  const double* slopes0;
  const double* slopes1;
  double offset0;
  double offset1;
  const double* scaled;  // of the particles
  Index stride;
  const double* linear;
  Index linear_stride;
};

template <int kColumns>
[[gnu::always_inline]] inline void load_columns(const double* from, Index stride, Index count,
                                                Columns<kColumns>& out) {
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    load(from + d * stride, out[static_cast<std::size_t>(d)]);
  }
}

// out += sum_d x_d row_d.
template <int kColumns>
[[gnu::always_inline]] inline void add_product(const Columns<kColumns>& x, const double* row,
                                               Index count, Lanes& out) {
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    out += x[static_cast<std::size_t>(d)] * row[d];
  }
}

// x_d += factor row_d.
template <int kColumns>
[[gnu::always_inline]] inline void add_row(const Lanes& factor, const double* row, Index count,
                                           Columns<kColumns>& x) {
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    x[static_cast<std::size_t>(d)] += factor * row[d];
  }
}

template <int kColumns>
[[gnu::always_inline]] inline void set_zero(Index count, Columns<kColumns>& x) {
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    x[static_cast<std::size_t>(d)] = Lanes{};
  }
}

template <int kColumns>
[[gnu::always_inline]] inline void store_columns(const Columns<kColumns>& x, Index stride,
                                                 Index count, double* to) {
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    store(x[static_cast<std::size_t>(d)], to + d * stride);
  }
}

// -1/2 |x - y|^2 = x'y - 1/2 |x|^2 - 1/2 |y|^2, half the operations of differences. Rounding is
// 1e-16 |x|^2, which matters to the kernel only where it is zero.
template <int kColumns>
[[gnu::always_inline]] inline void half_squares(const Columns<kColumns>& x, Index count,
                                                Lanes& out) {
  out = Lanes{};
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? count : kColumns); ++d) {
    out -= 0.5 * x[static_cast<std::size_t>(d)] * x[static_cast<std::size_t>(d)];
  }
}

template <int kColumns, int kLinear>
[[gnu::always_inline]] inline void value_body(const SamplePass& p, Index particle, double* smooth,
                                              double* kernel, double* mean) {
  Columns<kColumns> x;
  Columns<kLinear> linear;
  load_columns<kColumns>(p.scaled + particle, p.stride, p.columns, x);
  load_columns<kLinear>(p.linear + particle, p.linear_stride, p.linear_columns, linear);
  Lanes own;
  half_squares<kColumns>(x, p.columns, own);
  Lanes sums = {};
  for (Index j = 0; j < p.samples; ++j) {
    Lanes k = own + p.half_squares[j];
    add_product<kColumns>(x, p.scaled_samples + j * p.columns, p.columns, k);
    exp_of(k);
    k *= p.variance;
    store(k, smooth + j * kLaneCount);
    if (kLinear != 0) {
      Lanes a = Lanes{} + p.offset0;
      add_product<kLinear>(linear, p.slopes0 + j * p.linear_columns, p.linear_columns, a);
      if (p.factors == 2) {
        Lanes b = Lanes{} + p.offset1;
        add_product<kLinear>(linear, p.slopes1 + j * p.linear_columns, p.linear_columns, b);
        a *= b;
      }
      k += a;
    }
    store(k, kernel + j * kLaneCount);
    sums += k * p.weights[j];
  }
  store(sums, mean + particle);
}

// Few columns are unrolled: of a cart and a pole, and of plants with two of each.
#define KINESCOPE_BY_COLUMNS(body, ...)                                        \
  const bool plain = p.factors == 0;                                           \
  if (plain && p.columns == 5) return body<5, 0>(__VA_ARGS__);                 \
  if (plain && p.columns == 6) return body<6, 0>(__VA_ARGS__);                 \
  if (plain && p.columns == 7) return body<7, 0>(__VA_ARGS__);                 \
  if (plain) return body<-1, 0>(__VA_ARGS__);                                  \
  if (p.columns == 6 && p.linear_columns == 6) return body<6, 6>(__VA_ARGS__); \
  return body<-1, -1>(__VA_ARGS__)

KINESCOPE_WIDE void value_pass(const SamplePass& p, Index particle, double* smooth, double* kernel,
                               double* mean) {
  KINESCOPE_BY_COLUMNS(value_body, p, particle, smooth, kernel, mean);
}

struct Slopes {
  const double* smooth;  // of the group
  const double* solved;
  const double* d_mean;
  const double* d_variance;
  double* d_scaled;
  Index d_stride;
  double* d_linear;
  Index d_linear_stride;
};

// d_x = sum_j d_k_j (y_j - x) = sum_j d_k_j y_j - x sum_j d_k_j, and by the product rule.
template <int kColumns, int kLinear>
[[gnu::always_inline]] inline void pullback_body(const SamplePass& p, const Slopes& s,
                                                 Index particle) {
  Columns<kLinear> linear;
  Columns<kColumns> d_x;
  Columns<kLinear> d_linear;
  load_columns<kLinear>(p.linear + particle, p.linear_stride, p.linear_columns, linear);
  set_zero<kColumns>(p.columns, d_x);
  set_zero<kLinear>(p.linear_columns, d_linear);
  Lanes d_mean;
  Lanes d_variance;
  load(s.d_mean + particle, d_mean);
  load(s.d_variance + particle, d_variance);
  d_variance *= -2.0;
  Lanes total = {};
  for (Index j = 0; j < p.samples; ++j) {
    Lanes d_smooth;
    Lanes d_k;
    load(s.smooth + j * kLaneCount, d_smooth);
    load(s.solved + j * kLaneCount, d_k);
    d_k = d_mean * p.weights[j] + d_variance * d_k;
    d_smooth *= d_k;
    total += d_smooth;
    add_row<kColumns>(d_smooth, p.scaled_samples + j * p.columns, p.columns, d_x);
    if (kLinear == 0) continue;
    const double* slopes0 = p.slopes0 + j * p.linear_columns;
    if (p.factors == 2) {
      const double* slopes1 = p.slopes1 + j * p.linear_columns;
      Lanes a = Lanes{} + p.offset0;
      Lanes b = Lanes{} + p.offset1;
      add_product<kLinear>(linear, slopes0, p.linear_columns, a);
      add_product<kLinear>(linear, slopes1, p.linear_columns, b);
      a *= d_k;
      d_k *= b;
      add_row<kLinear>(a, slopes1, p.linear_columns, d_linear);
    }
    add_row<kLinear>(d_k, slopes0, p.linear_columns, d_linear);
  }
  Columns<kColumns> x;
  load_columns<kColumns>(p.scaled + particle, p.stride, p.columns, x);
#pragma GCC unroll 8
  for (Index d = 0; d < (kColumns < 0 ? p.columns : kColumns); ++d) {
    d_x[static_cast<std::size_t>(d)] -= total * x[static_cast<std::size_t>(d)];
  }
  store_columns<kColumns>(d_x, s.d_stride, p.columns, s.d_scaled + particle);
  store_columns<kLinear>(d_linear, s.d_linear_stride, p.linear_columns, s.d_linear + particle);
}

KINESCOPE_WIDE void pullback_pass(const SamplePass& p, const Slopes& s, Index particle) {
  KINESCOPE_BY_COLUMNS(pullback_body, p, s, particle);
}
#undef KINESCOPE_BY_COLUMNS

KINESCOPE_WIDE void sum_squares(const double* values, Index columns, double* sums) {
  Lanes total = {};
  for (Index j = 0; j < columns; ++j) {
    Lanes x;
    load(values + j * kLaneCount, x);
    total += x * x;
  }
  store(total, sums);
}

SamplePass pass_of(const PreparedSamples& samples, const ConstBlock& scaled,
                   const ConstBlock& linear) {
  KINESCOPE_CHECK(scaled.rows() % kLaneCount == 0, "a multiple of eight particles");
  return {samples.scaled.rows(),
          samples.scaled.cols(),
          samples.scaled.data(),
          samples.half_squares.data(),
          samples.variance,
          samples.weights.data(),
          samples.factors,
          samples.factors > 0 ? samples.slopes[0].cols() : 0,
          samples.slopes[0].data(),
          samples.slopes[1].data(),
          samples.offsets[0],
          samples.offsets[1],
          scaled.data(),
          scaled.outerStride(),
          linear.data(),
          linear.outerStride()};
}

}  // namespace

PreparedSamples::PreparedSamples(const KernelValues& kernel, const Eigen::MatrixXd& inputs,
                                 const Eigen::MatrixXd& linear, const Eigen::VectorXd& mean_weights)
    : variance(kernel.variance),
      inverse_scales(kernel.length_scales.cwiseInverse().transpose()),
      weights(mean_weights),
      factors(static_cast<Index>(kernel.factors.size())) {
  KINESCOPE_CHECK(factors <= 2 && inputs.cols() <= kMaxColumns && linear.cols() <= kMaxColumns,
                  "at most two factors and 64 columns");
  scaled = inputs * inverse_scales.asDiagonal();
  half_squares = -0.5 * scaled.rowwise().squaredNorm();
  for (std::size_t f = 0; f < kernel.factors.size(); ++f) {
    offsets[f] = kernel.factors[f].offset;
    slopes[f] = linear * kernel.factors[f].weights.asDiagonal();
  }
}

void kernel_value(const PreparedSamples& samples, const ConstBlock& scaled,
                  const ConstBlock& linear, LaneMatrix& smooth, LaneMatrix& kernel, Block mean) {
  const SamplePass pass = pass_of(samples, scaled, linear);
  for (Index g = 0; g < smooth.groups(); ++g) {
    value_pass(pass, g * kLaneCount, smooth.group(g), kernel.group(g), mean.data());
  }
}

void kernel_pullback(const PreparedSamples& samples, const ConstBlock& scaled,
                     const ConstBlock& linear, const LaneMatrix& smooth, const LaneMatrix& solved,
                     const ConstBlock& d_mean, const ConstBlock& d_variance, Block d_scaled,
                     Block d_linear) {
  const SamplePass pass = pass_of(samples, scaled, linear);
  for (Index g = 0; g < smooth.groups(); ++g) {
    const Slopes slopes{smooth.group(g),   solved.group(g),       d_mean.data(),
                        d_variance.data(), d_scaled.data(),       d_scaled.outerStride(),
                        d_linear.data(),   d_linear.outerStride()};
    pullback_pass(pass, slopes, g * kLaneCount);
  }
}

void squared_rows(const LaneMatrix& values, Block sums) {
  for (Index g = 0; g < values.groups(); ++g) {
    sum_squares(values.group(g), values.columns(), sums.data() + g * kLaneCount);
  }
}

}  // namespace kinescope::policy
