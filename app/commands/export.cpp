// SPDX-License-Identifier: Apache-2.0
//
// `kinescope export`: a robot, or what a run saw of it, for other programs.
#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "app/commands/export_form.h"
#include "app/io/output_folder.h"
#include "app/io/same_place.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

std::vector<ExportForm> forms_of(const ExportOptions& options) {
  std::vector<ExportForm> out;
  if (!options.mjcf.empty()) out.push_back(export_mjcf(options));
  if (!options.tum.empty()) out.push_back(export_tum(options));
  if (!options.dh.empty()) out.push_back(export_dh(options));
  if (!options.mcap.empty()) out.push_back(export_mcap(options));
  if (!options.lerobot.empty()) out.push_back(export_lerobot(options));
  if (!out.empty()) return out;
  throw bad_request("export", "nothing is named that is to be written",
                    "name it with --mjcf, --tum, --dh, --mcap or --lerobot");
}

// One path under two options would be what was written last. Before anything is written.
void require_different_places(const std::vector<ExportForm>& forms) {
  std::vector<std::filesystem::path> taken;
  const auto take = [&](const std::filesystem::path& path) {
    const auto same = [&](const auto& other) { return same_place(path, other); };
    if (std::ranges::any_of(taken, same))
      throw bad_request(path.string(), "is named twice", "name different files");
    taken.push_back(path);
  };
  for (const ExportForm& form : forms) {
    if (!form.folder.empty()) take(form.folder);
    for (const ExportedFile& file : form.files) take(form.folder / file.path);
  }
}

void require_folders_of_files(const std::vector<ExportForm>& forms) {
  for (const ExportForm& form : forms) {
    if (!form.folder.empty()) continue;
    for (const ExportedFile& file : form.files) require_folder_of(file.path);
  }
}

OutputFolder folder_of(const ExportForm& form, bool force) {
  Writer writer{.command = "export",
                .products = {},
                .inputs = form.inputs,
                .force = force,
                .option = "--tum"};
  for (const ExportedFile& file : form.files) writer.products.push_back(file.path.string());
  return {form.folder, std::move(writer)};
}

// What an earlier export wrote there goes with it.
void write_into(const OutputFolder& folder, const ExportForm& form) {
  for (const std::string& earlier : folder.own_products()) {
    const std::filesystem::path path = earlier;
    if (std::ranges::find(form.files, path, &ExportedFile::path) == form.files.end())
      folder.remove(earlier);
  }
  for (const ExportedFile& file : form.files) folder.write(file.path.string(), file.bytes);
}

}  // namespace

ExitCode export_command(const ExportOptions& options, const Console& console) {
  const std::vector<ExportForm> forms = forms_of(options);
  require_different_places(forms);
  require_folders_of_files(forms);
  std::vector<std::optional<OutputFolder>> folders;
  for (const ExportForm& form : forms) {
    folders.emplace_back();
    if (!form.folder.empty()) folders.back() = folder_of(form, options.force);
  }
  nlohmann::json result = nlohmann::json::object();
  for (std::size_t k = 0; k < forms.size(); ++k) {
    const ExportForm& form = forms[k];
    if (folders[k]) write_into(*folders[k], form);
    if (!folders[k])
      for (const ExportedFile& file : form.files) write_file_atomically(file.path, file.bytes);
    result.update(form.result);
    for (const std::string& warning : form.warnings) console.warn(warning);
  }
  if (console.json) {
    console.print(result);
    return ExitCode::kDone;
  }
  for (const ExportForm& form : forms)
    for (const std::string& line : form.lines) fmt::print("{}\n", line);
  return ExitCode::kDone;
}

}  // namespace kinescope
