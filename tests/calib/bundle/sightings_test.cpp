// SPDX-License-Identifier: Apache-2.0
//
// What the sightings say about themselves: how long their errors last, which are not the marker.
#include <algorithm>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "calib/bundle/choose_sightings.h"
#include "calib/bundle/linearise.h"
#include "calib/bundle/make_spec.h"
#include "calib/bundle/solve.h"
#include "tests/truth/camera_world.h"

namespace kinescope::bundle {
namespace {

using truth::make_world;
using truth::World;

class Sightings : public ::testing::Test {
 protected:
  Sightings() {
    truth::WorldOptions options;
    options.frames = 600;
    options.sigma_px = 0.03;
    world_ = make_world(options);
  }

  /// Moves the corners of every sighting along x by `shift` of its time and marker, px.
  template <typename Shift>
  void move_corners(Shift shift) {
    for (TagObservation& seen : world_.measurements.corners) {
      const double dx =
          shift(world_.measurements.times_s[static_cast<std::size_t>(seen.frame)], seen.id);
      for (Eigen::Vector2d& corner : seen.corners_px) corner.x() += dx;
    }
  }

  void look() {
    CalibrationStart start;
    start.tree = world_.tree;
    start.T_camera_base = world_.T_camera_base;
    start.camera = world_.camera;
    spec_ = make_spec(world_.measurements, world_.markers, world_.log, start, {});
    state_ = initial_state(spec_, start);
    usable_ = usable_sightings(spec_, state_);
  }

  [[nodiscard]] std::vector<int> every(int nth) const {
    std::vector<int> out;
    std::ranges::copy_if(usable_, std::back_inserter(out), [&](int index) {
      return spec_.sightings[static_cast<std::size_t>(index)].frame % nth == 0;
    });
    return out;
  }

  World world_;
  Spec spec_;
  State state_;
  std::vector<int> usable_;
};

TEST_F(Sightings, ErrorsThatLastAreSeenToLastWhereFramesAreThinned) {
  move_corners([](double t, TagId) { return 0.3 * std::sin(2.0 * t); });
  look();
  const double all = correlation_time(spec_, state_, every(1));
  EXPECT_GT(all, 0.3);
  for (const int nth : {2, 5}) {
    EXPECT_NEAR(correlation_time(spec_, state_, every(nth)), all, 0.15 * all) << nth;
  }
}

TEST_F(Sightings, NoiseOfItsOwnInEveryFrameLastsHalfAStep) {
  look();
  EXPECT_NEAR(correlation_time(spec_, state_, every(1)), 0.5 / 30.0, 0.2 / 30.0);
  EXPECT_NEAR(correlation_time(spec_, state_, every(5)), 2.5 / 30.0, 1.0 / 30.0);
}

// A hand over a marker for 20 frames, and a marker that slips for good.
TEST_F(Sightings, ARunThatEndsIsLeftOutAndOneThatLastsIsKept) {
  const TagId covered = world_.tree.markers[1].id;
  const TagId slipped = world_.tree.markers[2].id;
  const auto is_covered = [](double t) { return t > 5.0 && t < 5.0 + 20.5 / 30.0; };
  move_corners([&](double t, TagId id) {
    if (id == covered && is_covered(t)) return 60.0;
    return id == slipped && t > 19.0 ? 60.0 : 0.0;
  });
  look();
  const ChosenSightings chosen = choose_by_neighbours(spec_, state_, usable_, 4.5);
  const std::set<int> used(chosen.used.begin(), chosen.used.end());
  int kept = 0;
  int lasting = 0;
  int after = 0;
  for (const int index : usable_) {
    const Sighting& sighting = spec_.sightings[static_cast<std::size_t>(index)];
    const TagId id = spec_.tree.markers[static_cast<std::size_t>(sighting.marker)].id;
    const double t = spec_.times_s[static_cast<std::size_t>(sighting.frame)];
    const bool is_used = used.contains(index);
    if (id == covered && is_covered(t)) kept += is_used ? 1 : 0;
    if (id != slipped || t <= 19.0) continue;
    ++after;
    lasting += is_used ? 1 : 0;
  }
  EXPECT_EQ(kept, 0);
  ASSERT_GT(after, 20);
  EXPECT_GT(lasting, after / 2);
}

// Of postures, where the model says what stands out.
TEST_F(Sightings, WhatIsRejectedUpToAnEndIsNotByChance) {
  look();
  const int slipped = 1;
  const int with_outliers = 2;
  RobustSolution solution;
  std::size_t seen = 0;
  std::vector<int> of_slipped;
  for (const int index : usable_) {
    if (spec_.sightings[static_cast<std::size_t>(index)].marker == slipped)
      of_slipped.push_back(index);
  }
  const std::size_t last = of_slipped.size() * 7 / 10;
  const std::set<int> after(of_slipped.begin() + static_cast<std::ptrdiff_t>(last),
                            of_slipped.end());
  std::set<int> outliers;
  for (const int index : usable_) {
    const int marker = spec_.sightings[static_cast<std::size_t>(index)].marker;
    if (marker == with_outliers && seen++ % 7 == 0) outliers.insert(index);
    const bool rejected = after.contains(index) || outliers.contains(index);
    (rejected ? solution.rejected : solution.used).push_back(index);
  }
  ASSERT_GT(outliers.size(), 20U);
  const std::vector<int> used = with_what_lasts(spec_, state_, solution);
  EXPECT_EQ(used.size(), usable_.size() - outliers.size());
  for (const int index : used) EXPECT_FALSE(outliers.contains(index)) << index;
  EXPECT_TRUE(std::ranges::is_sorted(used));
}

// A joint that errs at one end of its range; its marker's sightings elsewhere are outliers by
// chance.
TEST_F(Sightings, WhatIsRejectedFromOneValueOfAJointOnIsNotByChance) {
  look();
  const int seen = static_cast<int>(spec_.tree.markers.size()) - 1;
  const int joint =
      spec_.path[spec_.tree.markers[static_cast<std::size_t>(seen)].link.index()].back();
  const Readings readings(spec_, state_);
  std::vector<std::pair<double, int>> by_value;
  for (const int index : usable_) {
    const Sighting& sighting = spec_.sightings[static_cast<std::size_t>(index)];
    if (sighting.marker == seen)
      by_value.emplace_back(readings.value(sighting.frame, joint), index);
  }
  std::ranges::sort(by_value);
  std::set<int> rejected;
  std::set<int> at_the_end;
  for (std::size_t i = 0; i < by_value.size(); ++i) {
    if (10 * i >= 9 * by_value.size()) at_the_end.insert(by_value[i].second);
    if (i % 9 == 0) rejected.insert(by_value[i].second);
  }
  ASSERT_GT(at_the_end.size(), 20U);
  rejected.insert(at_the_end.begin(), at_the_end.end());
  RobustSolution solution;
  for (const int index : usable_)
    (rejected.contains(index) ? solution.rejected : solution.used).push_back(index);
  const std::vector<int> used = with_what_lasts(spec_, state_, solution);
  for (const int index : at_the_end) EXPECT_TRUE(std::ranges::binary_search(used, index)) << index;
  EXPECT_EQ(used.size(), solution.used.size() + at_the_end.size());
}

}  // namespace
}  // namespace kinescope::bundle
