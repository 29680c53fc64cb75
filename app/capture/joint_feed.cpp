// SPDX-License-Identifier: Apache-2.0
#include "app/capture/joint_feed.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"
#include "kinematics/log/header_units.h"

namespace kinescope {
namespace {

constexpr int kPatience_ms = 50;
constexpr double kSameClock_s = 1.0;  // more is no delay of a pipe
constexpr int kMostWarnings = 5;      // of lines; more are of one kind

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> out(1);
  for (const char c : line) {
    if (c == ',') {
      out.emplace_back();
    } else if (c != ' ' && c != '\t' && c != '\r') {
      out.back() += c;
    }
  }
  return out;
}

bool is_empty(const std::string& line) {
  return line.find_first_not_of(" \t\r") == std::string::npos || line.starts_with('#');
}

bool is_time(const std::string& column) {
  const std::string name = without_unit(column);
  return name == "t" || name == "time" || name == "stamp" || name == "timestamp";
}

}  // namespace

std::vector<std::string> JointLines::whole_lines(std::string_view text) {
  begun_ += text;
  std::vector<std::string> out;
  std::size_t begin = 0;
  for (std::size_t end = begun_.find('\n'); end != std::string::npos;
       end = begun_.find('\n', begin)) {
    out.push_back(begun_.substr(begin, end - begin));
    begin = end + 1;
  }
  begun_.erase(0, begin);
  return out;
}

void JointLines::read_header(const std::string& line) {
  const std::vector<std::string> cells = cells_of(line);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!time_at_ && is_time(cells[i])) {
      time_at_ = i;
      by_sender_ = true;
      unit_s_ = header_factor(cells[i]);
    } else {
      channels_.push_back(cells[i]);
    }
  }
  columns_ = cells.size();
  const bool numbers =
      std::ranges::any_of(cells, [](const std::string& c) { return parse_number(c).has_value(); });
  if (channels_.empty() || numbers || std::ranges::count(channels_, std::string()) > 0) {
    throw bad_input(fmt::format("--joints, line {}", line_),
                    fmt::format("'{}' is no header of channels", line.substr(0, 60)),
                    "send one line of names first, such as t,joint1,joint2");
  }
}

void JointLines::warn_of_line(const std::string& what) {
  if (++left_out_ > kMostWarnings) return;
  warnings_.push_back(fmt::format("--joints, line {}: {}: the line is left out{}", line_, what,
                                  left_out_ == kMostWarnings ? ", as are further ones" : ""));
}

std::optional<JointLines::Row> JointLines::read_row(const std::string& line) {
  const std::vector<std::string> cells = cells_of(line);
  if (cells.size() != columns_) {
    warn_of_line(fmt::format("has {} values, not {}", cells.size(), columns_));
    return std::nullopt;
  }
  Row out;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::optional<double> value = parse_number(cells[i]);
    if (!value || !std::isfinite(*value)) {
      warn_of_line(fmt::format("'{}' is no number", cells[i].substr(0, 40)));
      return std::nullopt;
    }
    if (time_at_ == i) {
      out.sent = *value;
    } else {
      out.values.push_back(*value);
    }
  }
  return out;
}

// Nothing where the sender's clock is none.
std::optional<double> JointLines::sender_stamp(double sent, double received_s) {
  if (!by_sender_) return std::nullopt;
  if (!begin_s_) begin_s_ = received_s - unit_s_ * sent;
  const double out = *begin_s_ + unit_s_ * sent;
  if (out > last_s_ && std::abs(out - received_s) < kSameClock_s) return out;
  warnings_.push_back(
      fmt::format("--joints, line {}: the time column does not go with the clock (s are expected, "
                  "or a unit in its name): rows are stamped when they are received",
                  line_));
  by_sender_ = false;
  return std::nullopt;
}

std::vector<JointRow> JointLines::add(std::string_view text, double now_s) {
  std::vector<JointRow> out;
  std::vector<std::size_t> unstamped;
  for (const std::string& line : whole_lines(text)) {
    ++line_;
    if (is_empty(line)) continue;
    if (columns_ == 0) {
      read_header(line);
      continue;
    }
    std::optional<Row> row = read_row(line);
    if (!row) continue;
    const std::optional<double> stamp_s = sender_stamp(row->sent, now_s);
    if (stamp_s) last_s_ = *stamp_s;
    if (!stamp_s) unstamped.push_back(out.size());
    out.push_back({stamp_s.value_or(now_s), std::move(row->values)});
  }
  if (out.empty()) return out;
  // One piece: when its single rows were sent, nobody said.
  const double before_s = received_s_ > 0.0 ? received_s_ : now_s - 1e-3 * kPatience_ms;
  for (std::size_t i = 0; i < unstamped.size(); ++i) {
    const double share = static_cast<double>(i + 1) / static_cast<double>(unstamped.size());
    out[unstamped[i]].stamp_s = before_s + share * (now_s - before_s);
  }
  received_s_ = now_s;
  if (!unstamped.empty()) leave_out_early(out, unstamped.front());
  return out;
}

// Behind the change from the sender's clock to ours: a log goes forward.
void JointLines::leave_out_early(std::vector<JointRow>& rows, std::size_t from) {
  const auto early = [this](const JointRow& row) { return row.stamp_s <= last_s_; };
  const auto begin = rows.begin() + static_cast<std::ptrdiff_t>(from);
  rows.erase(std::remove_if(begin, rows.end(), early), rows.end());
  if (!rows.empty()) last_s_ = std::max(last_s_, rows.back().stamp_s);
}

void JointLines::pass_over(std::string_view text) {
  for (const std::string& line : whole_lines(text)) {
    ++line_;
    if (columns_ == 0 && !is_empty(line)) read_header(line);
  }
}

std::vector<std::string> JointLines::take_warnings() { return std::exchange(warnings_, {}); }

JointSource::JointSource(const std::string& name) {
  // A pipe without a writer must not hold the recording up.
  file_ = name == "-" ? ::dup(STDIN_FILENO) : ::open(name.c_str(), O_RDONLY | O_NONBLOCK);
  struct stat status{};
  if (file_ < 0 || ::fstat(file_, &status) != 0 || S_ISDIR(status.st_mode)) {
    if (file_ >= 0) ::close(file_);
    throw bad_input(name, "joint values cannot be read from it",
                    "name a file or pipe that is there, or - for standard input");
  }
  grows_ = S_ISREG(status.st_mode);
}

JointSource::~JointSource() { ::close(file_); }

std::string JointSource::wait() {
  std::string out;
  pollfd ready{file_, POLLIN, 0};
  if (grows_ || ::poll(&ready, 1, kPatience_ms) > 0) {
    std::array<char, 65536> buffer{};
    const ssize_t n = ::read(file_, buffer.data(), buffer.size());
    if (n > 0) out.assign(buffer.data(), static_cast<std::size_t>(n));
  }
  // At the end of a file, and of a pipe whose writer is gone, poll() returns at once.
  if (out.empty()) ::usleep(grows_ ? 5'000 : 1'000 * kPatience_ms / 2);
  return out;
}

std::string JointSource::there_already() {
  std::string out;
  if (!grows_) return out;
  std::array<char, 65536> buffer{};
  for (ssize_t n = ::read(file_, buffer.data(), buffer.size()); n > 0;
       n = ::read(file_, buffer.data(), buffer.size()))
    out.append(buffer.data(), static_cast<std::size_t>(n));
  return out;
}

}  // namespace kinescope
