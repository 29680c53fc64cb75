// SPDX-License-Identifier: Apache-2.0
#include "calib/camera/view_cost.h"

#include <algorithm>
#include <utility>

#include <ceres/cost_function.h>

namespace kinescope {
namespace {

using AllIntrinsics = Eigen::Matrix<double, kMaxIntrinsics, 1>;

AllIntrinsics intrinsics_of(const CameraModel& camera) {
  AllIntrinsics out;
  out.head<4>() << camera.fx, camera.fy, camera.cx, camera.cy;
  std::ranges::copy(camera.distortion, out.data() + 4);
  return out;
}

CameraModel with_intrinsics(CameraModel camera, const AllIntrinsics& intrinsics) {
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  std::copy_n(intrinsics.data() + 4, camera.distortion.size(), camera.distortion.begin());
  return camera;
}

class ViewCost final : public ceres::CostFunction {
 public:
  ViewCost(const CameraModel& camera, FreeIntrinsics free, ViewOfTarget view)
      : camera_(camera), free_(std::move(free)), view_(std::move(view)) {
    set_num_residuals(2 * static_cast<int>(view_.places_m.size()));
    *mutable_parameter_block_sizes() = {static_cast<int>(free_.cols()), 6};
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const CameraModel camera = camera_at(camera_, free_, parameters[0]);
    const Vector6d step = Eigen::Map<const Vector6d>(parameters[1]);
    const Pose T = view_.T_camera_target * exp_pose(step);
    const Eigen::Matrix3d R = T.matrix3();
    const Matrix6d right = inverse_right_jacobian(step).inverse();
    for (std::size_t i = 0; i < view_.places_m.size(); ++i) {
      const Eigen::Vector3d& place_m = view_.places_m[i];
      const auto at = project_with_derivatives(camera, T * place_m);
      if (!at) return false;
      const auto row = static_cast<Eigen::Index>(2 * i);
      Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()).segment<2>(row) =
          (at->pixel - view_.pixels_px[i]) / view_.sigma_px;
      if (jacobians == nullptr) continue;
      if (jacobians[0] != nullptr) {
        Eigen::Map<RowMajor>(jacobians[0], num_residuals(), free_.cols()).middleRows<2>(row) =
            at->d_intrinsics * free_ / view_.sigma_px;
      }
      if (jacobians[1] != nullptr) {
        Eigen::Matrix<double, 3, 6> d_point;
        d_point << -R * skew(place_m), R;
        Eigen::Map<RowMajor>(jacobians[1], num_residuals(), 6).middleRows<2>(row) =
            at->d_point * d_point * right / view_.sigma_px;
      }
    }
    return true;
  }

 private:
  CameraModel camera_;
  FreeIntrinsics free_;
  ViewOfTarget view_;
};

}  // namespace

CameraModel camera_at(CameraModel camera, const FreeIntrinsics& free, const double* numbers) {
  AllIntrinsics intrinsics = intrinsics_of(camera);
  const Eigen::Map<const Eigen::VectorXd> values(numbers, free.cols());
  for (Eigen::Index k = 0; k < kMaxIntrinsics; ++k)
    if (!free.row(k).isZero(0.0)) intrinsics[k] = free.row(k).dot(values);
  return with_intrinsics(std::move(camera), intrinsics);
}

Eigen::VectorXd numbers_of(const CameraModel& camera, const FreeIntrinsics& free) {
  const AllIntrinsics intrinsics = intrinsics_of(camera);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(free.cols());
  for (Eigen::Index n = 0; n < free.cols(); ++n) {
    Eigen::Index k = 0;
    free.col(n).cwiseAbs().maxCoeff(&k);
    out[n] = intrinsics[k] / free(k, n);
  }
  return out;
}

std::unique_ptr<ceres::CostFunction> make_view_cost(const CameraModel& camera,
                                                    const FreeIntrinsics& free, ViewOfTarget view) {
  return std::make_unique<ViewCost>(camera, free, std::move(view));
}

}  // namespace kinescope
