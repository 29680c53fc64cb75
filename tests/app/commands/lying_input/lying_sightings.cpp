// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Geometry>

#include "tests/app/commands/lying_input/changes.h"
#include "tests/app/commands/lying_input/sound_recordings.h"

namespace kinescope::lying {

std::vector<LyingInput> lying_sightings() {
  return {
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
      {"PosesOfAMarkerThatFell",
       poses,
       [](Files& files) {
         Row where;
         each_row("poses.csv", [&](Row& row, int) {
           if (row[1] != "3" || std::stod(row[0]) < 4.0) return;
           if (where.empty()) where = row;
           std::copy(where.begin() + 2, where.end(), row.begin() + 2);
         })(files);
       },
       kRun,
       0,
       {"tag_3 is not where the robot carries it from t = 4", "3 joints"},
       {"moves, but by no joint"}},
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
      {"CornersUpsideDown",
       corners,
       column("corners.csv", "v", [](double v, int) { return 719.0 - v; }),
       kInspect,
       0,
       {"corners.csv: the corners 0, 1, 2, 3 of 80 of 80 sightings go round clockwise",
        "Does v count upward instead, the robot comes out mirrored",
        "take v from the images' height"}},
      {"CornersNumberedTheOtherWay",
       corners,
       column("corners.csv", "corner", [](double corner, int) { return 3.0 - corner; }),
       kInspect,
       0,
       {"go round clockwise: taken for OpenCV's order, from the upper left"}},
      {"CornersOfOneMarkerNumberedTheOtherWay",
       corners,
       each_row("corners.csv",
                [](Row& row, int) {
                  if (row[1] == "7") row[2] = std::to_string(3 - std::stoi(row[2]));
                }),
       kInspect,
       0,
       {"of tag_7 go round clockwise, those of other markers do not"}},
      {"CornersOfAMarkerWithoutSize",
       corners,
       is("tags.yaml", "family: tag36h11\nsizes: {3: 0.05}\n"),
       kInspect,
       0,
       {"tag 7 is seen but not listed in tags.yaml: left out; add its size or default_size"}},
      {"CornersOfTwoMarkersAlike",
       corners,
       column("corners.csv", "tag", [](double, int) { return 3.0; }),
       kRun,
       3,
       {"corners.csv:", "tag 3 at t = 0 has its corner 0 twice"}},
      {"CornersOfOneFrame",
       corners,
       each_row("corners.csv",
                [](Row& row, int i) {
                  if (i >= 8) row.clear();
                }),
       kInspect,
       0,
       {"1 frame only"}},
      {"CornersWithoutOne",
       corners,
       each_row("corners.csv",
                [](Row& row, int i) {
                  if (i == 100) row.clear();
                }),
       kInspect,
       0,
       {"has 3 corners of 4: left out"}},
      {"CornersOfDates",
       corners,
       each_row("corners.csv", [](Row& row, int) { row[0] = "01.02.2024 00:00:00"; }),
       kRun,
       3,
       {"corners.csv:2: column 't' holds '01.02.2024 00:00:00'", "write times in s"}},
  };
}

}  // namespace kinescope::lying
