// SPDX-License-Identifier: Apache-2.0
#include "kinematics/log/channel_ranks.h"

#include <algorithm>
#include <cctype>
#include <optional>
#include <string>
#include <utility>

namespace kinescope {
namespace {

// Digits of a number that orders joints: more are no count of them.
constexpr std::size_t kMostDigits = 4;

bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

// The first number in a name, and the name without it.
std::optional<std::pair<std::string, int>> numbered(const std::string& name) {
  const auto first = std::ranges::find_if(name, is_digit);
  const auto last = std::find_if_not(first, name.end(), is_digit);
  const auto digits = static_cast<std::size_t>(last - first);
  if (digits == 0 || digits > kMostDigits) return std::nullopt;
  return std::pair(std::string(name.begin(), first) + std::string(last, name.end()),
                   std::stoi(std::string(first, last)));
}

}  // namespace

std::vector<std::size_t> channel_ranks(const JointLog& log) {
  std::vector<std::size_t> columns(log.channels.size());
  for (std::size_t c = 0; c < columns.size(); ++c) columns[c] = c;
  std::vector<int> numbers;
  std::optional<std::string> stem;
  for (const std::string& channel : log.channels) {
    const auto name = numbered(channel);
    if (!name || (stem && *stem != name->first)) return columns;
    stem = name->first;
    numbers.push_back(name->second);
  }
  std::vector<std::size_t> sorted = columns;
  std::ranges::stable_sort(sorted, {}, [&](std::size_t c) { return numbers[c]; });
  std::vector<std::size_t> out(columns.size());
  for (std::size_t k = 0; k < sorted.size(); ++k) out[sorted[k]] = k;
  return out;
}

}  // namespace kinescope
