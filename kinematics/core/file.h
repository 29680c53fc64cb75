// SPDX-License-Identifier: Apache-2.0
//
// Whole files, in and out. A product is written to a temporary name beside its place and renamed,
// so that a run that is cut off leaves nothing half-written.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace kinescope {

/// The file's bytes. Throws bad_input: missing, a folder, pipe or device, unreadable, too large.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path,
                                         std::uintmax_t max_bytes = std::uintmax_t{1} << 30U);

/// Throws bad_request where there is something that is no file: a folder, a pipe, a device.
void require_replaceable(const std::filesystem::path& path);

/// Writes all of it or nothing. Throws bad_request when the folder cannot be written, and as
/// require_replaceable().
void write_file_atomically(const std::filesystem::path& path, std::string_view content);

struct FileContent {
  std::filesystem::path path;
  std::string_view content;
};
/// The same of several, none of which is replaced before all are written.
void write_files_atomically(const std::vector<FileContent>& files);

/// Removes what a process that is gone (killed, or without power) left of files of these names when
/// it was writing them.
void remove_abandoned(const std::filesystem::path& folder, const std::vector<std::string>& names);

/// Makes the folder (and its parents) and proves that a file can be made there. Throws bad_request.
void require_writable_folder(const std::filesystem::path& folder);

}  // namespace kinescope
