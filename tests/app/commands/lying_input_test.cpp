// SPDX-License-Identifier: Apache-2.0
//
// Input that is bad or lies, one row a case: what is changed in a sound recording, the command, the
// exit code, the words that must be said and those that would lead astray. A refusal is one line
// with a remedy, and leaves every file as it was.
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "kinematics/core/gzip.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "kinematics/urdf/urdf.h"
#include "tests/app/commands/folder_contents.h"
#include "tests/app/commands/poses_of_arm.h"
#include "tests/app/commands/program.h"
#include "tests/app/commands/torque_log_text.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, std::string>;  // by their path in the folder

// ---- sound recordings

RandomRobot robot_of_poses() {
  Rng rng = Rng::from_name("lying input");
  return random_robot({.joints = 3, .prismatic_share = 0.0}, rng);
}

RobotRecording poses_of(const RecordingOptions& options) {
  Rng rng = Rng::from_name("lying input, motion");
  RecordingOptions few = options;
  few.frames = 200;
  few.lowest_hz = 0.2;
  few.highest_hz = 0.6;
  few.shuffle_channels = false;
  return record(robot_of_poses(), few, rng);
}

Files poses_files(const RecordingOptions& options = {}) {
  const RobotRecording recording = poses_of(options);
  return {{"poses.csv", tracks_csv(recording.tracks)}, {"joints.csv", joints_csv(recording.log)}};
}

const Files& poses() {
  static const Files files = poses_files();
  return files;
}

constexpr const char* kCamera =
    "image_width: 1280\nimage_height: 720\ncamera_matrix: {rows: 3, cols: 3, data: [900, 0, 640, "
    "0, "
    "900, 360, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 5, "
    "data: [0.1, 0, 0, 0, 0]}\n";

// A tag at rest and one that goes round; what is refused is refused before any geometry.
const Files& corners() {
  static const Files files = [] {
    std::string text = "t,tag,corner,u,v\n";
    for (int frame = 0; frame < 40; ++frame) {
      const double angle = 0.1 * frame;
      for (const int tag : {3, 7}) {
        const double u = tag == 3 ? 200.0 : 900.0 + 200.0 * std::cos(angle);
        const double v = tag == 3 ? 300.0 : 350.0 + 200.0 * std::sin(angle);
        for (int corner = 0; corner < 4; ++corner) {
          const double x = corner == 1 || corner == 2 ? 20.0 : -20.0;
          const double y = corner < 2 ? 20.0 : -20.0;
          text +=
              fmt::format("{:.6f},{},{},{:.3f},{:.3f}\n", frame / 30.0, tag, corner, u + x, v + y);
        }
      }
    }
    std::string log = "t,a\n";
    for (int row = 0; row < 140; ++row)
      log += fmt::format("{:.2f},{:.4f}\n", 0.01 * row, 0.03 * row);
    return Files{{"corners.csv", text},
                 {"joints.csv", log},
                 {"camera.yaml", kCamera},
                 {"tags.yaml", "family: tag36h11\ndefault_size: 0.05\n"}};
  }();
  return files;
}

// The arm of the poses as drawn, its joints named like the columns.
const Files& nominal() {
  static const Files files = [] {
    KinematicTree tree = robot_of_poses().tree;
    const RobotRecording recording = poses_of({});
    tree.markers.clear();
    for (std::size_t j = 0; j < tree.joints.size(); ++j) {
      tree.joints[j].name =
          recording.log.channels[static_cast<std::size_t>(recording.channel_of_joint[j])];
      tree.joints[j].limits = JointLimits{-2.0, 2.0};
    }
    Files out = poses();
    out["nominal.urdf"] = write_urdf(tree);
    return out;
  }();
  return files;
}

