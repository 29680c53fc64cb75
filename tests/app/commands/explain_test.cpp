// SPDX-License-Identifier: Apache-2.0
//
// Recordings that no stage alone explains, through the user's command.
#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/file.h"
#include "kinematics/urdf/urdf.h"
#include "tests/acceptance/truth_of_world.h"
#include "tests/app/commands/program.h"
#include "tests/app/io/recording_folder.h"
#include "tests/experiments/undeclared_cases.h"
#include "tests/truth/recorded_world.h"

namespace kinescope {
namespace {

struct Answered {
  Outcome outcome;
  std::string difference;  // of the structure
  nlohmann::json trace;
  nlohmann::json calibration;
};

Answered run_case(int number, Damage damage = Damage::kNone) {
  const RecordingFolder folder;
  const truth::World world = write_case(undeclared_case(number, damage), folder.path(), damage);
  const std::filesystem::path out = folder.path() / "out";
  Answered answered;
  answered.outcome = run({"run", folder.path().string(), "--output", out.string()});
  if (!std::filesystem::exists(out / "robot.urdf")) {
    answered.difference = "no robot";
    return answered;
  }
  answered.difference =
      acceptance::structure_difference(acceptance::truth_of(world), read_urdf(out / "robot.urdf"));
  answered.trace = nlohmann::json::parse(read_text_file(out / "trace.json"));
  answered.calibration = nlohmann::json::parse(read_text_file(out / "calibration.json"));
  return answered;
}

// "name place" of all effects, sorted.
std::vector<std::string> effects(const Answered& answered) {
  std::vector<std::string> out;
  if (!answered.trace.is_object()) return out;
  for (const nlohmann::json& effect : answered.trace["accepted"])
    out.push_back(effect["effect"].get<std::string>() + " " + effect["place"].get<std::string>());
  std::ranges::sort(out);
  return out;
}

// "name place" of those effects that hold over what was seen of their own joint, sorted.
std::vector<std::string> ranged_effects(const Answered& answered) {
  std::vector<std::string> out;
  for (const nlohmann::json& effect : answered.calibration["effects"]) {
    for (const nlohmann::json& joint : answered.calibration["robot"]["joints"]) {
      if (effect["place"] != joint["name"] || !effect.contains("range")) continue;
      EXPECT_EQ(effect["range"], joint["range"]);
      out.push_back(effect["effect"].get<std::string>() + " " + effect["place"].get<std::string>());
    }
  }
  std::ranges::sort(out);
  return out;
}

// The one effect found; empty where there are several or none.
std::string only_effect(const Answered& answered) {
  const std::vector<std::string> found = effects(answered);
  return found.size() == 1 ? found.front() : "";
}

// A marker 4 % too large bends the tracks: the structure is in doubt until its size is known.
TEST(Explain, TheStructureIsAskedAgainOnceAnEffectIsKnown) {
  const Answered answered = run_case(266);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "tag_size tag_11");
}

// A camera that turned by 1.5 degrees: no structure explains the whole, one explains each half.
TEST(Explain, HalfARecordingShowsTheRobotWhereTheCameraWasBumped) {
  const Answered answered = run_case(71);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "camera_bump camera");
}

// A focal length of 19 % too much: beside the structure that shows with the declared camera, it
// would be found among couplings, if at all.
TEST(Explain, AFocalLengthThatIsFarOffIsFoundBesideACorruptedRow) {
  const Answered answered = run_case(12006, Damage::kCorruptedRow);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "intrinsics camera focal length");
  EXPECT_NE(answered.outcome.err.find("'q3' reads 12.929"), std::string::npos)
      << answered.outcome.err;
}

// Bent by 2.5 mm, the only marker of its link: on its track the links behind hang elsewhere.
TEST(Explain, ABentMarkerIsSeenBeforeTheStructureIsSearchedFor) {
  const Answered answered = run_case(11063);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "bent_tag tag_11");
}

TEST(Explain, AReadingThatContradictsEverythingIsPutAsideAndNamed) {
  const Answered answered = run_case(0, Damage::kCorruptedRow);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_NE(answered.outcome.err.find("'q2' reads 18.1817"), std::string::npos)
      << answered.outcome.err;
  EXPECT_NE(answered.outcome.err.find("the markers say 0.40"), std::string::npos)
      << answered.outcome.err;
}

