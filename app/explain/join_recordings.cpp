// SPDX-License-Identifier: Apache-2.0
#include "app/explain/join_recordings.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/same_place.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "kinematics/log/join_logs.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

void require_no_single_files(const RecordingPaths& paths) {
  const std::vector<std::pair<const char*, bool>> of_one{{"--video", paths.video.has_value()},
                                                         {"--joints", paths.joints.has_value()},
                                                         {"--corners", paths.corners.has_value()},
                                                         {"--poses", paths.poses.has_value()},
                                                         {"--points", paths.points.has_value()}};
  for (const auto& [option, is_given] : of_one) {
    if (!is_given) continue;
    throw bad_request(option, "it names a file of one recording, and several are given",
                      "put the file into that recording's folder");
  }
}

void require_different(const std::vector<fs::path>& folders) {
  for (std::size_t a = 0; a < folders.size(); ++a) {
    for (std::size_t b = a + 1; b < folders.size(); ++b) {
      if (!same_place(folders[a], folders[b])) continue;
      throw bad_request(folders[b].string(), "this recording is given twice",
                        "name each recording once");
    }
  }
}

// As part of a file's name.
std::string in_a_name(std::string text) {
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '.') c = '_';
  return text;
}

struct NamedFolder {
  std::string name;
  fs::path folder;
};

// By name, whichever way they were given.
std::vector<NamedFolder> named_folders(const std::vector<fs::path>& folders) {
  std::map<std::string, int> count;
  for (const fs::path& folder : folders) ++count[in_a_name(recording_name(folder))];
  std::set<std::string> taken;
  std::vector<NamedFolder> out;
  for (const fs::path& folder : folders) {
    std::string name = in_a_name(recording_name(folder));
    if (count[name] > 1) {
      const fs::path above = fs::absolute(folder).lexically_normal().parent_path();
      name.insert(0, in_a_name(recording_name(above)) + "_");
    }
    if (!taken.insert(name).second) {
      throw bad_request(folder.string(),
                        fmt::format("two of the recordings would be called {}", name),
                        "give their folders different names");
    }
    out.push_back({std::move(name), folder});
  }
  std::ranges::sort(out, {}, &NamedFolder::name);
  return out;
}

std::vector<fs::path> all_folders(const RecordingPaths& paths,
                                  const std::vector<fs::path>& further) {
  std::vector<fs::path> out{paths.folder};
  out.insert(out.end(), further.begin(), further.end());
  return out;
}

Error not_alike(const Recording& of, const std::string& what, const std::string& remedy) {
  return bad_request(of.folder.string(), what, remedy);
}

void require_one_fixed_camera(const Recording& of) {
  const std::string apart = "run that recording alone, and compare the runs (kinescope compare)";
  if (!of.cameras.empty())
    throw not_alike(of, "a recording of several cameras is not combined with others", apart);
  if (!of.flange.empty())
    throw not_alike(of, "a recording with a flange.csv is not combined with others", apart);
  if (of.log.empty()) {
    throw not_alike(of, "it has no joints.csv, which ties it to the other recordings",
                    "log the joints, or run it alone");
  }
  const bool in_targets =
      of.points && std::ranges::any_of(of.points->observations, [](const PointObservation& point) {
        return !point.position_m.has_value();
      });
  if (in_targets || !of.settings.target_distances.empty())
    throw not_alike(of, "points held in targets are not combined with other recordings", apart);
}

void require_same_markers(const Recording& first, const Recording& other) {
  const MarkerSet& a = first.markers;
  const MarkerSet& b = other.markers;
  if (a.family != b.family) {
    throw not_alike(other,
                    fmt::format("its markers are of {}, those of {} of {}", b.family,
                                first.camera_name, a.family),
                    "recordings of one robot have markers of one family");
  }
  std::set<TagId> ids;
  for (const MarkerSet* set : {&a, &b}) {
    for (const auto& [id, size] : set->sizes_m) ids.insert(id);
    for (const auto& [id, corners] : set->boards) ids.insert(id);
  }
  const bool alike =
      a.default_size_m == b.default_size_m && std::ranges::all_of(ids, [&](TagId id) {
        return a.size_m(id) == b.size_m(id) && a.boards.contains(id) == b.boards.contains(id) &&
               a.corners_m(id) == b.corners_m(id);
      });
  if (alike) return;
  throw not_alike(
      other,
      fmt::format("its tags.yaml gives markers other sizes than that of {}", first.camera_name),
      "give a marker of another size another id");
}

