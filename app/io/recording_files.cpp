// SPDX-License-Identifier: Apache-2.0
#include "app/io/recording_files.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/container_cameras.h"
#include "app/io/nearest_name.h"
#include "kinematics/bags/bag.h"
#include "kinematics/bags/bag_contents.h"
#include "kinematics/core/error.h"
#include "kinematics/datasets/dataset.h"
#include "kinematics/recorded/container.h"

namespace kinescope {
namespace fs = std::filesystem;
namespace {

using MaybePath = std::optional<fs::path>;

constexpr std::array kVideoEndings = {".mp4", ".avi",  ".mkv", ".mov", ".webm", ".m4v",
                                      ".mpg", ".mpeg", ".wmv", ".ts",  ".ogv",  ".flv"};

const std::vector<std::string> kTables = {"joints", "flange", "corners", "poses", "points"};

bool is_video_file(const fs::path& path) {
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return std::ranges::find(kVideoEndings, ending) != kVideoEndings.end();
}

std::vector<fs::path> sorted_files(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    std::error_code dangling;  // a link to nothing is no file, and no fault of the folder
    if (entry.is_regular_file(dangling)) files.push_back(entry.path());
  }
  if (error) throw bad_input(folder.string(), "cannot be listed", "check its permissions");
  std::ranges::sort(files);
  return files;
}

void check_folder(const fs::path& folder) {
  std::error_code error;
  if (!fs::exists(folder, error))
    throw bad_input(folder.string(), "no such folder", "check the path");
  if (fs::is_directory(folder, error)) return;
  throw bad_input(
      folder.string(), "is a file, neither a recording's folder nor a bag",
      "name the folder that holds the video, tags.yaml and joints.csv, or a .mcap, .db3 "
      "or .bag file");
}

/// Something of a file's name that cannot be read as one is not the same as nothing.
void refuse_no_file(const fs::path& path) {
  std::error_code error;
  const fs::file_type entry = fs::symlink_status(path, error).type();
  if (entry == fs::file_type::not_found || entry == fs::file_type::none) return;
  const fs::file_type target = fs::status(path, error).type();
  const char* what = "is a pipe or a device, not a file";
  if (target == fs::file_type::directory) what = "is a folder, not a file";
  if (target == fs::file_type::not_found) what = "is a link to a file that is not there";
  if (error == std::errc::too_many_symbolic_link_levels) what = "is a link that leads to itself";
  throw bad_input(path.string(), what, "put the file there, or remove it");
}

/// The video: the one named video.*, else the only one, else a folder of images.
MaybePath find_video(const fs::path& folder) {
  std::vector<fs::path> videos = sorted_files(folder);
  std::erase_if(videos, [](const fs::path& path) { return !is_video_file(path); });
  std::vector<fs::path> named = videos;
  std::erase_if(named, [](const fs::path& path) { return path.stem() != "video"; });
  const std::vector<fs::path>& candidates = named.empty() ? videos : named;
  if (candidates.size() > 1) {
    std::vector<std::string> names;
    names.reserve(candidates.size());
    for (const fs::path& path : candidates) names.push_back(path.filename().string());
    throw bad_input(folder.string(),
                    fmt::format("holds several videos: {}", fmt::join(names, ", ")),
                    "name one with --video");
  }
  if (candidates.size() == 1) return candidates.front();
  for (const char* ending : kVideoEndings) refuse_no_file(folder / (std::string("video") + ending));
  for (const char* name : {"images", "video"}) {
    std::error_code error;
    if (fs::is_directory(folder / name, error)) return folder / name;
  }
  return std::nullopt;
}

/// What stands behind the underscore of "video_left": "left"; nothing of other names.
std::optional<std::string> name_behind(const std::string& stem, std::string_view kind) {
  if (!stem.starts_with(kind) || stem.size() <= kind.size() + 1 || stem[kind.size()] != '_')
    return std::nullopt;
  return stem.substr(kind.size() + 1);
}

/// What each camera of the folder shows: its videos and folders of images, or its tables of
/// corners.
std::map<std::string, fs::path> shown_by_cameras(const fs::path& folder, bool corners) {
  std::map<std::string, fs::path> out;
  const auto add = [&](const std::optional<std::string>& name, const fs::path& path) {
    if (!name) return;
    const auto [known, fresh] = out.emplace(*name, path);
    if (fresh) return;
    throw bad_input(folder.string(),
                    fmt::format("both {} and {} are of camera '{}'",
                                known->second.filename().string(), path.filename().string(), *name),
                    "give each camera one of them");
  };
  for (const fs::path& path : sorted_files(folder)) {
    const std::string stem = path.stem().string();
    if (corners && path.extension() == ".csv") add(name_behind(stem, "corners"), path);
    if (!corners && is_video_file(path)) add(name_behind(stem, "video"), path);
  }
  if (corners) return out;
  std::error_code error;
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    if (entry.is_directory(error)) folders.push_back(entry.path());
  std::ranges::sort(folders);
  for (const fs::path& path : folders) add(name_behind(path.filename().string(), "images"), path);
  return out;
}

/// Several cameras are two or more; what is called without a name is the only one's.
bool has_single_camera(const fs::path& folder) {
  std::error_code error;
  for (const char* ending : kVideoEndings)
    if (fs::exists(folder / (std::string("video") + ending), error)) return true;
  return fs::is_directory(folder / "images", error) || fs::exists(folder / "corners.csv", error);
}

/// Names of cameras are in the names of products and in tables.
void require_plain_name(const std::string& name, const fs::path& path) {
  const bool plain = std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.';
  });
  if (plain) return;
  throw bad_input(path.string(), fmt::format("'{}' is no name for a camera", name),
                  "use letters, digits, '_', '-' and '.'");
}

