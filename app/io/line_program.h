// SPDX-License-Identifier: Apache-2.0
//
// Another program that is talked with in lines, over its standard input and output. Its standard
// error is kept for messages. It runs in a process group of its own, which is ended with it.
#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sys/types.h>

namespace kinescope {

class LineProgram {
 public:
  /// Starts `words` (the program, found as a shell finds it, and its arguments) in `folder`; no
  /// answer may take longer than `timeout_s`. Throws bad_input where it cannot be started.
  LineProgram(const std::vector<std::string>& words, const std::filesystem::path& folder,
              double timeout_s);
  /// Ends the program where it still runs.
  ~LineProgram();
  LineProgram(const LineProgram&) = delete;
  LineProgram& operator=(const LineProgram&) = delete;

  enum class Answer { kLine, kEnd, kLate };
  /// The next line without its end; kEnd where its output ended, kLate where none came in time.
  [[nodiscard]] Answer read(std::string& line);
  /// A program that reads no more is told apart by its next answer.
  void write_line(std::string_view line);
  /// Its input ends.
  void close_input();
  /// Waits for its end; nothing for exit code 0, else what happened: "ended with exit code 3",
  /// "was ended by signal 11", "did not end within 10 s".
  [[nodiscard]] std::optional<std::string> wait_for_end();
  /// The last line that it wrote to standard error; empty: none.
  [[nodiscard]] std::string last_words();

 private:
  struct CloseFile {
    void operator()(FILE* file) const { (void)std::fclose(file); }
  };
  [[nodiscard]] bool fill(double deadline_s);
  [[nodiscard]] bool ended_by(double deadline_s);
  void end();

  double timeout_s_;
  std::unique_ptr<FILE, CloseFile> errors_;
  pid_t pid_ = -1;
  int input_ = -1;   // ours to write
  int output_ = -1;  // ours to read
  std::string buffer_;
  bool output_ended_ = false;
  std::optional<int> status_;
};

}  // namespace kinescope
