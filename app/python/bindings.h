// SPDX-License-Identifier: Apache-2.0
//
// The parts of the module, each in a file of its own.
#pragma once

#include <string_view>

#include <pybind11/pybind11.h>

namespace kinescope::python {

/// What is no UTF-8 (bytes of a file's name) becomes U+FFFD.
[[nodiscard]] inline pybind11::str text_of(std::string_view text) {
  PyObject* const out =
      PyUnicode_DecodeUTF8(text.data(), static_cast<Py_ssize_t>(text.size()), "replace");
  if (out == nullptr) throw pybind11::error_already_set();
  return pybind11::reinterpret_steal<pybind11::str>(out);
}

void add_commands(pybind11::module_& m);
void add_robot(pybind11::module_& m);
void add_calibrate(pybind11::module_& m);
void add_torque_model(pybind11::module_& m);

}  // namespace kinescope::python
