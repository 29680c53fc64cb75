// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/compact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamics/gp/compact_loops.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;

// One row of position features a joint: (cos, sin) or q.
void position_features(const JointKinds& joints, const double* q, double* out) {
  for (const JointKind kind : joints) {
    if (kind == JointKind::kRevolute) {
      *out++ = std::cos(*q);
      *out++ = std::sin(*q);
    } else {
      *out++ = *q;
    }
    ++q;
  }
}

Index position_count(const JointKinds& joints) {
  const auto turning = std::ranges::count(joints, JointKind::kRevolute);
  return std::ssize(joints) + turning;
}

// ddq, then the products of rates.
void motion_features(const double* motion, Index joints, double* out) {
  for (Index i = 0; i < joints; ++i) *out++ = motion[2 * joints + i];
  for (Index i = 0; i < joints; ++i) {
    for (Index j = i; j < joints; ++j) *out++ = motion[joints + i] * motion[joints + j];
  }
}

Index motion_count(Index joints) { return joints + joints * (joints + 1) / 2; }

bool has_rbf(const CompactGp& gp) { return gp.kernel.rbf_rates.size() > 0; }

void check_parts(const CompactGp& gp, const Eigen::MatrixXd& motions,
                 const Eigen::MatrixXd& features) {
  const CompactKernel& kernel = gp.kernel;
  const auto joints = std::ssize(kernel.gip_joints);
  const Index positions = position_count(kernel.gip_joints);
  const bool gip =
      joints == 0 ||
      (motions.cols() == 3 * joints && kernel.gip_motion.size() == motion_count(joints) &&
       kernel.gip_first.size() == positions && kernel.gip_second.size() == positions);
  const bool rbf = !has_rbf(gp) || kernel.rbf_rates.size() == motions.cols();
  const bool linear = kernel.linear.size() == features.cols();
  const bool sizes = gp.weights.size() == std::ssize(gp.points) &&
                     gp.root.rows() == gp.root.cols() && gp.root.cols() <= gp.weights.size() &&
                     features.rows() == motions.rows();
  const bool rows = std::ranges::all_of(
      gp.points, [&](int row) { return row >= 0 && row < static_cast<int>(motions.rows()); });
  if (gip && rbf && linear && sizes && rows) return;
  throw bad_request("process", "its kernel, points, weights and variance do not fit each other",
                    "make it with the program that reads it");
}

std::vector<int> each_once(std::vector<int> rows) {
  std::ranges::sort(rows);
  rows.erase(std::ranges::unique(rows).begin(), rows.end());
  return rows;
}

}  // namespace

// What a process has of its own.
struct CompactPredictor::Process {
  CompactKernel kernel;
  double shift = 0.0;
  std::size_t group = 0;
  Index column = 0;             // of its group's values
  Eigen::VectorXd weights;      // one a row of its group
  std::vector<Index> carriers;  // rows of its group
  Eigen::VectorXd linear_mean;  // what the linear part adds up to
  Eigen::MatrixXd linear;       // weighted features of the carriers
  Eigen::VectorXd root;         // columns of R, one after another, without zeros
  // Of the last sample.
  Eigen::VectorXd features, carried, product;

  // `rows` of the tables, ascending: those of its group.
  Process(const CompactGp& gp, const std::vector<int>& rows, const Eigen::MatrixXd& table)
      : kernel(gp.kernel),
        shift(gp.shift),
        weights(Eigen::VectorXd::Zero(std::ssize(rows))),
        linear_mean(gp.kernel.linear.size()),
        root(gp.root.cols() * (gp.root.cols() + 1) / 2),
        features(gp.kernel.linear.size()),
        carried(gp.root.cols()),
        product(gp.root.cols()) {
    const Index count = gp.root.cols();
    for (Index i = 0; i < gp.weights.size(); ++i) {
      const auto row = std::ranges::lower_bound(rows, gp.points[static_cast<std::size_t>(i)]);
      weights[row - rows.begin()] += gp.weights[i];
      if (i < count) carriers.push_back(row - rows.begin());
    }
    const Eigen::MatrixXd own = table(gp.points, Eigen::all);
    for (Index d = 0; d < linear_mean.size(); ++d) {
      linear_mean[d] =
          kernel.linear[d] * loops::dot(own.col(d).data(), gp.weights.data(), gp.weights.size());
    }
    linear = own.topRows(count) * kernel.linear.asDiagonal();
    for (Index j = 0, next = 0; j < count; next += ++j) {
      root.segment(next, j + 1) = gp.root.col(j).head(j + 1);
    }
  }
};

