// SPDX-License-Identifier: Apache-2.0
//
// Markers found in photographs of others, by the search that the program makes of a single picture
// and by the packaged libraries at several settings. A marker counts as there where the set comes
// with a list of them; else where two of the libraries' searches agree on it. Goal: at least the
// best library setting's recall on every set, and no marker that is not there.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "calib/vision/tag_detector.h"
#include "kinematics/core/error.h"
#include "tests/experiments/command_line.h"
#include "tests/truth/shared_data.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

struct PhotoSet {
  std::string folder;  // below vision/
  std::string family;
  std::string only = {};  // part of the pictures' names
};

// The pictures of one set are of one family.
const std::vector<PhotoSet> kSets = {
    {"apriltag_reference_photos", "tag36h11"},
    {"apriltag_room_mapping/images", "tag36h11"},
    {"frc_field_36h11", "tag36h11"},
    {"apriltag_sheet_10mpx", "tag36h11"},
    {"aruco_boards_misc", "DICT_6X6_1000", "rct_aruco"},
    {"aruco_boards_misc", "DICT_6X6_250", "rct_charuco"},
    {"aruco_boards_misc", "DICT_4X4_250", "moveit_aruco"},
    {"aruco_boards_misc", "DICT_5X5_250", "moveit_charuco"},
};

struct Search {
  std::string name;
  bool votes = true;  // on what is there
  DetectorOptions options = {};
  bool opencv = false;
  bool opencv_april = false;  // its AprilTag corners, which come with their own search
};

// The first is the program's own.
const std::vector<Search> kSearches = {
    {.name = "ours", .votes = false, .options = {}},
    {.name = "decimate 1", .options = {.max_hamming = 2, .min_margin = 0.0}},
    {.name = "decimate 1.5", .options = {.decimate = 1.5, .max_hamming = 2, .min_margin = 0.0}},
    {.name = "decimate 2", .options = {.decimate = 2.0, .max_hamming = 2, .min_margin = 0.0}},
    {.name = "OpenCV", .opencv = true},
    {.name = "OpenCV APRILTAG", .opencv = true, .opencv_april = true},
};

struct Sighting {
  int id = 0;
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
  double edge_px = 0.0;
  int corrected_bits = 0;  // 0 also where a search does not say
};

Sighting sighting_of(int id, const std::vector<Eigen::Vector2d>& corners, int corrected_bits = 0) {
  Sighting out{.id = id, .corrected_bits = corrected_bits};
  for (std::size_t k = 0; k < 4; ++k) {
    out.middle_px += 0.25 * corners[k];
    out.edge_px += 0.25 * (corners[(k + 1) % 4] - corners[k]).norm();
  }
  return out;
}

bool is_among(const Sighting& one, const std::vector<Sighting>& all) {
  return std::ranges::any_of(all, [&](const Sighting& other) {
    return other.id == one.id && (other.middle_px - one.middle_px).norm() < 0.5 * one.edge_px;
  });
}

