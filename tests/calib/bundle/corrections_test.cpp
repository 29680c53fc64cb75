// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "calib/bundle/corrected.h"
#include "calib/bundle/make_spec.h"
#include "tests/truth/camera_effects.h"

namespace kinescope::bundle {
namespace {

using truth::make_effect_world;
using truth::make_world;
using truth::perturbed_start;
using truth::World;

// Central differences lose half of a double's digits to the step, some more to the camera's px.
constexpr double kDifferences = 1e-5;
// A corner's motion between the middle row and its own is taken as even, whatever else is
// corrected.
constexpr double kFirstOrder = 0.05;
constexpr int kFrame = 40;

// A correction with a value at which it shows, and a step for differences.
struct Case {
  Correction correction;
  double value = 0.0;
  double step = 1e-6;
};

Correction of_part(CorrectedPart part, const std::string& name, int index, int frames) {
  Correction out;
  out.name = out.block = name;
  out.part = part;
  out.index = index;
  out.share = Eigen::VectorXd::LinSpaced(frames, -1.0, 2.0);
  return out;
}

Vector6d twist(double first) {
  Vector6d out;
  out << first, -0.3, 0.8, 0.1, 0.2, -0.15;
  return out;
}

// Marker 4 sits behind joints 0 to 3 of the chain below.
std::vector<Case> all_parts(int frames) {
  std::vector<Case> out;
  for (const CorrectedPart part :
       {CorrectedPart::kJoint, CorrectedPart::kMarker, CorrectedPart::kCamera}) {
    out.push_back({of_part(part, "twist", 1, frames), 0.01});
    out.back().correction.direction = twist(0.6);
  }
  out[1].correction.index = 4;
  out.push_back({of_part(CorrectedPart::kJoint, "turning twist", 2, frames), 0.01});
  out.back().correction.twists.resize(frames, 6);
  for (int f = 0; f < frames; ++f) out.back().correction.twists.row(f) = twist(0.01 * f);
  out.push_back({of_part(CorrectedPart::kMarkerSize, "size", 4, frames), 0.02});
  out.push_back({of_part(CorrectedPart::kIntrinsic, "fx", 0, frames), 3.0, 1e-3});
  out.push_back({of_part(CorrectedPart::kIntrinsic, "cy", 3, frames), 3.0, 1e-3});
  out.push_back({of_part(CorrectedPart::kIntrinsic, "k1", 4, frames), 0.01});
  out.push_back({of_part(CorrectedPart::kIntrinsic, "p2", 7, frames), 0.01});
  out.push_back({of_part(CorrectedPart::kBloom, "bloom", 0, frames), 0.2});
  out.push_back({of_part(CorrectedPart::kReadout, "line", 0, frames), 1e-5, 1e-7});
  out.push_back({of_part(CorrectedPart::kMarkerSize, "sizes", kEverywhere, frames), 0.02});
  out.push_back({of_part(CorrectedPart::kGrowth, "growth", 0, frames), 0.02});
  out.push_back({of_part(CorrectedPart::kCarried, "carried", 0, frames), 0.01});
  out.back().correction.direction = twist(0.6);
  out.push_back({of_part(CorrectedPart::kClock, "joint's clock", 2, frames), 5e-3});
  out.push_back({of_part(CorrectedPart::kClock, "clock", kEverywhere, frames), 5e-3});
  out.push_back(out.back());
  out.back().correction.name = "clock, always";
  out.back().correction.share.resize(0);
  return out;
}

class Derivatives : public ::testing::Test {
 protected:
  void SetUp() override {
    truth::WorldOptions options;
    options.joints = {JointType::kRevolute, JointType::kPrismatic, JointType::kRevolute,
                      JointType::kRevolute};
    options.frames = 80;
    world_ = make_world(options);
    cases_ = all_parts(options.frames);
    CalibrationStart start = perturbed_start(world_, 0.005, 0.001, 1);
    for (const Case& c : cases_) start.corrections.push_back(c.correction);
    spec_ = make_spec(world_.measurements, world_.markers, world_.log, start, {});
    state_ = initial_state(spec_, start);
    const auto found = std::ranges::find_if(
        spec_.sightings, [](const Sighting& s) { return s.frame == kFrame && s.marker == 4; });
    ASSERT_NE(found, spec_.sightings.end());
    sighting_ = &*found;
  }

