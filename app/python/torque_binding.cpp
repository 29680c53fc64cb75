// SPDX-License-Identifier: Apache-2.0
#include <optional>

#include <fmt/format.h>
#include <pybind11/stl.h>

#include "app/io/torque_model_file.h"
#include "app/python/arrays.h"
#include "app/python/bindings.h"
#include "app/torque/saved_model_log.h"
#include "app/torque/torque_inputs.h"
#include "kinematics/core/error.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;

/// A file of dynamics --save-model.
class SavedModel {
 public:
  explicit SavedModel(const std::string& path) : file_(read_torque_model(path)) {}

  /// Mean and sigma, each samples x joints, of single samples.
  [[nodiscard]] py::tuple predict(const py::object& q, const py::object& dq, const py::object& ddq,
                                  int threads) const {
    const TorqueSamples motion = motion_of(q, dq, ddq);
    TorquePrediction out;
    {
      const py::gil_scoped_release unlocked;
      out = predict_torque(file_.model, motion.q, motion.dq, motion.ddq, threads);
    }
    return py::make_tuple(array_of(out.mean), array_of(out.sigma));
  }

  /// The same of motions, with the effects that tracing found.
  [[nodiscard]] py::tuple predict_traced(const py::object& q, const py::object& dq,
                                         const py::object& ddq, const py::object& t,
                                         const py::object& trajectory) const {
    if (!file_.traced) {
      throw bad_request("traced", "this model has no effects that tracing found",
                        "call predict without it");
    }
    TorqueSamples motion = motion_of(q, dq, ddq);
    motion.t_s = vector_of(t, "t");
    motion.trajectory = trajectory.is_none() ? Eigen::VectorXi::Zero(motion.t_s.size())
                                             : integers_of(trajectory, "trajectory");
    check_times(motion);
    TorquePrediction out;
    {
      const py::gil_scoped_release unlocked;
      out = predict_traced_torque(*file_.traced, motion);
    }
    return py::make_tuple(array_of(out.mean), array_of(out.sigma));
  }

  /// What `kinescope predict` takes from logs.
  [[nodiscard]] py::dict read_log(const std::vector<std::string>& logs,
                                  const std::optional<std::string>& settings) const {
    if (logs.empty()) throw bad_request("logs", "none is named", "name one or more");
    TorqueData read;
    {
      const py::gil_scoped_release unlocked;
      read =
          read_log_for(file_, {logs.begin(), logs.end()}, log_settings(settings, logs.front(), {}));
    }
    const TorqueSamples& samples = read.samples;
    py::dict out;
    py::list warnings;
    for (const std::string& warning : warnings_of(read.findings)) warnings.append(text_of(warning));
    out["warnings"] = warnings;
    out["t"] = py::array_t<double>(samples.t_s.size(), samples.t_s.data());
    out["trajectory"] = py::array_t<int>(samples.trajectory.size(), samples.trajectory.data());
    out["q"] = array_of(samples.q);
    out["qd"] = array_of(samples.dq);
    out["qdd"] = array_of(samples.ddq);
    Eigen::MatrixXd torque = samples.torque;
    if (samples.torque_missing.size() > 0)
      torque = samples.torque_missing.select(std::nan(""), torque.array());
    out["torque"] = array_of(torque);
    return out;
  }

  /// Half the width of bands, in sigmas, of predictions by the model itself.
  [[nodiscard]] py::tuple bands() const {
    Eigen::MatrixXd out(joints(), 2);
    for (Eigen::Index j = 0; j < joints(); ++j)
      out.row(j) << file_.model.bands.width_90(j), file_.model.bands.width_95(j);
    return py::make_tuple(array_of(out.col(0)).squeeze(), array_of(out.col(1)).squeeze());
  }

  [[nodiscard]] py::dict facts() const {
    std::vector<std::string> names;
    for (const RigidBody& body : file_.model.rigid.bodies) names.push_back(body.joint);
    py::dict out;
    out["kind"] = std::string(to_string(file_.model.kind));
    out["robot"] = file_.model.robot;
    out["joints"] = names;
    out["unit"] = file_.model.torque_unit;
    out["samples"] = file_.model.samples;
    out["traced"] = file_.traced.has_value();
    out["version"] = file_.version;
    return out;
  }

 private:
  [[nodiscard]] Eigen::Index joints() const { return std::ssize(file_.model.rigid.bodies); }

  [[nodiscard]] TorqueSamples motion_of(const py::object& q, const py::object& dq,
                                        const py::object& ddq) const {
    TorqueSamples out;
    out.q = rows_of(q, "q", joints());
    out.dq = rows_of(dq, "qd", joints());
    out.ddq = rows_of(ddq, "qdd", joints());
    if (out.dq.rows() != out.q.rows() || out.ddq.rows() != out.q.rows()) {
      throw bad_request(
          "q, qd, qdd",
          fmt::format("have {}, {} and {} rows", out.q.rows(), out.dq.rows(), out.ddq.rows()),
          "give one row a sample in each");
    }
    out.torque = Eigen::MatrixXd::Zero(out.q.rows(), out.q.cols());
    out.torque_unit = file_.model.torque_unit;
    return out;
  }

  static void check_times(const TorqueSamples& motion) {
    if (motion.t_s.size() != motion.q.rows() || motion.trajectory.size() != motion.q.rows()) {
      throw bad_request("t, trajectory",
                        fmt::format("have {} and {} entries for {} samples", motion.t_s.size(),
                                    motion.trajectory.size(), motion.q.rows()),
                        "give one a sample");
    }
    for (Eigen::Index i = 1; i < motion.t_s.size(); ++i) {
      if (motion.trajectory[i] != motion.trajectory[i - 1] || motion.t_s[i] > motion.t_s[i - 1])
        continue;
      throw bad_request(fmt::format("t[{}]", i), "does not increase within its trajectory",
                        "sort the samples by time, and number the trajectories");
    }
  }

  TorqueModelFile file_;
};

}  // namespace

void add_torque_model(py::module_& m) {
  py::class_<SavedModel>(m, "SavedModel")
      .def(py::init<const std::string&>(), py::arg("path"))
      .def("predict", &SavedModel::predict, py::arg("q"), py::arg("qd"), py::arg("qdd"),
           py::arg("threads"))
      .def("predict_traced", &SavedModel::predict_traced, py::arg("q"), py::arg("qd"),
           py::arg("qdd"), py::arg("t"), py::arg("trajectory"))
      .def("read_log", &SavedModel::read_log, py::arg("logs"), py::arg("settings"))
      .def("bands", &SavedModel::bands)
      .def("facts", &SavedModel::facts);
}

}  // namespace kinescope::python
