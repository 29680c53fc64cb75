// SPDX-License-Identifier: Apache-2.0
#include "app/io/recording_list.h"

#include <sstream>
#include <string>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kBlank = " \t\r";

std::string trimmed(const std::string& line) {
  const std::size_t first = line.find_first_not_of(kBlank);
  if (first == std::string::npos) return {};
  return line.substr(first, line.find_last_not_of(kBlank) + 1 - first);
}

std::vector<fs::path> lines_of(const fs::path& file) {
  std::vector<fs::path> out;
  std::istringstream lines(read_text_file(file));
  for (std::string line; std::getline(lines, line);) {
    const std::string word = trimmed(line);
    if (!word.empty() && !word.starts_with('#')) out.push_back(file.parent_path() / word);
  }
  if (out.empty())
    throw bad_input(file.string(), "it lists no recordings", "write one folder a line");
  return out;
}

}  // namespace

std::vector<fs::path> listed_recordings(const std::vector<fs::path>& words, const fs::path& from) {
  std::vector<fs::path> out;
  for (const fs::path& word : words) {
    if (!word.string().starts_with('@')) {
      out.push_back(from / word);
      continue;
    }
    for (fs::path& line : lines_of(from / word.string().substr(1))) out.push_back(std::move(line));
  }
  return out;
}

}  // namespace kinescope
