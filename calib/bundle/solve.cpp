// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/solve.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>

#include <ceres/ordered_groups.h>
#include <ceres/solver.h>

#include "kinematics/core/chi_square.h"
#include "kinematics/core/median.h"
#include "kinematics/core/silence_glog.h"
#include "kinematics/core/single_threaded_blas.h"

namespace kinescope::bundle {
namespace {

// Groups smaller than this share the common noise level.
constexpr std::size_t kMinGroup = 30;
// How far the time offset may move from its start without running into the ends of the log, s.
constexpr double kOffsetMargin = 0.03;
// Width of the Cauchy loss in units of the square root of a sighting's degrees of freedom.
constexpr double kLossWidth = 3.0;

// Starts are good enough for nearly whole Gauss-Newton steps. With 1e8 what cannot be told apart
// wanders in its null space; with 1e9 where an earlier fit ended, too.
constexpr double kFirstRadius = 1e6;
// RMS share of a marker's motion: with less than that left the robot describes where it goes.
constexpr double kUndescribed = 0.25;
// A robust solution only tells the noise level and what stands out.
constexpr double kRobustTolerance = 1e-6;
// Of the cost: 1e-4 where it is 10 000, and Gauss-Newton steps leave less than what they took.
constexpr double kPlainTolerance = 1e-8;
// Of the cost, a step. A camera that drifts beside a joint that follows a temperature: from 60 to 1
// in 40 steps, then 2e-5 a step for more than 100 (`undeclared`, 13885).
constexpr double kSettledTolerance = 1e-4;

struct Misfit {
  int sighting = 0;
  double chi_square = 0.0;  // infinite where nothing can be predicted
  double rotation = 0.0;    // poses: the parts of it
  double translation = 0.0;
};

std::vector<Misfit> misfits(const Spec& spec, const State& state, const std::vector<int>& indices) {
  const Readings readings(spec, state);
  std::vector<Misfit> out;
  for (const int index : indices) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    const auto error = error_of(spec, state, readings, sighting);
    Misfit misfit{index, std::numeric_limits<double>::infinity(), 0.0, 0.0};
    if (error) {
      misfit.chi_square = error->residual.squaredNorm();
      if (sighting.kind == MeasurementKind::kPose) {
        misfit.rotation = error->residual.head<3>().squaredNorm();
        misfit.translation = error->residual.tail<3>().squaredNorm();
      }
    }
    out.push_back(misfit);
  }
  return out;
}

double robust_scale(const std::vector<double>& chi_squares, double freedom, double shrink) {
  if (chi_squares.empty()) return 1.0;
  const double ratio = median_of(chi_squares) / chi_square_quantile(freedom, 0.0) * shrink;
  return std::sqrt(std::max(ratio, 1e-12));
}

// Of poses: turns and shifts of each camera (tracker) have a noise of their own.
void rescale_poses(Spec& spec, const std::vector<Misfit>& misfits, double shrink) {
  struct Parts {
    std::vector<double> rotation, translation;
  };
  std::vector<Parts> parts(spec.cameras.size() + 1);  // of all at last
  for (const Misfit& misfit : misfits) {
    if (!std::isfinite(misfit.chi_square)) continue;
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(misfit.sighting)];
    for (Parts* of : {&parts[static_cast<std::size_t>(sighting.camera)], &parts.back()}) {
      of->rotation.push_back(misfit.rotation);
      of->translation.push_back(misfit.translation);
    }
  }
  std::vector<std::pair<double, double>> scales;
  for (const Parts& own : parts) {
    const Parts& of = own.rotation.size() >= kMinGroup ? own : parts.back();
    scales.emplace_back(robust_scale(of.rotation, 3.0, shrink),
                        robust_scale(of.translation, 3.0, shrink));
  }
  for (Sighting& sighting : spec.sightings) {
    const auto& [rotation, translation] = scales[static_cast<std::size_t>(sighting.camera)];
    sighting.whitening.leftCols<3>() /= rotation;
    sighting.whitening.rightCols<3>() /= translation;
  }
}