// What processes of the same points and parts share.
struct CompactPredictor::Group {
  std::vector<int> points;  // rows of the tables, ascending
  bool rbf = false;
  JointKinds gip_joints;
  loops::LaneTable motions, motion_features, positions;  // of the points
  // Of the kernels, one row a process.
  Eigen::MatrixXd square_rates;
  Eigen::VectorXd rbf_variances;
  loops::PolynomialFactors gip;
  // Of the last sample.
  Eigen::VectorXd own_motion, own_positions;
  loops::PolynomialFactors by_sample;  // the same times its features
  Eigen::MatrixXd values;              // points x processes

  Group(std::vector<int> rows, const CompactGp& gp, const Eigen::MatrixXd& table)
      : points(std::move(rows)), rbf(has_rbf(gp)), gip_joints(gp.kernel.gip_joints) {
    const Eigen::MatrixXd at = table(points, Eigen::all);
    if (rbf) motions = loops::LaneTable(at);
    if (gip_joints.empty()) return;
    own_motion.resize(motion_count(std::ssize(gip_joints)));
    own_positions.resize(position_count(gip_joints));
    Eigen::MatrixXd of_motion(at.rows(), own_motion.size());
    Eigen::MatrixXd of_positions(at.rows(), own_positions.size());
    for (Index i = 0; i < at.rows(); ++i) {
      take(at.row(i));
      of_motion.row(i) = own_motion;
      of_positions.row(i) = own_positions;
    }
    motion_features = loops::LaneTable(of_motion);
    positions = loops::LaneTable(of_positions);
  }

  [[nodiscard]] bool fits(const std::vector<int>& rows, const CompactGp& gp) const {
    return points == rows && rbf == has_rbf(gp) && gip_joints == gp.kernel.gip_joints;
  }

  [[nodiscard]] Index size() const { return rbf_variances.size(); }

  void add(const CompactKernel& kernel) {
    append(kernel.rbf_variance, rbf_variances);
    append(kernel.gip_offset, gip.offsets);
    append(kernel.rbf_rates.cwiseAbs2(), square_rates);
    append(kernel.gip_motion, gip.motion);
    append(kernel.gip_first, gip.first);
    append(kernel.gip_second, gip.second);
    by_sample = gip;
    const Index whole = (std::ssize(points) + loops::kLanes - 1) / loops::kLanes * loops::kLanes;
    values = Eigen::MatrixXd::Zero(whole, size());
  }

  // All but the linear parts of the kernels between the points and a motion.
  void evaluate(const Eigen::VectorXd& motion) {
    if (gip_joints.empty()) {
      values.setZero();
    } else {
      take(motion);
      by_sample.motion = gip.motion * own_motion.asDiagonal();
      by_sample.first = gip.first * own_positions.asDiagonal();
      by_sample.second = gip.second * own_positions.asDiagonal();
      loops::polynomials(motion_features, positions, gip_joints, by_sample, values);
    }
    if (rbf) loops::add_rbf(motions, motion, square_rates, rbf_variances, values);
  }

 private:
  static void append(double value, Eigen::VectorXd& to) {
    to.conservativeResize(to.size() + 1);
    to[to.size() - 1] = value;
  }
  static void append(const Eigen::VectorXd& row, Eigen::MatrixXd& to) {
    to.conservativeResize(to.rows() + 1, row.size());
    if (row.size() > 0) to.bottomRows(1) = row.transpose();
  }

