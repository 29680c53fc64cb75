// SPDX-License-Identifier: Apache-2.0
//
// Once for each instruction set, by compact_loops.cpp, in a namespace of its own: the compiler
// splits what is wider than the registers it may use before it inlines anything.

// Without a call: the registers' width is the caller's.
#define KINESCOPE_INLINE [[gnu::always_inline]] inline

using Lanes [[gnu::vector_size(kLanes * sizeof(double))]] = double;
using LaneBits [[gnu::vector_size(kLanes * sizeof(double))]] = std::uint64_t;

KINESCOPE_INLINE Lanes load(const double* from) {
  Lanes out;
  __builtin_memcpy(&out, from, sizeof out);
  return out;
}

KINESCOPE_INLINE void store(Lanes value, double* to) { __builtin_memcpy(to, &value, sizeof value); }

// e^x for x <= 0: 2^n e^r with |r| <= ln(2) / 2, Taylor's series to the last bit but one.
KINESCOPE_INLINE Lanes exponential(Lanes x) {
  constexpr double kLog2E = 1.4426950408889634;
  constexpr double kLn2High =
      0.693147180369123816490;  // without its last bits: n times it is exact
  constexpr double kLn2Low = 1.90821492927058770002e-10;
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: its last bits count units
  constexpr double kLeast = -700.0;              // 1e-304
  x = x > kLeast ? x : Lanes{} + kLeast;
  const Lanes shifted = x * kLog2E + kRound;
  const Lanes n = shifted - kRound;
  const Lanes r = (x - n * kLn2High) - n * kLn2Low;
  Lanes sum = r * (1.0 / 479001600.0) + 1.0 / 39916800.0;
  sum = sum * r + 1.0 / 3628800.0;
  sum = sum * r + 1.0 / 362880.0;
  sum = sum * r + 1.0 / 40320.0;
  sum = sum * r + 1.0 / 5040.0;
  sum = sum * r + 1.0 / 720.0;
  sum = sum * r + 1.0 / 120.0;
  sum = sum * r + 1.0 / 24.0;
  sum = sum * r + 1.0 / 6.0;
  sum = sum * r + 0.5;
  sum = sum * r + 1.0;
  sum = sum * r + 1.0;
  const LaneBits power = (reinterpret_cast<LaneBits>(shifted) + 1023U) << 52U;
  return sum * reinterpret_cast<Lanes>(power);
}

// Blocks k to k + B of processes first to first + J.
template <std::size_t J, std::size_t B>
KINESCOPE_INLINE void rbf_blocks(const RbfTask& task, Index first, Index k) {
  const Index next = task.columns * kLanes;
  const double* at = task.table + k * next;
  const double* factor = task.factors + first;
  Lanes sums[B][J] = {};
  for (Index d = 0; d < task.columns; ++d, at += kLanes, factor += task.processes) {
    for (std::size_t b = 0; b < B; ++b) {
      const Lanes difference = load(at + static_cast<Index>(b) * next) - task.x[d];
      const Lanes square = difference * difference;
      for (std::size_t j = 0; j < J; ++j) sums[b][j] += square * factor[j];
    }
  }
  const double* variances = task.variances + first;
  double* out = task.out + first * task.rows + k * kLanes;
  for (std::size_t j = 0; j < J; ++j, out += task.rows) {
    for (std::size_t b = 0; b < B; ++b) {
      double* own = out + static_cast<Index>(b) * kLanes;
      store(load(own) + variances[j] * exponential(-0.5 * sums[b][j]), own);
    }
  }
}

// As many sums at a time as hide how long each addition takes.
template <std::size_t J>
KINESCOPE_INLINE void one_pass(const RbfTask& task, const Pass& pass) {
  constexpr std::size_t kTogether = kProcesses / J;
  constexpr auto kStep = static_cast<Index>(kTogether);
  Index k = pass.begin;
  for (; k + kStep <= pass.end; k += kStep) rbf_blocks<J, kTogether>(task, pass.first, k);
  for (; k < pass.end; ++k) rbf_blocks<J, 1>(task, pass.first, k);
}

template <std::size_t J>
KINESCOPE_INLINE void one_pass(const PolynomialTask& task, const Pass& pass) {
  const double* offsets = task.offsets + pass.first;
  for (Index k = pass.begin; k < pass.end; ++k) {
    Lanes values[J];
    for (std::size_t j = 0; j < J; ++j) values[j] = Lanes{} + offsets[j];
    const double* at = task.motions + k * task.columns * kLanes;
    const double* factor = task.by_motion + pass.first;
    for (Index d = 0; d < task.columns; ++d, at += kLanes, factor += task.processes) {
      const Lanes feature = load(at);
      for (std::size_t j = 0; j < J; ++j) values[j] += feature * factor[j];
    }
    at = task.positions + k * task.position_columns * kLanes;
    const double* a = task.by_first + pass.first;
    const double* b = task.by_second + pass.first;
    for (Index joint = 0; joint < task.joints; ++joint) {
      const Lanes p = load(at);
      const bool turns = task.kinds[joint] == JointKind::kRevolute;
      if (turns) {
        const Lanes q = load(at + kLanes);
        const double* a_of_q = a + task.processes;
        const double* b_of_q = b + task.processes;
        for (std::size_t j = 0; j < J; ++j)
          values[j] *= (1.0 + a[j] * p + a_of_q[j] * q) * (1.0 + b[j] * p + b_of_q[j] * q);
      } else {
        for (std::size_t j = 0; j < J; ++j) values[j] *= (1.0 + a[j] * p) * (1.0 + b[j] * p);
      }
      const Index taken = turns ? 2 : 1;
      at += taken * kLanes;
      a += taken * task.processes;
      b += taken * task.processes;
    }
    double* out = task.out + pass.first * task.rows + k * kLanes;
    for (std::size_t j = 0; j < J; ++j, out += task.rows) store(values[j], out);
  }
}

// With the number of processes known to the compiler.
template <typename Task>
KINESCOPE_INLINE void all_passes(const Task& task) {
  for (Pass pass; pass.next(task.rows, task.processes);) {
    switch (pass.processes) {
      case 1:
        one_pass<1>(task, pass);
        break;
      case 2:
        one_pass<2>(task, pass);
        break;
      case 3:
        one_pass<3>(task, pass);
        break;
      default:
        one_pass<kProcesses>(task, pass);
    }
  }
}

void add_rbf(const RbfTask& task) { all_passes(task); }
void polynomials(const PolynomialTask& task) { all_passes(task); }

#undef KINESCOPE_INLINE
