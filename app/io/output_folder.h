// SPDX-License-Identifier: Apache-2.0
//
// Whose files are whose. A command replaces and removes in a folder only what the same command
// wrote there: what the folder's file `.kinescope_products` and a run's run.json say. A file that
// is named by itself (-o FILE) must be new. `--force` lifts both; what is read is never written
// over.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace kinescope {

/// The program's version.
[[nodiscard]] std::string program_version();

/// Names of the files that a command may write into its folder.
[[nodiscard]] std::vector<std::string> run_products(bool torques);
[[nodiscard]] std::vector<std::string> contact_products();
/// `trace_file` empty: without those of tracing.
[[nodiscard]] std::vector<std::string> dynamics_products(const std::string& trace_file);

/// A command that writes into a folder.
struct Writer {
  std::string command;                        ///< "run", "dynamics", "contact"
  std::vector<std::string> products;          ///< names of what it may write
  std::vector<std::filesystem::path> inputs;  ///< what it reads
  bool force = false;                         ///< replace also what it did not write
  std::string option = "--output";            ///< that names the folder
};

/// A folder of products under their names, each whole or not there.
class OutputFolder {
 public:
  /// Throws bad_request: a product would replace an input or, without force, a file that this
  /// command did not write; then nothing was made. Else makes the folder and proves that it can be
  /// written.
  OutputFolder(std::filesystem::path folder, Writer writer);

  [[nodiscard]] std::filesystem::path file(std::string_view name) const { return folder_ / name; }
  void write(std::string_view name, std::string_view content) const;
  /// Products of one piece: by name, none of which is replaced before all are written.
  void write(const std::vector<std::pair<std::string, std::string>>& products) const;
  /// Nothing happens to a file that this command did not write.
  void remove(std::string_view name) const;
  /// Names of what this command wrote here, now or earlier.
  [[nodiscard]] std::set<std::string> own_products() const;
  /// Those that only run.json names are in the folder's list after it.
  void list_own_products() const;

 private:
  std::filesystem::path folder_;
  std::string command_;
};

/// Throws bad_request where the folder holds one of the inputs: products are not to be mixed with
/// them.
void require_apart(const std::filesystem::path& folder,
                   const std::vector<std::filesystem::path>& inputs);

/// Throws bad_request where the folder is not there that a single file would be written into.
void require_folder_of(const std::filesystem::path& file);

/// The same as of products for a single file, named with `option`. Throws bad_request: it is an
/// input, a folder or a product of a command, or, without force, it is there already.
void require_new_file(const std::filesystem::path& file, std::string_view option,
                      const std::vector<std::filesystem::path>& inputs, bool force);

}  // namespace kinescope
