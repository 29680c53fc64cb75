// SPDX-License-Identifier: Apache-2.0
//
// Takes   a recording's folder, bag or dataset (and files named on the command line in place of
// those in
//         it).
// Gives   Recording: everything declared and logged, read and checked; the video is only found, not
// decoded.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/bundle/measurements.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/marker_set.h"
#include "calib/camera/tag_observations.h"
#include "calib/hand_eye/hand_eye.h"
#include "kinematics/core/error.h"
#include "kinematics/log/joint_log.h"
#include "kinematics/model/kinematic_tree.h"
#include "kinematics/structure/pose_tracks.h"

namespace kinescope {

/// Files named on the command line; each takes the place of the one in the folder.
struct RecordingPaths {
  /// or a bag, "FILE" or "FILE:/topic", or a LeRobot dataset, "FOLDER" or "FOLDER:camera:episodes"
  std::filesystem::path folder;
  std::optional<std::filesystem::path> video, joints, camera, tags, corners, poses, points, nominal;
};

/// recording.yaml as a value. Its keys: name, torques, gravity, fixed_tags, video_start,
/// target_distances (list of from, to, distance, sigma), units (channel: unit), camera_mount,
/// gravity_camera, flange; video_start may hold one number for each of several cameras.
struct RecordingSettings {
  std::string name;                          ///< of the robot; default: the folder's name
  std::vector<std::string> torque_channels;  ///< columns of joints.csv beside those named tau*
  std::optional<Eigen::Vector3d> gravity;    ///< in the camera's frame, any length
  std::vector<TagId> fixed_tags;             ///< declared at rest in the camera's frame
  double video_start_s =
      0.0;  ///< added to the video's times: time of its first stamp on the log's clock
  std::map<std::string, double> video_starts_s;  ///< the same by the name of a camera, of several
  std::string gravity_camera;  ///< the camera in whose frame `gravity` is, of several
  std::vector<TargetDistance> target_distances;
  /// channel: rad, deg, m, mm, ticks. read_recording() turns deg to rad and mm to m, in the log and
  /// here.
  std::map<std::string, std::string> units;
  /// "hand" (on the robot), "fixed" or "carried" (by a person: not beside a flange.csv).
  std::optional<CameraMount> camera_mount;
  /// How flange.csv is to be read: flange (rotation, conjugate, unit, row_offset).
  std::optional<FlangeDeclaration> flange;
};

/// How far into the path the recording enters.
enum class RecordingEntry { kVideo, kCorners, kPoses, kPoints };

/// "video", "corners", "poses", "points".
[[nodiscard]] std::string_view to_string(RecordingEntry entry);

/// One of several fixed cameras: video_NAME, images_NAME or corners_NAME.csv, camera_NAME.yaml.
struct RecordedCamera {
  std::string name;
  std::filesystem::path video;             ///< as Recording::video
  std::optional<TagObservations> corners;  ///< corners_NAME.csv
  std::optional<CameraModel> camera;       ///< none: to be estimated
  std::filesystem::path camera_file;
};

struct Recording {
  std::filesystem::path folder;
  std::string name;  ///< of the folder, bag or dataset
  RecordingSettings settings;
  RecordingEntry entry = RecordingEntry::kVideo;
  std::filesystem::path video;              ///< file or image folder; empty unless entry is kVideo
  std::optional<TagObservations> corners;   ///< corners.csv
  std::optional<PoseTracks> poses;          ///< poses.csv
  std::optional<PointObservations> points;  ///< points.csv
  JointLog log;                             ///< empty when there is no joints.csv
  /// flange.csv, in place of joints.csv: each way to read its columns; empty when there is none.
  std::vector<FlangeReading> flange;
  std::optional<CameraModel> camera;  ///< none: to be estimated
  std::filesystem::path camera_file;  ///< that it was read from
  /// Two or more, by name, in place of `video`, `corners` and `camera`; empty: one camera.
  std::vector<RecordedCamera> cameras;
  std::string camera_name;  ///< of a part that of_camera() gave, of one of several recordings; else
                            ///< empty
  std::vector<std::string> joined;  ///< names of the recordings that it stands for; empty: one
  MarkerSet markers;
  std::optional<KinematicTree> nominal;
  std::filesystem::path nominal_file;        ///< that it was read from
  std::vector<std::filesystem::path> files;  ///< everything that was read, sorted
  std::vector<std::string> warnings;
};

/// Reads and checks everything but the video's frames. Throws Error (file, place, remedy).
[[nodiscard]] Recording read_recording(const RecordingPaths& paths);

/// The recording as if this one of its cameras were the only one.
[[nodiscard]] Recording of_camera(const Recording& recording, const RecordedCamera& camera);

/// What can be read although something is wrong, and all that is wrong.
struct ReadAttempt {
  Recording recording;
  std::vector<Error> errors;  ///< in the order met; empty when read_recording() would not throw
};

/// As read_recording(), but goes on behind an error. Throws nothing for a bad recording.
[[nodiscard]] ReadAttempt try_read_recording(const RecordingPaths& paths);

/// The name of a recording's folder, also where its path ends in a slash or a dot.
[[nodiscard]] std::string recording_name(const std::filesystem::path& folder);

/// Throws bad_input when the log and the times (on the log's clock) of `source` have no moment in
/// common. Nothing to check where there is no log.
void require_time_overlap(const JointLog& log, const std::vector<double>& times_s,
                          const std::string& source);

/// The same for poses of a flange; of numbered ones, one of the times must be one of the numbers.
void require_time_overlap(const PoseLog& log, const std::vector<double>& times_s,
                          const std::string& source);

/// The single readers, for the same files anywhere. Those of tables leave a few bad rows out
/// (bad_rows.h) and say so; those of corners in the observations' warnings.
/// tags.yaml: family, default_size, sizes (id: size), tags (list of id, size), boards (id: columns,
/// rows, square: the inner corners of a chessboard row by row, x right, y down), only_listed.
[[nodiscard]] MarkerSet read_marker_set(const std::filesystem::path& path);
[[nodiscard]] RecordingSettings read_recording_settings(const std::filesystem::path& path);
/// corners.csv: t,tag,corner,u,v[,sigma] (px; corner from 0), one row a corner.
[[nodiscard]] TagObservations read_corners(const std::filesystem::path& path,
                                           const MarkerSet& markers);
/// What a reader gives, and one line each for what it left out.
template <typename Found>
struct ReadSightings {
  Found found;
  std::vector<std::string> warnings;
};
/// poses.csv: t,body,x,y,z,qx,qy,qz,qw[,sigma_m,sigma_rad] (m; body in the camera's or tracker's
/// frame). Positions that span more than a hall are taken as mm, with a warning.
[[nodiscard]] ReadSightings<PoseTracks> read_poses(const std::filesystem::path& path);
/// flange.csv: t (or row, index, frame, image, pose: a number), x,y,z, and qx,qy,qz,qw (by name in
/// any order) or three angles: roll,pitch,yaw; w,p,r; a,b,c; rx,ry,rz (a rotation vector or angles:
/// two readings). Names in any case, also q1..q4 and those of ROS messages (pose.position.x).
/// Angles are in the header's unit, else in rad; in degrees where one is beyond a turn. Positions
/// beyond any robot's reach are taken as mm, with a warning. Behind the usual readings stand those
/// of other conventions (FlangeReading::usual), unless `as` says which one it is.
[[nodiscard]] ReadSightings<std::vector<FlangeReading>> read_flange(
    const std::filesystem::path& path, const std::optional<FlangeDeclaration>& as = {});
/// And behind them each with the poses one row (or number) later and earlier, as off by one.
[[nodiscard]] std::vector<FlangeReading> with_moved_rows(std::vector<FlangeReading> readings);
/// points.csv: t,point,x,y,z[,sigma][,target]; empty x,y,z: held in the named target, whose place
/// is unknown.
[[nodiscard]] ReadSightings<PointObservations> read_points(const std::filesystem::path& path);

}  // namespace kinescope
