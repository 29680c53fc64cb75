// SPDX-License-Identifier: Apache-2.0
#include "app/io/output_folder.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/io/same_place.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/recorded/container.h"

#ifndef KINESCOPE_VERSION
#error "KINESCOPE_VERSION is set by the build"
#endif

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// One line a product: command, name. Written to before each file that is new here, so that a
// command that is cut off goes on in its own folder.
constexpr std::string_view kList = ".kinescope_products";
constexpr std::string_view kListHead =
    "# Written here by kinescope, which may replace and remove them: command, file\n";
constexpr std::string_view kRunCommand = "run";

// Name of a file: the command that wrote it.
using Owners = std::map<std::string, std::string, std::less<>>;

void append(std::vector<std::string>& names, const std::vector<std::string>& more) {
  names.insert(names.end(), more.begin(), more.end());
}

// Of run.json, where it is one, the names that a run may have written.
void add_products_of_run(const fs::path& run_json, Owners& owners) {
  std::error_code error;
  if (!fs::is_regular_file(run_json, error)) return;
  const json document = json::parse(read_text_file(run_json), nullptr, false);
  if (!document.is_object() || document.value("schema", json()) != "kinescope.run") return;
  const std::vector<std::string> known = run_products(true);
  for (const json& name : document.value("products", json::array())) {
    if (name.is_string() && std::ranges::find(known, name.get<std::string>()) != known.end()) {
      owners[name.get<std::string>()] = kRunCommand;
    }
  }
}

void add_listed(const fs::path& folder, Owners& owners) {
  std::error_code error;
  if (!fs::is_regular_file(folder / kList, error)) return;
  std::istringstream lines(read_text_file(folder / kList));
  for (std::string line; std::getline(lines, line);) {
    const std::size_t space = line.find(' ');
    if (line.starts_with('#') || space == std::string::npos) continue;
    const std::string name = line.substr(space + 1);
    // Files of this folder alone, whatever someone wrote into the list.
    if (name != ".." && fs::path(name).filename() == name) owners[name] = line.substr(0, space);
  }
}

Owners owners_in(const fs::path& folder) {
  Owners owners;
  add_products_of_run(folder / "run.json", owners);
  add_listed(folder, owners);
  return owners;
}

std::string owner_of(std::string_view name, const Owners& owners) {
  const auto found = owners.find(name);
  return found == owners.end() ? std::string() : found->second;
}

void add_to_list(const fs::path& folder, const std::string& command, std::string_view name) {
  const fs::path list = folder / kList;
  std::error_code error;
  const bool begun = fs::exists(list, error);
  // In one piece: two runs at once add their lines, and neither loses the other's.
  std::ofstream stream(list, std::ios::binary | std::ios::app);
  stream << fmt::format("{}{} {}\n", begun ? "" : kListHead, command, name);
  stream.flush();
  if (stream) return;
  throw bad_request(list.string(), "cannot be written",
                    "check that the folder is writable and the disk is not full");
}

void remove_from_list(const fs::path& folder, std::string_view name) {
  std::error_code error;
  if (!fs::is_regular_file(folder / kList, error)) return;
  std::istringstream lines(read_text_file(folder / kList));
  std::string kept;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#') || line.substr(line.find(' ') + 1) != name) kept += line + "\n";
  }
  write_file_atomically(folder / kList, kept);
}

void require_no_input(const fs::path& file, const std::vector<fs::path>& inputs,
                      std::string_view option) {
  std::error_code error;
  const auto same = [&](const fs::path& input) {
    return std::ranges::any_of(recorded::parts_of(input), [&](const fs::path& part) {
      return fs::equivalent(file, part, error);
    });
  };
  if (std::ranges::none_of(inputs, same)) return;
  throw bad_request(file.string(), "is an input, and would be written over",
                    fmt::format("name another place with {}", option));
}

void require_own(const fs::path& folder, const Writer& writer) {
  const Owners owners = owners_in(folder);
  for (const std::string& name : writer.products) {
    std::error_code error;
    if (!fs::exists(fs::symlink_status(folder / name, error))) continue;
    const std::string owner = owner_of(name, owners);
    if (owner == writer.command) continue;
    throw bad_request(
        (folder / name).string(),
        owner.empty()
            ? fmt::format("would be replaced, and kinescope {} did not write it", writer.command)
            : fmt::format("would be replaced, and kinescope {} wrote it", owner),
        fmt::format("name another folder with {}, or replace it with --force", writer.option));
  }
}

}  // namespace

