// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include "kinematics/core/gzip.h"
#include "tests/app/commands/lying_input/changes.h"
#include "tests/app/commands/lying_input/sound_recordings.h"

namespace kinescope::lying {
namespace {

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

}  // namespace

std::vector<LyingInput> lying_logs() {
  return {
      // joints.csv, as a file
      {"LogEmpty", poses, is("joints.csv", ""), kRun, 3, {"joints.csv: is empty"}, {"structure"}},
      {"LogHeaderOnly", poses, is("joints.csv", "t,a,b\n"), kRun, 3, {"joints.csv: has a header"}},
      {"LogColumnTwice",
       poses,
       is("joints.csv", "t,a,a\n0,0,0\n1,1,1\n"),
       kRun,
       3,
       {"joints.csv:1: two columns are named 'a'"}},
      {"LogTimeTwice",
       poses,
       is("joints.csv", "t,a,t\n0,0,0\n1,1,1\n"),
       kRun,
       3,
       {"joints.csv:1: two columns are named 't'"}},
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
      {"LogColumnFrozen",
       poses,
       [](Files& files) {
         const std::vector<Row> rows = rows_of(files["joints.csv"]);
         each_row("joints.csv", [&](Row& row, int i) {
           if (i >= 300 && i < 340) row[1] = rows[301][1];
         })(files);
       },
       kRun,
       0,
       {"'ch0' is wrong (readings that froze, or a row that was repeated)",
        "but the markers it moves say"}},
      {"LogLateForAWhile",
       poses,
       log_late(300, 400, 24),
       kRun,
       0,
       {"'ch0', 'ch1', 'ch2' are wrong (0.25 s late)"}},
      {"LogLateForAWhileAndAMarkerThatFell",
       poses,
       all_of({log_late(300, 400, 24), marker_fallen("3", 4.0)}),
       kRun,
       0,
       {"'ch0', 'ch1' are wrong (0.25",  // the joint of 'ch2' shows by that marker alone
        "tag_3 is not where the robot carries it from t = 4", "3 joints"}},
      // joints.csv, written by other programs: read as it is meant
      {"LogOfSemicolonsAndCommas",
       poses,
       all_of({with_all("joints.csv", ",", ";"), with_all("joints.csv", ".", ",")}),
       kRun,
       0,
       {"3 joints"},
       {"warning"}},
      {"LogOfTabs",
       poses,
       with_all("joints.csv", ",", "\t"),
       kInspect,
       0,
       {"3 channels"},
       {"note"}},
      {"LogOfSpaces",
       poses,
       with_all("joints.csv", ",", " "),
       kInspect,
       0,
       {"3 channels"},
       {"note"}},
      {"LogOfAnotherSystem",
       poses,
       all_of({with("joints.csv", "t,", "\xEF\xBB\xBFt,"), with_all("joints.csv", "\n", "\r\n")}),
       kInspect,
       0,
       {"3 channels"},
       {"note"}},
      {"LogOfQuotedNames",
       poses,
       with("joints.csv", "t,ch0,ch1,ch2", "\"t\",\"ch0\",\"ch1\",\"ch2\""),
       kInspect,
       0,
       {"  ch0 "},
       {"note"}},
      {"LogOfNamedMilliseconds",
       poses,
       all_of({column("joints.csv", "t", [](double t, int) { return 1e3 * t; }),
               with("joints.csv", "t,", "t_ms,")}),
       kInspect,
       0,
       {"3 channels"},
       {"note", "are its stamps in"}},
      {"LogOfNamedNanoseconds",
       poses,
       all_of({column("joints.csv", "t", [](double t, int) { return 1e9 * t; }),
               with("joints.csv", "t,", "timestamp_ns,")}),
       kRun,
       0,
       {"3 joints"},
       {"warning"}},
      {"LogOfDates",
       poses,
       each_row("joints.csv",
                [](Row& row, int i) {
                  row[0] = fmt::format("2024-01-01T00:{:02}:{:02}.{:03}", i / 6000, i / 100 % 60,
                                       10 * (i % 100));
                }),
       kRun,
       3,
       {"joints.csv: runs from 1704067200.000", "no common time", "add 1704067200.000 s"},
       {"remove the line"}},
      {"LogWithoutTimes",
       poses,
       with("joints.csv", "t,", "row,"),
       kRun,
       3,
       {"joints.csv:1: no column 't'", "name the one that holds it so",
        "the columns are row, ch0, ch1, ch2"}},
      // joints.csv, single rows
      {"LogWithAWord",
       poses,
       each_row("joints.csv",
                [](Row& row, int i) {
                  if (i == 300) row[1] = "abc";
                }),
       kRun,
       0,
       {"joints.csv:302: column 'ch0' holds 'abc', not a finite number: left out", "3 joints"}},
      {"LogWithAShortRow",
       poses,
       each_row("joints.csv",
                [](Row& row, int i) {
                  if (i == 300) row.pop_back();
                }),
       kInspect,
       0,
       {"joints.csv:302: 3 cells where the header has 4: left out"}},
      {"LogWithAWildReading",
       poses,
       column("joints.csv", "ch1", [](double q, int i) { return i == 300 ? 1e308 : q; }),
       kRun,
       0,
       {"'ch1' reads 1e+308, which none of its other readings comes near: put aside"}},
      {"LogWithAWildReadingInspected",
       poses,
       column("joints.csv", "ch1", [](double q, int i) { return i == 300 ? 37.0 : q; }),
       kInspect,
       0,
       {"'ch1' reads 37, which none of its other readings comes near: `run` puts it aside"},
       {"deg or mm", "declare units"}},
      // joints.csv, its extent
      {"LogOfHalfTheTime",
       poses,
       each_row("joints.csv",
                [](Row& row, int) {
                  if (std::stod(row[0]) > 3.0) row.clear();
                }),
       kRun,
       0,
       {"joints.csv: ", "of the 200 frames have no reading", "do not take part"}},
      {"LogOfHalfTheTimeInspected",
       poses,
       each_row("joints.csv",
                [](Row& row, int) {
                  if (std::stod(row[0]) > 3.0) row.clear();
                }),
       kInspect,
       0,
       {"joints.csv: ", "of the 200 frames have no reading"}},
      {"LogWithoutAJoint",
       poses,
       without_column("joints.csv", "ch1"),
       kRun,
       0,
       {"3 joints", "no logged channel drives"}},
  };
}

}  // namespace kinescope::lying