// Within the range of what was read: no reading of a motion comes from nowhere and goes there.
TEST(Explain, CorruptedRowsArePutAsideByWhatIsReadBeforeAndAfter) {
  const Answered answered = run_case(10, Damage::kCorruptedRows);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(answered.trace["verdict"], "clean") << answered.outcome.out;
  EXPECT_NE(answered.outcome.err.find("are not near those before and after: put aside"),
            std::string::npos)
      << answered.outcome.err;
}

// A plug in the wrong socket, half-way: no column is any joint's as a whole.
TEST(Explain, ColumnsExchangedHalfwayAreMended) {
  const Answered answered = run_case(10, Damage::kExchangedHalfway);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(answered.trace["verdict"], "clean") << answered.outcome.out;
  EXPECT_NE(answered.outcome.err.find("goes on as"), std::string::npos) << answered.outcome.err;
  EXPECT_NE(answered.outcome.err.find("; taken so"), std::string::npos) << answered.outcome.err;
}

// The markers alone gave another robot, with the clock's jump in it.
TEST(Explain, ColumnsExchangedHalfwayAreSeenInTheLogBesideAnEffect) {
  const Answered answered = run_case(13791, Damage::kExchangedHalfway);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "clock_jump clock");
}

// As they arrived, some together: weighed by their scatter, the error on unseen data was ten times
// the noise.
TEST(Explain, FramesThatAreStampedAsTheyArriveAreTakenAsEven) {
  const Answered answered = run_case(10, Damage::kLateFrames);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_NE(answered.outcome.err.find("taken as even"), std::string::npos) << answered.outcome.err;
  // Where the first one begins, and how long they take, the stamps tell to fractions of a
  // millisecond.
  for (const nlohmann::json& effect : answered.trace["accepted"])
    EXPECT_EQ(effect["place"], "clock");
  EXPECT_LT(answered.trace["held_out_after"]["value"].get<double>(), 0.044);
}

// A line of `sizes:` that was forgotten: the marker moves with no joint.
TEST(Explain, AForgottenSizeIsShownByWhatMovesAboutTheSamePoint) {
  const Answered answered = run_case(10, Damage::kForgottenSize);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  ASSERT_EQ(effects(answered).size(), 1U);
  const auto truth = undeclared_case(10, Damage::kForgottenSize).world.effects.front();
  EXPECT_EQ(only_effect(answered), "tag_size " + truth.place);
  EXPECT_NEAR(answered.trace["accepted"][0]["size"].get<double>(), truth.size, 2e-3);
}

// One of no library beside a model that it bends: a wobble of another joint took a seventh of it.
TEST(Explain, WhatIsATenthOfItselfBesideTheRestIsNotNamed) {
  const Answered answered = run_case(13839);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(answered.trace["verdict"], "unknown");
  EXPECT_TRUE(effects(answered).empty()) << answered.trace["accepted"].dump();
}

TEST(Explain, AReadingThatTheFitLeftOutIsNamed) {
  const Answered answered = run_case(13, Damage::kCorruptedRow);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_NE(answered.outcome.err.find("'q7' reads 13.0056"), std::string::npos)
      << answered.outcome.err;
}

// Postures before a tracker that was bumped after a third of them: the fit of the others leaves
// these out as outliers, of every marker.
TEST(Explain, WhatIsLeftOutUpToAnEndIsExplained) {
  const Answered answered = run_case(48);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(effects(answered),
            (std::vector<std::string>{"camera_bump camera", "encoder_scale q5", "helical q2"}));
}

// Parallel axes that stand nearly upright: what gravity does to the last depends on small tilts,
// and one mass under an unknown gravity leaves some of it. It was told as a sag, a coupling and a
// scale.
TEST(Explain, ASagUnderTheGravityThatItTellsIsOneEffect) {
  const Answered answered = run_case(9526);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "compliance q4");
}

