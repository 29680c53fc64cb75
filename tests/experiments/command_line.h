// SPDX-License-Identifier: Apache-2.0
//
// How an experiment starts: its options, and one line where it fails.
#pragma once

#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace kinescope {

/// The exit code of `run` after `app` has read the options it was given.
template <typename Run>
int run_experiment(CLI::App& app, int argc, char** argv, Run run) {
  CLI11_PARSE(app, argc, argv);
  try {
    run();
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace kinescope
