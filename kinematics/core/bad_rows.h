// SPDX-License-Identifier: Apache-2.0
//
// Rows of a table that a reader leaves out. A few are what happens to recordings (a sensor that
// said nothing, a file that ends early); many mean that the table is not what it is taken for.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "kinematics/core/csv.h"
#include "kinematics/core/error.h"

namespace kinescope {

/// At most 5 % of the rows are left out, in short tables at most 3, and always less than half.
/// Interpolation bridges a sample in twenty; a reader that guesses a column wrong spoils all.
class BadRows {
 public:
  /// Begins with the table's ragged rows.
  explicit BadRows(const CsvTable& table);
  /// `unit` is what is counted, `count` how many there are of it, good or bad.
  BadRows(std::string source, std::size_t count, std::string unit);

  /// One more, in this line of the file. Throws the error of the first when they are too many.
  void add(std::size_t line, const Error& error);
  [[nodiscard]] bool too_many(std::size_t bad) const;
  [[nodiscard]] std::size_t size() const { return errors_.size(); }
  /// One line that names the first and says how many there are; nothing where there is none. Before
  /// it what was passed over above the table's header.
  [[nodiscard]] std::vector<std::string> warnings() const;

 private:
  [[nodiscard]] const Error& first() const;

  std::string source_;
  std::string unit_;
  std::size_t count_;
  std::vector<std::string> titles_;
  std::vector<std::pair<std::size_t, Error>> errors_;  ///< line, what is wrong
};

}  // namespace kinescope
