// SPDX-License-Identifier: Apache-2.0
//
// Small builders of what is changed in the files of a sound recording.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kinematics/core/pose.h"
#include "kinematics/model/kinematic_tree.h"
#include "tests/app/commands/lying_input/lying_case.h"

namespace kinescope::lying {

using Row = std::vector<std::string>;

[[nodiscard]] std::vector<Row> rows_of(const std::string& text);

/// Every row but the header, by number; a row left empty is taken out.
[[nodiscard]] Change each_row(const std::string& file, const std::function<void(Row&, int)>& edit);
/// Every value of a column, by row.
[[nodiscard]] Change column(const std::string& file, const std::string& name,
                            const std::function<double(double, int)>& value);
[[nodiscard]] Change columns_exchanged(const std::string& file, const std::string& a,
                                       const std::string& b);
[[nodiscard]] Change without_column(const std::string& file, const std::string& name);
[[nodiscard]] Change is(const std::string& file, const std::string& text);
[[nodiscard]] Change without(const std::string& file);
/// The first `from` becomes `to`, or all of them.
[[nodiscard]] Change with(const std::string& file, const std::string& from, const std::string& to);
[[nodiscard]] Change with_all(const std::string& file, const std::string& from,
                              const std::string& to);
[[nodiscard]] Change all_of(const std::vector<Change>& changes);
[[nodiscard]] Change none();
/// Rows of the log from `first` to before `end` that hold what those so many rows before do.
[[nodiscard]] Change log_late(int first, int end, int rows);
/// A marker of poses.csv that lies where it was at that time from then on.
[[nodiscard]] Change marker_fallen(const std::string& body, double from_s);
/// What a drawing is with its first joint changed.
[[nodiscard]] Change first_joint(const std::function<void(Joint&)>& edit);
[[nodiscard]] Change poses_as(const std::function<Pose(const Pose&)>& other);

}  // namespace kinescope::lying
