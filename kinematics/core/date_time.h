// SPDX-License-Identifier: Apache-2.0
//
// Dates with times of day, as loggers write them (ISO 8601).
#pragma once

#include <optional>
#include <string_view>

namespace kinescope {

/// "2024-06-10T06:13:20.25Z", also with a blank in place of T, with a zone (+02:00, +0200) or
/// without one (UTC): s since 1970. Nothing for what is no such date. To 0.3 us, as doubles have
/// it.
[[nodiscard]] std::optional<double> parse_date_time(std::string_view text);

}  // namespace kinescope
