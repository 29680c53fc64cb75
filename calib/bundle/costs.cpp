// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/costs.h"

#include <algorithm>

#include <ceres/sized_cost_function.h>

#include "calib/bundle/corrected.h"

namespace kinescope::bundle {
namespace {

CameraModel camera_from(const CameraModel& base, const double* intrinsics) {
  CameraModel camera = base;
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  std::copy(intrinsics + 4, intrinsics + kMaxIntrinsics, camera.distortion.begin());
  return camera;
}

// One sighting. Blocks: camera_base, then for every joint on the way its frame and its map (or its
// value in this frame), the mount, the time offset, the intrinsics, the target.
class SightingCost final : public ceres::CostFunction {
 public:
  SightingCost(const Spec& spec, const Sighting& sighting, const Readings& readings,
               std::vector<CorrectionBlock> corrections)
      : spec_(&spec),
        sighting_(&sighting),
        readings_(&readings),
        correction_blocks_(std::move(corrections)) {
    const Marker& marker = spec.tree.markers[static_cast<std::size_t>(sighting.marker)];
    path_ = &spec.path[marker.link.index()];
    set_num_residuals(sighting.dimension());
    auto& sizes = *mutable_parameter_block_sizes();
    sizes.push_back(7);
    for (const int joint : *path_) {
      sizes.push_back(7);
      sizes.push_back(spec.free_value[static_cast<std::size_t>(joint)] ? 1 : 2);
    }
    sizes.push_back(7);
    sizes.push_back(1);
    if (sighting.camera > 0) sizes.push_back(1);
    behind_clock_ = sizes.size();
    if (sighting.kind == MeasurementKind::kCorners) sizes.push_back(kMaxIntrinsics);
    if (sighting.target >= 0) sizes.push_back(3);
    first_correction_ = sizes.size();
    for (const CorrectionBlock& block : correction_blocks_) {
      sizes.push_back(block.count);
      for (int k = 0; k < block.count; ++k) corrections_.push_back(block.first + k);
    }
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    std::vector<ChainJoint> joints(path_->size());
    std::vector<double> rates(path_->size());
    for (std::size_t k = 0; k < path_->size(); ++k) {
      joints[k] = joint_at(k, parameters);
      rates[k] = rate_at(k, parameters);
    }
    const std::size_t mount = 1 + 2 * path_->size();
    const bool corners = sighting_->kind == MeasurementKind::kCorners;
    const CameraModel& model = spec_->cameras[static_cast<std::size_t>(sighting_->camera)].model;
    const CameraModel camera = corners ? camera_from(model, parameters[behind_clock_]) : model;
    Eigen::Vector3d target = Eigen::Vector3d::Zero();
    if (sighting_->target >= 0) target = Eigen::Vector3d(parameters[behind_clock_]);
    const CorrectedSighting corrected =
        sum_corrections(*spec_, *sighting_, corrections_, values_of_corrections(parameters));
    const Eigen::Vector3d* measured = sighting_->target >= 0 ? &target : nullptr;
    const Pose T_camera_base = from_block(parameters[0]);
    const Pose T_link_marker = from_block(parameters[mount]);
    const auto take = [&](const Eigen::VectorXd& residual) {
      Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = residual;
      return residual.allFinite();
    };
    if (jacobians == nullptr) {
      const auto residual =
          corrected_residual(*spec_, *sighting_, corrected, T_camera_base, std::move(joints),
                             std::move(rates), T_link_marker, camera, measured);
      return residual && take(*residual);
    }
    const auto at = corrected_error(*spec_, *sighting_, corrected, T_camera_base, std::move(joints),
                                    std::move(rates), T_link_marker, camera, measured);
    if (!at || !take(at->error.residual)) return false;
    fill_jacobians(parameters, corrected, *at, jacobians);
    return true;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  ChainJoint joint_at(std::size_t k, double const* const* parameters) const {
    const int id = (*path_)[k];
    const Joint& joint = spec_->tree.joints[static_cast<std::size_t>(id)];
    const double* map = parameters[2 + 2 * k];
    const double value = spec_->free_value[static_cast<std::size_t>(id)]
                             ? map[0]
                             : map[0] * readings_->value(sighting_->frame, id) + map[1];
    return {joint.type, joint.axis,       from_block(parameters[1 + 2 * k]),
            value,      Vector6d::Zero(), spec_->upward[static_cast<std::size_t>(id)]};
  }

  double rate_at(std::size_t k, double const* const* parameters) const {
    const int id = (*path_)[k];
    return spec_->free_value[static_cast<std::size_t>(id)]
               ? 0.0
               : parameters[2 + 2 * k][0] * readings_->rate(sighting_->frame, id);
  }

  [[nodiscard]] std::vector<double> values_of_corrections(double const* const* parameters) const {
    std::vector<double> out;
    for (std::size_t b = 0; b < correction_blocks_.size(); ++b) {
      const double* values = parameters[first_correction_ + b];
      out.insert(out.end(), values, values + correction_blocks_[b].count);
    }
    return out;
  }

  void fill_pose(double* out, const SightingError& error, const Matrix6d& d,
                 const double* pose) const {
    if (out == nullptr) return;
    Eigen::Map<RowMajor>(out, num_residuals(), 7) =
        error.d_marker * (d * minus_jacobian(from_block(pose)));
  }

  void fill_jacobians(double const* const* parameters, const CorrectedSighting& corrected,
                      const CorrectedError& at, double** jacobians) const {
    const int rows = num_residuals();
    const ChainDerivatives& chain = at.chain;
    const SightingError& error = at.error;
    fill_pose(jacobians[0], error, chain.d_camera_base, parameters[0]);
    for (std::size_t k = 0; k < path_->size(); ++k) {
      const int id = (*path_)[k];
      fill_pose(jacobians[1 + 2 * k], error, chain.d_joint[k], parameters[1 + 2 * k]);
      const Eigen::VectorXd d_value = error.d_marker * chain.d_value[k];
      double* out = jacobians[2 + 2 * k];
      if (spec_->free_value[static_cast<std::size_t>(id)]) {
        if (out != nullptr) Eigen::Map<Eigen::VectorXd>(out, rows) = d_value;
        continue;
      }
      if (out != nullptr) {
        Eigen::Map<RowMajor> d_map(out, rows, 2);
        d_map.col(0) = d_value * readings_->value(sighting_->frame, id);
        d_map.col(1) = d_value;
      }
    }
    const std::size_t mount = 1 + 2 * path_->size();
    fill_pose(jacobians[mount], error, chain.d_mount * adjoint(exp_pose(-corrected.marker)),
              parameters[mount]);
    for (std::size_t clock = mount + 1; clock < behind_clock_; ++clock) {
      if (jacobians[clock] != nullptr) {
        Eigen::Map<Eigen::VectorXd>(jacobians[clock], rows) = at.d_time;
      }
    }
    if (sighting_->kind == MeasurementKind::kCorners && jacobians[behind_clock_] != nullptr) {
      Eigen::Map<RowMajor>(jacobians[behind_clock_], rows, kMaxIntrinsics) = error.d_intrinsics;
    }
    if (sighting_->target >= 0 && jacobians[behind_clock_] != nullptr) {
      Eigen::Map<RowMajor>(jacobians[behind_clock_], rows, 3) =
          Eigen::Matrix3d::Identity() / sighting_->sigma;
    }
    for (std::size_t b = 0; b < correction_blocks_.size(); ++b) {
      double* out = jacobians[first_correction_ + b];
      if (out == nullptr) continue;
      const CorrectionBlock& block = correction_blocks_[b];
      Eigen::Map<RowMajor> d_block(out, rows, block.count);
      for (int k = 0; k < block.count; ++k) {
        const auto c = static_cast<std::size_t>(block.first + k);
        d_block.col(k) = d_correction(*spec_, *sighting_, spec_->corrections[c], at);
      }
    }
  }

  const Spec* spec_;
  const Sighting* sighting_;
  const Readings* readings_;
  const std::vector<int>* path_;
  std::vector<CorrectionBlock> correction_blocks_;
  std::vector<int> corrections_;      // of these blocks
  std::size_t behind_clock_ = 0;      // of the blocks: intrinsics, or a target
  std::size_t first_correction_ = 0;  // of the blocks
};

// Parts of a joint frame that should stay near the nominal one: rows on the right perturbation.
class FramePrior final : public ceres::CostFunction {
 public:
  FramePrior(Pose nominal, Eigen::Matrix<double, Eigen::Dynamic, 6> whitening)
      : nominal_(std::move(nominal)), whitening_(std::move(whitening)) {
    set_num_residuals(static_cast<int>(whitening_.rows()));
    mutable_parameter_block_sizes()->push_back(7);
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Pose pose = from_block(parameters[0]);
    const Vector6d d = log_pose(nominal_.inverse() * pose);
    Eigen::Map<Eigen::VectorXd>(residuals, whitening_.rows()) = whitening_ * d;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>> slope(
          jacobians[0], whitening_.rows(), 7);
      slope = whitening_ * inverse_right_jacobian(d) * minus_jacobian(pose);
    }
    return true;
  }

