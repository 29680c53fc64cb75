// SPDX-License-Identifier: Apache-2.0
#include "tests/app/commands/lying_input/changes.h"
#include "tests/app/commands/lying_input/sound_recordings.h"

namespace kinescope::lying {

std::vector<LyingInput> lying_drawings() {
  return {
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
      {"OutputIsAFile",
       poses,
       is("out", "mine"),
       kRun,
       2,
       {"out: the output folder cannot be made: ", "out is no folder"}},
      {"OutputBelowAFile",
       poses,
       is("mine.txt", "mine"),
       {"run", "{d}", "--output", "{d}/mine.txt/out", "--quiet"},
       2,
       {"mine.txt/out: the output folder cannot be made: ", "mine.txt is no folder"}},
      {"OutputIsADevice",
       poses,
       none(),
       {"run", "{d}", "--output", "/dev/null", "--quiet"},
       2,
       {"/dev/null is no folder"}},
      {"LimitIsNoNumber",
       poses,
       none(),
       and_(kRun, {"--fail-on", "held_out_m>nan"}),
       2,
       {"'held_out_m>nan' is no limit"}},
      {"LimitOnNothing", poses, none(), and_(kRun, {"--fail-on", "tip>0.2"}), 2, {"tip"}},
      {"GeometryOfNoRobot", poses, none(), and_(kRun, {"--free", "placement"}), 2, {"--nominal"}},
  };
}

}  // namespace kinescope::lying
