// SPDX-License-Identifier: Apache-2.0
//
// Measured hand-eye sets of others through `kinescope run`: hand_eye_real [SET..]
// Targets are poses (AUBO, FR3, UR10), the corners of a chessboard (KUKA; its lens from the same
// images) or 17 markers of a ChArUco board (ABB; likewise).
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "kinematics/core/file.h"
#include "tests/experiments/real_files.h"
#include "tests/truth/shared_data.h"
#include "tests/truth/temporary_path.h"

namespace {

namespace fs = std::filesystem;
using namespace kinescope;
using real::Columns;

Pose fixed_axes(const Eigen::Vector3d& a, const Eigen::Vector3d& p) {
  return {exp_rotation({0.0, 0.0, a.z()}) * exp_rotation({0.0, a.y(), 0.0}) *
              exp_rotation({a.x(), 0.0, 0.0}),
          p};
}

Eigen::Vector3d three(const Columns& table, std::size_t row,
                      const std::array<const char*, 3>& names) {
  return {table.number(row, names[0]), table.number(row, names[1]), table.number(row, names[2])};
}

struct Rows {
  std::vector<Pose> flange;
  std::vector<Pose> target;  // in the camera's frame; empty: seen otherwise
};

void write_rows(const fs::path& folder, const Rows& rows) {
  std::string flange = "row,x,y,z,qx,qy,qz,qw\n";
  std::vector<real::PoseRow> poses;
  for (std::size_t i = 0; i < rows.flange.size(); ++i) {
    const Eigen::Vector3d& p = rows.flange[i].translation;
    const Eigen::Vector4d q = rows.flange[i].rotation.coeffs();
    flange +=
        fmt::format("{},{},{},{},{},{},{},{}\n", i, p.x(), p.y(), p.z(), q[0], q[1], q[2], q[3]);
    if (rows.target.empty()) continue;
    real::PoseRow row;
    row.time_s = static_cast<double>(i);
    row.pose = rows.target[i];
    poses.push_back(row);
  }
  real::write_text(folder, "flange.csv", flange);
  if (!poses.empty()) real::write_poses(folder, poses);
}

void aubo(const fs::path& data, const fs::path& folder) {
  constexpr double kDegree = 0.017453292519943295;
  const Columns table(data / "poses.csv");
  Rows out;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const auto pose = [&](const std::string& of) {
      const Eigen::Vector3d a(table.number(r, of + "_rx_deg"), table.number(r, of + "_ry_deg"),
                              table.number(r, of + "_rz_deg"));
      return fixed_axes(kDegree * a, table.vector3(r, of + "_"));
    };
    out.flange.push_back(pose("base_T_hand"));
    out.target.push_back(pose("cam_T_marker"));
  }
  write_rows(folder, out);
}

void fr3(const fs::path& data, const fs::path& folder) {
  const Columns table(data / "measurements.csv");
  Rows out;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    out.flange.push_back(table.pose(r, "base_T_tcp_nominal_"));
    out.target.push_back(table.pose(r, "board_T_camera_").inverse());
  }
  write_rows(folder, out);
}

// The published table of Denavit and Hartenberg.
Pose ur10_flange(const std::array<double, 6>& q) {
  constexpr std::array<double, 6> kA{0.0, -0.612, -0.5723, 0.0, 0.0, 0.0};
  constexpr std::array<double, 6> kD{0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922};
  constexpr std::array<double, 6> kQuarters{1.0, 0.0, 0.0, 1.0, -1.0, 0.0};
  Pose out;
  for (std::size_t k = 0; k < q.size(); ++k) {
    const Pose turn{exp_rotation({0.0, 0.0, q[k]}), {0.0, 0.0, kD[k]}};
    const Pose twist{exp_rotation({kQuarters[k] * M_PI_2, 0.0, 0.0}), {kA[k], 0.0, 0.0}};
    out = out * turn * twist;
  }
  return out;
}

void ur10(const fs::path& data, const fs::path& folder) {
  constexpr std::array kJoints{"shoulder_pan", "shoulder_lift", "elbow",
                               "wrist_1",      "wrist_2",       "wrist_3"};
  const Columns table(data / "measurements.csv");
  Rows out;
  for (std::size_t r = 0; r < table.rows(); ++r) {
    std::array<double, 6> q{};
    for (std::size_t k = 0; k < q.size(); ++k)
      q[k] = table.number(r, fmt::format("{}_joint_rad", kJoints[k]));
    out.flange.push_back(ur10_flange(q));
    out.target.push_back(fixed_axes(three(table, r, {"roll_x_rad", "pitch_y_rad", "yaw_z_rad"}),
                                    three(table, r, {"x_m", "y_m", "z_m"})));
  }
  write_rows(folder, out);
}

Rows logged(const Columns& table, const std::string& prefix) {
  Rows out;
  for (std::size_t r = 0; r < table.rows(); ++r) out.flange.push_back(table.pose(r, prefix));
  return out;
}

