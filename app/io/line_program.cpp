// SPDX-License-Identifier: Apache-2.0
#include "app/io/line_program.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

/// A line is some numbers.
constexpr std::size_t kLongestLine = 1U << 20U;
/// Between asking to end and ending it, s: time to stop a motor.
constexpr double kGrace_s = 1.0;
constexpr std::chrono::milliseconds kPause{2};

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int milliseconds_until(double deadline_s) {
  return static_cast<int>(1e3 * std::clamp(deadline_s - now_s(), 0.0, 1e6)) + 1;
}

void close_if_open(int& descriptor) {
  if (descriptor >= 0) (void)::close(descriptor);
  descriptor = -1;
}

Error not_started(const std::string& program, int code) {
  return bad_input(program,
                   fmt::format("cannot be started: {}", std::generic_category().message(code)),
                   "check the program's name, and that it may be executed");
}

struct FileActions {
  posix_spawn_file_actions_t value{};
  FileActions() { (void)posix_spawn_file_actions_init(&value); }
  ~FileActions() { (void)posix_spawn_file_actions_destroy(&value); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
};

struct Attributes {
  posix_spawnattr_t value{};
  Attributes() {
    (void)posix_spawnattr_init(&value);
    (void)posix_spawnattr_setflags(&value, POSIX_SPAWN_SETPGROUP);
  }
  ~Attributes() { (void)posix_spawnattr_destroy(&value); }
  Attributes(const Attributes&) = delete;
  Attributes& operator=(const Attributes&) = delete;
};

}  // namespace

LineProgram::LineProgram(const std::vector<std::string>& words, const std::filesystem::path& folder,
                         double timeout_s)
    : timeout_s_(timeout_s), errors_(std::tmpfile()) {
  KINESCOPE_CHECK(!words.empty(), "a program has a name");
  // A socket for its input: writing to a program that has ended is then no signal.
  std::array<int, 2> in{-1, -1};
  std::array<int, 2> out{-1, -1};
  if (errors_ == nullptr || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, in.data()) != 0 ||
      ::pipe2(out.data(), O_CLOEXEC) != 0) {
    const int code = errno;
    for (int descriptor : in) close_if_open(descriptor);
    throw not_started(words.front(), code);
  }
  FileActions actions;
  (void)posix_spawn_file_actions_adddup2(&actions.value, in[1], STDIN_FILENO);
  (void)posix_spawn_file_actions_adddup2(&actions.value, out[1], STDOUT_FILENO);
  (void)posix_spawn_file_actions_adddup2(&actions.value, ::fileno(errors_.get()), STDERR_FILENO);
  if (!folder.empty()) {
    (void)posix_spawn_file_actions_addchdir_np(&actions.value, folder.c_str());
  }
  const Attributes attributes;
  std::vector<std::string> copies = words;
  std::vector<char*> arguments;
  for (std::string& word : copies) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const int failure = ::posix_spawnp(&pid_, arguments.front(), &actions.value, &attributes.value,
                                     arguments.data(), environ);
  close_if_open(in[1]);
  close_if_open(out[1]);
  input_ = in[0];
  output_ = out[0];
  if (failure == 0) return;
  pid_ = -1;
  close_if_open(input_);
  close_if_open(output_);
  throw not_started(words.front(), failure);
}

LineProgram::~LineProgram() {
  close_if_open(input_);
  end();
  close_if_open(output_);
}

bool LineProgram::fill(double deadline_s) {
  pollfd waiting{.fd = output_, .events = POLLIN, .revents = 0};
  while (true) {
    const int ready = ::poll(&waiting, 1, milliseconds_until(deadline_s));
    if (ready == 0) return false;
    if (ready < 0) continue;  // a signal
    std::array<char, 4096> bytes{};
    const ssize_t count = ::read(output_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      output_ended_ = true;
    } else {
      buffer_.append(bytes.data(), static_cast<std::size_t>(count));
    }
    return true;
  }
}

LineProgram::Answer LineProgram::read(std::string& line) {
  const double deadline_s = now_s() + timeout_s_;
  while (true) {
    const std::size_t end = buffer_.find('\n');
    if (end != std::string::npos || (output_ended_ && !buffer_.empty())) {
      line = buffer_.substr(0, end);
      buffer_.erase(0, end == std::string::npos ? end : end + 1);
      if (!line.empty() && line.back() == '\r') line.pop_back();
      return Answer::kLine;
    }
    if (output_ended_) return Answer::kEnd;
    if (buffer_.size() > kLongestLine || now_s() > deadline_s || !fill(deadline_s)) {
      return Answer::kLate;
    }
  }
}

void LineProgram::write_line(std::string_view line) {
  std::string text(line);
  text += '\n';
  std::string_view rest = text;
  const double deadline_s = now_s() + timeout_s_;
  while (!rest.empty() && now_s() < deadline_s) {
    pollfd waiting{.fd = input_, .events = POLLOUT, .revents = 0};
    if (::poll(&waiting, 1, milliseconds_until(deadline_s)) <= 0) continue;
    const ssize_t count = ::send(input_, rest.data(), rest.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count > 0) {
      rest.remove_prefix(static_cast<std::size_t>(count));
    } else if (count == 0 || (errno != EINTR && errno != EAGAIN)) {
      return;
    }
  }
}

void LineProgram::close_input() { close_if_open(input_); }

bool LineProgram::ended_by(double deadline_s) {
  while (!status_) {
    int status = 0;
    const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
    if (ended == pid_ || (ended < 0 && errno == ECHILD)) {
      status_ = status;
    } else if (now_s() > deadline_s) {
      return false;
    } else {
      std::this_thread::sleep_for(kPause);
    }
  }
  return true;
}

std::optional<std::string> LineProgram::wait_for_end() {
  if (!ended_by(now_s() + timeout_s_)) return fmt::format("did not end within {:g} s", timeout_s_);
  const int status = value_of(status_);
  if (WIFSIGNALED(status)) return fmt::format("was ended by signal {}", WTERMSIG(status));
  if (WEXITSTATUS(status) != 0) {
    return fmt::format("ended with exit code {}", WEXITSTATUS(status));
  }
  return std::nullopt;
}

void LineProgram::end() {
  if (pid_ < 0) return;
  // The group, or what the program itself has started goes on.
  if (!ended_by(0.0)) {
    (void)::kill(-pid_, SIGTERM);
    (void)ended_by(now_s() + kGrace_s);
  }
  (void)::kill(-pid_, SIGKILL);
  if (!status_) {
    int status = 0;
    (void)::waitpid(pid_, &status, 0);
    status_ = status;
  }
}

std::string LineProgram::last_words() {
  constexpr long kTail = 4096;
  (void)std::fseek(errors_.get(), 0, SEEK_END);
  const long size = std::ftell(errors_.get());
  (void)std::fseek(errors_.get(), std::max(0L, size - kTail), SEEK_SET);
  std::array<char, kTail> bytes{};
  const std::size_t count = std::fread(bytes.data(), 1, bytes.size(), errors_.get());
  std::string text(bytes.data(), count);
  while (!text.empty() && std::strchr("\r\n \t", text.back()) != nullptr) text.pop_back();
  return text.substr(text.find_last_of('\n') + 1);
}

}  // namespace kinescope
