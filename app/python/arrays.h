// SPDX-License-Identifier: Apache-2.0
//
// NumPy arrays in and out: what comes in is checked, what goes out owns its memory.
#pragma once

#include <string>

#include <Eigen/Core>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace kinescope::python {

/// Row-major, as NumPy has it.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// An array of one or two dimensions with so many columns (one dimension: one row) of finite real
/// numbers, whatever its type and layout. Throws bad_request, which names the argument and the
/// entry: another shape, no numbers, complex numbers, NaN or infinity.
[[nodiscard]] Rows rows_of(const pybind11::object& value, const std::string& name,
                           Eigen::Index columns);

/// A vector of finite real numbers. Throws as rows_of().
[[nodiscard]] Eigen::VectorXd vector_of(const pybind11::object& value, const std::string& name);

/// The same with whole numbers. Throws bad_request also for others.
[[nodiscard]] Eigen::VectorXi integers_of(const pybind11::object& value, const std::string& name);

/// An array of its own of these sizes, filled by whoever asked for it.
[[nodiscard]] inline pybind11::array_t<double> new_array(std::vector<pybind11::ssize_t> shape) {
  return pybind11::array_t<double>(std::move(shape));
}

/// A copy, rows first.
[[nodiscard]] pybind11::array_t<double> array_of(const Eigen::MatrixXd& values);

}  // namespace kinescope::python
