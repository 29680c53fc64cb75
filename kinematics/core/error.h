// SPDX-License-Identifier: Apache-2.0
//
// How things go wrong. `Error` is for the user's input: one line that names the file, the place in
// it and the remedy, and the exit code the program ends with. `KINESCOPE_CHECK` is for our own
// mistakes.
#pragma once

#include <optional>
#include <source_location>
#include <stdexcept>
#include <string>
#include <string_view>

namespace kinescope {

/// The program's exit codes (README, "Exit codes").
enum class ExitCode : int {
  kDone = 0,
  kInternalError = 1,
  kBadRequest = 2,    ///< command line or configuration
  kBadInput = 3,      ///< an input cannot be read
  kUndetermined = 4,  ///< the data cannot determine what was asked
  kOutsideLimits = 5  ///< done, but outside limits set with --fail-on
};

/// What the user is told, in one line: "where: what (remedy)"; control characters become spaces.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, std::string_view where, std::string_view what, std::string_view remedy);
  [[nodiscard]] ExitCode code() const { return code_; }

 private:
  ExitCode code_;
};

/// An input that cannot be read. `where` is "file" or "file:line".
[[nodiscard]] Error bad_input(std::string_view where, std::string_view what,
                              std::string_view remedy);
/// A command line or configuration that makes no sense.
[[nodiscard]] Error bad_request(std::string_view where, std::string_view what,
                                std::string_view remedy);
/// Data that cannot determine what was asked; the remedy says what to record instead.
[[nodiscard]] Error undetermined(std::string_view where, std::string_view what,
                                 std::string_view remedy);

namespace internal {
[[noreturn]] void check_failed(const char* condition, std::string_view message,
                               std::source_location location);
}

}  // namespace kinescope

/// An invariant of our own code; always on. Throws std::logic_error with the place.
#define KINESCOPE_CHECK(condition, message)                                                      \
  do {                                                                                           \
    if (!(condition))                                                                            \
      ::kinescope::internal::check_failed(#condition, message, std::source_location::current()); \
  } while (false)

namespace kinescope {

/// The value of an optional that the code before has seen to.
template <typename T>
[[nodiscard]] T& value_of(std::optional<T>& value) {
  KINESCOPE_CHECK(value.has_value(), "a value that is there");
  return *value;
}
template <typename T>
[[nodiscard]] const T& value_of(const std::optional<T>& value) {
  KINESCOPE_CHECK(value.has_value(), "a value that is there");
  return *value;
}

}  // namespace kinescope
