// SPDX-License-Identifier: Apache-2.0
//
// Takes   a MAT-file of MATLAB, level 5 (`save -v6`, `save -v7`; Octave, SciPy), of either order of
//         bytes, compressed or not.
// Gives   its numeric matrices; of everything else the name and what it is.
// Method  MathWorks, "MAT-File Format" (R2024a), chapter 1, level 5.
// Not here: what a variable means (mat_log.h). Version 7.3 is HDF5 and refused, as is level 4.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace kinescope::mat {

/// A real matrix of two dimensions.
struct Variable {
  std::string name;
  Eigen::MatrixXd values;
};

/// What is no such matrix.
struct LeftOut {
  std::string name;
  std::string what;  ///< "a struct", "complex", "a text", "of 3 dimensions"
};

struct Contents {
  std::vector<Variable> variables;  ///< in the file's order
  std::vector<LeftOut> left_out;
};

/// True where the name ends in .mat, in any case.
[[nodiscard]] bool is_mat(const std::filesystem::path& path);

/// Throws bad_input naming `source`: no MAT-file, another level or version, cut off, damaged, two
/// variables of one name, more than kMostCells numbers or 1 GiB unpacked (kinematics/core/csv.h).
[[nodiscard]] Contents parse_variables(std::string_view bytes, const std::string& source);
[[nodiscard]] Contents read_variables(const std::filesystem::path& path);

}  // namespace kinescope::mat
