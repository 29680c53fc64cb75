// SPDX-License-Identifier: Apache-2.0
#include "app/experiments/experiments.h"

namespace kinescope {

const std::vector<Experiment>& all_experiments() {
  static const std::vector<Experiment> experiments = {
      {"scara",
       "Torque models on a SCARA that is not as its data sheet says",
       {"--runs", "--samples", "--noise", "--tilt", "--shift", "--models", "--starts",
        "--search-samples", "--log"},
       {"medians", "spread", "runs"},
       scara_experiment},
      {"efficiency",
       "Torque models against the motion that they learn from",
       {"--runs", "--samples", "--noise", "--models", "--starts", "--search-samples", "--log"},
       {"medians", "spread", "runs"},
       efficiency_experiment},
      {"panda",
       "Torque models on simulated Pandas of more and more joints",
       {"--runs", "--joints", "--models", "--starts", "--search-samples"},
       {"medians", "spread", "runs"},
       panda_experiment},
      {"ur10",
       "Exact torque models from many samples of a UR10, and what inducing points cost",
       {"--runs", "--samples", "--inducing", "--models", "--starts", "--search-samples", "--log"},
       {"medians", "spread", "runs"},
       ur10_experiment},
      {"barrett",
       "Joint 4 of a WAM: outliers, friction, gravity and the mass of a sensor",
       {"--samples"},
       {"fits", "grid", "choices", "friction", "gravity", "sensor"},
       barrett_experiment},
      {"contact",
       "Contact detection and the momentum observer on a simulated arm",
       {"--runs", "--samples", "--seconds", "--noise"},
       {"detection", "detectors", "runs", "contacts", "false_alarms"},
       contact_experiment},
      {"control",
       "Learned compensation in the servo loop of a WAM, and of its joint 4 alone",
       {"--runs", "--seconds", "--joints"},
       {"wam", "feedback", "weight", "payload", "joint4"},
       control_experiment},
  };
  return experiments;
}

}  // namespace kinescope
