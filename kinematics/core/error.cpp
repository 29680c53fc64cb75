// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/error.h"

#include <algorithm>

#include <fmt/format.h>

namespace kinescope {
namespace {

// Names from a file may hold line ends and what a terminal takes for commands.
bool is_control(char c) {
  const auto code = static_cast<unsigned char>(c);
  return code < 0x20 || code == 0x7f;
}

std::string compose(std::string_view where, std::string_view what, std::string_view remedy) {
  std::string text;
  if (!where.empty()) text = fmt::format("{}: ", where);
  text += what;
  if (!remedy.empty()) text += fmt::format(" ({})", remedy);
  std::ranges::replace_if(text, is_control, ' ');
  return text;
}

}  // namespace

Error::Error(ExitCode code, std::string_view where, std::string_view what, std::string_view remedy)
    : std::runtime_error(compose(where, what, remedy)), code_(code) {}

Error bad_input(std::string_view where, std::string_view what, std::string_view remedy) {
  return {ExitCode::kBadInput, where, what, remedy};
}

Error bad_request(std::string_view where, std::string_view what, std::string_view remedy) {
  return {ExitCode::kBadRequest, where, what, remedy};
}

Error undetermined(std::string_view where, std::string_view what, std::string_view remedy) {
  return {ExitCode::kUndetermined, where, what, remedy};
}

void internal::check_failed(const char* condition, std::string_view message,
                            std::source_location location) {
  throw std::logic_error(fmt::format("{}:{}: check failed: {} ({})", location.file_name(),
                                     location.line(), message, condition));
}

}  // namespace kinescope
