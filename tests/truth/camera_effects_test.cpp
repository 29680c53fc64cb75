// SPDX-License-Identifier: Apache-2.0
#include "tests/truth/camera_effects.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>

namespace kinescope::truth {
namespace {

constexpr double kExactPx = 1e-9;          // px: projections of up to 1000 px in double
constexpr double kInterpolationPx = 1e-4;  // px: the joint log between its samples, 200 Hz, cubic

EffectWorldOptions short_world(std::vector<InjectedEffect> effects = {}) {
  EffectWorldOptions options;
  options.seed = 5;
  options.frames = 60;
  options.effects = std::move(effects);
  return options;
}

EffectWorldOptions exact_world(std::vector<InjectedEffect> effects = {}) {
  EffectWorldOptions options = short_world(std::move(effects));
  options.sigma_px = 0.0;
  return options;
}

using Sightings = std::map<std::pair<int, TagId>, std::vector<Eigen::Vector2d>>;

Sightings sightings(const World& world) {
  Sightings out;
  for (const TagObservation& o : world.measurements.corners) out[{o.frame, o.id}] = o.corners_px;
  return out;
}

// Largest shift of a corner between twins, over the sightings that a predicate picks.
template <typename Picked>
double largest_shift(const World& a, const World& b, const Picked& picked) {
  const Sightings there = sightings(b);
  double largest = 0.0;
  for (const auto& [key, corners] : sightings(a)) {
    const auto other = there.find(key);
    if (other == there.end() || !picked(key.first, key.second)) continue;
    for (std::size_t c = 0; c < corners.size(); ++c)
      largest = std::max(largest, (corners[c] - other->second[c]).norm());
  }
  return largest;
}

constexpr auto kAll = [](int, TagId) { return true; };

void expect_same(const World& a, const World& b) {
  ASSERT_EQ(a.measurements.corners.size(), b.measurements.corners.size());
  for (std::size_t i = 0; i < a.measurements.corners.size(); ++i) {
    EXPECT_EQ(a.measurements.corners[i].corners_px, b.measurements.corners[i].corners_px);
    EXPECT_EQ(a.measurements.corners[i].frame, b.measurements.corners[i].frame);
  }
  EXPECT_EQ(a.log.values, b.log.values);
  EXPECT_EQ(a.log.times_s, b.log.times_s);
}

TEST(CameraEffects, TwinsAgreeToTheLastBit) {
  for (const RobotKind kind : kRobotKinds) {
    EffectWorldOptions options = short_world();
    options.kind = kind;
    options.correlated_share = 0.3;
    options.detector_bias_px = 0.02;
    expect_same(make_effect_world(options), make_effect_world(options));
  }
}

// Of every effect, at every place: the declared side and the noise stay, the corners do not.
TEST(CameraEffects, EffectsChangeTheCornersAndNothingThatIsDeclared) {
  for (const RobotKind kind : {RobotKind::kScara, RobotKind::kTree}) {
    EffectWorldOptions options = short_world();
    options.kind = kind;
    const World clean = make_effect_world(options);
    std::vector<std::string> names = library_effects();
    std::ranges::copy(own_effects(), std::back_inserter(names));
    std::erase(names, "quantisation");  // is in the log
    for (const std::string& name : names) {
      for (const InjectedEffect& effect : weakest_effects(name, robot_of(options))) {
        options.effects = {effect};
        const World world = make_effect_world(options);
        EXPECT_EQ(world.log.values, clean.log.values) << name;
        EXPECT_EQ(world.camera, clean.camera) << name;
        EXPECT_EQ(world.markers.default_size_m, clean.markers.default_size_m);
        EXPECT_EQ(world.tree.markers.front().size_m, clean.tree.markers.front().size_m);
        const double px = twin_distance_px(world, clean);
        EXPECT_GT(px, 1e-4) << name << " at " << effect.place;
        // Most of another focal length or centre looks like a camera that stands elsewhere.
        EXPECT_LT(px, name == "intrinsics" ? 3.0 : 0.5) << name << " at " << effect.place;
      }
    }
  }
}

TEST(CameraEffects, NoiseIsAsLargeAsDeclaredAndAsLong) {
  EffectWorldOptions options = short_world();
  options.frames = 600;
  options.kind = RobotKind::kGantry;
  options.correlated_share = 0.5;
  const World noisy = make_effect_world(options);
  options.sigma_px = 0.0;
  const World exact = make_effect_world(options);
  const Sightings there = sightings(exact);
  double square = 0.0;
  double product = 0.0;
  int count = 0;
  std::map<TagId, Eigen::Vector2d> before;
  for (const auto& [key, corners] : sightings(noisy)) {
    const Eigen::Vector2d stray = corners[0] - there.at(key)[0];
    square += stray.squaredNorm();
    if (before.contains(key.second)) product += stray.dot(before[key.second]);
    before[key.second] = stray;
    ++count;
  }
  EXPECT_NEAR(std::sqrt(square / (2.0 * count)), 0.1, 0.005);
  // Half of the variance remembers exp(-1 / (30 x 0.3)) from frame to frame.
  EXPECT_NEAR(product / square, 0.5 * std::exp(-1.0 / 9.0), 0.05);
}

TEST(CameraEffects, AnOffsetIsTheSameRobotAtAnotherInstant) {
  // Three frames later.
  const World late = make_effect_world(exact_world({{"time_offset", "clock", 0.1}}));
  const World clean = make_effect_world(exact_world());
  const Sightings shown = sightings(clean);
  for (const auto& [key, corners] : sightings(late)) {
    const auto same = shown.find({key.first + 3, key.second});
    if (same == shown.end()) continue;
    for (std::size_t c = 0; c < 4; ++c) EXPECT_LT((corners[c] - same->second[c]).norm(), kExactPx);
  }
  EXPECT_GT(twin_distance_px(late, clean), 1.0);
}

TEST(CameraEffects, ADriftingClockAgreesWhereItSays) {
  const World drifting =
      make_effect_world(exact_world({{"clock_drift", "clock", 1e-3, 30.0 / 59.0}}));
  const World clean = make_effect_world(exact_world());
  EXPECT_LT(largest_shift(drifting, clean, [](int f, TagId) { return f == 30; }), kExactPx);
  const double end = largest_shift(drifting, clean, [](int f, TagId) { return f == 59; });
  EXPECT_GT(end, 0.01);
}

TEST(CameraEffects, ASlipMovesOneTagFromItsInstantOn) {
  const World slipped = make_effect_world(exact_world({{"tag_slip", "tag_12", 1e-3, 0.5}}));
  const World clean = make_effect_world(exact_world());
  const auto before = [](int f, TagId) { return f < 30; };
  const auto others = [](int, TagId id) { return id != TagId{12}; };
  EXPECT_EQ(largest_shift(slipped, clean, before), 0.0);
  EXPECT_EQ(largest_shift(slipped, clean, others), 0.0);
  // 1 mm at 1.3 m and 900 px, seen obliquely, with a turn of at most half of it at the corners.
  const double after = largest_shift(slipped, clean, kAll);
  EXPECT_GT(after, 0.3);
  EXPECT_LT(after, 1.3);
}

TEST(CameraEffects, ABumpMovesEverythingFromItsInstantOn) {
  const double size = 1.0 / 900.0;
  const World bumped = make_effect_world(exact_world({{"camera_bump", "camera", size, 0.5}}));
  const World clean = make_effect_world(exact_world());
  EXPECT_EQ(largest_shift(bumped, clean, [](int f, TagId) { return f < 30; }), 0.0);
  std::set<TagId> moved;
  for (const auto& [key, corners] : sightings(bumped)) {
    const auto one = [&key = key](int f, TagId id) { return f == key.first && id == key.second; };
    if (key.first >= 30 && largest_shift(bumped, clean, one) > 0.1) moved.insert(key.second);
  }
  EXPECT_EQ(moved.size(), clean.tree.markers.size());
  EXPECT_LT(largest_shift(bumped, clean, kAll), 2.0);
}

TEST(CameraEffects, RollingShutterOfAStillRobotChangesNothing) {
  EffectWorldOptions still = exact_world({{"rolling_shutter", "camera", 3e-5, 0.5}});
  still.amplitude_rad = 0.0;
  const World rolled = make_effect_world(still);
  still.effects.clear();
  EXPECT_LT(largest_shift(rolled, make_effect_world(still), kAll), kExactPx);
}

// Corners of a row that is exposed 100 rows late lie where a clock 100 lines late shows them.
TEST(CameraEffects, RollingShutterShowsEachRowAtItsInstant) {
  const double line_s = 3e-5;
  const World rolled = make_effect_world(exact_world({{"rolling_shutter", "camera", line_s, 0.5}}));
  int checked = 0;
  for (const auto& [key, corners] : sightings(rolled)) {
    if (key.first % 20 != 7) continue;
    const double delay_s = line_s * (corners[2].y() - 360.0);
    const Sightings late =
        sightings(make_effect_world(exact_world({{"time_offset", "clock", delay_s}})));
    const auto same = late.find(key);
    if (same == late.end()) continue;
    EXPECT_LT((same->second[2] - corners[2]).norm(), 1e-6);  // px: four rounds of the row
    ++checked;
  }
  EXPECT_GT(checked, 5);
}

TEST(CameraEffects, ALargerTagIsLargerInTheImage) {
  const double size = 0.05;
  const World large = make_effect_world(exact_world({{"tag_size", "tag_11", size}}));
  const World clean = make_effect_world(exact_world());
  EXPECT_EQ(largest_shift(large, clean, [](int, TagId id) { return id != TagId{11}; }), 0.0);
  const Sightings there = sightings(clean);
  int seen = 0;
  for (const auto& [key, corners] : sightings(large)) {
    if (key.second != TagId{11} || !there.contains(key)) continue;
    const auto& before = there.at(key);
    const double ratio = (corners[0] - corners[2]).norm() / (before[0] - before[2]).norm();
    EXPECT_NEAR(ratio, 1.0 + size, 0.01);  // perspective bends the diagonal's share a little
    ++seen;
  }
  EXPECT_GT(seen, 20);
}

// Brown 1966: k1 moves a point by k1 r^3 in normalised coordinates.
TEST(CameraEffects, LensTermsActByTheirPowerOfTheRadius) {
  const double k1 = 0.01;
  const World bent = make_effect_world(exact_world({{"lens_distortion", "camera", k1}}));
  const World clean = make_effect_world(exact_world());
  const Sightings there = sightings(clean);
  for (const auto& [key, corners] : sightings(bent)) {
    const auto other = there.find(key);
    if (other == there.end()) continue;
    const auto ray = unproject(clean.camera, other->second[0]);
    const double shift = 900.0 * k1 * std::pow(ray.value_or(Eigen::Vector2d::Zero()).norm(), 3);
    EXPECT_NEAR((corners[0] - other->second[0]).norm(), shift, 1e-9 + 1e-6 * shift);
  }
  const World tangential =
      make_effect_world(exact_world({{"lens_distortion", "camera", k1, 0.0, "tangential"}}));
  EXPECT_GT(twin_distance_px(tangential, bent), 0.01);
}

TEST(CameraEffects, AFocalLengthScalesTheImageAndACentreShiftsIt) {
  const World clean = make_effect_world(exact_world());
  const World zoomed = make_effect_world(exact_world({{"intrinsics", "camera", 0.02}}));
  const World cropped =
      make_effect_world(exact_world({{"intrinsics", "camera", 7.0, 0.0, "centre"}}));
  const Eigen::Vector2d centre(clean.camera.cx, clean.camera.cy);
  const Sightings there = sightings(clean);
  for (const auto& [key, corners] : sightings(zoomed)) {
    const auto other = there.find(key);
    if (other == there.end()) continue;
    EXPECT_LT((corners[0] - centre - 1.02 * (other->second[0] - centre)).norm(), 1e-9);
  }
  EXPECT_NEAR(twin_distance_px(cropped, clean), 7.0, 1e-9);
  EXPECT_EQ(cropped.camera, clean.camera);
}

// Two opposite corners of a bent tag stand before the plane through all four, two behind it.
TEST(CameraEffects, ABentTagsCornersLeaveItsPlane) {
  EffectWorldOptions options = exact_world({{"bent_tag", "tag_12", 1e-3, 0.7}});
  const World bent = make_effect_world(options);
  const World clean = make_effect_world(exact_world());
  const Sightings there = sightings(clean);
  for (const auto& [key, corners] : sightings(bent)) {
    const auto other = there.find(key);
    if (other == there.end()) continue;
    const double moved = (corners[0] - other->second[0]).norm();
    if (key.second == TagId{12}) {
      EXPECT_GT(moved, 1e-3);
    } else {
      EXPECT_EQ(moved, 0.0);
    }
  }
}

TEST(CameraEffects, AReadingInStepsIsInTheLogAndNowhereElse) {
  const World clean = make_effect_world(exact_world());
  const World stepped = make_effect_world(exact_world({{"quantisation", "q2", 0.01}}));
  EXPECT_EQ(twin_distance_px(stepped, clean), 0.0);
  EXPECT_EQ(stepped.log.values.col(0), clean.log.values.col(0));
  const Eigen::ArrayXd off = (stepped.log.values - clean.log.values).col(1).array();
  EXPECT_LE(off.abs().maxCoeff(), 0.005 + 1e-12);
  EXPECT_GT(off.abs().maxCoeff(), 0.004);
}

TEST(CameraEffects, ChequersShiftByTheirSize) {
  const World chequered = make_effect_world(exact_world({{"own_chequer", "camera", 0.03, 80.0}}));
  const World clean = make_effect_world(exact_world());
  EXPECT_NEAR(twin_distance_px(chequered, clean), 0.03, 1e-9);
}

TEST(CameraEffects, TheLogIsRoundedToTheEncodersStep) {
  EffectWorldOptions options = exact_world();
  options.encoder_step_rad = 1e-3;
  const World world = make_effect_world(options);
  for (Eigen::Index i = 0; i < world.log.values.rows(); ++i) {
    const double steps = world.log.values(i, 0) / 1e-3;
    EXPECT_NEAR(steps, std::round(steps), 1e-9);
  }
  EXPECT_TRUE(std::ranges::is_sorted(world.log.times_s));
}

TEST(CameraEffects, DetectorBiasGrowsToItsBound) {
  EffectWorldOptions options = exact_world();
  const World clean = make_effect_world(options);
  options.detector_bias_px = 0.02;
  const World biased = make_effect_world(options);
  EXPECT_LE(largest_shift(biased, clean, kAll), 0.02);
  EXPECT_GT(largest_shift(biased, clean, kAll), 0.005);
}

TEST(CameraEffects, TagsAreSeenMostOfTheTime) {
  for (const RobotKind kind : kRobotKinds) {
    double seen = 0.0;
    double least = 1.0;
    constexpr int kSeeds = 20;
    for (int seed = 0; seed < kSeeds; ++seed) {
      EffectWorldOptions options;
      options.seed = static_cast<std::uint64_t>(seed);
      options.kind = kind;
      options.frames = 300;
      options.frame_rate_hz = 10.0;
      const World world = make_effect_world(options);
      for (const Marker& marker : world.tree.markers) {
        const double share = static_cast<double>(std::ranges::count(
                                 world.measurements.corners, marker.id, &TagObservation::id)) /
                             options.frames;
        seen += share / static_cast<double>(world.tree.markers.size()) / kSeeds;
        least = std::min(least, share);
      }
    }
    EXPECT_GT(seen, 0.9) << to_string(kind);
    EXPECT_GT(least, 0.5) << to_string(kind);
  }
}

// What false alarms are judged on holds nothing that the declared model lacks.
TEST(CameraEffects, WithoutEffectsTheDeclaredModelExplainsEverything) {
  for (const RobotKind kind : kRobotKinds) {
    EffectWorldOptions options = exact_world();
    options.kind = kind;
    options.frames = 150;
    options.frame_rate_hz = 5.0;
    const World world = make_effect_world(options);
    const Calibration found = calibrate(world.measurements, world.markers, world.log,
                                        perturbed_start(world, 0.005, 0.001, 1), {.folds = 0});
    EXPECT_EQ(found.status, CalibrationStatus::kConverged);
    EXPECT_LT(found.final_rms, kInterpolationPx) << to_string(kind);
    EXPECT_NEAR(found.time_offset_s, 0.0, 1e-6);
  }
}

TEST(CameraEffects, NamesThatAreNotThereAreRefused) {
  EXPECT_ANY_THROW(make_effect_world(exact_world({{"tag_slip", "tag_99", 1e-3}})));
  EXPECT_ANY_THROW(make_effect_world(exact_world({{"no_such_effect", "camera", 1e-3}})));
}

}  // namespace
}  // namespace kinescope::truth
