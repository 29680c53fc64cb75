// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/linearise.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include <ceres/cost_function.h>
#include <ceres/crs_matrix.h>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/error.h"
#include "kinematics/core/median.h"

namespace kinescope::bundle {
namespace {

std::vector<double*> data_of(const std::vector<FreeBlock>& blocks) {
  std::vector<double*> data;
  for (const FreeBlock& block : blocks) data.push_back(block.data);
  return data;
}

// Some rows of a matrix, of its columns from `column` on.
Eigen::MatrixXd dense_rows(const ceres::CRSMatrix& m, int first, int count, int column,
                           int columns) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(count, columns);
  for (int i = 0; i < count; ++i) {
    const auto row = static_cast<std::size_t>(first + i);
    for (int k = m.rows[row]; k < m.rows[row + 1]; ++k) {
      const int c = m.cols[static_cast<std::size_t>(k)] - column;
      if (c >= 0 && c < columns) out(i, c) = m.values[static_cast<std::size_t>(k)];
    }
  }
  return out;
}

// The same of those among the first `width` columns that the rows have entries in.
FrameRows shown_rows(const ceres::CRSMatrix& m, int first, int count, int width) {
  std::vector<Eigen::Index> place(static_cast<std::size_t>(width), -1);
  const auto each_entry = [&](const auto& visit) {
    for (int i = 0; i < count; ++i) {
      const auto row = static_cast<std::size_t>(first + i);
      for (int k = m.rows[row]; k < m.rows[row + 1]; ++k) {
        const int column = m.cols[static_cast<std::size_t>(k)];
        if (column < width)
          visit(i, place[static_cast<std::size_t>(column)], m.values[static_cast<std::size_t>(k)]);
      }
    }
  };
  each_entry([](int, Eigen::Index& at, double) { at = 0; });
  FrameRows out;
  for (std::size_t c = 0; c < place.size(); ++c) {
    if (place[c] < 0) continue;
    place[c] = std::ssize(out.shown);
    out.shown.push_back(static_cast<Eigen::Index>(c));
  }
  out.J = Eigen::MatrixXd::Zero(count, std::ssize(out.shown));
  each_entry([&](int row, Eigen::Index at, double value) { out.J(row, at) = value; });
  return out;
}

void add_priors(BuiltProblem& built, const std::vector<double*>& parameters, int width,
                LinearBundle& out) {
  out.prior_information.resize(width, width);
  out.prior_gradient = Eigen::VectorXd::Zero(width);
  if (built.prior_ids().empty()) return;
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = parameters;
  options.residual_blocks = built.prior_ids();
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  KINESCOPE_CHECK(built.problem().Evaluate(options, nullptr, &residuals, nullptr, &jacobian),
                  "priors can be evaluated");
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < jacobian.num_rows; ++row) {
    const auto at = static_cast<std::size_t>(row);
    for (int a = jacobian.rows[at]; a < jacobian.rows[at + 1]; ++a) {
      const int column = jacobian.cols[static_cast<std::size_t>(a)];
      const double value = jacobian.values[static_cast<std::size_t>(a)];
      out.prior_gradient[column] += value * residuals[at];
      for (int b = jacobian.rows[at]; b < jacobian.rows[at + 1]; ++b) {
        entries.emplace_back(column, jacobian.cols[static_cast<std::size_t>(b)],
                             value * jacobian.values[static_cast<std::size_t>(b)]);
      }
    }
  }
  out.prior_information.setFromTriplets(entries.begin(), entries.end());
}

// Takes the frame's own unknowns out: J <- J - L (L'L)^-1 L' J.
void eliminate(FrameRows& rows, const Eigen::MatrixXd& local) {
  if (local.cols() == 0) return;
  Eigen::MatrixXd normal = local.transpose() * local;
  normal.diagonal().array() += 1e-12 * (normal.diagonal().maxCoeff() + 1e-300);
  const LdltFactor factor(normal);
  rows.J -= local * factor.solve(Eigen::MatrixXd(local.transpose() * rows.J));
  rows.r -= local * factor.solve(Eigen::VectorXd(local.transpose() * rows.r));
}

using BlocksOfFrames = std::map<int, std::vector<ceres::ResidualBlockId>>;

// The rows of the frames from `first` to before `last`.
void evaluate(BuiltProblem& built, BlocksOfFrames::const_iterator first,
              BlocksOfFrames::const_iterator last,
              const std::map<int, std::vector<FreeBlock>>& locals, int width, LinearBundle& out) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = data_of(out.blocks);
  options.apply_loss_function = false;
  for (auto frame = first; frame != last; ++frame) {
    options.residual_blocks.insert(options.residual_blocks.end(), frame->second.begin(),
                                   frame->second.end());
    if (const auto local = locals.find(frame->first); local != locals.end())
      std::ranges::copy(data_of(local->second), std::back_inserter(options.parameter_blocks));
  }
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  KINESCOPE_CHECK(built.problem().Evaluate(options, nullptr, &residuals, nullptr, &jacobian),
                  "a solution can be evaluated");
  int row = 0;
  int local_column = width;
  for (auto frame = first; frame != last; ++frame) {
    int count = 0;
    for (const ceres::ResidualBlockId id : frame->second)
      count += built.problem().GetCostFunctionForResidualBlock(id)->num_residuals();
    const auto local = locals.find(frame->first);
    const int local_width = local == locals.end() ? 0 : width_of(local->second);
    FrameRows rows = shown_rows(jacobian, row, count, width);
    rows.r = Eigen::Map<Eigen::VectorXd>(residuals.data() + row, count);
    eliminate(rows, dense_rows(jacobian, row, count, local_column, local_width));
    out.frames.emplace(frame->first, std::move(rows));
    row += count;
    local_column += local_width;
  }
}

}  // namespace