void calibrate_lens(const fs::path& data, const BoardSpec& board, const fs::path& folder) {
  CameraOptions camera;
  camera.source = data / "images";
  camera.board = board;
  camera.output = folder / "camera.yaml";
  camera.force = true;
  static_cast<void>(camera_command(camera, {.json = false, .quiet = true, .progress = {}}));
}

void kuka(const fs::path& data, const fs::path& folder) {
  write_rows(folder, logged(Columns(data / "robot_poses.csv"), "base_T_flange_"));
  const Columns corners(data / "derived_corners.csv");
  std::string text = "t,tag,corner,u,v\n";
  for (std::size_t r = 0; r < corners.rows(); ++r)
    text += fmt::format("{},0,{},{},{}\n", corners.text(r, "index"), corners.text(r, "corner"),
                        corners.text(r, "u_px"), corners.text(r, "v_px"));
  real::write_text(folder, "corners.csv", text);
  real::write_text(folder, "tags.yaml",
                   "family: tag36h11\nonly_listed: true\n"
                   "boards: {0: {columns: 28, rows: 17, square: 0.02}}\n");
  BoardSpec board;
  board.columns = 28;
  board.rows = 17;
  board.square_m = 0.02;
  calibrate_lens(data, board, folder);
}

void abb(const fs::path& data, const fs::path& folder) {
  const Columns table(data / "robot_poses.csv");
  write_rows(folder, logged(table, "base_T_wrist_"));
  fs::create_directories(folder / "images");
  std::string times = "image,t\n";
  for (std::size_t r = 0; r < table.rows(); ++r) {
    const fs::path image = data / table.text(r, "image");
    const fs::path link = folder / "images" / image.filename();
    if (!fs::exists(link)) fs::create_symlink(fs::absolute(image), link);
    times += fmt::format("{},{}\n", image.filename().string(), r);
  }
  real::write_text(folder / "images", "times.csv", times);
  BoardSpec board;
  board.type = BoardType::kCharuco;
  board.columns = 5;
  board.rows = 7;
  board.square_m = 0.036195;
  board.marker_m = 0.018256;
  board.dictionary = "DICT_6X6_250";
  calibrate_lens(data, board, folder);
  real::write_text(folder, "tags.yaml", "family: DICT_6X6_250\ndefault_size: 0.018256\n");
}

struct Set {
  const char* folder;
  void (*convert)(const fs::path& data, const fs::path& folder);
};

void report(const std::string& name, const fs::path& run) {
  constexpr double kMillimetres = 1e3;
  constexpr double kDegrees = 57.29577951308232;
  const auto result = nlohmann::json::parse(read_text_file(run / "hand_eye.json"));
  const auto words = [&](const char* which) {
    const auto& e = result.at("errors").at(which);
    return fmt::format("{:6.2f} mm {:6.3f} deg", kMillimetres * e.at("m").get<double>(),
                       kDegrees * e.at("rad").get<double>());
  };
  fmt::print("{:6} camera {:6} {:3} of {:3} poses  fitted {}  held out {}\n", name,
             result.at("camera_mount").get<std::string>(),
             result.at("errors").at("held_out").at("poses").get<int>(), result.at("poses").size(),
             words("fitted"), words("held_out"));
}

}  // namespace

int main(int argc, char** argv) {
  const std::map<std::string, Set> sets{{"abb", {"abb_charuco_wrist", abb}},
                                        {"aubo", {"aubo_i5_handeye", aubo}},
                                        {"fr3", {"franka_fr3_eye_in_hand", fr3}},
                                        {"kuka", {"kuka_linear_chessboard", kuka}},
                                        {"ur10", {"ur10_realsense_chessboard", ur10}}};
  std::vector<std::string> names(argv + 1, argv + argc);
  if (names.empty())
    for (const auto& [name, set] : sets) names.push_back(name);
  for (const std::string& name : names) {
    if (!sets.contains(name)) {
      fmt::print(stderr, "hand_eye_real: no set '{}' (abb, aubo, fr3, kuka, ur10)\n", name);
      return 2;
    }
    const Set& set = sets.at(name);
    const auto data = shared_data(fmt::format("vision/{}", set.folder));
    if (!data) {
      fmt::print("{}: not on this machine, skipped\n", name);
      continue;
    }
    const fs::path folder = truth::temporary_path("hand_eye_" + name);
    fs::create_directories(folder);
    set.convert(*data, folder);
    RunOptions options;
    options.recording.folder = folder;
    options.output = folder.string() + "_run";
    options.trace = false;
    try {
      static_cast<void>(run_command(options, {.json = false, .quiet = true, .progress = {}}));
      report(name, options.output);
    } catch (const Error& error) {
      fmt::print("{}: {}\n", name, error.what());
    }
  }
  return 0;
}
