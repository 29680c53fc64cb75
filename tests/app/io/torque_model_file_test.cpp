// SPDX-License-Identifier: Apache-2.0
#include "app/io/torque_model_file.h"

#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"
#include "kinematics/core/file.h"
#include "tests/app/io/recording_folder.h"
#include "tests/truth/torque_world.h"

namespace kinescope {
namespace {

struct Arm {
  DynamicModel model;
  TorqueSamples log;
};

Arm make_arm(int samples) {
  Rng rng = Rng::from_name("torque model file");
  // One slide among the joints.
  const RandomRobot robot = random_robot({.joints = 3, .prismatic_share = 0.4}, rng);
  Arm out;
  out.model = random_masses(robot.tree, {}, rng);
  out.log = torque_log_of(
      out.model, {.samples = samples, .rate_hz = 50.0, .noise = 0.01, .trajectories = 6}, rng);
  return out;
}

TorqueModelFile learned(const Arm& arm, TorqueModelKind kind, int inducing) {
  TorqueModelOptions options;
  options.samples = 150;
  options.hyperparameter_samples = 80;
  options.starts = 1;
  options.inducing_points = inducing;
  options.keep_saved = true;
  TorqueModelFile out;
  out.version = "test";
  out.model = *fit_torque_model(kind, arm.model, arm.log, options).saved;
  out.filter = {LowPass::kButterworth, 12.345678901234567};
  out.source = MotionSource::kVelocity;
  return out;
}

TEST(TorqueModelFile, TheModelReadPredictsTheSameBits) {
  const Arm arm = make_arm(400);
  const RecordingFolder folder;
  for (const TorqueModelKind kind : {TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                     TorqueModelKind::kGip, TorqueModelKind::kSemiParametric}) {
    for (const int inducing : {0, 30}) {
      SCOPED_TRACE(testing::Message() << to_string(kind) << " " << inducing);
      const TorqueModelFile written = learned(arm, kind, inducing);
      const std::string text = torque_model_json(written);
      folder.write("m.json", text);
      const TorqueModelFile read = read_torque_model(folder.path() / "m.json");
      EXPECT_EQ(torque_model_json(read), text);
      EXPECT_EQ(read.filter.cutoff_hz, written.filter.cutoff_hz);
      const auto a = predict_torque(written.model, arm.log.q, arm.log.dq, arm.log.ddq);
      const auto b = predict_torque(read.model, arm.log.q, arm.log.dq, arm.log.ddq);
      EXPECT_EQ(a.mean, b.mean);
      EXPECT_EQ(a.sigma, b.sigma);
      EXPECT_EQ(written.model.bands.of_95, read.model.bands.of_95);
    }
  }
}

// Every value of a small file replaced by what it should not be: it is read, or refused in one
// line; nothing else happens.
TEST(TorqueModelFile, WhateverIsDamagedIsReadOrRefused) {
  const Arm arm = make_arm(120);
  const RecordingFolder folder;
  for (const TorqueModelKind kind : {TorqueModelKind::kGip, TorqueModelKind::kSemiParametric}) {
    const auto whole = nlohmann::json::parse(torque_model_json(learned(arm, kind, 4)));
    int refused = 0;
    int tried = 0;
    const auto flat = whole.flatten();
    std::set<std::string> places;
    for (const auto& [pointer, value] : flat.items()) {
      // The value and all that hold it; of long lists the first two entries.
      if (pointer.find("/2") != std::string::npos && pointer.size() > 12) continue;
      for (std::string place = pointer; !place.empty(); place.resize(place.rfind('/')))
        places.insert(place);
    }
    for (const std::string& place : places) {
      for (const auto& wrong :
           {nlohmann::json(), nlohmann::json("x"), nlohmann::json(-7), nlohmann::json(1e300),
            nlohmann::json(2000000000), nlohmann::json::array(), nlohmann::json::object(),
            nlohmann::json{{1.0}}}) {
        auto damaged = whole;
        damaged[nlohmann::json::json_pointer(place)] = wrong;
        folder.write("m.json", damaged.dump());
        ++tried;
        try {
          const TorqueModelFile read = read_torque_model(folder.path() / "m.json");
          (void)predict_torque(read.model, arm.log.q.topRows(2), arm.log.dq.topRows(2),
                               arm.log.ddq.topRows(2));
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ExitCode::kBadInput) << place << ": " << error.what();
          ++refused;
        }
      }
    }
    EXPECT_GT(refused, tried / 2);
  }
}

}  // namespace
}  // namespace kinescope
