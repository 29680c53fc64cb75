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
  };
  return experiments;
}

}  // namespace kinescope
