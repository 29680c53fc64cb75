// SPDX-License-Identifier: Apache-2.0
#include "app/io/shard.h"

#include <charconv>

#include <fmt/format.h>

namespace kinescope {
namespace {

std::optional<int> whole_number(const std::string& text) {
  int out = 0;
  const char* const end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, out);
  if (error != std::errc() || stopped != end) return std::nullopt;
  return out;
}

}  // namespace

std::optional<Shard> parse_shard(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos) return std::nullopt;
  const auto index = whole_number(std::string(text.substr(0, slash)));
  const auto count = whole_number(std::string(text.substr(slash + 1)));
  if (!index || !count || *index < 1 || *index > *count) return std::nullopt;
  return Shard{*index, *count};
}

std::string to_string(const Shard& shard) { return fmt::format("{}/{}", shard.index, shard.count); }

}  // namespace kinescope
