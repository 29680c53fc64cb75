// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/student_t.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kinescope {
namespace {

constexpr double kFreedom = 4.0;  // tails as sightings of markers have them

double squared_scale(std::span<const double> squares, double coordinates) {
  const double all = coordinates * static_cast<double>(squares.size());
  double scale = 0.0;
  for (const double r2 : squares) scale += r2;
  scale /= all;
  constexpr int kMostSteps = 200;
  constexpr double kSettled = 1e-9;
  for (int step = 0; step < kMostSteps && scale > 0.0; ++step) {
    double sum = 0.0;
    for (const double r2 : squares) sum += r2 * student_weight(r2, coordinates, scale);
    const double next = sum / all;
    const bool settled = std::abs(next / scale - 1.0) < kSettled;
    scale = next;
    if (settled) break;
  }
  return scale;
}

}  // namespace

double student_weight(double square, double coordinates, double scale_squared) {
  return (kFreedom + coordinates) / (kFreedom + square / scale_squared);
}

StudentT fit_student_t(std::span<const double> squares, double coordinates,
                       double least_scale_squared) {
  if (squares.empty()) return {};
  StudentT out;
  out.scale_squared = std::max(squared_scale(squares, coordinates), least_scale_squared);
  const double norm = std::lgamma(0.5 * (kFreedom + coordinates)) - std::lgamma(0.5 * kFreedom) -
                      0.5 * coordinates * std::log(kFreedom * std::numbers::pi * out.scale_squared);
  for (const double r2 : squares)
    out.deviance +=
        (kFreedom + coordinates) * std::log1p(r2 / (kFreedom * out.scale_squared)) - 2.0 * norm;
  return out;
}

}  // namespace kinescope
