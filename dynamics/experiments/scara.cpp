// SPDX-License-Identifier: Apache-2.0
#include "dynamics/experiments/scara.h"

#include <cmath>
#include <numeric>
#include <string>
#include <vector>

#include "dynamics/data/splits.h"
#include "dynamics/experiments/reference_arms.h"

namespace kinescope::experiments {
namespace {

Rng generator(std::string_view part, int run, const ScaraOptions& options) {
  return Rng::from_name("scara " + std::string(part) + " " + std::to_string(run), options.seed);
}

}  // namespace

ComparisonCase scara_case(const Misplacement& size, int run, const ScaraOptions& options) {
  ComparisonCase out;
  out.believed = scara_arm();
  Rng places = generator("geometry", run, options);
  const DynamicModel arm = misplaced(out.believed, size.tilt_rad, size.shift_m, places);
  Rng motion = generator("motion", run, options);
  out.train = sinusoid_log(arm, {.samples = options.samples}, motion);
  out.test = sinusoid_log(arm, {.samples = options.test_samples}, motion);
  const Eigen::RowVectorXd mean = out.train.torque.colwise().mean();
  const Eigen::RowVectorXd spread =
      (out.train.torque.rowwise() - mean).colwise().norm() / std::sqrt(options.samples);
  Rng noise = generator("noise", run, options);
  add_white_noise(out.train, options.noise * spread, noise);
  return out;
}

ComparisonCase first_of(ComparisonCase all, int samples) {
  std::vector<Eigen::Index> rows(static_cast<std::size_t>(samples));
  std::iota(rows.begin(), rows.end(), Eigen::Index{0});
  all.train = select_rows(all.train, rows);
  return all;
}

}  // namespace kinescope::experiments
