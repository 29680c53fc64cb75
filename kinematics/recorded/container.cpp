// SPDX-License-Identifier: Apache-2.0
#include "kinematics/recorded/container.h"

#include "kinematics/bags/bag.h"
#include "kinematics/datasets/dataset.h"

namespace kinescope::recorded {
namespace fs = std::filesystem;

std::optional<Container> container_of(const fs::path& path) {
  if (const auto bag = bags::bag_source(path)) return Container{bag->bag, bag->topic};
  if (const auto dataset = datasets::dataset_source(path)) {
    const std::string whole = dataset->path().string();
    const std::size_t folder = dataset->folder.string().size();
    return Container{dataset->folder, whole.size() > folder ? whole.substr(folder + 1) : ""};
  }
  return std::nullopt;
}

std::vector<fs::path> parts_of(const fs::path& path) {
  if (const auto bag = bags::bag_source(path)) return bags::files_of(bag->bag);
  if (const auto dataset = datasets::dataset_source(path)) return datasets::files_of(*dataset);
  return {path};
}

std::string short_name(const fs::path& path) {
  const auto container = container_of(path);
  if (!container || container->part.empty()) return path.filename().string();
  return container->path.filename().string() + ":" + container->part;
}

std::vector<fs::path> places_of(const Container& container) {
  std::error_code error;
  const fs::path whole = fs::absolute(container.path).lexically_normal();
  const fs::path around = (whole.has_filename() ? whole : whole.parent_path()).parent_path();
  if (datasets::dataset_source(container.path)) return {container.path, around};
  if (fs::is_directory(container.path, error)) return {container.path};
  const fs::path parent = container.path.parent_path();
  return {parent.empty() ? fs::path(".") : parent};
}

}  // namespace kinescope::recorded
