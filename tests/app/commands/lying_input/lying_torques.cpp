// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "tests/app/commands/lying_input/changes.h"
#include "tests/app/commands/lying_input/sound_recordings.h"

namespace kinescope::lying {
namespace {

Change noise_for_torques() {
  return [](Files& files) {
    Rng rng = Rng::from_name("noise for torques");
    for (const char* name : {"tau1", "tau2", "tau3"}) {
      column("log.csv", name, [&](double, int) { return rng.normal(); })(files);
    }
  };
}

}  // namespace

std::vector<LyingInput> lying_torques() {
  return {
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
}

}  // namespace kinescope::lying
