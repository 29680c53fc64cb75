// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/apriltag_families.h"

#include <algorithm>
#include <array>

#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

namespace kinescope {
namespace {

// The codes of tag36h11 with two black cells around them instead of one, as Kalibr prints its
// boards.
apriltag_family_t* tag36h11_wide_create() {
  apriltag_family_t* family = tag36h11_create();
  family->width_at_border += 2;
  family->total_width += 2;
  for (std::uint32_t i = 0; i < family->nbits; ++i) {
    ++family->bit_x[i];
    ++family->bit_y[i];
  }
  return family;
}

struct Entry {
  std::string_view name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array<Entry, 10> kFamilies = {{
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tag36h11b2", tag36h11_wide_create, tag36h11_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
}};

// OpenCV's names. DICT_APRILTAG_36h10 is not in the AprilTag library.
struct Alias {
  std::string_view name;
  std::string_view family;
};
constexpr std::array<Alias, 3> kAliases = {{{"DICT_APRILTAG_16h5", "tag16h5"},
                                            {"DICT_APRILTAG_25h9", "tag25h9"},
                                            {"DICT_APRILTAG_36h11", "tag36h11"}}};

const Entry* find(std::string_view name) {
  const auto* alias = std::ranges::find(kAliases, name, &Alias::name);
  if (alias != kAliases.end()) name = alias->family;
  const auto* found = std::ranges::find(kFamilies, name, &Entry::name);
  return found == kFamilies.end() ? nullptr : found;
}

}  // namespace

std::vector<std::string> apriltag_family_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kFamilies) names.emplace_back(entry.name);
  for (const Alias& alias : kAliases) names.emplace_back(alias.name);
  return names;
}

bool is_apriltag_family(std::string_view name) { return find(name) != nullptr; }

AprilTagFamily make_apriltag_family(std::string_view name) {
  const Entry* entry = find(name);
  if (entry == nullptr) return {nullptr, FreeFamily{}};
  return {entry->create(), FreeFamily{entry->destroy}};
}

}  // namespace kinescope
