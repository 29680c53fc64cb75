// SPDX-License-Identifier: Apache-2.0
//
// Apart from torque_model.cpp: a controller that reads a model links no fit.
#include <algorithm>
#include <array>
#include <utility>

#include "dynamics/models/torque_model.h"

namespace kinescope {
namespace {

constexpr std::array<std::pair<TorqueModelKind, std::string_view>, 8> kNames{{
    {TorqueModelKind::kParametric, "parametric"},
    {TorqueModelKind::kRbf, "rbf"},
    {TorqueModelKind::kGip, "gip"},
    {TorqueModelKind::kModelBased, "model_based"},
    {TorqueModelKind::kSemiParametric, "semi_parametric"},
    {TorqueModelKind::kLip, "lip"},
    {TorqueModelKind::kSupportVectors, "svr"},
    {TorqueModelKind::kNeuralNetwork, "network"},
}};

}  // namespace

std::string_view to_string(TorqueModelKind kind) {
  return std::ranges::find(kNames, kind, &decltype(kNames)::value_type::first)->second;
}

std::optional<TorqueModelKind> torque_model_kind(std::string_view name) {
  const auto found = std::ranges::find(kNames, name, &decltype(kNames)::value_type::second);
  if (found == kNames.end()) return std::nullopt;
  return found->first;
}

const std::vector<TorqueModelKind>& all_torque_models() {
  static const std::vector<TorqueModelKind> kinds = [] {
    std::vector<TorqueModelKind> out;
    out.reserve(kNames.size());
    for (const auto& [kind, name] : kNames) out.push_back(kind);
    return out;
  }();
  return kinds;
}

const std::vector<TorqueModelKind>& usual_torque_models() {
  static const std::vector<TorqueModelKind> kinds{
      TorqueModelKind::kParametric, TorqueModelKind::kGip, TorqueModelKind::kSemiParametric};
  return kinds;
}

}  // namespace kinescope
