// SPDX-License-Identifier: Apache-2.0
//
// Takes   what the package kinescope (app/python/kinescope) calls: words of a command line, arrays.
// Gives   the extension module kinescope._kinescope.
// Units   SI, as everywhere; the package's docstrings say shapes, units and frames.
// Method  pybind11; the interpreter's lock is given up while a command or a loop over rows runs.
// Not here: names, signatures and help, which the package has.
#include <utility>

#include "app/io/output_folder.h"
#include "app/python/bindings.h"
#include "kinematics/core/error.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;

// The classes stand in Python, where they have their docstrings.
void throw_in_python(const Error& error) {
  const py::object make = py::module_::import("kinescope._errors").attr("error_of");
  const py::object raised = make(static_cast<int>(error.code()), text_of(error.what()));
  PyErr_SetObject(py::type::of(raised).ptr(), raised.ptr());
}

}  // namespace
}  // namespace kinescope::python

PYBIND11_MODULE(_kinescope, m) {
  using namespace kinescope::python;
  m.attr("__version__") = kinescope::program_version();
  pybind11::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(std::move(thrown));
    } catch (const kinescope::Error& error) {
      throw_in_python(error);
    }
  });
  add_commands(m);
  add_robot(m);
  add_calibrate(m);
  add_torque_model(m);
}