 private:
  Pose nominal_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> whitening_;
};

// The direction in which a joint moves, as a right perturbation of its frame.
Vector6d motion_of(const Joint& joint) {
  Vector6d out = Vector6d::Zero();
  (joint.type == JointType::kPrismatic ? out.tail<3>() : out.head<3>()) = joint.axis;
  return out;
}

Matrix6d whitening_of(const NominalSigmas& sigmas) {
  Vector6d weights;
  weights << Eigen::Vector3d::Constant(1.0 / sigmas.rad), Eigen::Vector3d::Constant(1.0 / sigmas.m);
  return weights.asDiagonal();
}

// A value over its prior's sigma.
class CorrectionPrior final : public ceres::CostFunction {
 public:
  CorrectionPrior(double sigma, int at, int size) : weight_(1.0 / sigma), at_(at), size_(size) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(size);
  }
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    residuals[0] = weight_ * parameters[0][at_];
    if (jacobians == nullptr || jacobians[0] == nullptr) return true;
    std::fill_n(jacobians[0], size_, 0.0);
    jacobians[0][at_] = weight_;
    return true;
  }

 private:
  double weight_;
  int at_;
  int size_;
};

// A measured distance between two targets.
class DistanceCost final : public ceres::SizedCostFunction<1, 3, 3> {
 public:
  DistanceCost(double distance_m, double sigma_m) : distance_(distance_m), sigma_(sigma_m) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Vector3d between = Eigen::Map<const Eigen::Vector3d>(parameters[0]) -
                                    Eigen::Map<const Eigen::Vector3d>(parameters[1]);
    const double length = between.norm();
    if (length < 1e-9) return false;
    residuals[0] = (length - distance_) / sigma_;
    if (jacobians == nullptr) return true;
    const Eigen::Vector3d slope = between / (length * sigma_);
    for (int i = 0; i < 3; ++i) {
      if (jacobians[0] != nullptr) jacobians[0][i] = slope[i];
      if (jacobians[1] != nullptr) jacobians[1][i] = -slope[i];
    }
    return true;
  }

 private:
  double distance_;
  double sigma_;
};

}  // namespace

