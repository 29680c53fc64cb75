// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/state_features.h"

#include <algorithm>

namespace kinescope::policy {
namespace {

using Eigen::Index;

bool is_angle(const StateLayout& layout, Index position) {
  return layout.is_angle[static_cast<std::size_t>(position)];
}

}  // namespace

Index feature_count(const StateLayout& layout) {
  const Index angles = std::ranges::count(layout.is_angle, true);
  return layout.state_count() + angles;
}

std::vector<std::string> feature_names(const StateLayout& layout) {
  std::vector<std::string> out;
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    if (!layout.is_angle[p]) out.push_back(layout.positions[p]);
  }
  for (const std::string& name : layout.positions) out.push_back(name + " speed");
  for (std::size_t p = 0; p < layout.positions.size(); ++p) {
    if (!layout.is_angle[p]) continue;
    out.push_back("sin " + layout.positions[p]);
    out.push_back("cos " + layout.positions[p]);
  }
  return out;
}

void state_features(const StateLayout& layout, const ConstBlock& states, Block features) {
  const Index positions = layout.position_count();
  Index at = 0;
  for (Index p = 0; p < positions; ++p) {
    if (!is_angle(layout, p)) features.col(at++) = states.col(p);
  }
  for (Index p = 0; p < positions; ++p) features.col(at++) = states.col(positions + p);
  for (Index p = 0; p < positions; ++p) {
    if (!is_angle(layout, p)) continue;
    features.col(at++) = states.col(p).array().sin();
    features.col(at++) = states.col(p).array().cos();
  }
}

void state_features_pullback(const StateLayout& layout, const ConstBlock& features,
                             const ConstBlock& d_features, Block d_states) {
  const Index positions = layout.position_count();
  Index at = 0;
  for (Index p = 0; p < positions; ++p) {
    if (!is_angle(layout, p)) d_states.col(p) += d_features.col(at++);
  }
  for (Index p = 0; p < positions; ++p) d_states.col(positions + p) += d_features.col(at++);
  for (Index p = 0; p < positions; ++p) {
    if (!is_angle(layout, p)) continue;
    d_states.col(p).array() += d_features.col(at).array() * features.col(at + 1).array() -
                               d_features.col(at + 1).array() * features.col(at).array();
    at += 2;
  }
}

}  // namespace kinescope::policy
