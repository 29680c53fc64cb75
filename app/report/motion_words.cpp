// SPDX-License-Identifier: Apache-2.0
#include "app/report/motion_words.h"

#include <algorithm>
#include <numbers>

#include <fmt/format.h>

namespace kinescope {
namespace {

// Of the samples: fewer hold the peaks of a motion of the same kind, a little higher each time (as
// for bands, section_torque_models.cpp).
constexpr double kFew = 0.01;

struct Beyond {
  double share = 0.0;  // of the samples
  double most = 0.0;   // of the values
};

Beyond beyond(const Eigen::ArrayXd& values, double limit) {
  return {static_cast<double>((values > limit).count()) / static_cast<double>(values.size()),
          values.maxCoeff()};
}

std::string share_words(double share) {
  return fmt::format("beyond it at {:.0f} % of the samples", std::max(1.0, 100.0 * share));
}

void add_rate(const std::string& joint, const char* does, const char* how,
              const Eigen::ArrayXd& values, double limit, std::vector<std::string>& out) {
  const Beyond found = beyond(values.abs(), limit);
  if (!(found.share > kFew)) return;
  // Of a joint at rest any motion is infinitely more.
  out.push_back(limit > 0.0
                    ? fmt::format("{} {} {:.1f} times as {} here as in what was learned ({})",
                                  joint, does, found.most / limit, how, share_words(found.share))
                    : fmt::format("{} moves here and did not in what was learned", joint));
}

void add_position(const std::string& joint, bool turns, const char* side,
                  const Eigen::ArrayXd& values, double limit, std::vector<std::string>& out) {
  const Beyond found = beyond(values, limit);
  if (!(found.share > kFew)) return;
  const double way = found.most - limit;
  out.push_back(fmt::format("{} goes {:.3g} {} {} what was learned ({})", joint,
                            turns ? way * 180.0 / std::numbers::pi : 1000.0 * way,
                            turns ? "deg" : "mm", side, share_words(found.share)));
}

}  // namespace

std::vector<std::string> motion_words(const MotionSpan& learned, const TorqueSamples& here,
                                      const RigidModel& rigid) {
  std::vector<std::string> out;
  if (here.size() == 0) return out;
  for (Eigen::Index j = 0; j < here.joints(); ++j) {
    const RigidBody& body = rigid.bodies[static_cast<std::size_t>(j)];
    const bool turns = body.type != JointType::kPrismatic;
    add_position(body.joint, turns, "above", here.q.col(j), learned.upper[j], out);
    add_position(body.joint, turns, "below", -here.q.col(j), -learned.lower[j], out);
    add_rate(body.joint, "moves", "fast", here.dq.col(j), learned.fastest[j], out);
    add_rate(body.joint, "accelerates", "hard", here.ddq.col(j), learned.hardest[j], out);
  }
  return out;
}

}  // namespace kinescope
