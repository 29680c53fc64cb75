// SPDX-License-Identifier: Apache-2.0
//
// Random numbers of the particles, each a function of seed, use, step of the search, time and
// particle alone: the same on any number of threads, and common to two evaluations of one step.
#pragma once

#include <cstdint>

#include "dynamics/gp/blas.h"

namespace kinescope::policy {

enum class Use : std::uint8_t { kStart = 1, kStartMode, kTransition, kMeasurement, kDropout };

struct DrawPlace {
  std::uint64_t seed = 1;
  Use use = Use::kStart;
  std::uint32_t step = 0;  ///< of the search, or another number of the caller's
  std::uint32_t time = 0;
};

/// Standard normals for particles first .. first + rows - 1, one row each (Box and Muller 1958).
void draw_normals(const DrawPlace& place, Eigen::Index first, gp::Block out);
/// Uniform in [0, 1), likewise.
void draw_uniforms(const DrawPlace& place, Eigen::Index first, gp::Block out);
/// 0 with probability round(256 rate) / 256, else 1 over the probability of not being 0.
void draw_dropout(const DrawPlace& place, double rate, Eigen::Index first, gp::Block out);

}  // namespace kinescope::policy