// A robot of three joints, its torques, and the model learned from them.
const Files& torques() {
  static const Files files = [] {
    Rng rng = Rng::from_name("lying torques");
    const RandomRobot robot = random_robot({.joints = 3, .prismatic_share = 0.0}, rng);
    const DynamicModel model = random_masses(robot.tree, {.every_direction = false}, rng);
    const TorqueSamples samples = torque_log_of(model, {.samples = 1500, .trajectories = 1}, rng);
    Files out{{"log.csv", torque_log_csv(samples)}, {"robot.urdf", write_urdf(model)}};
    const fs::path folder = truth::temporary_path("lying_input_model");
    fs::create_directories(folder);
    for (const auto& [name, text] : out) write_file_atomically(folder / name, text);
    const Outcome learned =
        run({"dynamics", (folder / "log.csv").string(), "--robot", (folder / "robot.urdf").string(),
             "--model", "parametric", "--no-trace", "--no-robust", "--save-model",
             (folder / "torque.json").string(), "--output", (folder / "out").string(), "--quiet"});
    EXPECT_EQ(learned.code, 0) << learned.err;
    out["torque.json"] = read_text_file(folder / "torque.json");
    fs::remove_all(folder);
    return out;
  }();
  return files;
}

// ---- changes

using Change = std::function<void(Files&)>;
using Row = std::vector<std::string>;

std::vector<Row> rows_of(const std::string& text) {
  std::vector<Row> rows(1, Row(1));
  for (const char c : text) {
    if (c == '\n') {
      rows.emplace_back(1);
    } else if (c == ',') {
      rows.back().emplace_back();
    } else {
      rows.back().back() += c;
    }
  }
  rows.pop_back();
  return rows;
}

/// Every row but the header, by number.
Change each_row(const std::string& file, const std::function<void(Row&, int)>& edit) {
  return [=](Files& files) {
    std::vector<Row> rows = rows_of(files.at(file));
    std::string text = fmt::format("{}\n", fmt::join(rows.front(), ","));
    for (std::size_t i = 1; i < rows.size(); ++i) {
      edit(rows[i], static_cast<int>(i) - 1);
      if (!rows[i].empty()) text += fmt::format("{}\n", fmt::join(rows[i], ","));
    }
    files[file] = text;
  };
}

std::size_t index_of(const Files& files, const std::string& file, const std::string& column) {
  const Row header = rows_of(files.at(file)).front();
  return static_cast<std::size_t>(std::ranges::find(header, column) - header.begin());
}

Change column(const std::string& file, const std::string& name,
              const std::function<double(double, int)>& value) {
  return [=](Files& files) {
    const std::size_t at = index_of(files, file, name);
    each_row(file, [&](Row& row, int i) {
      row.at(at) = fmt::format("{}", value(std::stod(row.at(at)), i));
    })(files);
  };
}

Change columns_exchanged(const std::string& file, const std::string& a, const std::string& b) {
  return [=](Files& files) {
    const std::size_t first = index_of(files, file, a);
    const std::size_t second = index_of(files, file, b);
    each_row(file, [&](Row& row, int) { std::swap(row.at(first), row.at(second)); })(files);
  };
}

Change is(const std::string& file, const std::string& text) {
  return [=](Files& files) { files[file] = text; };
}

Change without(const std::string& file) {
  return [=](Files& files) { files.erase(file); };
}

Change with(const std::string& file, const std::string& from, const std::string& to) {
  return [=](Files& files) {
    std::string& text = files.at(file);
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
  };
}

Change all_of(const std::vector<Change>& changes) {
  return [=](Files& files) {
    for (const Change& change : changes) change(files);
  };
}

Change none() {
  return [](Files&) {};
}

/// What a drawing is with its first joint changed.
Change first_joint(const std::function<void(Joint&)>& edit) {
  return [=](Files& files) {
    const fs::path path = truth::temporary_path("lying_input.urdf");
    write_file_atomically(path, files.at("nominal.urdf"));
    KinematicTree tree = read_urdf(path);
    fs::remove(path);
    edit(tree.joints.front());
    files["nominal.urdf"] = write_urdf(tree);
  };
}

Change poses_as(const std::function<Pose(const Pose&)>& other) {
  return [=](Files& files) {
    PoseTracks tracks = poses_of({}).tracks;
    for (PoseTrack& track : tracks.tracks) {
      for (PoseSample& sample : track.samples)
        sample.T_camera_marker = other(sample.T_camera_marker);
    }
    files["poses.csv"] = tracks_csv(tracks);
  };
}

