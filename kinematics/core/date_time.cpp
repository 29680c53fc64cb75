// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/date_time.h"

#include <charconv>
#include <chrono>

namespace kinescope {
namespace {

// Takes what it reads from the front of the text.
class Cursor {
 public:
  explicit Cursor(std::string_view text) : text_(text) {}

  [[nodiscard]] bool empty() const { return text_.empty(); }
  bool skip(std::string_view any_of) {
    if (text_.empty() || any_of.find(text_.front()) == std::string_view::npos) return false;
    text_.remove_prefix(1);
    return true;
  }
  std::optional<int> digits(std::size_t count) {
    int value = 0;
    if (text_.size() < count) return std::nullopt;
    const auto [end, error] = std::from_chars(text_.data(), text_.data() + count, value);
    if (error != std::errc{} || end != text_.data() + count || value < 0) return std::nullopt;
    text_.remove_prefix(count);
    return value;
  }
  /// Digits behind a decimal point, as a share of one; 0 where there is none.
  std::optional<double> fraction() {
    if (!skip(".,")) return 0.0;
    double value = 0.0;
    double unit = 1.0;
    const std::size_t before = text_.size();
    while (!text_.empty() && text_.front() >= '0' && text_.front() <= '9') {
      unit /= 10.0;
      value += unit * (text_.front() - '0');
      text_.remove_prefix(1);
    }
    if (text_.size() == before) return std::nullopt;
    return value;
  }

 private:
  std::string_view text_;
};

std::optional<std::chrono::sys_days> read_date(Cursor& text) {
  const auto year = text.digits(4);
  if (!year || !text.skip("-/")) return std::nullopt;
  const auto month = text.digits(2);
  if (!month || !text.skip("-/")) return std::nullopt;
  const auto day = text.digits(2);
  if (!day) return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(*year),
                                         std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!date.ok()) return std::nullopt;
  return std::chrono::sys_days(date);
}

// Of the day, s.
std::optional<double> read_time(Cursor& text) {
  const auto hours = text.digits(2);
  if (!hours || !text.skip(":")) return std::nullopt;
  const auto minutes = text.digits(2);
  if (!minutes || !text.skip(":")) return std::nullopt;
  const auto seconds = text.digits(2);
  const auto fraction = seconds ? text.fraction() : std::nullopt;
  if (!fraction || *hours > 24 || *minutes > 59 || *seconds > 60) return std::nullopt;
  return 3600.0 * *hours + 60.0 * *minutes + *seconds + *fraction;
}

// What the zone is ahead of UTC, s; 0 where none stands there.
std::optional<double> read_zone(Cursor& text) {
  if (text.empty() || text.skip("Z")) return 0.0;
  const bool behind = text.skip("-");
  if (!behind && !text.skip("+")) return std::nullopt;
  const auto hours = text.digits(2);
  text.skip(":");
  const auto minutes = text.empty() ? std::optional(0) : text.digits(2);
  if (!hours || !minutes) return std::nullopt;
  return (behind ? -1.0 : 1.0) * (3600.0 * *hours + 60.0 * *minutes);
}

}  // namespace

std::optional<double> parse_date_time(std::string_view text) {
  Cursor cursor(text);
  const auto date = read_date(cursor);
  if (!date || !cursor.skip("T ")) return std::nullopt;
  const auto time_s = read_time(cursor);
  const auto ahead_s = time_s ? read_zone(cursor) : std::nullopt;
  if (!ahead_s || !cursor.empty()) return std::nullopt;
  const auto days = static_cast<double>(date->time_since_epoch().count());
  return 86400.0 * days - *ahead_s + *time_s;
}

}  // namespace kinescope