// Each of the three is hidden by the two others, and lasts as long as they do.
TEST(Explain, LargeEffectsThatHideEachOtherAreFoundTogether) {
  const Answered answered = run_case(328);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(effects(answered),
            (std::vector<std::string>{"backlash q1", "gear_error q2", "rolling_shutter camera"}));
  EXPECT_EQ(ranged_effects(answered), (std::vector<std::string>{"backlash q1", "gear_error q2"}));
}

// A guide on a curve makes another joint seem to follow the slide.
TEST(Explain, ACouplingThatTheStructureSawGivesWayToWhatExplainsMore) {
  const Answered answered = run_case(317);
  EXPECT_EQ(answered.difference, "");
  const std::vector<std::string> found = effects(answered);
  EXPECT_TRUE(std::ranges::binary_search(found, "curved_slider q2"));
  EXPECT_TRUE(std::ranges::binary_search(found, "eccentricity q4"));
  EXPECT_FALSE(std::ranges::binary_search(found, "coupling q4"));
}

// A bump of 1.2 degrees and a marker 3 % too large: a channel that rises with time (a temperature)
// seems to turn the base's marker.
TEST(Explain, ABumpIsNoJointOfAnIdleChannel) {
  const Answered answered = run_case(325);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(effects(answered), (std::vector<std::string>{"camera_bump camera", "tag_size tag_15"}));
}

// A camera that turns by 0.43 degrees while it warms up: the same channel seems to turn the base.
TEST(Explain, ADriftingCameraIsNoJointOfAnIdleChannel) {
  const Answered answered = run_case(1223);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(only_effect(answered), "camera_drift camera");
}

// A bent coupling of 2.6 degrees looks as if its channel counted in another unit.
TEST(Explain, AUnitThatAnEffectHidIsTheUsualOne) {
  const Answered answered = run_case(608);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  ASSERT_EQ(effects(answered),
            (std::vector<std::string>{"axis_wobble q2", "eccentricity q7", "tag_slip tag_11"}));
  for (const nlohmann::json& effect : answered.trace["accepted"]) {
    if (effect["place"] != "q7") continue;
    EXPECT_NEAR(effect["size"].get<double>(), 0.04548, 5e-4);
  }
}

// A marker that is bent by 0.95 mm moves with no joint exactly: the structure leaves it free.
TEST(Explain, AMarkerThatAnEffectKeptFreeIsOnItsLink) {
  const Answered answered = run_case(5095);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(answered.difference, "");
  EXPECT_EQ(effects(answered),
            (std::vector<std::string>{"bent_tag tag_12", "lens_distortion camera"}));
}

// Which way things fall shows once the bump is known, and a third effect once that is known.
TEST(Explain, GravityIsFoundBesideWhatElseWasTraced) {
  const Answered answered = run_case(398);
  EXPECT_EQ(answered.outcome.code, 0) << answered.outcome.err;
  EXPECT_EQ(effects(answered),
            (std::vector<std::string>{"camera_bump camera", "compliance q2", "helical q3"}));
}

// Poses of markers of 10 px, or of 1 px of noise, have errors that no covariance tells: a marker
// that rests looks like one on a slide, and the images settle it.
TEST(Explain, SmallAndNoisyMarkersShowTheRobot) {
  struct Case {
    std::uint64_t seed;
    std::size_t joints;
    double tag_size_m;
    double sigma_px;
  };
  for (const Case& c : {Case{5, 5, 0.012, 0.1}, Case{7, 4, 0.05, 1.0}, Case{10, 4, 0.05, 1.0}}) {
    SCOPED_TRACE(c.seed);
    truth::WorldOptions options;
    options.seed = c.seed;
    options.joints.assign(c.joints, JointType::kRevolute);
    options.tag_size_m = c.tag_size_m;
    options.sigma_px = c.sigma_px;
    options.distance_m = c.tag_size_m < 0.05 ? 1.3 : 1.0;
    const truth::World world = truth::make_world(options);
    const RecordingFolder folder;
    truth::write_world(world, folder.path());
    const std::filesystem::path out = folder.path() / "out";
    const Outcome outcome =
        run({"run", folder.path().string(), "--output", out.string(), "--no-trace"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(acceptance::structure_difference(acceptance::truth_of(world),
                                               read_urdf(out / "robot.urdf")),
              "");
  }
}

}  // namespace
}  // namespace kinescope