void find_cameras(const fs::path& folder, RecordingFiles& files) {
  for (const bool corners : {false, true}) {
    const std::map<std::string, fs::path> shown = shown_by_cameras(folder, corners);
    if (shown.size() < 2) continue;
    if (has_single_camera(folder)) {
      files.warnings.push_back(
          fmt::format("{} is not used: a video, images or corners.csv without a camera's name "
                      "stand beside it",
                      shown.begin()->second.string()));
      return;
    }
    files.entry = corners ? RecordingEntry::kCorners : RecordingEntry::kVideo;
    for (const auto& [name, path] : shown) {
      require_plain_name(name, path);
      CameraFiles camera{name, {}, {}, {}};
      (corners ? camera.corners : camera.video) = path;
      const fs::path intrinsics = folder / fmt::format("camera_{}.yaml", name);
      std::error_code error;
      if (fs::is_regular_file(intrinsics, error)) camera.camera = intrinsics;
      files.cameras.push_back(std::move(camera));
    }
    return;
  }
}

/// A camera's file that belongs to none is a slip of the pen.
void check_camera_files(const fs::path& folder, const RecordingPaths& paths,
                        RecordingFiles& files) {
  if (paths.camera) {
    throw bad_request("--camera", "the recording is of several cameras",
                      "call each one's intrinsics camera_NAME.yaml, or name one video with "
                      "--video");
  }
  std::vector<std::string> names;
  for (const CameraFiles& camera : files.cameras) names.push_back(camera.name);
  for (const fs::path& path : sorted_files(folder)) {
    if (path.extension() != ".yaml") continue;
    const std::string stem = path.stem().string();
    const auto name = name_behind(stem, "camera");
    if (stem != "camera" && !name) continue;
    if (name && std::ranges::find(names, *name) != names.end()) continue;
    files.warnings.push_back(
        fmt::format("{} is not used: the cameras are {}", path.string(), fmt::join(names, ", ")));
  }
}

/// The file named on the command line, else the one of that name in the folder.
MaybePath find_file(const MaybePath& declared, const fs::path& folder, const char* name,
                    const char* option) {
  std::error_code error;
  if (declared) {
    const auto container = recorded::container_of(*declared);
    if (fs::exists(container ? container->path : *declared, error)) return declared;
    throw bad_input(declared->string(), "no such file", fmt::format("correct {}", option));
  }
  if (fs::is_regular_file(folder / name, error)) return folder / name;
  refuse_no_file(folder / name);
  return std::nullopt;
}

/// The way in that the command line asks for.
std::optional<RecordingEntry> declared_entry(const RecordingPaths& paths) {
  std::vector<std::pair<RecordingEntry, std::string>> named;
  if (paths.video) named.emplace_back(RecordingEntry::kVideo, "--video");
  if (paths.corners) named.emplace_back(RecordingEntry::kCorners, "--corners");
  if (paths.poses) named.emplace_back(RecordingEntry::kPoses, "--poses");
  if (paths.points) named.emplace_back(RecordingEntry::kPoints, "--points");
  if (named.size() > 1) {
    throw bad_request(fmt::format("{} {}", named[0].second, named[1].second),
                      "both say what was seen of the robot", "name only one of them");
  }
  if (named.empty()) return std::nullopt;
  return named.front().first;
}

