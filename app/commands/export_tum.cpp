// SPDX-License-Identifier: Apache-2.0
//
// Paths of links and camera, a file each, as the TUM RGB-D benchmark has them (Sturm et al., "A
// benchmark for the evaluation of RGB-D SLAM systems", 2012): `timestamp tx ty tz qx qy qz qw`.
#include <iterator>
#include <set>

#include <fmt/format.h>

#include "app/commands/export_form.h"
#include "app/io/output_folder.h"
#include "app/report/result_values.h"

namespace kinescope {
namespace {

// A path over the recording's frames; not finite where it is not known.
struct ExportedPath {
  std::string name;
  std::vector<Pose> poses;
};

bool is_known_pose(const Pose& pose) {
  return pose.translation.allFinite() && pose.rotation.coeffs().allFinite();
}

// In the frame of the camera at each instant.
void into_camera(const std::vector<Pose>& T_base_camera, std::vector<Pose>& poses) {
  for (std::size_t f = 0; f < poses.size(); ++f) poses[f] = T_base_camera[f].inverse() * poses[f];
}

std::vector<ExportedPath> paths_of(const RecordedRun& recorded, bool in_camera) {
  const Calibration& calibration = recorded.run.calibration;
  std::vector<ExportedPath> out;
  const std::size_t first = in_camera ? 0 : 1;  // the base rests in its own frame
  for (std::size_t link = first; link < calibration.tree.links.size(); ++link) {
    ExportedPath path{calibration.tree.links[link].name, {}};
    for (const std::vector<Pose>& links : recorded.T_base_link) path.poses.push_back(links[link]);
    out.push_back(std::move(path));
  }
  if (in_camera)
    for (ExportedPath& path : out) into_camera(recorded.T_base_camera, path.poses);
  if (!in_camera && calibration.moving)
    out.push_back({"camera_optical_frame", recorded.T_base_camera});
  return out;
}

// Of a link whose name may hold anything; no two alike.
std::string file_name(const std::string& link, std::set<std::string>& taken) {
  std::string out = link;
  for (char& c : out) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '_' || c == '-' || c == '.';
    if (!plain) c = '_';
  }
  if (out.empty() || out.front() == '.') out.insert(0, "_");
  while (!taken.insert(out).second) out += '_';
  return out + ".tum";
}

// The quaternion goes on in small steps; q and -q are one rotation.
std::string tum_text(const ExportedPath& path, const std::vector<double>& times_s,
                     std::string_view frame) {
  std::string out = fmt::format(
      "# {} in the frame of {} (m, unit quaternion), written by Kinescope {}\n"
      "# timestamp: s, of the recording's frames on the camera's clock\n"
      "# timestamp tx ty tz qx qy qz qw\n",
      path.name, frame, program_version());
  Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
  for (std::size_t f = 0; f < path.poses.size(); ++f) {
    if (!is_known_pose(path.poses[f])) continue;
    Eigen::Quaterniond q = path.poses[f].rotation.normalized();
    if (q.dot(last) < 0.0) q.coeffs() *= -1.0;
    last = q;
    const Eigen::Vector3d& p = path.poses[f].translation;
    fmt::format_to(std::back_inserter(out), "{} {} {} {} {} {} {} {}\n", times_s[f], p.x(), p.y(),
                   p.z(), q.x(), q.y(), q.z(), q.w());
  }
  return out;
}

}  // namespace

ExportForm export_tum(const ExportOptions& options) {
  const RecordedRun recorded = read_recorded_run(options.source, "--tum");
  require_apart(options.tum, recorded.inputs);
  const std::string_view frame = options.tum_in_camera ? "the camera" : "the base";
  ExportForm out;
  out.folder = options.tum;
  out.inputs = recorded.inputs;
  nlohmann::json files = nlohmann::json::object();
  std::set<std::string> taken;
  for (const ExportedPath& path : paths_of(recorded, options.tum_in_camera)) {
    const std::string file = file_name(path.name, taken);
    const auto poses = std::ranges::count_if(path.poses, is_known_pose);
    files[report::text(path.name)] = {{"file", file}, {"poses", poses}};
    out.files.push_back({file, tum_text(path, recorded.joints.times_s, frame)});
    if (poses == 0) out.warnings.push_back(fmt::format("{} is known in no frame", path.name));
  }
  out.result["tum"] = {{"folder", report::text(options.tum.string())},
                       {"frame", options.tum_in_camera ? "camera" : "base"},
                       {"paths", files}};
  out.lines = {fmt::format("tum     {} ({} paths in the frame of {}, {} frames)",
                           options.tum.string(), out.files.size(), frame,
                           recorded.joints.times_s.size())};
  return out;
}

}  // namespace kinescope