Eigen::MatrixXd FrameRows::dense(int width) const {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(J.rows(), width);
  out(Eigen::all, shown) = J;
  return out;
}

int width_of(const std::vector<FreeBlock>& blocks) {
  int width = 0;
  for (const FreeBlock& block : blocks) width += static_cast<int>(block.names.size());
  return width;
}

std::map<const double*, PoseColumns> pose_columns(const std::vector<FreeBlock>& blocks) {
  std::map<const double*, PoseColumns> out;
  int next = 0;
  for (const FreeBlock& block : blocks) {
    PoseColumns columns;
    columns.fill(-1);
    for (std::size_t i = 0; i < block.components.size(); ++i) {
      const auto component = static_cast<std::size_t>(block.components[i]);
      if (component < 6) columns[component] = next + static_cast<int>(i);
    }
    out[block.data] = columns;
    next += static_cast<int>(block.names.size());
  }
  return out;
}

LinearBundle linearise(const Spec& spec, State& state, const std::vector<int>& used) {
  BuiltProblem built(spec, state, used, {});
  LinearBundle out;
  std::map<int, std::vector<FreeBlock>> locals;
  for (const FreeBlock& block : built.blocks()) {
    if (block.local_frame < 0) {
      out.blocks.push_back(block);
    } else {
      locals[block.local_frame].push_back(block);
    }
  }
  const int width = width_of(out.blocks);
  std::map<int, std::vector<ceres::ResidualBlockId>> ids;
  for (std::size_t i = 0; i < built.sighting_ids().size(); ++i) {
    const int frame =
        i < used.size() ? spec.sightings[static_cast<std::size_t>(used[i])].frame : -1;
    ids[frame].push_back(built.sighting_ids()[i]);
  }
  // Some frames at a time: each evaluation looks at all of the problem, and the memory needed does
  // not depend on the length of the recording.
  constexpr std::ptrdiff_t kFramesAtATime = 64;
  for (auto first = ids.begin(); first != ids.end();) {
    const auto last = std::ranges::next(first, kFramesAtATime, ids.end());
    evaluate(built, first, last, locals, width, out);
    first = last;
  }
  add_priors(built, data_of(out.blocks), width, out);
  return out;
}

namespace {

// Residuals of one camera's markers, by the number of its frame among its own.
struct CameraSeries {
  std::map<int, std::map<int, Eigen::VectorXd>> by_marker;
  std::vector<double> times_s;  // of its frames
};

double correlation_time_of(const CameraSeries& camera) {
  const auto& by_marker = camera.by_marker;
  // Long recordings are thinned: neighbours are the frames that were used.
  std::set<int> used_frames;
  for (const auto& [marker, series] : by_marker) {
    for (const auto& [frame, r] : series) used_frames.insert(frame);
  }
  const std::size_t frames = used_frames.size();
  if (frames < 20) return 0.0;
  std::vector<double> steps;
  for (auto frame = used_frames.begin(); std::next(frame) != used_frames.end(); ++frame) {
    steps.push_back(*std::next(frame) - *frame);
  }
  const int step = static_cast<int>(std::lround(median_of(std::move(steps))));
  const double step_s = step * (camera.times_s.back() - camera.times_s.front()) /
                        static_cast<double>(camera.times_s.size() - 1);
  double variance = 0.0;
  for (const auto& [marker, series] : by_marker) {
    for (const auto& [frame, r] : series)
      variance += r.squaredNorm() / static_cast<double>(r.size());
  }
  std::size_t total = 0;
  for (const auto& [marker, series] : by_marker) total += series.size();
  if (total == 0 || variance <= 0.0) return 0.0;
  variance /= static_cast<double>(total);
  double sum = 0.5;
  const int max_lag = static_cast<int>(std::min<std::size_t>(frames / 4, 200));
  for (int lag = 1; lag <= max_lag; ++lag) {
    double product = 0.0;
    int pairs = 0;
    for (const auto& [marker, series] : by_marker) {
      for (const auto& [frame, r] : series) {
        const auto later = series.find(frame + lag * step);
        if (later == series.end()) continue;
        product += r.dot(later->second) / static_cast<double>(r.size());
        ++pairs;
      }
    }
    const double rho = pairs > 0 ? product / (pairs * variance) : 0.0;
    if (rho < 0.05) break;
    sum += rho;
  }
  return sum * step_s;
}

}  // namespace

double correlation_time(const Spec& spec, const State& state, const std::vector<int>& used) {
  const Readings readings(spec, state);
  // Neighbours are of one camera: frames of several stand side by side.
  std::vector<int> own_number(spec.times_s.size());
  std::vector<CameraSeries> cameras(spec.cameras.size());
  for (std::size_t f = 0; f < own_number.size(); ++f) {
    const int camera = spec.camera_of_frame.empty() ? 0 : spec.camera_of_frame[f];
    std::vector<double>& own = cameras[static_cast<std::size_t>(camera)].times_s;
    own_number[f] = static_cast<int>(own.size());
    own.push_back(spec.times_s[f]);
  }
  for (const int index : used) {
    const Sighting& sighting = spec.sightings[static_cast<std::size_t>(index)];
    if (const auto error = error_of(spec, state, readings, sighting)) {
      cameras[static_cast<std::size_t>(sighting.camera)]
          .by_marker[sighting.marker][own_number[static_cast<std::size_t>(sighting.frame)]] =
          error->residual;
    }
  }
  double longest_s = 0.0;
  for (const CameraSeries& camera : cameras)
    longest_s = std::max(longest_s, correlation_time_of(camera));
  return longest_s;
}

}  // namespace kinescope::bundle