/// Tables of the folder that nothing reads, where the joint log or poses of the flange are missing:
/// a file under another name is no file to the rest.
std::vector<fs::path> unread_tables(const RecordingFiles& files) {
  const std::vector<fs::path> read = files.all();
  std::vector<fs::path> out;
  for (const fs::path& path : sorted_files(files.folder)) {
    const std::string name = path.filename().string();
    const bool plain = path.extension() == ".csv";
    const bool known =
        plain && (std::ranges::find(kTables, path.stem().string()) != kTables.end() ||
                  name_behind(path.stem().string(), "corners"));
    const bool table = plain || name.ends_with(".csv.gz");
    if (table && !known && std::ranges::find(read, path) == read.end()) out.push_back(path);
  }
  return out;
}

RecordingEntry choose_entry(const RecordingPaths& paths, RecordingFiles& files) {
  const std::array<std::pair<RecordingEntry, const MaybePath*>, 4> ways = {
      {{RecordingEntry::kVideo, &files.video},
       {RecordingEntry::kCorners, &files.corners},
       {RecordingEntry::kPoses, &files.poses},
       {RecordingEntry::kPoints, &files.points}}};
  std::optional<RecordingEntry> entry = declared_entry(paths);
  for (const auto& [way, file] : ways) {
    if (!*file || (entry && *entry == way)) continue;
    if (entry) {
      files.warnings.push_back(fmt::format(
          "{} is not used: the recording is read from another file", (*file)->string()));
    } else {
      entry = way;
    }
  }
  if (entry) return *entry;
  std::string unread;
  for (const fs::path& path : unread_tables(files))
    unread += fmt::format("{}{}", unread.empty() ? "; not read: " : ", ", path.filename().string());
  throw bad_input(paths.folder.string(),
                  "holds no video, bag, dataset, corners.csv, poses.csv or points.csv" + unread,
                  "add one of them, or name it with --video, --corners, --poses or --points");
}

/// The bags or datasets of a folder.
std::vector<fs::path> containers_in(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> found;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    if (recorded::container_of(entry.path())) found.push_back(entry.path());
  std::ranges::sort(found);
  return found;
}

/// The only one. Throws where there are several.
MaybePath container_in(const fs::path& folder) {
  const std::vector<fs::path> found = containers_in(folder);
  if (found.empty()) return std::nullopt;
  if (found.size() == 1) return found.front();
  std::vector<std::string> names;
  for (const fs::path& path : found) names.push_back(path.filename().string());
  throw bad_input(folder.string(),
                  fmt::format("holds several bags or datasets: {}", fmt::join(names, ", ")),
                  "name one in place of the folder");
}

fs::path with_topic(const fs::path& bag, const std::string& topic) {
  return bag.string() + ":" + topic;
}

/// What a bag gives in place of files that are not there: images, else corners; joints; a camera.
void take_from_bag(const bags::Source& source, RecordingFiles& files) {
  const bags::Contents& contents = bags::look_into(source.bag);
  const auto names_one_of = [&](const auto& all) {
    return std::ranges::any_of(all,
                               [&](const auto& series) { return series.topic == source.topic; });
  };
  const auto topic_for = [&](const auto& all) {
    return names_one_of(all) ? source.topic : std::string();
  };
  const bool names_joints = names_one_of(contents.joints);
  const bool seen =
      files.video || files.corners || files.poses || files.points || !files.cameras.empty();
  if (!seen) {
    const bool detected = names_one_of(contents.detections) ||
                          (contents.images.empty() && !contents.detections.empty());
    if (detected) {
      files.corners = with_topic(
          source.bag, bags::choose_detections(contents, topic_for(contents.detections)).topic);
    } else {
      const std::string topic = names_joints ? std::string() : source.topic;
      files.video = with_topic(source.bag, bags::choose_images(contents, topic).topic);
    }
  }
  if (!files.joints && !contents.joints.empty()) {
    // Without a topic other publishers' joints join in.
    static_cast<void>(bags::choose_joints(contents, topic_for(contents.joints)));
    files.joints = names_joints ? with_topic(source.bag, source.topic) : source.bag;
  }
  const MaybePath& images = files.video ? files.video : files.corners;
  const auto shown = images ? bags::bag_source(*images) : std::nullopt;
  if (files.camera || !images || !files.cameras.empty()) return;
  // Of images that are none of the bag's it is the bag's only camera.
  if (bags::camera_of(contents, shown ? shown->topic : std::string()))
    files.camera = shown ? images : source.bag;
}