// Multiplies the declared sigmas so that the misfits have the size their degrees of freedom ask
// for.
void rescale(Spec& spec, const std::vector<Misfit>& misfits, double shrink) {
  if (spec.kind == MeasurementKind::kPose) {
    rescale_poses(spec, misfits, shrink);
    return;
  }
  std::vector<double> all;
  std::map<int, std::vector<double>> by_series;
  for (const Misfit& misfit : misfits) {
    if (!std::isfinite(misfit.chi_square)) continue;
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(misfit.sighting)];
    // Per degree of freedom, so that boards and tags can be mixed.
    all.push_back(misfit.chi_square / sighting.dimension());
    by_series[sighting.series].push_back(all.back());
  }
  if (all.empty()) return;
  const auto scale_of = [&](const std::vector<double>& values, int series) {
    double freedom = 8.0;
    for (const Sighting& s : spec.sightings) {
      if (series < 0 || s.series == series) {
        freedom = s.dimension();
        break;
      }
    }
    std::vector<double> chi(values);
    for (double& value : chi) value *= freedom;
    return robust_scale(chi, freedom, shrink);
  };
  const double common = scale_of(all, -1);
  std::map<int, double> scale;
  for (const auto& [series, values] : by_series) {
    // Where each frame's camera follows what it is believed by most, a marker of its own noise
    // would be believed ever more.
    const bool own = !spec.carried && values.size() >= kMinGroup;
    scale[series] = own ? scale_of(values, series) : common;
  }
  for (Sighting& sighting : spec.sightings) {
    const auto found = scale.find(sighting.series);
    sighting.sigma *= found == scale.end() ? common : found->second;
  }
}

double rms_sigma(const Spec& spec) {
  double sum = 0.0;
  for (const Sighting& s : spec.sightings) {
    const double sigma = s.kind == MeasurementKind::kPose
                             ? std::sqrt(3.0) / s.whitening.rightCols<3>().norm()
                             : s.sigma;
    sum += sigma * sigma;
  }
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, spec.sightings.size())));
}

// Sightings beyond `reject_sigma`; the others are what is used. What is off by no more than is
// usual for others is no outlier: compressed video repeats the pixels of a marker at rest, which
// then scatters by a fifth of that, and changes them once in a while.
std::vector<int> keep_inliers(const Spec& spec, const std::vector<Misfit>& misfits,
                              double reject_sigma) {
  std::vector<std::vector<double>> sigmas(spec.cameras.size());
  for (const Misfit& misfit : misfits) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(misfit.sighting)];
    sigmas[static_cast<std::size_t>(sighting.camera)].push_back(sighting.sigma);
  }
  std::vector<double> usual;  // of each camera
  for (std::vector<double>& of_camera : sigmas)
    usual.push_back(of_camera.empty() ? 0.0 : median_of(std::move(of_camera)));
  std::vector<int> kept;
  for (const Misfit& misfit : misfits) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(misfit.sighting)];
    const double share =
        sighting.kind == MeasurementKind::kPose
            ? 1.0
            : std::min(1.0, sighting.sigma / usual[static_cast<std::size_t>(sighting.camera)]);
    if (share * share * misfit.chi_square <=
        chi_square_quantile(sighting.dimension(), reject_sigma)) {
      kept.push_back(misfit.sighting);
    }
  }
  return kept;
}

// What was measured, in units of its noise.
Eigen::VectorXd whitened(const Sighting& sighting) {
  if (sighting.kind == MeasurementKind::kPoint) return sighting.position_m / sighting.sigma;
  if (sighting.kind == MeasurementKind::kPose) {
    const double per_rad = sighting.whitening.leftCols<3>().norm() / std::sqrt(3.0);
    const double per_m = sighting.whitening.rightCols<3>().norm() / std::sqrt(3.0);
    Eigen::VectorXd out(12);
    // Two rotations a small angle apart differ by its square times 2.
    out << per_rad / std::numbers::sqrt2 * sighting.T_camera_marker.matrix3().reshaped(),
        per_m * sighting.T_camera_marker.translation;
    return out;
  }
  Eigen::VectorXd out(sighting.dimension());
  for (std::size_t c = 0; c < sighting.corners_px.size(); ++c)
    out.segment<2>(2 * static_cast<Eigen::Index>(c)) = sighting.corners_px[c] / sighting.sigma;
  return out;
}

