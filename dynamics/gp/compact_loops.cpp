// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/compact_loops.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "dynamics/gp/simd.h"

namespace kinescope::gp::loops {
namespace {

using Eigen::Index;

// Blocks of a pass: what it reads stays in the first-level cache for the next processes.
constexpr Index kBlocks = 32;
// Processes of a pass: their sums stay in registers, two to each where registers hold four.
constexpr std::size_t kProcesses = 4;

// Some blocks of rows for some processes.
struct Pass {
  Index begin = 0;
  Index end = 0;
  Index first = 0;
  Index processes = 0;

  // The first one, or the one after this; false at the end.
  bool next(Index rows, Index all_processes) {
    first += processes;
    if (end == 0 || first == all_processes) {
      begin = end;
      first = 0;
    }
    const Index blocks = rows / kLanes;
    end = std::min(begin + kBlocks, blocks);
    processes = std::min(static_cast<Index>(kProcesses), all_processes - first);
    return begin < blocks && processes > 0;
  }
};

// Numbers alone: what is compiled for one processor must not be a template that others share.
struct RbfTask {
  const double* table;
  const double* x;
  const double* factors;
  const double* variances;
  double* out;
  Index columns, rows, processes;
};

struct PolynomialTask {
  const double* motions;
  const double* positions;
  const JointKind* kinds;
  const double* offsets;
  const double* by_motion;
  const double* by_first;
  const double* by_second;
  double* out;
  Index columns, position_columns, joints, rows, processes;
};

namespace plain {
#include "dynamics/gp/compact_lanes.inl"
}

#if defined(KINESCOPE_HAS_WIDE)
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v3")
namespace v3 {
#include "dynamics/gp/compact_lanes.inl"
}
#pragma GCC pop_options
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v4")
namespace v4 {
#include "dynamics/gp/compact_lanes.inl"
}
#pragma GCC pop_options
#endif

struct Loops {
  void (*add_rbf)(const RbfTask&);
  void (*polynomials)(const PolynomialTask&);
};

Loops compiled_for(Registers registers) {
  switch (registers) {
#if defined(KINESCOPE_HAS_WIDE)
    case Registers::k512:
      return {v4::add_rbf, v4::polynomials};
    case Registers::k256:
      return {v3::add_rbf, v3::polynomials};
#endif
    default:
      return {plain::add_rbf, plain::polynomials};
  }
}

Registers registers_of_this_processor() {
#if defined(KINESCOPE_HAS_WIDE)
  if (__builtin_cpu_supports("x86-64-v4")) return Registers::k512;
  if (__builtin_cpu_supports("x86-64-v3")) return Registers::k256;
#endif
  return Registers::k128;
}

}  // namespace

Registers widest_registers() {
  static const Registers widest = registers_of_this_processor();
  return widest;
}

LaneTable::LaneTable(const Eigen::MatrixXd& table)
    : columns_(table.cols()),
      blocks_((table.rows() + kLanes - 1) / kLanes),
      values_(Eigen::VectorXd::Zero(blocks_ * kLanes * columns_)) {
  for (Index d = 0; d < columns_; ++d) {
    for (Index i = 0; i < table.rows(); ++i)
      values_[(i / kLanes * columns_ + d) * kLanes + i % kLanes] = table(i, d);
  }
}

void add_rbf(const LaneTable& table, const Eigen::VectorXd& x, const Eigen::MatrixXd& factors,
             const Eigen::VectorXd& variances, Eigen::MatrixXd& out, Registers registers) {
  compiled_for(registers).add_rbf({table.data(), x.data(), factors.data(), variances.data(),
                                   out.data(), table.columns(), table.rows(), out.cols()});
}

void polynomials(const LaneTable& motions, const LaneTable& positions, const JointKinds& joints,
                 const PolynomialFactors& factors, Eigen::MatrixXd& out, Registers registers) {
  compiled_for(registers).polynomials(
      {motions.data(), positions.data(), joints.data(), factors.offsets.data(),
       factors.motion.data(), factors.first.data(), factors.second.data(), out.data(),
       motions.columns(), positions.columns(), std::ssize(joints), motions.rows(), out.cols()});
}

KINESCOPE_WIDE double dot(const double* a, const double* b, Index size) {
  double lanes[kLanes] = {};
  const Index whole = size / kLanes * kLanes;
  for (Index i = 0; i < whole; i += kLanes) {
    for (Index lane = 0; lane < kLanes; ++lane) lanes[lane] += a[i + lane] * b[i + lane];
  }
  for (Index i = whole; i < size; ++i) lanes[i - whole] += a[i] * b[i];
  double sum = 0.0;
  for (const double lane : lanes) sum += lane;
  return sum;
}

KINESCOPE_WIDE void triangle_times(const double* packed, const double* k, Index size, double* out) {
  for (Index i = 0; i < size; ++i) out[i] = 0.0;
  for (Index j = 0; j < size; ++j) {
    const double factor = k[j];
    for (Index i = 0; i <= j; ++i) out[i] += packed[i] * factor;
    packed += j + 1;
  }
}

}  // namespace kinescope::gp::loops