/// What a dataset gives in place of files that are not there: a camera's videos, joints.
void take_from_dataset(const datasets::Source& source, RecordingFiles& files) {
  const datasets::Dataset& dataset = datasets::look_into(source.folder);
  const bool seen =
      files.video || files.corners || files.poses || files.points || !files.cameras.empty();
  if (!seen) {
    const std::string& camera = datasets::choose_camera(dataset, source).name;
    files.video = datasets::Source{source.folder, camera, source.episodes}.path();
  }
  if (!files.joints && dataset.feature("observation.state") != nullptr)
    files.joints = datasets::Source{source.folder, {}, source.episodes}.path();
}

void take_from_container(const fs::path& path, RecordingFiles& files) {
  if (const auto bag = bags::bag_source(path)) take_from_bag(*bag, files);
  if (const auto dataset = datasets::dataset_source(path)) take_from_dataset(*dataset, files);
}

/// The whole bag, or the dataset's episodes.
fs::path without_camera(const fs::path& part) {
  if (const auto dataset = datasets::dataset_source(part))
    return datasets::Source{dataset->folder, {}, dataset->episodes}.path();
  return value_of(recorded::container_of(part)).path;
}

/// The topic of a bag that --video or --corners named: of several that is the one that is chosen.
void name_topic(MaybePath& path, const auto& choose) {
  const auto source = path ? bags::bag_source(*path) : std::nullopt;
  if (source && source->topic.empty())
    path = with_topic(source->bag, choose(bags::look_into(source->bag), std::string()).topic);
}

/// The bag that shows the robot has its joints, too; else one beside what shows it.
void take_from_beside(RecordingFiles& files) {
  name_topic(files.video, bags::choose_images);
  name_topic(files.corners, bags::choose_detections);
  const MaybePath& shown = files.video ? files.video : files.corners;
  const auto own = shown ? recorded::container_of(*shown) : std::nullopt;
  if (own) take_from_container(*shown, files);
  std::vector<fs::path> others = containers_in(files.folder);
  std::erase_if(others, [&](const fs::path& path) {
    std::error_code error;
    return own && fs::equivalent(path, own->path, error);
  });
  const bool complete = files.joints && (files.camera || !shown);
  if (others.size() == 1 && !complete) {
    const MaybePath joints = files.joints, camera = files.camera;
    take_from_container(others.front(), files);
    if (files.joints != joints || files.camera != camera) return;
  }
  for (const fs::path& path : others) {
    files.warnings.push_back(
        fmt::format("{} is not used: {}", path.string(),
                    files.joints ? fmt::format("the joint log is {}", files.joints->string())
                                 : "name the one that holds the joint log with --joints"));
  }
}

void warn_of_unread_tables(RecordingFiles& files) {
  if (files.joints || files.flange) return;
  for (const fs::path& path : unread_tables(files)) {
    const bool poses = nearest_name(path.stem().stem().string(), kTables) == "flange";
    files.warnings.push_back(
        fmt::format("{} is not read: {}", path.string(),
                    poses ? "is it the poses of the flange? Name it flange.csv"
                          : "is it the joint log? Name it joints.csv, or give --joints"));
  }
}

/// Poses in a bag that has no joints: they may be the flange's.
void warn_of_unread_poses(RecordingFiles& files) {
  static const std::set<std::string> kPoses = {
      "geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped",
      "geometry_msgs/TransformStamped", "tf2_msgs/TFMessage", "tf/tfMessage"};
  const MaybePath& shown = files.video ? files.video : files.corners;
  const auto bag = shown ? bags::bag_source(*shown) : std::nullopt;
  if (!bag || files.joints || files.flange) return;
  std::vector<std::string> topics;
  for (const bags::TopicCount& count : bags::look_into(bag->bag).topics)
    if (kPoses.contains(count.topic.type)) topics.push_back(count.topic.name);
  if (topics.empty()) return;
  files.warnings.push_back(
      fmt::format("{}: {} {} not read: are these poses of the flange? Write them to flange.csv",
                  bag->bag.string(), fmt::join(topics, ", "), topics.size() == 1 ? "is" : "are"));
}

/// Poses of the flange take the place of joint values where there are none.
void find_flange(RecordingFiles& files) {
  files.flange = find_file(std::nullopt, files.folder, "flange.csv", "");
  if (!files.flange) return;
  const MaybePath& preferred = files.joints ? files.joints : files.nominal;
  if (!preferred && files.entry != RecordingEntry::kPoints) return;
  files.warnings.push_back(fmt::format(
      "{} is not used: {}", files.flange->string(),
      preferred ? fmt::format("there is {}", preferred->string()) : "points have no rotation"));
  files.flange.reset();
}

}  // namespace