// Whether the misfits of a marker's sightings are small beside its motion.
bool is_described(const Spec& spec, const std::vector<Misfit>& of_marker) {
  const auto count = static_cast<double>(of_marker.size());
  std::vector<Eigen::VectorXd> seen;
  double left = 0.0;
  for (const Misfit& misfit : of_marker) {
    seen.push_back(whitened(spec.sightings[static_cast<std::size_t>(misfit.sighting)]));
    left += misfit.chi_square;
  }
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(seen.front().size());
  for (const Eigen::VectorXd& one : seen) mean += one / count;
  double motion = 0.0;
  for (const Eigen::VectorXd& one : seen) motion += (one - mean).squaredNorm();
  return left < kUndescribed * kUndescribed * motion;
}

// Outliers are the lesser part: which of two halves of a marker's sightings is right a robust fit
// cannot tell. All of them go back into `kept`, where the robot describes the marker at all.
void put_back_the_larger_part(const Spec& spec, const std::vector<Misfit>& misfits,
                              std::vector<int>& kept) {
  std::map<int, std::vector<Misfit>> by_series;
  for (const Misfit& misfit : misfits)
    by_series[spec.sightings[static_cast<std::size_t>(misfit.sighting)].series].push_back(misfit);
  for (const auto& [series, all] : by_series) {
    const auto rejected = std::ranges::count_if(all, [&](const Misfit& misfit) {
      return !std::ranges::binary_search(kept, misfit.sighting);
    });
    if (2 * rejected <= std::ssize(all) || !is_described(spec, all)) continue;
    std::vector<int> with;
    std::vector<int> of_series;
    for (const Misfit& misfit : all) of_series.push_back(misfit.sighting);
    std::ranges::set_union(kept, of_series, std::back_inserter(with));
    kept = std::move(with);
  }
}

// Poses of the camera, one a frame, are eliminated first: no two of them meet in a residual (Schur
// complement; Triggs et al. 2000, section 6.1). Joint values of a frame would meet them.
void eliminate_camera_poses(BuiltProblem& built, const Spec& spec,
                            ceres::Solver::Options& options) {
  const bool values = std::ranges::find(spec.free_value, true) != spec.free_value.end();
  if (built.camera_poses().empty() || values) return;
  if (built.blocks().size() == built.camera_poses().size()) return;
  options.linear_solver_type = ceres::SPARSE_SCHUR;
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  std::vector<double*> all;
  built.problem().GetParameterBlocks(&all);
  for (double* block : all) ordering->AddElementToGroup(block, 1);
  for (double* pose : built.camera_poses()) ordering->AddElementToGroup(pose, 0);
  options.linear_solver_ordering = std::move(ordering);
}

// Factor N / (N - P): residuals of a fit are smaller than the noise.
double freedom_factor(const Spec& spec, State& state, const std::vector<int>& used) {
  BuiltProblem built(spec, state, used, {});
  int unknowns = 0;
  for (const FreeBlock& block : built.blocks()) unknowns += static_cast<int>(block.names.size());
  int rows = 0;
  for (const int index : used) rows += spec.sightings[static_cast<std::size_t>(index)].dimension();
  return static_cast<double>(rows) / std::max(1.0, static_cast<double>(rows - unknowns));
}

}  // namespace

SolveSummary solve(const Spec& spec, State& state, const std::vector<int>& sightings,
                   const BuildOptions& build_options, int max_iterations) {
  silence_glog();
  BuiltProblem built(spec, state, sightings, build_options);
  if (built.blocks().empty()) return {true, true, "nothing is free", 0, 0.0, 0.0};
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  eliminate_camera_poses(built, spec, options);
  options.max_num_iterations = max_iterations;
  options.initial_trust_region_radius = kFirstRadius;
  options.function_tolerance = build_options.robust_width ? kRobustTolerance : kPlainTolerance;
  options.parameter_tolerance = 1e-12;
  options.gradient_tolerance = 1e-14;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  const SingleThreadedBlas same_bytes_on_any_number_of_cores;
  ceres::Solve(options, &built.problem(), &summary);
  // It becomes a part of longer sentences.
  if (summary.message.ends_with('.')) summary.message.pop_back();
  const bool converged = summary.termination_type == ceres::CONVERGENCE;
  std::optional<double> last_taken;
  for (const ceres::IterationSummary& iteration : summary.iterations)
    if (iteration.iteration > 0 && iteration.step_is_successful) last_taken = iteration.cost_change;
  const bool settled = summary.termination_type == ceres::NO_CONVERGENCE && last_taken &&
                       *last_taken < kSettledTolerance * summary.final_cost;
  return {converged,
          converged || settled,
          summary.message,
          static_cast<int>(summary.iterations.size()),
          summary.initial_cost,
          summary.final_cost};
}

