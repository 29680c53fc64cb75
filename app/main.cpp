// SPDX-License-Identifier: Apache-2.0
#include <csignal>

#include "app/commands/cli.h"

int main(int argc, char** argv) {
  // A file over the limit (ulimit -f) is then one that cannot be written, and said to be.
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  return kinescope::run_program(argc, argv);
}