std::vector<fs::path> RecordingFiles::all() const {
  std::vector<fs::path> out;
  const MaybePath* seen[] = {&video, &corners, &poses, &points};
  const MaybePath& used = *seen[static_cast<std::size_t>(entry)];
  std::vector<const MaybePath*> files{&used, &joints, &flange, &camera, &tags, &settings, &nominal};
  for (const CameraFiles& one : cameras)
    files.insert(files.end(), {&one.video, &one.corners, &one.camera});
  for (const MaybePath* file : files) {
    if (!*file) continue;
    std::error_code error;
    const bool images = !recorded::container_of(**file) && fs::is_directory(**file, error);
    const std::vector<fs::path> parts = images ? sorted_files(**file) : recorded::parts_of(**file);
    out.insert(out.end(), parts.begin(), parts.end());
  }
  std::ranges::sort(out);
  const auto again = std::ranges::unique(out);  // a bag holds several of them
  out.erase(again.begin(), again.end());
  return out;
}

namespace {

/// Cameras that are named behind a bag or dataset are what is seen.
void refuse_other_sights(const RecordingPaths& paths) {
  const std::array<std::pair<const MaybePath*, const char*>, 4> others = {
      {{&paths.video, "--video"},
       {&paths.corners, "--corners"},
       {&paths.poses, "--poses"},
       {&paths.points, "--points"}}};
  for (const auto& [path, option] : others) {
    if (!*path) continue;
    throw bad_request(option, fmt::format("{} names cameras already", paths.folder.string()),
                      "name the cameras or the file");
  }
}

}  // namespace

RecordingFiles find_recording_files(const RecordingPaths& paths) {
  const std::vector<fs::path> parts = parts_apart(paths.folder);
  const bool several = parts.size() > 1;
  const auto container = recorded::container_of(parts.front());
  if (container && !fs::exists(container->path))
    throw bad_input(container->path.string(), "no such file", "check the path");
  const std::vector<fs::path> places =
      container ? recorded::places_of(*container) : std::vector<fs::path>{paths.folder};
  const fs::path& folder = places.front();
  check_folder(folder);
  RecordingFiles files;
  files.folder = folder;
  const bool seen_otherwise = paths.corners || paths.poses || paths.points;
  const bool named = paths.video || seen_otherwise;
  if (several) {
    refuse_other_sights(paths);
    take_cameras(parts, places, files);
  }
  if (!named && !container) find_cameras(folder, files);
  if (paths.video) {
    files.video = find_file(paths.video, folder, "", "--video");
  } else if (!seen_otherwise && !container && files.cameras.empty()) {
    files.video = find_video(folder);
  }
  // Of the files beside a bag or dataset those that it does not hold itself.
  const auto find = [&](const MaybePath& declared, const char* name, const char* option) {
    if (container && !declared) return MaybePath();
    return find_file(declared, folder, name, option);
  };
  const auto find_beside = [&](const MaybePath& declared, const char* name, const char* option) {
    MaybePath found = find_file(declared, folder, name, option);
    return found ? found : find_file(std::nullopt, places.back(), name, option);
  };
  files.joints = find(paths.joints, "joints.csv", "--joints");
  if (files.cameras.empty()) {
    files.camera = find_beside(paths.camera, "camera.yaml", "--camera");
  } else {
    check_camera_files(folder, paths, files);
  }
  files.tags = find_beside(paths.tags, "tags.yaml", "--tags");
  files.settings = find_beside(std::nullopt, "recording.yaml", "");
  files.corners = find(paths.corners, "corners.csv", "--corners");
  files.poses = find(paths.poses, "poses.csv", "--poses");
  files.points = find(paths.points, "points.csv", "--points");
  files.nominal = find_beside(paths.nominal, "nominal.urdf", "--nominal");
  const bool seen =
      files.video || files.corners || files.poses || files.points || !files.cameras.empty();
  if (container) {
    take_from_container(several ? without_camera(parts.front()) : paths.folder, files);
  } else if (!seen) {
    if (const MaybePath alone = container_in(folder)) take_from_container(*alone, files);
  } else {
    take_from_beside(files);
  }
  if (files.cameras.empty()) files.entry = choose_entry(paths, files);
  find_flange(files);
  if (!container) warn_of_unread_tables(files);
  warn_of_unread_poses(files);
  return files;
}

}  // namespace kinescope
