// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/file.h"

#include <cstdio>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <unistd.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace fs = std::filesystem;
namespace {

// Beside the target, so that the rename stays within one file system; the process id keeps two runs
// on one folder apart.
fs::path temporary_beside(const fs::path& path) {
  return path.parent_path() / fmt::format(".{}.{}.tmp", path.filename().string(), ::getpid());
}

}  // namespace

std::string read_text_file(const fs::path& path, std::uintmax_t max_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) throw bad_input(path.string(), "no such file", "check the path");
  if (fs::is_directory(status)) {
    throw bad_input(path.string(), "is a folder, not a file", "name a file");
  }
  const std::uintmax_t size = fs::file_size(path, error);
  if (!error && size > max_bytes) {
    throw bad_input(path.string(), fmt::format("{} bytes, more than {}", size, max_bytes),
                    "is this the right file?");
  }
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) throw bad_input(path.string(), "cannot be read", "check its permissions");
  return std::move(text).str();
}

void write_file_atomically(const fs::path& path, std::string_view content) {
  const fs::path temporary = temporary_beside(path);
  {
    std::ofstream stream(temporary, std::ios::binary | std::ios::trunc);
    stream.write(content.data(), static_cast<std::streamsize>(content.size()));
    stream.flush();
    if (!stream) {
      std::error_code ignored;
      fs::remove(temporary, ignored);
      throw bad_request(path.string(), "cannot be written",
                        "check that the folder is writable and the disk is not full");
    }
  }
  std::error_code error;
  fs::rename(temporary, path, error);
  if (error) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw bad_request(path.string(), fmt::format("cannot be written: {}", error.message()),
                      "choose another output folder with --output");
  }
}

void require_writable_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder, error)) {
    throw bad_request(folder.string(), "the output folder cannot be made",
                      "choose another one with --output");
  }
  const fs::path probe = temporary_beside(folder / "probe");
  std::ofstream stream(probe);
  stream << "kinescope";
  stream.flush();
  if (!stream) {
    throw bad_request(folder.string(), "the output folder cannot be written",
                      "choose another one with --output, or free some disk space");
  }
  stream.close();
  fs::remove(probe, error);
}

}  // namespace kinescope
