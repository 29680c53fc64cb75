// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/process_values.h"

#include <algorithm>
#include <numeric>

#include "dynamics/models/joint_kinds.h"
#include "kinematics/core/error.h"

namespace kinescope::models {
namespace {

using Eigen::Index;

// Parameters one after another.
class Values {
 public:
  explicit Values(const std::vector<gp::Parameter>& parameters) : parameters_(parameters) {}
  [[nodiscard]] double one() { return parameters_[next_++].value; }
  [[nodiscard]] Eigen::VectorXd several(Index count) {
    Eigen::VectorXd out(count);
    for (double& value : out) value = one();
    return out;
  }
  [[nodiscard]] bool all_taken() const { return next_ == parameters_.size(); }

 private:
  const std::vector<gp::Parameter>& parameters_;
  std::size_t next_ = 0;
};

// In squared units of the torque, of inputs as they are.
gp::CompactKernel compact_kernel(TorqueModelKind kind, const JointProcess& process,
                                 const gp::JointKinds& joints) {
  const gp::Normalisation& normalisation = process.function.normalisation;
  const double square = normalisation.target_scale[0] * normalisation.target_scale[0];
  const Index n = std::ssize(joints);
  Values values(process.function.kernel.parameters());
  gp::CompactKernel out;
  if (kind == TorqueModelKind::kGip) {
    out.gip_joints = joints;
    out.gip_offset = square * values.one();
    out.gip_motion = square * values.several(n + n * (n + 1) / 2);
    const Index positions = n + std::ranges::count(joints, gp::JointKind::kRevolute);
    out.gip_first.resize(positions);
    out.gip_second.resize(positions);
    Index at = 0;
    for (const gp::JointKind joint : joints) {
      const Index size = joint == gp::JointKind::kRevolute ? 2 : 1;
      out.gip_first.segment(at, size) = values.several(size);
      out.gip_second.segment(at, size) = values.several(size);
      at += size;
    }
    out.linear = square * values.several(2);  // friction
  } else {
    if (kind == TorqueModelKind::kSemiParametric)
      out.linear = square * values.one() * process.feature_prior;
    out.rbf_variance = square * values.one();
    out.rbf_rates = values.several(3 * n).cwiseInverse();
    if (normalisation.input_scale.size() > 0)
      out.rbf_rates = out.rbf_rates.cwiseQuotient(normalisation.input_scale.transpose());
  }
  KINESCOPE_CHECK(values.all_taken(), "a kernel with other parameters");
  return out;
}

// The inducing inputs' own rows first.
std::vector<int> carriers_first(const Eigen::MatrixXd& inputs, const Eigen::MatrixXd& inducing) {
  std::vector<char> taken(static_cast<std::size_t>(inputs.rows()), 0);
  std::vector<int> out;
  for (Index k = 0; k < inducing.rows(); ++k) {
    for (Index i = 0; i < inputs.rows(); ++i) {
      if (taken[static_cast<std::size_t>(i)] != 0 || inputs.row(i) != inducing.row(k)) continue;
      taken[static_cast<std::size_t>(i)] = 1;
      out.push_back(static_cast<int>(i));
      break;
    }
  }
  KINESCOPE_CHECK(std::ssize(out) == inducing.rows(), "inducing inputs are samples");
  for (Index i = 0; i < inputs.rows(); ++i) {
    if (taken[static_cast<std::size_t>(i)] == 0) out.push_back(static_cast<int>(i));
  }
  return out;
}

void append_motions(const Eigen::MatrixXd& motions, Eigen::MatrixXd& all) {
  const Index before = all.rows();
  all.conservativeResize(before + motions.rows(), motions.cols());
  all.bottomRows(motions.rows()) = motions;
}

}  // namespace

void add_process(TorqueModelKind kind, const JointProcess& process, const Eigen::MatrixXd& root,
                 SavedTorqueModel& model) {
  const gp::JointKinds joints = joint_kinds(model.rigid);
  const Index columns = 3 * std::ssize(joints);
  const gp::Normalisation& normalisation = process.function.normalisation;
  const double scale = normalisation.target_scale[0];
  SavedProcess out;
  out.gp.kernel = compact_kernel(kind, process, joints);
  out.gp.shift = normalisation.target_shift[0];
  out.gp.root = root / scale;
  out.features = kind == TorqueModelKind::kGip              ? SavedProcess::Features::kFriction
                 : kind == TorqueModelKind::kSemiParametric ? SavedProcess::Features::kTerms
                                                            : SavedProcess::Features::kNone;
  if (out.features == SavedProcess::Features::kTerms) out.terms = process.terms;
  const Eigen::MatrixXd& points = process.sparse ? process.inducing : process.inputs;
  const Eigen::MatrixXd motions = points.leftCols(columns);
  // Joints that learned from the same samples share them.
  Index first = 0;
  if (model.motions.rows() == motions.rows() && model.motions == motions) {
    first = 0;
  } else {
    first = model.motions.rows();
    append_motions(motions, model.motions);
  }
  if (process.sparse) {
    out.gp.points.resize(static_cast<std::size_t>(points.rows()));
    std::iota(out.gp.points.begin(), out.gp.points.end(), 0);
  } else {
    out.gp.points = carriers_first(process.inputs, process.inducing);
  }
  // normalised mean = sum w k / scale^2.
  out.gp.weights = process.weights(out.gp.points) / scale;
  for (int& row : out.gp.points) row += static_cast<int>(first);
  model.processes.push_back(std::move(out));
}

void add_constant_process(double mean, SavedTorqueModel& model) {
  SavedProcess out;
  out.gp.shift = mean;
  model.processes.push_back(std::move(out));
}

}  // namespace kinescope::models
