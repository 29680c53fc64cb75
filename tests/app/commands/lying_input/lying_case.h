// SPDX-License-Identifier: Apache-2.0
//
// A row of the tables of input that is bad or lies.
#pragma once

#include <functional>
#include <map>
#include <ostream>
#include <string>
#include <vector>

namespace kinescope::lying {

using Files = std::map<std::string, std::string>;  ///< by their path in the folder
using Change = std::function<void(Files&)>;
using Words = std::vector<std::string>;

/// What is changed in a sound recording, the command, its exit code, and the words.
struct LyingInput {
  const char* name;
  const Files& (*sound)();
  Change change;
  Words command;  ///< `{d}` at a word's beginning: the case's folder
  int code;
  Words says;         ///< each is in what the program prints
  Words silent = {};  ///< words that would lead astray
};

inline void PrintTo(const LyingInput& input, std::ostream* out) { *out << input.name; }

inline const Words kRun{"run",     "{d}",        "--output", "{d}/out",
                        "--quiet", "--no-trace", "--folds",  "0"};
inline const Words kInspect{"inspect", "{d}"};

inline const Words kDynamics{"dynamics", "{d}/log.csv", "--robot",    "{d}/robot.urdf",
                             "--model",  "parametric",  "--no-trace", "--no-robust",
                             "--output", "{d}/out",     "--quiet"};
inline const Words kPredict{"predict",  "{d}/log.csv",       "--model", "{d}/torque.json",
                            "--output", "{d}/predicted.csv", "--quiet"};

inline Words and_(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

[[nodiscard]] std::vector<LyingInput> lying_logs();       ///< joints.csv
[[nodiscard]] std::vector<LyingInput> lying_sightings();  ///< corners.csv, poses.csv
[[nodiscard]] std::vector<LyingInput> lying_settings();   ///< what stands beside them, as YAML
[[nodiscard]] std::vector<LyingInput> lying_drawings();   ///< nominal.urdf, the output, options
[[nodiscard]] std::vector<LyingInput> lying_torques();    ///< logs and models of torque

}  // namespace kinescope::lying
