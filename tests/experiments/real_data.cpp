// SPDX-License-Identifier: Apache-2.0
//
// The program on measured recordings of others, beside the first fits that were made of them by
// other means. Usage: real_data [SET...]; without names all. The recordings are read from
// $KINESCOPE_SHARED_DATA/vision (or
// ../shared/data/vision beside the sources); the folders of the runs are temporary.
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "calib/vision/board.h"
#include "tests/experiments/real_run.h"
#include "tests/experiments/real_sets.h"
#include "tests/truth/shared_data.h"

namespace kinescope::real {
namespace {

namespace fs = std::filesystem;

/// One line of the table.
struct Line {
  std::string set;
  std::string found;
  std::string fit;       ///< all sightings seen by the model
  std::string postures;  ///< held out: postures unlike those the model has seen
  std::string lot;       ///< held out: postures drawn by lot, outliers counted in
  std::string first_fit;
  std::string reached;
};

struct Folders {
  fs::path data;
  fs::path recording;
  fs::path run;
};

struct Set {
  std::string name;
  std::string folder;  ///< below vision/
  std::function<std::vector<Line>(const Folders&)> judge;
};

std::string text(const Length& length) {
  std::string out = fmt::format("{:.3f} mm", length.mm);
  if (length.deg > 0.0) out += fmt::format(" {:.3f} deg", length.deg);
  return out;
}

void print_details(const std::string& name, const Outcome& o) {
  const Errors& e = o.errors;
  fmt::print("== {}: exit {}{}{}\n", name, static_cast<int>(o.code), o.message.empty() ? "" : ": ",
             o.message);
  if (!o.status.empty()) {
    fmt::print("   structure {}, probability {:.4f}: {} [{}]\n", o.status, o.probability, o.types(),
               o.order());
    for (const FoundJoint& joint : o.joints) {
      fmt::print("   {} {} -> {} {} x {:.5f}\n", joint.type, joint.parent, joint.child,
                 joint.channel, joint.scale);
    }
  }
  for (const std::string& doubt : o.doubts) fmt::print("   doubt: {}\n", doubt);
  if (o.calibrated) {
    fmt::print(
        "   before {}; fit {}; held out {} (median {}; outliers counted in {}; {:.3f} px); "
        "{} sightings, {} rejected\n",
        text(e.before), text(e.fit), text(e.held_out), text(e.held_out_median),
        text(e.held_out_all), e.held_out_px, e.sightings, e.rejected);
  }
  const nlohmann::json trace =
      o.result.is_object() ? o.result.value("trace", nlohmann::json()) : nlohmann::json();
  if (trace.is_object()) {
    fmt::print("   traced: {}: {}; {:.4g} -> {:.4g} {}\n", trace.value("verdict", ""),
               trace.value("reason", ""), trace["held_out_before"].value("value", 0.0),
               trace["held_out_after"].value("value", 0.0),
               trace["held_out_after"].value("unit", ""));
    for (const nlohmann::json& effect : trace["accepted"]) {
      fmt::print("     {} at {}: {:.4g} {} [{:.4g} {:.4g}]\n", effect.value("effect", ""),
                 effect.value("place", ""), effect.value("size", 0.0), effect.value("unit", ""),
                 effect["interval"][0].get<double>(), effect["interval"][1].get<double>());
    }
  }
  fmt::print("   {:.1f} s\n", o.seconds);
  std::fflush(stdout);
}

std::string structure_text(const Outcome& o) {
  if (o.joints.empty()) {
    return fmt::format("no joint, {} links, {} free tags", o.links.size(), o.free_tags.size());
  }
  std::string letters;
  for (const FoundJoint& joint : o.joints) {
    letters += static_cast<char>(std::toupper(static_cast<unsigned char>(joint.type.front())));
  }
  return fmt::format("{} [{}]", letters, o.order().empty() ? "no log" : o.order());
}

std::string held_out_text(const Errors& e) {
  return text(e.held_out) +
         (e.rejected > 0 ? fmt::format(" (-{}/{})", e.rejected, e.sightings) : std::string());
}

bool within(const Length& length, const Length& limit) {
  return length.mm <= limit.mm && (limit.deg == 0.0 || length.deg <= limit.deg);
}

CalibrateOptions options_for(FreeGeometry free, bool by_lot) {
  CalibrateOptions options;
  options.free = free;
  options.folds_by_lot = by_lot;
  return options;
}

/// Runs a recording twice: held out by posture, and by lot as first fits do it.
Line judge_structure(const std::string& name, const RecordingPaths& paths, const fs::path& run,
                     const std::string& types, const std::string& order, const Length& first_fit) {
  const Outcome o = run_recording(paths, run / "postures");
  print_details(name, o);
  const Outcome lot = run_recording(paths, run / "lot", options_for(FreeGeometry::kGeometry, true));
  print_details(name + ", folds by lot", lot);
  const bool structure = o.types() == types && o.order() == order;
  const bool accurate =
      within(o.errors.held_out, first_fit) || within(lot.errors.held_out_all, first_fit);
  const bool fitted = within(o.errors.fit, first_fit);
  return {name,
          structure_text(o),
          text(o.errors.fit),
          held_out_text(o.errors),
          text(lot.errors.held_out_all),
          first_fit.mm > 0.0 ? text(first_fit) : "none",
          fmt::format("structure {}{}", structure ? "yes" : "no",
                      first_fit.mm == 0.0 ? ""
                      : accurate          ? ", error yes"
                      : fitted            ? ", error in the fit only"
                                          : ", error no")};
}

std::vector<Line> judge_positioner(const Folders& f) {
  return {judge_structure("positioner_2r", positioner(f.data, f.recording), f.run,
                          "revolute revolute", "joint_1 joint_2", {0.40, 0.053})};
}

std::vector<Line> judge_sweeps(const Folders& f) {
  return {judge_structure("laser_sweeps", laser_sweeps(f.data, f.recording), f.run,
                          "revolute revolute revolute revolute revolute revolute",
                          "j1 j2 j3 j4 j5 j6", {0.04, 0.0})};
}

std::vector<Line> judge_door(const Folders& f) {
  return {judge_structure("door (poses)", door_poses(f.data, f.recording / "poses"),
                          f.run / "poses", "revolute", "", {0.87, 0.57}),
          judge_structure("door (video)", door_video(f.data, f.recording / "video"),
                          f.run / "video", "revolute", "", {})};
}

std::vector<Line> judge_kuka(const Folders& f) {
  BoardSpec board;
  board.columns = 28;
  board.rows = 17;
  board.square_m = 0.02;
  const IntrinsicCalibration intrinsics = calibrate_intrinsics(f.data / "images", board);
  fmt::print("== kuka: fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f}, {:.3f} px, {:.3f} px held out\n",
             intrinsics.camera.fx, intrinsics.camera.fy, intrinsics.camera.cx, intrinsics.camera.cy,
             intrinsics.rms_px, intrinsics.held_out_rms_px);
  return {judge_structure("kuka_chessboard",
                          kuka_chessboard(f.data, f.recording, intrinsics.camera), f.run,
                          "prismatic prismatic", "flange_y flange_z", {})};
}

std::vector<Line> judge_tagslam(const std::string& name, const std::string& topic,
                                const Folders& f) {
  const Outcome o = run_recording(tagslam(f.data, f.recording, topic), f.run);
  print_details(name, o);
  for (const auto& link : o.links) {
    fmt::print("   link:");
    for (const int tag : link) fmt::print(" {}", tag);
    fmt::print("\n");
  }
  fmt::print("   free:");
  for (const int tag : o.free_tags) fmt::print(" {}", tag);
  fmt::print("\n");
  bool mixed = false;
  for (const auto& link : o.links) {
    const auto bodies = tagslam_bodies(f.data);
    std::size_t owners = 0;
    for (const TagBody& body : bodies) {
      if (std::ranges::any_of(link,
                              [&](int tag) { return std::ranges::count(body.tags, tag) > 0; }))
        ++owners;
    }
    mixed = mixed || owners > 1;
  }
  const bool joint =
      std::ranges::any_of(o.joints, [](const FoundJoint& j) { return j.type != "fixed"; });
  const bool ran = !o.status.empty();
  return {{name, structure_text(o), "", "", "", "none",
           ran && !joint && !mixed ? "structure yes" : "structure no"}};
}

struct Level {
  FreeGeometry free;
  const char* name;
  Length first_fit;
};

std::vector<Line> judge_levels(const std::string& name, const RecordingPaths& paths,
                               const fs::path& run, const std::vector<Level>& levels) {
  std::vector<Line> lines;
  for (const Level& l : levels) {
    const Outcome o = run_recording(paths, run / l.name, options_for(l.free, false));
    print_details(fmt::format("{}, {}", name, l.name), o);
    const Outcome lot = run_recording(paths, run / l.name, options_for(l.free, true));
    print_details(fmt::format("{}, {}, folds by lot", name, l.name), lot);
    const bool by_posture = within(o.errors.held_out, l.first_fit);
    const bool by_lot = within(lot.errors.held_out_all, l.first_fit);
    lines.push_back({name, l.name, text(o.errors.fit), held_out_text(o.errors),
                     text(lot.errors.held_out_all),
                     l.first_fit.mm > 0.0 ? text(l.first_fit) : "none",
                     !o.calibrated           ? "did not run"
                     : l.first_fit.mm == 0.0 ? ""
                     : by_posture            ? "yes"
                     : by_lot                ? "yes, by lot"
                                             : "no"});
  }
  return lines;
}

std::vector<Set> all_sets() {
  using enum FreeGeometry;
  std::vector<Set> sets;
  sets.push_back({"positioner_2r", "positioner_2r", judge_positioner});
  sets.push_back({"laser_sweeps", "industrial_arm_laser_sweeps", judge_sweeps});
  sets.push_back({"door", "door_hinge_aruco", judge_door});
  sets.push_back({"kuka_chessboard", "kuka_linear_chessboard", judge_kuka});
  sets.push_back({"tagslam_block_tumble", "tagslam_block_tumble", [](const Folders& f) {
                    return judge_tagslam("tagslam_block_tumble", "/detector/tags", f);
                  }});
  sets.push_back({"tagslam_stereo_cube", "tagslam_stereo_cube", [](const Folders& f) {
                    return judge_tagslam("tagslam_stereo_cube", "/detector_0/tags", f);
                  }});
  sets.push_back({"tagslam_board_d435", "tagslam_board_d435", [](const Folders& f) {
                    return judge_tagslam("tagslam_board_d435", "/camera/color/tags", f);
                  }});
  const auto balls = [&](const std::string& stem, double offsets_mm) {
    sets.push_back({"mukca_" + stem, "mukca_ball_socket", [stem, offsets_mm](const Folders& f) {
                      return judge_levels("mukca_" + stem,
                                          ball_socket(f.data, f.recording, stem + ".csv"), f.run,
                                          {{kPlacement, "placement", {0.0, 0.0}},
                                           {kOffsets, "offsets", {offsets_mm, 0.0}},
                                           {kGeometry, "geometry", {offsets_mm, 0.0}}});
                    }});
  };
  balls("panda_2", 0.95);
  balls("panda_3", 1.31);
  balls("kuka_14", 0.0);
  sets.push_back({"franka_fr3", "franka_fr3_eye_in_hand", [](const Folders& f) {
                    return judge_levels("franka_fr3", franka_fr3(f.data, f.recording), f.run,
                                        {{kPlacement, "placement", {4.43, 0.744}},
                                         {kOffsets, "offsets", {1.96, 0.319}},
                                         {kGeometry, "geometry", {1.49, 0.220}}});
                  }});
  sets.push_back({"motoman", "motoman_dual_arm_aruco", [](const Folders& f) {
                    return judge_levels("motoman", motoman_tracker(f.data, f.recording), f.run,
                                        {{kPlacement, "placement", {0.241, 0.0}},
                                         {kOffsets, "offsets", {0.146, 0.0}},
                                         {kGeometry, "geometry", {0.071, 0.0}}});
                  }});
  sets.push_back({"ur10", "ur10_realsense_chessboard", [](const Folders& f) {
                    return judge_levels("ur10", ur10_chessboard(f.data, f.recording), f.run,
                                        {{kPlacement, "placement", {13.4, 0.57}},
                                         {kOffsets, "offsets", {13.6, 0.57}},
                                         {kGeometry, "geometry", {4.2, 0.40}}});
                  }});
  sets.push_back({"mover6", "mover6_apriltag", [](const Folders& f) {
                    return judge_levels("mover6", mover6(f.data, f.recording), f.run,
                                        {{kPlacement, "placement", {0.0, 0.0}},
                                         {kGeometry, "geometry", {0.0, 0.0}}});
                  }});
  return sets;
}

int run(const std::vector<std::string>& wanted) {
  const ScratchFolder scratch("real_data");
  std::vector<Line> table;
  for (const Set& set : all_sets()) {
    if (!wanted.empty() && std::ranges::find(wanted, set.name) == wanted.end()) continue;
    const auto data = shared_data("vision/" + set.folder);
    if (!data) {
      table.push_back({set.name, "not on this machine", "", "", "", "", "no data"});
      continue;
    }
    for (Line& line : set.judge(
             {*data, scratch.path() / set.name / "recording", scratch.path() / set.name / "run"})) {
      table.push_back(std::move(line));
    }
  }
  const auto row = [](const Line& l) {
    fmt::print("{:<22} {:<36} {:<20} {:<29} {:<20} {:<20} {}\n", l.set, l.found, l.fit, l.postures,
               l.lot, l.first_fit, l.reached);
  };
  fmt::print(
      "\nRms lengths of the errors. Held out: postures unlike those seen (without outliers, of "
      "which -n/N), and postures drawn by lot (all of them).\n");
  row({"set", "found", "fit", "held out, unseen postures", "held out, by lot", "first fit",
       "reached"});
  for (const Line& line : table) row(line);
  return 0;
}

}  // namespace
}  // namespace kinescope::real

int main(int argc, char** argv) { return kinescope::real::run({argv + 1, argv + argc}); }
