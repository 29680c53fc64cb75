// SPDX-License-Identifier: Apache-2.0
//
// The frame of every page: head, title, contents. Nothing is loaded from anywhere.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace kinescope::report {

/// Id of a section and its title in the contents.
using ContentsEntry = std::pair<std::string_view, std::string_view>;

/// From the doctype to the end of the contents; <main> is to follow. Texts are escaped here.
/// `policy`: what the page may beside showing itself, as directives of its content security policy.
[[nodiscard]] std::string page_begin(std::string_view brand, std::string_view title,
                                     std::string_view note, std::string_view version,
                                     std::span<const ContentsEntry> contents,
                                     std::string_view policy = "");

}  // namespace kinescope::report