void require_same_robot(const Recording& first, const Recording& other) {
  if (first.entry != other.entry) {
    throw not_alike(other,
                    fmt::format("it enters by {}, {} by {}", to_string(other.entry),
                                first.camera_name, to_string(first.entry)),
                    "combine recordings of one kind");
  }
  const auto unit = [](const Recording& of, const std::string& channel) {
    const auto found = of.settings.units.find(channel);
    const auto factor = of.log.unit_factors.find(channel);
    return std::pair(found == of.settings.units.end() ? "not declared" : found->second,
                     factor == of.log.unit_factors.end() ? 1.0 : factor->second);
  };
  for (const std::string& channel : first.log.channels) {
    if (unit(first, channel) == unit(other, channel)) continue;
    throw not_alike(other,
                    fmt::format("the unit of '{}' is declared otherwise than in {}", channel,
                                first.camera_name),
                    "declare the same units in every recording.yaml");
  }
  require_same_markers(first, other);
}

void require_same_nominal(const std::vector<Recording>& recordings) {
  const Recording* first = nullptr;
  for (const Recording& recording : recordings) {
    if (!recording.nominal) continue;
    if (first == nullptr) first = &recording;
    if (read_text_file(first->nominal_file) == read_text_file(recording.nominal_file)) continue;
    throw not_alike(recording,
                    fmt::format("its nominal robot is not that of {}", first->camera_name),
                    "name one for all with --nominal");
  }
}

}  // namespace

std::vector<std::string> recording_names(const RecordingPaths& paths,
                                         const std::vector<fs::path>& further) {
  std::vector<std::string> out;
  for (NamedFolder& one : named_folders(all_folders(paths, further)))
    out.push_back(std::move(one.name));
  return out;
}

std::vector<Recording> read_recordings(const RecordingPaths& paths,
                                       const std::vector<fs::path>& further, const Shard& shard) {
  std::vector<Recording> out;
  if (further.empty()) {
    out.push_back(read_recording(paths));
    return out;
  }
  require_no_single_files(paths);
  const std::vector<fs::path> folders = all_folders(paths, further);
  require_different(folders);
  const std::vector<NamedFolder> named = named_folders(folders);
  for (std::size_t k = 0; k < named.size(); ++k) {
    if (!shard.holds(k)) continue;
    RecordingPaths of_one = paths;
    of_one.folder = named[k].folder;
    out.push_back(read_recording(of_one));
    require_one_fixed_camera(out.back());
    out.back().camera_name = named[k].name;
  }
  if (out.empty()) return out;
  for (const Recording& recording : out) require_same_robot(out.front(), recording);
  require_same_nominal(out);
  // Throws where the channels differ.
  static_cast<void>(logs_together(out, {}));
  return out;
}

Recording described_together(const std::vector<Recording>& recordings) {
  Recording out = recordings.front();
  if (recordings.size() == 1) return out;
  out.camera_name.clear();
  out.files.clear();
  out.warnings.clear();
  std::set<fs::path> files;
  for (const Recording& recording : recordings) {
    out.joined.push_back(recording.camera_name);
    files.insert(recording.files.begin(), recording.files.end());
    out.markers.sizes_m.insert(recording.markers.sizes_m.begin(), recording.markers.sizes_m.end());
    out.markers.boards.insert(recording.markers.boards.begin(), recording.markers.boards.end());
    for (const std::string& warning : recording.warnings)
      out.warnings.push_back(fmt::format("{}: {}", recording.camera_name, warning));
    if (!recording.log.torque_columns.empty()) {
      out.warnings.push_back(
          fmt::format("{}: its torques are not looked at beside other recordings (kinescope "
                      "dynamics takes several logs)",
                      recording.camera_name));
    }
    if (!out.nominal && recording.nominal) {
      out.nominal = recording.nominal;
      out.nominal_file = recording.nominal_file;
    }
  }
  out.files.assign(files.begin(), files.end());
  out.name = fmt::format("{}", fmt::join(out.joined, "_"));
  const bool one_name = std::ranges::all_of(recordings, [&](const Recording& recording) {
    return recording.settings.name == recordings.front().settings.name;
  });
  if (!one_name) out.settings.name = out.name;
  out.folder = fs::absolute(recordings.front().folder).lexically_normal();
  if (out.folder.filename().empty()) out.folder = out.folder.parent_path();
  out.folder = out.folder.parent_path();
  out.log.torque_columns.clear();
  return out;
}

JointLog logs_together(const std::vector<Recording>& recordings,
                       const std::vector<double>& starts_s) {
  JointLog out = recordings.front().log;
  for (double& t : out.times_s) t += starts_s.empty() ? 0.0 : starts_s.front();
  for (double& t : out.joined_at_s) t += starts_s.empty() ? 0.0 : starts_s.front();
  for (std::size_t k = 1; k < recordings.size(); ++k) {
    const JointLog& next = recordings[k].log;
    // Anywhere behind, where nobody asks for the stamps.
    const double start_s =
        starts_s.empty() ? out.times_s.back() - next.times_s.front() + 1.0 : starts_s[k];
    out = joined_logs(std::move(out), next, start_s, true);
  }
  std::vector<std::string> sources;
  for (const Recording& recording : recordings) sources.push_back(recording.log.source);
  out.source = fmt::format("{}", fmt::join(sources, ", "));
  out.torque_columns.clear();
  return out;
}

}  // namespace kinescope