std::vector<int> usable_sightings(const Spec& spec, const State& state) {
  // The offset will move: frames must stay within the log when it does.
  const double margin_s = spec.free_time_offset ? kOffsetMargin : 0.0;
  State at = state;
  at.time_offset[0] = state.time_offset[0] - margin_s;
  const Readings early(spec, plain_clock(spec, at));
  at.time_offset[0] = state.time_offset[0] + margin_s;
  const Readings late(spec, plain_clock(spec, at));
  std::vector<int> usable;
  for (std::size_t i = 0; i < spec.sightings.size(); ++i) {
    const Sighting& sighting = spec.sightings[i];
    const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
    const auto& path = spec.path[marker.link.index()];
    const bool known = std::ranges::all_of(path, [&](int joint) {
      return spec.channel[static_cast<std::size_t>(joint)] < 0 ||
             (early.known(sighting.frame, joint) && late.known(sighting.frame, joint));
    });
    if (known) usable.push_back(static_cast<int>(i));
  }
  return usable;
}

SolveSummary settle(Spec& spec, State& state, const std::vector<int>& sightings,
                    int max_iterations) {
  // A first solve with declared sigmas and a wide loss, then the noise level is known well enough
  // for the loss to tell outliers from noise.
  rescale(spec, misfits(spec, state, sightings), 1.0);
  const double freedom =
      sightings.empty() ? 6.0 : spec.sightings[static_cast<std::size_t>(sightings[0])].dimension();
  BuildOptions robust{kLossWidth * std::sqrt(freedom), false};
  // The start's misfit passes for noise here: beside that much of it a prior would hold all.
  constexpr double kAtFirst = 30.0;
  const std::optional<NominalSigmas> prior = spec.prior;
  if (prior) spec.prior = NominalSigmas{kAtFirst * prior->rad, kAtFirst * prior->m};
  const SolveSummary first = solve(spec, state, sightings, robust, max_iterations);
  spec.prior = prior;
  rescale(spec, misfits(spec, state, sightings), 1.0);
  SolveSummary out = solve(spec, state, sightings, robust, max_iterations);
  out.iterations += first.iterations;
  out.initial_cost = first.initial_cost;
  return out;
}

RobustSolution solve_robustly(Spec& spec, State& state, std::vector<int> sightings,
                              double reject_sigma, int max_iterations) {
  constexpr int kPasses = 2;
  const double declared = rms_sigma(spec);
  RobustSolution out;
  out.summary = settle(spec, state, sightings, max_iterations);
  out.used = sightings;
  SolveSummary second;
  for (int pass = 0; pass < kPasses; ++pass) {
    std::vector<Misfit> all = misfits(spec, state, sightings);
    rescale(spec, all, freedom_factor(spec, state, out.used));
    all = misfits(spec, state, sightings);
    out.used = keep_inliers(spec, all, reject_sigma);
    put_back_the_larger_part(spec, all, out.used);
    second = solve(spec, state, out.used, {}, max_iterations);
    out.summary.iterations += second.iterations;
  }
  out.summary.converged = second.converged;
  out.summary.message = second.message;
  out.summary.final_cost = second.final_cost;
  rescale(spec, misfits(spec, state, out.used), freedom_factor(spec, state, out.used));
  std::ranges::set_difference(sightings, out.used, std::back_inserter(out.rejected));
  out.sigma_scale = rms_sigma(spec) / declared;
  return out;
}

}  // namespace kinescope::bundle