Change other_robots_log() {
  return [](Files& files) {
    Rng rng = Rng::from_name("another robot's motion");
    const RecordingOptions other{
        .frames = 200, .lowest_hz = 0.9, .highest_hz = 1.5, .shuffle_channels = false};
    files["joints.csv"] = joints_csv(record(robot_of_poses(), other, rng).log);
  };
}

Change markers_at_rest() {
  return [](Files& files) {
    files["poses.csv"] = poses_files({.still_joints = {0, 1, 2}}).at("poses.csv");
  };
}

Change noise_for_torques() {
  return [](Files& files) {
    Rng rng = Rng::from_name("noise for torques");
    for (const char* name : {"tau1", "tau2", "tau3"}) {
      column("log.csv", name, [&](double, int) { return rng.normal(); })(files);
    }
  };
}

// ---- the table

// `{d}`: the case's folder.
using Words = std::vector<std::string>;
const Words kRun{"run", "{d}", "--output", "{d}/out", "--quiet", "--no-trace", "--folds", "0"};
const Words kInspect{"inspect", "{d}"};
const Words kDynamics{"dynamics", "{d}/log.csv", "--robot",    "{d}/robot.urdf",
                      "--model",  "parametric",  "--no-trace", "--no-robust",
                      "--output", "{d}/out",     "--quiet"};
const Words kPredict{"predict",  "{d}/log.csv",       "--model", "{d}/torque.json",
                     "--output", "{d}/predicted.csv", "--quiet"};

struct LyingInput {
  const char* name;
  const Files& (*sound)();
  Change change;
  Words command;
  int code;
  Words says;
  Words silent = {};  ///< words that would lead astray
};

void PrintTo(const LyingInput& input, std::ostream* out) { *out << input.name; }