std::vector<Sighting> search_opencv(const cv::Mat& image, const std::string& family, bool april) {
  static const std::vector<std::pair<std::string, int>> kDictionaries = {
      {"tag36h11", cv::aruco::DICT_APRILTAG_36h11}, {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
      {"DICT_5X5_250", cv::aruco::DICT_5X5_250},    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
      {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
  };
  const auto found = std::ranges::find(kDictionaries, family, &std::pair<std::string, int>::first);
  const auto dictionary = cv::aruco::getPredefinedDictionary(found->second);
  const auto parameters = cv::aruco::DetectorParameters::create();
  if (april) parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_APRILTAG;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(image, dictionary, corners, ids, parameters);
  std::vector<Sighting> out;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    std::vector<Eigen::Vector2d> px;
    for (const cv::Point2f& p : corners[i])
      px.emplace_back(static_cast<double>(p.x), static_cast<double>(p.y));
    out.push_back(sighting_of(ids[i], px));
  }
  return out;
}

std::vector<Sighting> run(const Search& search, const cv::Mat& image, const std::string& family) {
  if (search.opencv) return search_opencv(image, family, search.opencv_april);
  const ImageView view{image.data, image.cols, image.rows, static_cast<int>(image.step)};
  const auto detector = make_tag_detector(family, search.options);
  std::vector<TagObservation> tags;
  if (search.votes) {
    tags = detector->detect(view);
  } else {
    tags = detect_with_both(*detector, *make_tag_detector(family, {.decimate = 2.0}), view);
  }
  std::vector<Sighting> out;
  for (const TagObservation& tag : tags)
    out.push_back(sighting_of(tag.id.value, tag.corners_px, tag.hamming));
  return out;
}

// Lines "id, (u v), (u v), (u v), (u v)".
std::optional<std::vector<Sighting>> listed(fs::path path) {
  std::ifstream file(path.replace_extension(".txt"));
  if (!file) return std::nullopt;
  std::vector<Sighting> out;
  for (std::string line; std::getline(file, line);) {
    std::ranges::replace_if(line, [](char c) { return c == ',' || c == '(' || c == ')'; }, ' ');
    std::istringstream numbers(line);
    int id = 0;
    std::vector<Eigen::Vector2d> corners(4);
    numbers >> id;
    for (Eigen::Vector2d& corner : corners) numbers >> corner.x() >> corner.y();
    if (numbers) out.push_back(sighting_of(id, corners));
  }
  return out;
}

// By search; what those that vote agree on, two at least, and what one of them is sure of.
std::vector<Sighting> agreed(const std::vector<std::vector<Sighting>>& found,
                             const std::set<int>& sure) {
  std::vector<Sighting> out;
  for (std::size_t s = 0; s < found.size(); ++s) {
    if (!kSearches[s].votes) continue;
    for (const Sighting& one : found[s]) {
      if (is_among(one, out)) continue;
      std::size_t votes = one.corrected_bits == 0 && sure.contains(one.id) ? 1 : 0;
      for (std::size_t other = 0; other < found.size(); ++other)
        votes += kSearches[other].votes && is_among(one, found[other]) ? 1U : 0U;
      if (votes >= 2) out.push_back(one);
    }
  }
  return out;
}

void judge(const PhotoSet& set) {
  const auto folder = shared_data("vision/" + set.folder);
  if (!folder) {
    fmt::print("{}: not on this machine\n", set.folder);
    return;
  }
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::directory_iterator(*folder)) {
    const std::string name = entry.path().filename().string();
    const std::string type = entry.path().extension().string();
    if ((type == ".jpg" || type == ".JPG" || type == ".jpeg" || type == ".png") &&
        name.find(set.only) != std::string::npos)
      pictures.push_back(entry.path());
  }
  std::ranges::sort(pictures);
  std::vector<std::vector<std::vector<Sighting>>> all;  // by picture and search
  std::set<int> ids;                                    // that searches agree on
  for (const fs::path& picture : pictures) {
    const cv::Mat image = cv::imread(picture.string(), cv::IMREAD_GRAYSCALE);
    std::vector<std::vector<Sighting>>& found = all.emplace_back();
    for (const Search& search : kSearches) found.push_back(run(search, image, set.family));
    for (const Sighting& one : agreed(found, {})) ids.insert(one.id);
  }
  std::size_t there = 0;
  std::vector<std::size_t> right(kSearches.size());
  std::vector<std::size_t> extra(kSearches.size());
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const std::vector<Sighting> truth = listed(pictures[i]).value_or(agreed(all[i], ids));
    there += truth.size();
    for (std::size_t s = 0; s < kSearches.size(); ++s) {
      for (const Sighting& one : truth) right[s] += is_among(one, all[i][s]) ? 1U : 0U;
      for (const Sighting& one : all[i][s]) extra[s] += is_among(one, truth) ? 0U : 1U;
    }
  }
  fmt::print("{:<30}{:>9}{:>7}", set.only.empty() ? set.folder : set.only, pictures.size(), there);
  for (std::size_t s = 0; s < kSearches.size(); ++s)
    fmt::print("{:>18}", fmt::format("{} +{}", right[s], extra[s]));
  fmt::print("\n");
}

void run_all() {
  fmt::print("Markers found that are there, and + those that are not.\n{:<30}{:>9}{:>7}", "set",
             "pictures", "there");
  for (const Search& search : kSearches) fmt::print("{:>18}", search.name);
  fmt::print("\n");
  for (const PhotoSet& set : kSets) judge(set);
}

}  // namespace
}  // namespace kinescope

int main(int argc, char** argv) {
  CLI::App app("markers in photographs of others, beside the packaged libraries");
  return kinescope::run_experiment(app, argc, argv, kinescope::run_all);
}