ceres::CostFunction* make_sighting_cost(const Spec& spec, const Sighting& sighting,
                                        const Readings& readings,
                                        std::vector<CorrectionBlock> corrections) {
  return new SightingCost(spec, sighting, readings, std::move(corrections));
}

ceres::CostFunction* make_frame_prior(const NominalSigmas& sigmas, const Joint& nominal) {
  const Vector6d motion = motion_of(nominal);
  const Matrix6d others = Matrix6d::Identity() - motion * motion.transpose();
  return new FramePrior(nominal.T_parent_joint, whitening_of(sigmas) * others);
}

ceres::CostFunction* make_zero_prior(const NominalSigmas& sigmas, const Joint& nominal) {
  return new FramePrior(nominal.T_parent_joint,
                        motion_of(nominal).transpose() * whitening_of(sigmas));
}

ceres::CostFunction* make_correction_prior(double sigma, int at, int size) {
  return new CorrectionPrior(sigma, at, size);
}

ceres::CostFunction* make_distance_cost(const TargetPair& pair) {
  return new DistanceCost(pair.distance_m, pair.sigma_m);
}

CameraModel camera_of(const Spec& spec, const State& state, std::size_t camera) {
  return camera_from(spec.cameras[camera].model, state.cameras[camera].intrinsics.data());
}

}  // namespace kinescope::bundle