Words and_(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

const std::vector<LyingInput>& table() {
  static const std::vector<LyingInput> cases{
      // joints.csv, as a file
      {"LogEmpty", poses, is("joints.csv", ""), kRun, 3, {"joints.csv: is empty"}, {"structure"}},
      {"LogHeaderOnly", poses, is("joints.csv", "t,a,b\n"), kRun, 3, {"joints.csv: has a header"}},
      {"LogColumnTwice",
       poses,
       is("joints.csv", "t,a,a\n0,0,0\n1,1,1\n"),
       kRun,
       3,
       {"joints.csv:1: two columns are named 'a'"}},
      {"LogWithoutHeader",
       poses,
       is("joints.csv", "0,0.1,0.2\n1,0.2,0.3\n"),
       kRun,
       3,
       {"joints.csv:1: the first line holds numbers"}},
      {"LogOfTimesOnly",
       poses,
       is("joints.csv", "t\n0\n1\n2\n"),
       kRun,
       3,
       {"no joint channel beside 't'"}},
      {"LogUtf16",
       poses,
       is("joints.csv", std::string("t\0,\0a\0\n\0", 8)),
       kRun,
       3,
       {"joints.csv: holds NUL bytes"}},
      {"LogBinary",
       poses,
       [](Files& files) {
         std::uint32_t state = 1;
         std::string bytes;
         while (bytes.size() < 20000) {
           state = 1664525U * state + 1013904223U;
           bytes += static_cast<char>(1U + (state >> 24U) % 255U);
         }
         files["joints.csv"] = bytes;
       },
       kRun,
       3,
       {"joints.csv", "not UTF-8 text"}},
      {"LogCutOffGzip",
       poses,
       [](Files& files) { files["joints.csv"] = gzip(files["joints.csv"]).substr(0, 900); },
       kRun,
       3,
       {"joints.csv: the gzip file is cut off"}},
      {"LogOfTooManyColumns",
       poses,
       [](Files& files) {
         std::string text = "t";
         for (int c = 0; c < 20000; ++c) text += fmt::format(",c{}", c);
         files["joints.csv"] = text + "\n0\n1\n";
       },
       kRun,
       3,
       {"joints.csv:1: has 20001 columns, more than 10000"}},
      {"LogMissingCellsEverywhere",
       poses,
       each_row("joints.csv",
                [](Row& row, int i) {
                  if (i % 2 == 0) row[1] = "nan";
                }),
       kRun,
       3,
       {"joints.csv:4: column 'ch0' holds 'nan', not a finite number"}},
      {"LogIsADevice",
       poses,
       none(),
       and_(kRun, {"--joints", "/dev/null"}),
       3,
       {"/dev/null: is a pipe or a device"}},
      {"LogNamedAndMissing",
       poses,
       none(),
       and_(kRun, {"--joints", "{d}/nowhere.csv"}),
       3,
       {"nowhere.csv: no such file"}},
      // joints.csv, its clock
      {"LogReversed",
       poses,
       column("joints.csv", "t", [](double t, int) { return -t; }),
       kRun,
       3,
       {"joints.csv:3: time", "does not come after"}},
      {"LogClockStands",
       poses,
       column("joints.csv", "t", [](double, int) { return 1.0; }),
       kRun,
       3,
       {"does not come after"}},
      {"LogInMilliseconds",
       poses,
       column("joints.csv", "t", [](double t, int) { return 1e3 * t; }),
       kRun,
       3,
       {"joints.csv: runs for", "are its stamps in ms?"},
       {"no common time", "structure"}},
      {"LogInMicroseconds",
       poses,
       column("joints.csv", "t", [](double t, int) { return 1e6 * t; }),
       kRun,
       3,
       {"are its stamps in us?"}},
      {"LogOfRowNumbers",
       poses,
       column("joints.csv", "t", [](double, int i) { return i; }),
       kRun,
       3,
       {"joints.csv: its stamps are whole numbers", "numbers of frames or rows"},
       {"structure"}},
      {"LogOfAnotherDay",
       poses,
       column("joints.csv", "t", [](double t, int) { return t - 1e5; }),
       kRun,
       3,
       {"no common time"},
       {"stamps in"}},
      {"LogOfOneReading",
       poses,
       is("joints.csv", "t,a\n1,0.5\n"),
       kRun,
       3,
       {"joints.csv: holds 1 reading for 200 frames"},
       {"structure", "no common time"}},
      {"LogOfTwoReadings",
       poses,
       is("joints.csv", "t,a\n0,0.5\n6,0.7\n"),
       kRun,
       3,
       {"joints.csv: holds 2 readings"},
       {"structure"}},
      {"LogClockJumps",
       poses,
       column("joints.csv", "t", [](double t, int i) { return i > 400 ? t + 2.0 : t; }),
       kInspect,
       0,
       {"joints.csv: the clock jumps by 2 s behind t = "}},
      // joints.csv, its meaning
      {"LogOfAnotherRobot",
       poses,
       other_robots_log(),
       kRun,
       4,
       {"joints.csv: the markers move as a robot of 3 joints does, and no column of the log moves"},
       {"axis of"}},
      {"MarkersRestAndTheLogMoves",
       poses,
       markers_at_rest(),
       kRun,
       4,
       {"joints.csv: 'ch0', 'ch1', 'ch2' move, and no marker does"}},
      {"LogFrozen",
       poses,
       [](Files& files) {
         const Row held = rows_of(files["joints.csv"])[301];
         each_row("joints.csv", [&](Row& row, int i) {
           if (i >= 300 && i < 520) std::copy(held.begin() + 1, held.end(), row.begin() + 1);
         })(files);
       },
       kRun,
       0,
       {"joints.csv: repeats one row from t = ", "the log was frozen"}},
      // poses.csv
      {"PosesEmpty", poses, is("poses.csv", ""), kRun, 3, {"poses.csv: is empty"}},
      {"PosesWithoutRotation",
       poses,
       all_of({column("poses.csv", "qx", [](double, int) { return 0.0; }),
               column("poses.csv", "qy", [](double, int) { return 0.0; }),
               column("poses.csv", "qz", [](double, int) { return 0.0; }),
               column("poses.csv", "qw", [](double, int) { return 0.0; })}),
       kRun,
       3,
       {"poses.csv:2: the quaternion has length 0"}},
      {"PosesOutOfReach",
       poses,
       column("poses.csv", "x", [](double, int) { return 1e308; }),
       kRun,
       3,
       {"poses.csv:2: column 'x' holds", "out of all reach"}},
      {"PosesOfNames",
       poses,
       each_row("poses.csv", [](Row& row, int) { row[1] = "hand"; }),
       kRun,
       3,
       {"poses.csv:2: column 'body' holds 'hand'"}},
      {"PosesInMilliseconds",
       poses,
       column("poses.csv", "t", [](double t, int) { return 1e3 * t; }),
       kRun,
       3,
       {"poses.csv: runs for", "are its stamps in ms?"}},
      {"PosesOfFrameNumbers",
       poses,
       column("poses.csv", "t", [](double t, int) { return std::round(30.0 * t); }),
       kRun,
       3,
       {"poses.csv: its stamps are whole numbers"},
       {"structure"}},
      {"PosesWithoutNoise",
       poses,
       column("poses.csv", "sigma_m", [](double, int) { return 1e-300; }),
       kRun,
       3,
       {"poses.csv:2: column 'sigma_m' holds 1e-300"},
       {"seen often enough"}},
      {"PosesWithWFirst",
       poses,
       poses_as([](const Pose& pose) {
         const Eigen::Quaterniond& q = pose.rotation;
         return Pose{Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), pose.translation};
       }),
       kRun,
       4,
       {"poses.csv: the bodies do not move as a robot's links do", "in the order w, x, y, z"},
       {"axis of"}},
      {"PosesInverted",
       poses,
       poses_as([](const Pose& pose) { return pose.inverse(); }),
       kRun,
       4,
       {"poses.csv: the bodies do not move as a robot's links do", "with the poses inverted"},
       {"axis of"}},
      // corners.csv
      {"CornersExchangedAxes",
       corners,
       columns_exchanged("corners.csv", "u", "v"),
       kRun,
       3,
       {"corners.csv:", "none is with u and v exchanged"},
       {"structure"}},
      {"CornersNormalised",
       corners,
       all_of({column("corners.csv", "u", [](double u, int) { return u / 1280.0; }),
               column("corners.csv", "v", [](double v, int) { return v / 720.0; })}),
       kRun,
       3,
       {"corners.csv: no corner is farther than", "shares of the size"},
       {"structure"}},
      {"CornersFromOne",
       corners,
       column("corners.csv", "corner", [](double corner, int) { return corner + 1.0; }),
       kRun,
       3,
       {"has no corner 4", "numbered from 0 to 3"}},
      {"CornersOfUnlistedTags",
       corners,
       is("tags.yaml", "family: tag36h11\nonly_listed: true\nsizes: {1: 0.05}\n"),
       kRun,
       3,
       {"corners.csv: holds no tag that tags.yaml lists"}},
      {"CornersOfLargerImages",
       corners,
       is("camera.yaml",
          "image_width: 640\nimage_height: 360\ncamera_matrix: {rows: 3, cols: 3, data: [450, 0, "
          "320, 0, 450, 180, 0, 0, 1]}\ndistortion_model: plumb_bob\ndistortion_coefficients: "
          "{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"),
       kRun,
       3,
       {"corners.csv: tag", "outside the images of 640 x 360"},
       {"exchanged"}},
      // tags.yaml
      {"TagsInMillimetres",
       corners,
       is("tags.yaml", "family: tag36h11\ndefault_size: 50\n"),
       kRun,
       3,
       {"tags.yaml:2: default_size is 50 m", "was this mm?"}},
      {"TagsOfNoSize",
       corners,
       is("tags.yaml", "family: tag36h11\ndefault_size: 1e-300\n"),
       kRun,
       3,
       {"tags.yaml:2: default_size is 1e-300 m, smaller than"},
       {"seen often enough"}},
      {"TagsOfUnknownFamily",
       corners,
       is("tags.yaml", "family: tag36h12\ndefault_size: 0.05\n"),
       kRun,
       3,
       {"tags.yaml:1: family 'tag36h12' is not known", "did you mean 'tag36h11'?"}},
      {"TagsWithUnknownKey",
       corners,
       is("tags.yaml", "family: tag36h11\ndefault_size: 0.05\nsize: 0.05\n"),
       kRun,
       3,
       {"tags.yaml:3: size is a key nobody reads", "did you mean 'sizes'?"}},
      {"TagsWithDecimalComma",
       corners,
       is("tags.yaml", "family: tag36h11\ndefault_size: 0,05\n"),
       kRun,
       3,
       {"tags.yaml:2: default_size is '0,05'", "a point"}},
      {"TagsMissing",
       corners,
       without("tags.yaml"),
       kRun,
       3,
       {"tags.yaml: no such file", "--tags"}},
      {"TagsInTwoUnits",
       corners,
       is("tags.yaml", "family: tag36h11\ndefault_size: 0.05\nsizes: {3: 0.5}\n"),
       kInspect,
       0,
       {"tags.yaml: sizes from 0.05 to 0.5 m: are all of them in m?"}},
      // camera.yaml
      {"CameraInMillimetres",
       corners,
       with("camera.yaml", "900, 0, 640, 0, 900", "4.2, 0, 640, 0, 4.2"),
       kRun,
       3,
       {"camera.yaml: focal lengths 4.2 and 4.2 fit no lens", "in mm?"},
       {"axis of"}},
      {"CameraWithoutFocalLength",
       corners,
       with("camera.yaml", "[900,", "[0,"),
       kRun,
       3,
       {"camera.yaml: camera_matrix.data: focal lengths 0 and 900 are not positive"}},
      {"CameraBentOutOfProportion",
       corners,
       with("camera.yaml", "data: [0.1,", "data: [1e6,"),
       kRun,
       3,
       {"camera.yaml: plumb_bob with these distortion coefficients"},
       {"axis of"}},
      {"CameraFoldedOver",
       corners,
       with("camera.yaml", "data: [0.1,", "data: [-500,"),
       kRun,
       3,
       {"camera.yaml: plumb_bob with these distortion coefficients"}},
      {"CameraWithoutMatrix",
       corners,
       with("camera.yaml", "camera_matrix", "matrix"),
       kRun,
       3,
       {"camera.yaml: camera_matrix: is missing"}},
      {"CameraOfNoSize",
       corners,
       with("camera.yaml", "image_width: 1280", "image_width: 0"),
       kRun,
       3,
       {"camera.yaml: image_width: '0' is no image size"}},
      {"CameraMissing",
       corners,
       without("camera.yaml"),
       kRun,
       3,
       {"camera.yaml: no such file", "--camera"}},
      {"CameraOfOblongPixels",
       corners,
       with("camera.yaml", "0, 900, 360", "0, 450, 360"),
       kInspect,
       0,
       {"camera.yaml: fx = 900 and fy = 450 are of pixels 2 times as long as wide"}},
      // recording.yaml
      {"SettingsWithUnknownKey",
       poses,
       is("recording.yaml", "gravty: [0, 1, 0]\n"),
       kRun,
       3,
       {"recording.yaml:1: gravty is a key nobody reads", "did you mean 'gravity'?"}},
      {"SettingsOfUnknownChannel",
       poses,
       is("recording.yaml", "units: {ch9: rad}\n"),
       kRun,
       3,
       {"recording.yaml: units names a channel 'ch9' that is not logged"}},
      {"SettingsOfTheWrongKindOfUnit",
       poses,
       is("recording.yaml", "units: {ch0: m}\n"),
       kRun,
       4,
       {"recording.yaml: the channel 'ch0', declared in m, turns its joint: its readings are in "
        "rad"}},
      {"SettingsInDegreesThatAreRadians",
       poses,
       is("recording.yaml", "units: {ch0: deg}\n"),
       kRun,
       4,
       {"recording.yaml: the channel 'ch0', declared in deg, moves its joint 57.3 times as far"},
       {"declared in rad"}},
      {"SettingsWithGravityOfNoLength",
       poses,
       is("recording.yaml", "gravity: [0, 0, 0]\n"),
       kRun,
       3,
       {"recording.yaml:1: gravity has no length"}},
      {"SettingsOfAVideoBesidePoses",
       poses,
       is("recording.yaml", "video_start: 5\n"),
       kRun,
       3,
       {"recording.yaml: video_start is 5 s", "remove video_start"}},
      {"SettingsOfAFixedTagNeverSeen",
       poses,
       is("recording.yaml", "fixed_tags: [999]\n"),
       kRun,
       3,
       {"recording.yaml: fixed_tags names 999, which is not seen"}},
      // the nominal robot
      {"DrawingInMillimetres",
       nominal,
       first_joint([](Joint& joint) { joint.T_parent_joint.translation.x() = 290.0; }),
       kRun,
       3,
       {"nominal.urdf: joint 'ch0' lies 290", "in mm?"},
       {"does not fit"}},
      {"DrawingOfTheWrongType",
       nominal,
       first_joint([](Joint& joint) { joint.type = JointType::kPrismatic; }),
       kRun,
       4,
       {"nominal.urdf: joint 'ch0' is drawn as prismatic, but the markers turn with its column "
        "'ch0'"},
       {"does not fit"}},
      {"DrawingCutOff",
       nominal,
       [](Files& files) { files["nominal.urdf"].resize(files["nominal.urdf"].size() / 2); },
       kRun,
       3,
       {"nominal.urdf:", "is not well-formed XML"}},
      {"DrawingNeedsALog",
       nominal,
       without("joints.csv"),
       kRun,
       3,
       {"joints.csv: no such file, but the nominal robot has joints"}},
      // the output and the command line
      {"OutputIsTheInput",
       poses,
       none(),
       {"run", "{d}", "--output", "{d}"},
       2,
       {"is the recording's own folder"}},
      {"OutputOfSomebody",
       poses,
       is("out/report.html", "mine"),
       kRun,
       2,
       {"out/report.html: would be replaced", "--force"}},
      {"LimitOnNothing", poses, none(), and_(kRun, {"--fail-on", "tip>0.2"}), 2, {"tip"}},
      {"GeometryOfNoRobot", poses, none(), and_(kRun, {"--free", "placement"}), 2, {"--nominal"}},
      // torques
      {"TorquesOfNoise",
       torques,
       noise_for_torques(),
       kDynamics,
       4,
       {"log.csv: the robot's motion explains the torques no better than noise"},
       {"payload", "torque_gain"}},
      {"TorquesExchanged",
       torques,
       columns_exchanged("log.csv", "tau1", "tau2"),
       kDynamics,
       3,
       {"log.csv: the torques of the joints", "stand in each other's place",
        "dynamics: {torque: [tau2, tau1, tau3]}"},
       {"cross_talk"}},
      {"TorquesInMillinewtonmetres",
       torques,
       all_of({column("log.csv", "tau1", [](double tau, int) { return 1e3 * tau; }),
               column("log.csv", "tau2", [](double tau, int) { return 1e3 * tau; }),
               column("log.csv", "tau3", [](double tau, int) { return 1e3 * tau; })}),
       kDynamics,
       3,
       {"log.csv: torque of joint", "times what the model says: mNm"}},
      {"PredictionOfMillinewtonmetres",
       torques,
       all_of({column("log.csv", "tau1", [](double tau, int) { return 1e3 * tau; }),
               column("log.csv", "tau2", [](double tau, int) { return 1e3 * tau; }),
               column("log.csv", "tau3", [](double tau, int) { return 1e3 * tau; })}),
       kPredict,
       3,
       {"log.csv: torque of joint", "times what the model says: mNm"}},
      {"PredictionOfARobotOfMoreJoints",
       torques,
       [](Files& files) {
         std::string text;
         for (const Row& row : rows_of(files["log.csv"])) {
           const bool header = text.empty();
           text += fmt::format("{},{}\n", fmt::join(row, ","), header ? "q4" : row[1]);
         }
         files["log.csv"] = text;
       },
       kPredict,
       0,
       {"log.csv: 3 joints are wanted, the log has 4: 'q4' left out"}},
      {"PredictionOfARobotOfFewerJoints",
       torques,
       [](Files& files) {
         std::string text;
         for (const Row& row : rows_of(files["log.csv"])) {
           text += fmt::format("{},{},{}\n", row[0], row[1], row.back());
         }
         files["log.csv"] = text;
       },
       kPredict,
       3,
       {"log.csv:1: the log's joints (1)"}},
      {"PredictionOfATruncatedModel",
       torques,
       [](Files& files) { files["torque.json"].resize(500); },
       kPredict,
       3,
       {"torque.json"}},
  };
  return cases;
}

