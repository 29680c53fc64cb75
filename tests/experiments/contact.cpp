// SPDX-License-Identifier: Apache-2.0
//
// Contact detection on recordings of others, beside the momentum observer at the same false-alarm
// rate, and `kinescope contact` as users run it. Needs the shared data; prints a table each.
// build/test/contact [ur6] [ur5] [logs_ur5] [logs_free] [logs_models] [logs_parametric] [logs_gip]
// [logs_semi_parametric] [logs_simulated]; logs_models is all of the models
#include <cstdio>
#include <set>
#include <string>

#include "kinematics/core/error.h"
#include "tests/experiments/contact_sets.h"

int main(int argc, char** argv) {
  const std::set<std::string> wanted(argv + 1, argv + argc);
  const auto asked = [&](const char* name) { return wanted.empty() || wanted.contains(name); };
  try {
    if (asked("ur6")) kinescope::contact_on_ur6();
    if (asked("ur5")) kinescope::contact_on_ur5();
    if (asked("logs_ur5")) kinescope::contact_logs_ur5();
    if (asked("logs_free")) kinescope::contact_logs_free();
    for (const char* model : {"parametric", "gip", "semi_parametric"}) {
      if (asked("logs_models") || asked((std::string("logs_") + model).c_str()))
        kinescope::contact_logs_model(model);
    }
    if (asked("logs_simulated")) kinescope::contact_logs_simulated();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
