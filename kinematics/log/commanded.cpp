// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/commanded.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace kinescope {

bool is_commanded(std::string name) {
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array kCommanded = {"command", "cmd",      "desired",  "target",
                                     "goal",    "setpoint", "reference"};
  return std::ranges::any_of(
      kCommanded, [&](const char* word) { return name.find(word) != std::string::npos; });
}

}  // namespace kinescope