void expect_one_line(const Outcome& outcome) {
  std::string line = outcome.err;
  while (line.starts_with("warning: ")) line.erase(0, line.find('\n') + 1);
  EXPECT_TRUE(line.starts_with("kinescope: ")) << outcome.err;
  EXPECT_EQ(std::ranges::count(line, '\n'), 1) << outcome.err;
  EXPECT_TRUE(line.ends_with(")\n")) << "a remedy: " << outcome.err;
  EXPECT_EQ(outcome.out, "");
}

class LyingInputs : public testing::TestWithParam<LyingInput> {
 protected:
  static fs::path folder_of(const LyingInput& input) {
    return truth::temporary_path(fmt::format("lying_input_{}", input.name));
  }
};

TEST_P(LyingInputs, AreNamed) {
  const LyingInput& input = GetParam();
  Files files = input.sound();
  input.change(files);
  const fs::path folder = folder_of(input);
  fs::remove_all(folder);
  for (const auto& [name, text] : files) {
    fs::create_directories((folder / name).parent_path());
    write_file_atomically(folder / name, text);
  }
  Words words = input.command;
  for (std::string& word : words) {
    if (word.starts_with("{d}")) word.replace(0, 3, folder.string());
  }
  const Outcome outcome = run(words);
  const std::string said = outcome.err + outcome.out;
  EXPECT_EQ(outcome.code, input.code) << said;
  for (const std::string& part : input.says) {
    EXPECT_NE(said.find(part), std::string::npos) << "'" << part << "' is not in: " << said;
  }
  for (const std::string& part : input.silent) {
    EXPECT_EQ(said.find(part), std::string::npos) << "'" << part << "' is in: " << said;
  }
  const Files after = contents(folder);
  for (const auto& [name, text] : files) {
    EXPECT_TRUE(after.contains(name) && after.at(name) == text) << name << " was touched";
  }
  if (input.code != 0) {
    expect_one_line(outcome);
    // What was seen is kept for the next run where the search for an answer had begun.
    const std::set<std::string> seen{"out/tracks.csv", "out/.kinescope_products"};
    for (const auto& [name, text] : after) {
      EXPECT_TRUE(files.contains(name) || seen.contains(name)) << name << " was left behind";
    }
  }
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Table, LyingInputs, testing::ValuesIn(table()),
                         [](const auto& test) { return std::string(test.param.name); });

