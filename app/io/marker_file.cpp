// SPDX-License-Identifier: Apache-2.0
//
// tags.yaml: what is declared about the markers.
#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "app/io/nearest_name.h"
#include "app/io/recording.h"
#include "app/io/yaml_value.h"
#include "calib/vision/tag_detector.h"

namespace kinescope {
namespace {

constexpr double kSmallestTagM = 5e-4;  // no lens of a robot's camera sees less
constexpr double kLargestTagM = 5.0;
constexpr const char* kSizeRemedy = "give the edge of the black square in m, as measured";

double size_of(const YamlValue& value) {
  const double size_m = value.positive(kSizeRemedy);
  if (size_m < kSmallestTagM) {
    throw value.error(fmt::format("is {} m, smaller than {} m", size_m, kSmallestTagM),
                      kSizeRemedy);
  }
  if (size_m > kLargestTagM) {
    throw value.error(fmt::format("is {} m, larger than {} m", size_m, kLargestTagM),
                      "sizes are in m; was this mm?");
  }
  return size_m;
}

TagId id_of_key(const std::string& key, const YamlValue& value) {
  TagId id;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), id.value);
  if (error != std::errc{} || end != key.data() + key.size() || id.value < 0) {
    throw value.error("does not stand under a marker's number", "write lines such as 12: 0.05");
  }
  return id;
}

void set_size(MarkerSet& markers, TagId id, const YamlValue& value) {
  if (!markers.sizes_m.emplace(id, size_of(value)).second) {
    throw value.error(fmt::format("declares marker {} a second time", id.value),
                      "keep one of them");
  }
}

/// tags: a list of {id, size}.
void read_tag_list(MarkerSet& markers, const YamlValue& list) {
  for (const YamlValue& item : list.items()) {
    item.only_keys({"id", "size"});
    const TagId id{item.require("id").whole(0)};
    if (const auto size = item.find("size")) {
      set_size(markers, id, *size);
    } else if (markers.default_size_m > 0.0) {
      markers.sizes_m.emplace(id, markers.default_size_m);
    } else {
      throw item.error(fmt::format("gives marker {} no size", id.value),
                       "add size: or a default_size: for all");
    }
  }
}

/// Inner corners of a chessboard, row by row from the top left, in its plane (x right, y down).
std::vector<Eigen::Vector3d> board_corners(const YamlValue& board) {
  board.only_keys({"columns", "rows", "square"});
  const int columns = board.require("columns").whole(2);
  const int rows = board.require("rows").whole(2);
  const double square_m = size_of(board.require("square"));
  if (columns > 1000 || rows > 1000)
    throw board.error("has over 1000 rows or columns", "correct it");
  std::vector<Eigen::Vector3d> corners;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) corners.emplace_back(c * square_m, r * square_m, 0.0);
  }
  return corners;
}

std::string read_family(const YamlValue& value) {
  const std::string family = value.text();
  const std::vector<std::string> known = known_families();
  if (std::ranges::find(known, family) != known.end()) return family;
  throw value.error(fmt::format("'{}' is not known", family), did_you_mean(family, known));
}

}  // namespace

MarkerSet read_marker_set(const std::filesystem::path& path) {
  const YamlValue file = YamlValue::read(path);
  file.only_keys({"family", "default_size", "sizes", "tags", "boards", "only_listed"});
  MarkerSet markers;
  if (const auto family = file.find("family")) markers.family = read_family(*family);
  if (const auto size = file.find("default_size")) markers.default_size_m = size_of(*size);
  if (const auto sizes = file.find("sizes")) {
    for (const auto& [key, value] : sizes->entries())
      set_size(markers, id_of_key(key, value), value);
  }
  if (const auto tags = file.find("tags")) read_tag_list(markers, *tags);
  if (const auto boards = file.find("boards")) {
    for (const auto& [key, board] : boards->entries()) {
      markers.boards.emplace(id_of_key(key, board), board_corners(board));
    }
  }
  if (markers.default_size_m == 0.0 && markers.sizes_m.empty() && markers.boards.empty()) {
    throw bad_input(path.string(), "declares no marker's size", "add default_size: 0.05 (in m)");
  }
  // Without a size for all others, only those that are listed can be used.
  markers.only_listed = markers.default_size_m == 0.0;
  if (const auto only = file.find("only_listed")) markers.only_listed = only->flag();
  return markers;
}

}  // namespace kinescope
