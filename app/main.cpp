// SPDX-License-Identifier: Apache-2.0
#include "app/commands/cli.h"

int main(int argc, char** argv) {
  kinescope::prepare_process(argv);
  return kinescope::run_program(argc, argv);
}