  [[nodiscard]] Eigen::VectorXd residual() const {
    return error_of(spec_, state_, Readings(spec_, state_), *sighting_).value().residual;
  }

  [[nodiscard]] Eigen::VectorXd analytic(std::size_t c) const {
    const auto at = corrected_error_of(spec_, state_, Readings(spec_, state_), *sighting_);
    return d_correction(spec_, *sighting_, spec_.corrections[c], at.value());
  }

  [[nodiscard]] Eigen::VectorXd numeric(std::size_t c) {
    double& value = state_.corrections[c];
    const double here = value;
    value = here + cases_[c].step;
    const Eigen::VectorXd above = residual();
    value = here - cases_[c].step;
    const Eigen::VectorXd below = residual();
    value = here;
    return (above - below) / (2.0 * cases_[c].step);
  }

  [[nodiscard]] Eigen::VectorXd residual_alone() const {
    const Readings readings(spec_, state_);
    const std::vector<int> which = corrections_of(spec_, *sighting_);
    std::vector<double> values;
    for (const int c : which) values.push_back(state_.corrections[static_cast<std::size_t>(c)]);
    return corrected_residual(
               spec_, *sighting_, sum_corrections(spec_, *sighting_, which, values),
               from_block(camera_block(state_, *sighting_).data()),
               chain_of(spec_, state_, readings, *sighting_),
               rates_of(spec_, state_, readings, *sighting_),
               from_block(state_.mounts[static_cast<std::size_t>(sighting_->marker)].data()),
               camera_of(spec_, state_, 0), nullptr)
        .value();
  }

  void compare_at(std::size_t c, double tolerance) {
    const Eigen::VectorXd differences = numeric(c);
    ASSERT_GT(differences.norm(), 0.05) << spec_.corrections[c].name;
    EXPECT_LT((analytic(c) - differences).norm(), tolerance * differences.norm())
        << spec_.corrections[c].name << " at " << state_.corrections[c];
  }

