// SPDX-License-Identifier: Apache-2.0
//
// Apart from bands.cpp: a controller that asks for a band links no fit.
#include "dynamics/models/bands.h"
#include "dynamics/models/normal_widths.h"

namespace kinescope {

using Eigen::Index;

double BandFactors::width_90(Index joint) const {
  return of_90.size() > 0 ? of_90[joint] : kNormal90;
}

double BandFactors::width_95(Index joint) const {
  return of_95.size() > 0 ? of_95[joint] : kNormal95;
}

}  // namespace kinescope
