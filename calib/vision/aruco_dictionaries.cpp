// SPDX-License-Identifier: Apache-2.0
#include "calib/vision/aruco_dictionaries.h"

#include <algorithm>
#include <array>

namespace kinescope {
namespace {

struct ArucoDictionary {
  std::string_view name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME value;
};

constexpr std::array<ArucoDictionary, 17> kArucoDictionaries = {{
    {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
}};

}  // namespace

std::vector<std::string> aruco_dictionary_names() {
  std::vector<std::string> names;
  for (const ArucoDictionary& dictionary : kArucoDictionaries) names.emplace_back(dictionary.name);
  return names;
}

cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(std::string_view name) {
  const auto* found = std::ranges::find(kArucoDictionaries, name, &ArucoDictionary::name);
  if (found == kArucoDictionaries.end()) return {};
  return cv::aruco::getPredefinedDictionary(found->value);
}

}  // namespace kinescope
