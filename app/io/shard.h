// SPDX-License-Identifier: Apache-2.0
//
// Work that is shared out between machines: of a list every n-th piece.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace kinescope {

/// The index-th of `count` shards, from 1. By default all of the work.
struct Shard {
  int index = 1;
  int count = 1;

  /// The k-th piece of the list, from 0, is this shard's.
  [[nodiscard]] bool holds(std::size_t k) const {
    return k % static_cast<std::size_t>(count) == static_cast<std::size_t>(index - 1);
  }
  bool operator==(const Shard&) const = default;
};

/// "2/3"; nothing where it says something else, or where there is no such shard (0/2, 3/2).
[[nodiscard]] std::optional<Shard> parse_shard(std::string_view text);
/// "2/3".
[[nodiscard]] std::string to_string(const Shard& shard);

}  // namespace kinescope