// What the table's changes are made to is sound: without a change nothing is refused.
TEST(SoundInputs, AreTaken) {
  for (const auto& [sound, command] :
       std::vector<std::pair<const Files& (*)(), Words>>{{poses, kRun},
                                                         {corners, kInspect},
                                                         {nominal, kInspect},
                                                         {torques, kDynamics},
                                                         {torques, kPredict}}) {
    const fs::path folder = truth::temporary_path("lying_input_sound");
    fs::remove_all(folder);
    fs::create_directories(folder);
    for (const auto& [name, text] : sound()) write_file_atomically(folder / name, text);
    Words words = command;
    for (std::string& word : words) {
      if (word.starts_with("{d}")) word.replace(0, 3, folder.string());
    }
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 0) << command.front() << ": " << outcome.err << outcome.out;
    EXPECT_EQ(outcome.err.find("warning"), std::string::npos) << outcome.err;
    fs::remove_all(folder);
  }
}

// The advice for exchanged torque columns works.
TEST(LyingTorques, TheAdviceForExchangedColumnsPutsThemRight) {
  Files files = torques();
  columns_exchanged("log.csv", "tau1", "tau2")(files);
  files["recording.yaml"] = "dynamics: {torque: [tau2, tau1, tau3]}\n";
  const fs::path folder = truth::temporary_path("lying_input_advice");
  fs::remove_all(folder);
  fs::create_directories(folder);
  for (const auto& [name, text] : files) write_file_atomically(folder / name, text);
  Words words = kDynamics;
  for (std::string& word : words) {
    if (word.starts_with("{d}")) word.replace(0, 3, folder.string());
  }
  const Outcome outcome = run(words);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  fs::remove_all(folder);
}

}  // namespace
}  // namespace kinescope
