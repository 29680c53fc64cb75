// SPDX-License-Identifier: Apache-2.0
#include "app/python/arrays.h"

#include <cmath>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;
using Contiguous = py::array_t<double, py::array::c_style | py::array::forcecast>;

std::string shape_words(const py::array& array) {
  std::string out;
  for (py::ssize_t i = 0; i < array.ndim(); ++i)
    out += fmt::format("{}{}", i == 0 ? "" : ", ", array.shape(i));
  return fmt::format("({}{})", out, array.ndim() == 1 ? "," : "");
}

// Strings, objects and complex numbers would be cast silently, or not at all.
py::array real_numbers(const py::object& value, const std::string& name) {
  const py::array out = py::array::ensure(value);
  if (!out) {
    PyErr_Clear();
    throw bad_request(name, "is no array of numbers", "give a NumPy array or lists of one length");
  }
  const char kind = out.dtype().kind();
  if (std::string_view("biuf").find(kind) == std::string_view::npos) {
    throw bad_request(
        name, fmt::format("holds {}, no real numbers", py::str(out.dtype()).cast<std::string>()),
        "give an array of floats");
  }
  return out;
}

std::string place(const py::array& array, py::ssize_t flat) {
  if (array.ndim() < 2) return fmt::format("[{}]", flat);
  return fmt::format("[{}, {}]", flat / array.shape(1), flat % array.shape(1));
}

Contiguous finite_numbers(const py::array& array, const std::string& name) {
  const Contiguous out = Contiguous::ensure(array);
  if (!out) throw py::error_already_set();
  for (py::ssize_t i = 0; i < out.size(); ++i) {
    if (std::isfinite(out.data()[i])) continue;
    throw bad_request(name + place(array, i), fmt::format("is {}", out.data()[i]),
                      "leave such rows out");
  }
  return out;
}

}  // namespace

Rows rows_of(const py::object& value, const std::string& name, Eigen::Index columns) {
  const py::array array = real_numbers(value, name);
  const bool fits =
      (array.ndim() == 1 || array.ndim() == 2) && array.shape(array.ndim() - 1) == columns;
  if (!fits) {
    throw bad_request(name, "has shape " + shape_words(array),
                      fmt::format("give (N, {0}), or ({0},) for one row", columns));
  }
  const Contiguous numbers = finite_numbers(array, name);
  return Eigen::Map<const Rows>(numbers.data(), array.ndim() == 1 ? 1 : array.shape(0), columns);
}

Eigen::VectorXd vector_of(const py::object& value, const std::string& name) {
  const py::array array = real_numbers(value, name);
  if (array.ndim() != 1)
    throw bad_request(name, "has shape " + shape_words(array), "give one dimension, (N,)");
  const Contiguous numbers = finite_numbers(array, name);
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(), numbers.size());
}

Eigen::VectorXi integers_of(const py::object& value, const std::string& name) {
  const Eigen::VectorXd numbers = vector_of(value, name);
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    const bool whole = std::floor(numbers[i]) == numbers[i] &&
                       std::abs(numbers[i]) <= std::numeric_limits<int>::max();
    if (!whole)
      throw bad_request(fmt::format("{}[{}]", name, i), fmt::format("is {}", numbers[i]),
                        "give whole numbers");
  }
  return numbers.cast<int>();
}

py::array_t<double> array_of(const Eigen::MatrixXd& values) {
  py::array_t<double> out = new_array({values.rows(), values.cols()});
  Eigen::Map<Rows>(out.mutable_data(), values.rows(), values.cols()) = values;
  return out;
}

}  // namespace kinescope::python
