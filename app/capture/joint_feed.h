// SPDX-License-Identifier: Apache-2.0
//
// Takes   joint values as lines of CSV that come while a recording is made: from standard input, a
//         pipe, or a file that grows.
// Gives   rows stamped on the clock of the frames.
// Method  with a time column the stamps are the sender's, shifted so that the first one is the time
//         at which it was received: what a pipe and a busy processor add scatters by milliseconds,
//         what is constant `run` estimates. Without one, or where it goes another way than the
//         clock, the stamp is the time of reception; rows that come in one piece are spread evenly
//         over the time since the one before. Of a file that has rows already only those that are
//         added count.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

/// One line of joint values.
struct JointRow {
  double stamp_s = 0.0;
  std::vector<double> values;
};

/// Lines to rows, without a clock or a file.
class JointLines {
 public:
  /// What was received until `now_s`: whole lines or parts of them. Increasing `now_s`; the rows'
  /// stamps increase, too.
  [[nodiscard]] std::vector<JointRow> add(std::string_view text, double now_s);
  /// Of the header, without the time; empty before it came.
  [[nodiscard]] const std::vector<std::string>& channels() const { return channels_; }
  /// "sender" or "reception".
  [[nodiscard]] std::string_view stamps() const { return by_sender_ ? "sender" : "reception"; }
  /// Lines that were left out, each with its number; each is given once.
  [[nodiscard]] std::vector<std::string> take_warnings();
  /// Rows that were there before the recording are passed over.
  void pass_over(std::string_view text);

 private:
  struct Row {
    double sent = 0.0;  // by the time column, in its unit
    std::vector<double> values;
  };
  void read_header(const std::string& line);
  [[nodiscard]] std::optional<Row> read_row(const std::string& line);
  [[nodiscard]] std::optional<double> sender_stamp(double sent, double received_s);
  void leave_out_early(std::vector<JointRow>& rows, std::size_t from);
  void warn_of_line(const std::string& what);
  [[nodiscard]] std::vector<std::string> whole_lines(std::string_view text);

  std::string begun_;  // a line of which the end is still to come
  int line_ = 0;
  std::size_t columns_ = 0;
  std::optional<std::size_t> time_at_;  // its column
  bool by_sender_ = false;              // its clock goes with ours
  double unit_s_ = 1.0;                 // of the time column
  std::optional<double> begin_s_;       // of the sender's clock, on ours
  std::vector<std::string> channels_;
  std::vector<std::string> warnings_;
  int left_out_ = 0;
  double last_s_ = 0.0;      // of the rows given
  double received_s_ = 0.0;  // the last ones
};

/// The file, pipe or standard input behind it.
class JointSource {
 public:
  /// `name`: "-" or a path. Throws bad_input where it cannot be opened.
  explicit JointSource(const std::string& name);
  ~JointSource();
  JointSource(const JointSource&) = delete;
  JointSource& operator=(const JointSource&) = delete;

  /// What came since; waits for a twentieth of a second at most.
  [[nodiscard]] std::string wait();
  /// What is in a file already; nothing of a pipe.
  [[nodiscard]] std::string there_already();

 private:
  int file_ = -1;
  bool grows_ = false;  // a file, whose end is not the end
};

}  // namespace kinescope
