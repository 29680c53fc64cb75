// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/file.h"

#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <istream>
#include <optional>

#include <fmt/format.h>
#include <sys/types.h>
#include <unistd.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kTemporary = ".tmp";

// Beside the target, so that the rename stays within one file system; the process id keeps two runs
// on one folder apart.
fs::path temporary_beside(const fs::path& path) {
  return path.parent_path() /
         fmt::format(".{}.{}{}", path.filename().string(), ::getpid(), kTemporary);
}

// The process that writes `name` by way of the file; nothing where it is none of such.
std::optional<pid_t> writer_of(std::string_view file, std::string_view name) {
  const std::string begin = fmt::format(".{}.", name);
  if (!file.starts_with(begin) || !file.ends_with(kTemporary)) return std::nullopt;
  if (file.size() <= begin.size() + kTemporary.size()) return std::nullopt;
  file = file.substr(begin.size(), file.size() - begin.size() - kTemporary.size());
  pid_t out = 0;
  const auto [end, error] = std::from_chars(file.data(), file.data() + file.size(), out);
  if (error != std::errc() || end != file.data() + file.size() || out <= 0) return std::nullopt;
  return out;
}

bool is_gone(pid_t process) { return ::kill(process, 0) == -1 && errno == ESRCH; }

Error too_large(const fs::path& path, std::uintmax_t bytes, std::uintmax_t max_bytes) {
  return bad_input(path.string(), fmt::format("{} bytes, more than {}", bytes, max_bytes),
                   "is this the right file?");
}

// Up to one byte beyond the most: a file may grow, and those of /proc have no size.
std::string read_at_most(std::istream& stream, std::uintmax_t expected, std::uintmax_t max_bytes) {
  constexpr std::size_t kReadBlock = std::size_t{1} << 16U;
  std::string text;
  text.reserve(expected + 1);
  while (stream && text.size() <= max_bytes) {
    const std::size_t before = text.size();
    text.resize(before + kReadBlock);
    stream.read(text.data() + before, kReadBlock);
    text.resize(before + static_cast<std::size_t>(stream.gcount()));
  }
  return text;
}

void remove_all(const std::vector<fs::path>& files) {
  std::error_code ignored;
  for (const fs::path& file : files) fs::remove(file, ignored);
}

}  // namespace

std::string read_text_file(const fs::path& path, std::uintmax_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw bad_input(path.string(), "no such file", "check the path");
  if (fs::is_directory(status)) {
    throw bad_input(path.string(), "is a folder, not a file", "name a file");
  }
  // A pipe without a writer would be waited for, a device may never end.
  if (!fs::is_regular_file(status)) {
    throw bad_input(path.string(), "is a pipe or a device, not a file", "name a file");
  }
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) throw bad_input(path.string(), "cannot be read", "check its permissions");
  if (size > max_bytes) throw too_large(path, size, max_bytes);
  std::ifstream stream(path, std::ios::binary);
  std::string text = read_at_most(stream, size, max_bytes);
  if (stream.bad() || !stream.is_open()) {
    throw bad_input(path.string(), "cannot be read", "check its permissions");
  }
  if (text.size() > max_bytes) throw too_large(path, text.size(), max_bytes);
  return text;
}

void require_replaceable(const fs::path& path) {
  std::error_code error;
  const fs::file_status there = fs::status(path, error);
  if (!fs::exists(there) || fs::is_regular_file(there)) return;
  throw bad_request(path.string(),
                    fs::is_directory(there) ? "is a folder" : "is a pipe or a device, no file",
                    "name another file");
}

void write_files_atomically(const std::vector<FileContent>& files) {
  for (const FileContent& file : files) require_replaceable(file.path);
  std::vector<fs::path> temporaries;
  for (const auto& [path, content] : files) {
    temporaries.push_back(temporary_beside(path));
    std::ofstream stream(temporaries.back(), std::ios::binary | std::ios::trunc);
    stream.write(content.data(), static_cast<std::streamsize>(content.size()));
    stream.flush();
    if (stream) continue;
    stream.close();
    remove_all(temporaries);
    throw bad_request(path.string(), "cannot be written",
                      "check that the folder is writable and the disk is not full");
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    std::error_code error;
    fs::rename(temporaries[i], files[i].path, error);
    if (!error) continue;
    remove_all(temporaries);
    throw bad_request(files[i].path.string(), fmt::format("cannot be written: {}", error.message()),
                      "choose another output folder with --output");
  }
}

void write_file_atomically(const fs::path& path, std::string_view content) {
  write_files_atomically({{path, content}});
}

void remove_abandoned(const fs::path& folder, const std::vector<std::string>& names) {
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string file = entry.path().filename().string();
    for (const std::string& name : names) {
      const auto process = writer_of(file, name);
      if (process && is_gone(*process)) abandoned.push_back(entry.path());
    }
  }
  remove_all(abandoned);
}

void require_writable_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder, error)) {
    const auto is_file = [](const fs::path& path) {
      std::error_code none;
      return fs::exists(path, none) && !fs::is_directory(path, none);
    };
    fs::path in_the_way = folder;
    while (in_the_way.has_relative_path() && !is_file(in_the_way))
      in_the_way = in_the_way.parent_path();
    throw bad_request(
        folder.string(),
        in_the_way.has_relative_path()
            ? "the output folder cannot be made: " + in_the_way.string() + " is no folder"
            : "the output folder cannot be made",
        "choose another one with --output");
  }
  const fs::path probe = temporary_beside(folder / "probe");
  std::ofstream stream(probe);
  stream << "kinescope";
  stream.flush();
  if (!stream) {
    stream.close();
    fs::remove(probe, error);
    throw bad_request(folder.string(), "the output folder cannot be written",
                      "choose another one with --output, or free some disk space");
  }
  stream.close();
  fs::remove(probe, error);
}

}  // namespace kinescope