  World world_;
  std::vector<Case> cases_;
  Spec spec_;
  State state_;
  const Sighting* sighting_ = nullptr;
};

TEST_F(Derivatives, AgreeWithDifferencesWhereNothingIsCorrected) {
  for (std::size_t c = 0; c < cases_.size(); ++c) compare_at(c, kDifferences);
}

TEST_F(Derivatives, AgreeWithDifferencesWhereTheCorrectionIs) {
  for (std::size_t c = 0; c < cases_.size(); ++c) {
    state_.corrections[c] = cases_[c].value;
    compare_at(c, kDifferences);
    state_.corrections[c] = 0.0;
  }
}

TEST_F(Derivatives, AgreeWithDifferencesBesideAllOthers) {
  for (std::size_t c = 0; c < cases_.size(); ++c) {
    if (spec_.corrections[c].part != CorrectedPart::kReadout)
      state_.corrections[c] = cases_[c].value;
  }
  for (std::size_t c = 0; c < cases_.size(); ++c) compare_at(c, kDifferences);
}

TEST_F(Derivatives, HoldToFirstOrderBesideARollingShutter) {
  for (std::size_t c = 0; c < cases_.size(); ++c) state_.corrections[c] = cases_[c].value;
  for (std::size_t c = 0; c < cases_.size(); ++c) compare_at(c, kFirstOrder);
}

TEST_F(Derivatives, OfNoUseAreLeftOutOfTheSameResidual) {
  for (std::size_t c = 0; c < cases_.size(); ++c) {
    state_.corrections[c] = cases_[c].value;
    EXPECT_LT((residual_alone() - residual()).norm(), 1e-9) << spec_.corrections[c].name;
  }
}

TEST_F(Derivatives, CorrectionsBearOnWhatTheyMove) {
  const auto bears = [&](const Sighting& sighting, int c) {
    return std::ranges::count(corrections_of(spec_, sighting), c) == 1;
  };
  for (const Sighting& sighting : spec_.sightings) {
    const auto at = spec_.tree.markers[static_cast<std::size_t>(sighting.marker)].link.index();
    EXPECT_EQ(bears(sighting, 0), at >= 2U);  // behind joint 1
    EXPECT_EQ(bears(sighting, 1), sighting.marker == 4);
    EXPECT_TRUE(bears(sighting, 2));
    EXPECT_EQ(bears(sighting, 3), at >= 3U);
    EXPECT_EQ(bears(sighting, 4), sighting.marker == 4);
  }
}

TEST_F(Derivatives, CorrectionsBearWhereTheyHaveAShare) {
  const std::vector<int> with = corrections_of(spec_, *sighting_);
  for (const int c : with) {
    Correction& correction = spec_.corrections[static_cast<std::size_t>(c)];
    if (correction.twists.rows() > 0) correction.twists.row(kFrame).setZero();
    if (correction.share.size() > 0) correction.share[kFrame] = 0.0;
  }
  const std::vector<int> without = corrections_of(spec_, *sighting_);
  EXPECT_LT(without.size(), with.size());
  for (const int c : without) {
    const Correction& correction = spec_.corrections[static_cast<std::size_t>(c)];
    EXPECT_EQ(correction.twists.rows() + correction.share.size(), 0) << correction.name;
  }
}

// The correction that undoes an effect: of the joint's own value, over the frames as logged.
Correction joint_correction(const World& world, int joint, const Eigen::VectorXd& share) {
  Correction out;
  out.name = "known effect";
  out.block = world.tree.joints[static_cast<std::size_t>(joint)].name;
  out.index = joint;
  out.direction.head<3>() = world.tree.joints[static_cast<std::size_t>(joint)].axis;
  out.share = share;
  return out;
}

const Parameter& parameter_named(const Calibration& found, std::string_view name) {
  const auto at = std::ranges::find(found.parameters, name, &Parameter::name);
  if (at == found.parameters.end()) throw std::logic_error("no parameter " + std::string(name));
  return *at;
}

truth::EffectWorldOptions filmed(std::vector<truth::InjectedEffect> effects) {
  truth::EffectWorldOptions options;
  options.seed = 11;
  options.frames = 200;
  options.frame_rate_hz = 200.0 / 33.0;
  options.sigma_px = 0.03;
  options.effects = std::move(effects);
  return options;
}

// What the log says at the frames.
Eigen::MatrixXd logged(const World& world) {
  return resample(world.log, world.measurements.times_s);
}

TEST(Corrections, AScaleErrorIsRecovered) {
  constexpr double kScale = 5e-3;
  const World world = make_effect_world(filmed({{"encoder_scale", "q2", kScale}}));
  CalibrationStart start = perturbed_start(world, 0.005, 0.001, 2);
  const Calibration plain =
      calibrate(world.measurements, world.markers, world.log, start, {.folds = 0});
  start.corrections = {joint_correction(world, 1, logged(world).col(1))};
  const Calibration found =
      calibrate(world.measurements, world.markers, world.log, start, {.folds = 0});
  const Parameter& scale = parameter_named(found, "known effect");
  ASSERT_TRUE(scale.sigma);
  EXPECT_LT(std::abs(scale.value - kScale), 4.0 * *scale.sigma);
  EXPECT_LT(*scale.sigma, 0.05 * kScale);
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.03, 0.0015);
  EXPECT_GT(plain.final_rms, 1.1 * found.final_rms);
}

TEST(Corrections, AnEccentricityIsRecovered) {
  constexpr double kAmplitude = 5e-3;
  const World world = make_effect_world(filmed({{"eccentricity", "q3", kAmplitude, 2.0}}));
  CalibrationStart start = perturbed_start(world, 0.005, 0.001, 3);
  const Eigen::ArrayXd angle = 2.0 * logged(world).col(2).array();
  start.corrections = {joint_correction(world, 2, angle.sin()),
                       joint_correction(world, 2, angle.cos())};
  start.corrections[1].name = "known effect, cosine";
  const Calibration found =
      calibrate(world.measurements, world.markers, world.log, start, {.folds = 0});
  const Parameter& sine = parameter_named(found, "known effect");
  const Parameter& cosine = parameter_named(found, "known effect, cosine");
  ASSERT_TRUE(sine.sigma && cosine.sigma);
  const double sigma = std::max(*sine.sigma, *cosine.sigma);
  EXPECT_LT(std::abs(std::hypot(sine.value, cosine.value) - kAmplitude), 4.0 * sigma);
  EXPECT_LT(sigma, 0.05 * kAmplitude);
  EXPECT_NEAR(found.final_rms, std::numbers::sqrt2 * 0.03, 0.0015);
}

}  // namespace
}  // namespace kinescope::bundle
