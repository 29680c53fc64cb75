// SPDX-License-Identifier: Apache-2.0
#include "dynamics/simulation/dry_friction.h"

#include <algorithm>
#include <cmath>

#include "dynamics/effects/drive_laws.h"

namespace kinescope {
namespace {

constexpr int kMostSweeps = 500;
// Of the speeds that are added up: rounding of double precision.
constexpr double kConverged = 1e-14;

struct Smooth {
  double torque = 0.0;
  double slope = 0.0;  ///< with the speed
};

/// All of an element's law that is smooth.
Smooth smooth_part(const DryElement& element, double speed, double step_s) {
  Smooth out;
  if (element.width > 0.0 && element.amplitude > 0.0) {
    const double way = effects::direction(speed, element.width);
    out.torque += element.amplitude * way;
    out.slope += element.amplitude * (1.0 - way * way) / element.width;
  }
  // The mean of the state over the step; joints move by the mean of their speeds.
  const double moved = 0.5 * step_s * (element.speed_before + speed);
  for (const DryElement::Presliding& part : element.presliding) {
    const double after = effects::dahl_after(part.state, moved, part.length);
    const double way = moved < 0.0 ? -1.0 : 1.0;
    out.torque += 0.5 * part.friction * (part.state + after);
    out.slope += 0.5 * part.friction * (1.0 - after * way) / part.length * 0.5 * step_s;
  }
  return out;
}

double bound(const DryElement& element) {
  double out = element.amplitude;
  for (const DryElement::Presliding& part : element.presliding) out += std::abs(part.friction);
  return out;
}

/// u + c (dry Sign(u) + smooth(u)) = r, rising in u: Newton's method within a bracket.
double smooth_speed(const DryElement& element, double r, double c, double dry, double step_s) {
  double low = r - c * bound(element);
  double high = r + c * bound(element);
  if (dry > 0.0) {
    const double at_rest = c * smooth_part(element, 0.0, step_s).torque - r;
    if (std::abs(at_rest) <= c * dry) return 0.0;
    // It slides one way; the sign is known.
    const double way = at_rest < 0.0 ? 1.0 : -1.0;
    r -= c * dry * way;
    (way > 0.0 ? low : high) = 0.0;
  }
  const double tolerance = kConverged * (std::abs(r) + c * bound(element));
  double u = std::clamp(r, low, high);
  constexpr int kMostSteps = 100;
  for (int k = 0; k < kMostSteps; ++k) {
    const Smooth smooth = smooth_part(element, u, step_s);
    const double error = u + c * smooth.torque - r;
    (error > 0.0 ? high : low) = u;
    double next = u - error / (1.0 + c * smooth.slope);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::abs(next - u) <= tolerance) return next;
    u = next;
  }
  return u;
}

}  // namespace

const DrySolution& DryFrictionSolver::solve(const std::vector<DryElement>& elements,
                                            const Eigen::MatrixXd& compliance,
                                            const Eigen::VectorXd& free_speed, double step_s,
                                            const Eigen::VectorXd& guess) {
  const Eigen::Index count = free_speed.size();
  Eigen::VectorXd& torque = solution_.torque;
  Eigen::VectorXd& speed = solution_.speed;
  torque = guess;
  speed.resize(count);
  for (solution_.sweeps = 1; solution_.sweeps <= kMostSweeps; ++solution_.sweeps) {
    bool moved = false;
    for (Eigen::Index e = 0; e < count; ++e) {
      const DryElement& element = elements[static_cast<std::size_t>(e)];
      const double c = step_s * compliance(e, e);
      const double r = free_speed[e] - step_s * compliance.row(e).dot(torque) + c * torque[e];
      const double dry = element.width == 0.0 ? element.amplitude : 0.0;
      const bool plain = element.presliding.empty() && element.width == 0.0;
      speed[e] = plain ? effects::sign_of(r) * std::max(0.0, std::abs(r) - c * dry)
                       : smooth_speed(element, r, c, dry, step_s);
      const bool slides = plain && speed[e] != 0.0;
      const double next = slides ? effects::sign_of(speed[e]) * dry : (r - speed[e]) / c;
      const double tolerance = kConverged * (std::abs(r) + c * bound(element));
      moved = moved || c * std::abs(next - torque[e]) > tolerance;
      torque[e] = next;
    }
    if (!moved) break;
  }
  return solution_;
}

}  // namespace kinescope
