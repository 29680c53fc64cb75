// SPDX-License-Identifier: Apache-2.0
#include <exception>
#include <mutex>
#include <thread>

#include <pybind11/stl.h>

#include "app/commands/cli.h"
#include "app/python/bindings.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;

/// Ends a command from within its progress.
struct Interrupted : std::exception {
  [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }
};

/// Tells a Python function of the progress, and the command of Ctrl-C and of what that function
/// raised. Only the calling thread may unwind the command; others leave it to its next stage.
class ProgressBridge {
 public:
  explicit ProgressBridge(py::object callback) : callback_(std::move(callback)) {}

  void update(std::string_view stage, int done, int total) {
    const bool caller = std::this_thread::get_id() == caller_;
    {
      const py::gil_scoped_acquire lock;
      if (!raised_) call(stage, done, total, caller);
      if (!raised_) return;
    }
    if (caller) throw Interrupted();
  }

  /// With the lock: raises in Python what ended the command.
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  void call(std::string_view stage, int done, int total, bool caller) {
    try {
      if (caller && PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (!callback_.is_none()) callback_(text_of(stage), done, total);
    } catch (...) {
      raised_ = std::current_exception();
    }
  }

  py::object callback_;
  std::thread::id caller_ = std::this_thread::get_id();
  std::exception_ptr raised_;  // with the interpreter's lock
};

py::tuple call(const std::vector<std::string>& arguments, const py::object& callback) {
  ProgressBridge bridge(callback);
  CalledCommand out;
  {
    const py::gil_scoped_release unlocked;
    out = call_command(arguments, [&bridge](std::string_view stage, int done, int total) {
      bridge.update(stage, done, total);
    });
  }
  bridge.rethrow();
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  py::list warnings;
  for (const std::string& warning : out.warnings) warnings.append(text_of(warning));
  return py::make_tuple(static_cast<int>(out.code), text_of(out.message), text_of(out.result),
                        warnings);
}

}  // namespace

void add_commands(py::module_& m) {
  m.def("call", &call, py::arg("arguments"), py::arg("progress") = py::none(),
        "call(arguments, progress) -> (exit code, message, JSON, warnings)\n\n"
        "A command line without the program's name; prints nothing.");
}

}  // namespace kinescope::python