std::string program_version() { return KINESCOPE_VERSION; }

std::vector<std::string> run_products(bool torques) {
  std::vector<std::string> out{
      "report.html",      "result.json",   "robot.urdf",       "structure.json",
      "calibration.json", "trace.json",    "observations.csv", "observations.json",
      "tracks.csv",       "residuals.csv", "run.json",         "failed_report.html",
      "hand_eye.json",    "hand_eye.urdf", "camera_path.csv",  "joint_values.csv"};
  out.emplace_back("nominal_calibrated.urdf");
  if (!torques) return out;
  append(out, dynamics_products("dynamics_trace.json"));
  append(out, contact_products());
  return out;
}

std::vector<std::string> contact_products() {
  return {"contacts.csv", "contacts.json", "contact.html"};
}

std::vector<std::string> dynamics_products(const std::string& trace_file) {
  std::vector<std::string> out{"dynamics.json", "robot_dynamics.urdf", "dynamics.html"};
  if (!trace_file.empty()) append(out, {trace_file, "robot_traced.urdf", "torque_compensated.csv"});
  return out;
}

OutputFolder::OutputFolder(fs::path folder, Writer writer)
    : folder_(std::move(folder)), command_(std::move(writer.command)) {
  writer.command = command_;
  for (const std::string& name : writer.products) {
    require_no_input(folder_ / name, writer.inputs, writer.option);
  }
  if (!writer.force) require_own(folder_, writer);
  require_writable_folder(folder_);
  writer.products.emplace_back(kList);
  remove_abandoned(folder_, writer.products);
}

void OutputFolder::write(std::string_view name, std::string_view content) const {
  write({{std::string(name), std::string(content)}});
}

void OutputFolder::write(const std::vector<std::pair<std::string, std::string>>& products) const {
  std::vector<FileContent> files;
  for (const auto& [name, content] : products) {
    if (owner_of(name, owners_in(folder_)) != command_) add_to_list(folder_, command_, name);
    files.push_back({folder_ / name, content});
  }
  write_files_atomically(files);
}

void OutputFolder::remove(std::string_view name) const {
  if (owner_of(name, owners_in(folder_)) != command_) return;
  std::error_code error;  // what cannot be removed is no reason to lose the rest
  if (!fs::is_regular_file(folder_ / name, error)) return;
  fs::remove(folder_ / name, error);
  if (!error) remove_from_list(folder_, name);
}

void OutputFolder::list_own_products() const {
  Owners listed;
  add_listed(folder_, listed);
  for (const std::string& name : own_products()) {
    if (owner_of(name, listed) != command_) add_to_list(folder_, command_, name);
  }
}

std::set<std::string> OutputFolder::own_products() const {
  std::set<std::string> out;
  for (const auto& [name, command] : owners_in(folder_)) {
    if (command == command_) out.insert(name);
  }
  return out;
}

void require_apart(const fs::path& folder, const std::vector<fs::path>& inputs) {
  std::map<fs::path, std::string> folders;  // with one of their files: images are many
  for (const fs::path& input : inputs) {
    folders.emplace(fs::absolute(input).parent_path(), input.filename().string());
  }
  for (const auto& [place, name] : folders) {
    if (!same_place(folder, place)) continue;
    throw bad_request(folder.string(),
                      fmt::format("holds the input {}: results are not written beside it", name),
                      "name another folder with --output");
  }
}

void require_folder_of(const fs::path& file) {
  std::error_code error;
  const fs::path folder = fs::absolute(file).parent_path();
  if (fs::is_directory(folder, error)) return;
  throw bad_request(file.string(), fmt::format("there is no folder {}", folder.string()),
                    "make it, or name another file");
}

void require_new_file(const fs::path& file, std::string_view option,
                      const std::vector<fs::path>& inputs, bool force) {
  require_no_input(file, inputs, option);
  std::error_code error;
  const fs::file_status status = fs::symlink_status(file, error);
  if (!fs::exists(status)) return;
  require_replaceable(file);
  const std::string remedy = fmt::format("name another file with {}", option);
  const std::string owner =
      owner_of(file.filename().string(), owners_in(fs::absolute(file).parent_path()));
  if (!owner.empty()) {
    throw bad_request(file.string(), fmt::format("is a product of kinescope {}", owner), remedy);
  }
  if (force) return;
  throw bad_request(file.string(), "is there already", remedy + ", or replace it with --force");
}

}  // namespace kinescope
