// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "app/manual/command_page.h"

namespace kinescope {

/// "kinescope-run.1" of the command `run`, "kinescope.1" of the program itself.
[[nodiscard]] std::string man_page_name(const CommandPage& program, const CommandPage& page);

/// A manual page as roff text with the macros of man(7). `page` is `program` or one of its
/// commands. Without a date, so that the same options give the same bytes.
[[nodiscard]] std::string man_page(const CommandPage& program, const CommandPage& page,
                                   std::string_view version);

}  // namespace kinescope
