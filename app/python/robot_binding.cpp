// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <pybind11/stl.h>

#include "app/io/calibration_file.h"
#include "app/python/arrays.h"
#include "app/python/bindings.h"
#include "calib/camera/camera_model.h"
#include "kinematics/core/error.h"
#include "kinematics/model/kinematic_tree.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;

/// The robot and camera of a calibration. Columns of joint values are its movable joints.
class Robot {
 public:
  Robot(const std::string& text, const std::string& source) {
    Calibration read = parse_calibration(text, source);
    tree_ = std::move(read.tree);
    camera_ = read.camera;
    for (std::size_t j = 0; j < tree_.joints.size(); ++j)
      if (is_movable(tree_.joints[j])) moving_.push_back(static_cast<Eigen::Index>(j));
  }

  /// T_base_link: links x samples x 4 x 4.
  [[nodiscard]] py::array forward(const py::object& q) const {
    const Rows values = rows_of(q, "q", std::ssize(moving_));
    const auto links = std::ssize(tree_.links);
    py::array_t<double> out = new_array({links, values.rows(), 4, 4});
    double* const to = out.mutable_data();
    const py::gil_scoped_release unlocked;
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      const std::vector<Pose> poses = forward_kinematics(tree_, all_joints(values.row(i)));
      for (std::size_t l = 0; l < poses.size(); ++l) {
        const Eigen::Index at = 16 * (static_cast<Eigen::Index>(l) * values.rows() + i);
        Eigen::Map<Rows>(to + at, 4, 4) = poses[l].matrix4();
      }
    }
    return out;
  }

  /// Body Jacobians of a link: samples x 6 x movable joints.
  [[nodiscard]] py::array jacobian(const py::object& q, const std::string& link) const {
    const auto id = tree_.link(link);
    if (!id) throw bad_request("link", "no link is named " + link, "the names are in Run.links");
    const auto n = std::ssize(moving_);
    const Rows values = rows_of(q, "q", n);
    py::array_t<double> out = new_array({values.rows(), 6, n});
    double* const to = out.mutable_data();
    const py::gil_scoped_release unlocked;
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      Eigen::Map<Rows>(to + i * 6 * n, 6, n) =
          body_jacobian(tree_, all_joints(values.row(i)), *id)(Eigen::all, moving_);
    }
    return out;
  }

  /// Joint axes with all joints at zero, as screws (rotation, translation) in the base frame:
  /// movable joints x 6. Lynch and Park 2017, eq. 4.14.
  [[nodiscard]] py::array screws() const {
    const std::vector<Pose> zero =
        forward_kinematics(tree_, Eigen::VectorXd::Zero(std::ssize(tree_.joints)));
    Eigen::MatrixXd out(std::ssize(moving_), 6);
    for (Eigen::Index k = 0; k < out.rows(); ++k) {
      const Joint& joint =
          tree_.joints[static_cast<std::size_t>(moving_[static_cast<std::size_t>(k)])];
      Vector6d body = Vector6d::Zero();
      (joint.type == JointType::kRevolute ? body.head<3>() : body.tail<3>()) = joint.axis;
      out.row(k) = adjoint(zero[joint.parent.index()] * joint.T_parent_joint) * body;
    }
    return array_of(out);
  }

  /// Pixels of points in the camera's frame: points x 2, NaN behind the camera.
  [[nodiscard]] py::array project_points(const py::object& points) const {
    if (camera_.fx == 0.0)
      throw bad_request("camera", "this run used none: it was calibrated from poses or points",
                        "take a run from a video, images or corners");
    const Rows from = rows_of(points, "points", 3);
    py::array_t<double> out = new_array({from.rows(), 2});
    double* const to = out.mutable_data();
    const py::gil_scoped_release unlocked;
    const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(std::nan(""));
    for (Eigen::Index i = 0; i < from.rows(); ++i) {
      Eigen::Map<Eigen::Vector2d>(to + 2 * i) =
          project(camera_, Eigen::Vector3d(from.row(i))).value_or(nowhere);
    }
    return out;
  }

 private:
  [[nodiscard]] Eigen::VectorXd all_joints(const Eigen::VectorXd& moving) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(std::ssize(tree_.joints));
    out(moving_) = moving;
    return out;
  }

  KinematicTree tree_;
  CameraModel camera_;
  std::vector<Eigen::Index> moving_;
};

}  // namespace

void add_robot(py::module_& m) {
  py::class_<Robot>(m, "Robot")
      .def(py::init<const std::string&, const std::string&>(), py::arg("calibration_json"),
           py::arg("source"))
      .def("forward", &Robot::forward, py::arg("q"))
      .def("jacobian", &Robot::jacobian, py::arg("q"), py::arg("link"))
      .def("screws", &Robot::screws)
      .def("project", &Robot::project_points, py::arg("points"));
}

}  // namespace kinescope::python