  void take(const Eigen::VectorXd& motion) {
    gp::motion_features(motion.data(), std::ssize(gip_joints), own_motion.data());
    gp::position_features(gip_joints, motion.data(), own_positions.data());
  }
};

CompactPredictor::CompactPredictor(const std::vector<CompactGp>& processes,
                                   const Eigen::MatrixXd& motions,
                                   const std::vector<Eigen::MatrixXd>& features)
    : mean_(std::ssize(processes)) {
  for (std::size_t j = 0; j < processes.size(); ++j) {
    const CompactGp& gp = processes[j];
    check_parts(gp, motions, features.at(j));
    const std::vector<int> rows = each_once(gp.points);
    auto group =
        std::ranges::find_if(groups_, [&](const Group& known) { return known.fits(rows, gp); });
    if (group == groups_.end()) group = groups_.insert(groups_.end(), Group(rows, gp, motions));
    Process& own = processes_.emplace_back(gp, rows, features[j]);
    own.group = static_cast<std::size_t>(group - groups_.begin());
    own.column = group->size();
    group->add(gp.kernel);
  }
}

CompactPredictor::~CompactPredictor() = default;
CompactPredictor::CompactPredictor(CompactPredictor&&) noexcept = default;
CompactPredictor& CompactPredictor::operator=(CompactPredictor&&) noexcept = default;

const Eigen::VectorXd& CompactPredictor::mean(const Eigen::VectorXd& motion,
                                              const std::vector<Eigen::VectorXd>& features) {
  for (Group& group : groups_) group.evaluate(motion);
  for (std::size_t j = 0; j < processes_.size(); ++j) {
    Process& own = processes_[j];
    own.features = features[j];
    const Eigen::MatrixXd& values = groups_[own.group].values;
    mean_[static_cast<Index>(j)] =
        own.shift +
        loops::dot(own.weights.data(), values.col(own.column).data(), own.weights.size()) +
        loops::dot(own.linear_mean.data(), own.features.data(), own.features.size());
  }
  return mean_;
}

double CompactPredictor::variance(Index process) {
  Process& own = processes_[static_cast<std::size_t>(process)];
  const Group& group = groups_[own.group];
  const CompactKernel& kernel = own.kernel;
  double prior = group.rbf ? kernel.rbf_variance : 0.0;
  if (!kernel.gip_joints.empty()) {
    double polynomial = kernel.gip_offset;
    for (Index d = 0; d < group.own_motion.size(); ++d) {
      polynomial += kernel.gip_motion[d] * group.own_motion[d] * group.own_motion[d];
    }
    Index at = 0;
    for (const JointKind kind : kernel.gip_joints) {
      double first = 1.0;
      double second = 1.0;
      for (Index k = 0; k < (kind == JointKind::kRevolute ? 2 : 1); ++k, ++at) {
        const double square = group.own_positions[at] * group.own_positions[at];
        first += kernel.gip_first[at] * square;
        second += kernel.gip_second[at] * square;
      }
      polynomial *= first * second;
    }
    prior += polynomial;
  }
  for (Index d = 0; d < own.features.size(); ++d) {
    prior += kernel.linear[d] * own.features[d] * own.features[d];
  }
  const auto values = group.values.col(own.column);
  for (Index i = 0; i < own.carried.size(); ++i) {
    own.carried[i] = values[own.carriers[static_cast<std::size_t>(i)]];
    for (Index d = 0; d < own.features.size(); ++d)
      own.carried[i] += own.linear(i, d) * own.features[d];
  }
  loops::triangle_times(own.root.data(), own.carried.data(), own.carried.size(),
                        own.product.data());
  const double out = prior - loops::dot(own.product.data(), own.product.data(), own.product.size());
  return std::isnan(out) ? std::numeric_limits<double>::infinity() : std::max(0.0, out);
}

}  // namespace kinescope::gp
