// SPDX-License-Identifier: Apache-2.0
//
// The sections of the report, each a function from the facts to HTML. report_html.cpp sets their
// order.
#pragma once

#include <string>
#include <string_view>

#include "app/report/facts.h"

namespace kinescope::report {

[[nodiscard]] std::string verdict_section(const Facts& facts);
/// What a reader gets in ten seconds, and what opens the verdict: one sentence, one error with its
/// interval, what each effect was worth, what to do next, beside the robot. `lights`: HTML.
[[nodiscard]] std::string first_screen(const Facts& facts, std::string_view lights);
[[nodiscard]] std::string identity_section(const Facts& facts);
[[nodiscard]] std::string data_section(const Facts& facts);
[[nodiscard]] std::string structure_section(const Facts& facts);
[[nodiscard]] std::string view_section(const Facts& facts);
[[nodiscard]] std::string parameters_section(const Facts& facts);
[[nodiscard]] std::string errors_section(const Facts& facts);
[[nodiscard]] std::string residuals_section(const Facts& facts);
[[nodiscard]] std::string observability_section(const Facts& facts);
/// Empty for a log without torques.
[[nodiscard]] std::string torque_section(const Facts& facts);
[[nodiscard]] std::string method_section(const Facts& facts);
[[nodiscard]] std::string reproduce_section(const Facts& facts, std::string_view urdf);
[[nodiscard]] std::string licences_section();

/// The structure as a drawing: links with their markers, joints on the edges with their evidence.
[[nodiscard]] std::string tree_drawing(const Facts& facts);
/// Three orthographic views of the robot at a posture of the recording.
[[nodiscard]] std::string robot_views(const Facts& facts);
/// The first of them.
[[nodiscard]] std::string robot_still(const Facts& facts);
/// The 3-D view and its controls; hidden until the script shows it.
[[nodiscard]] std::string viewer_panel();
/// Frames of the video with the markers and residual arrows that were seen in them, the middle one
/// shown; empty where there is no video.
[[nodiscard]] std::string film(const Facts& facts);
/// What the 3-D view plays, as JSON text that is safe inside a script element.
[[nodiscard]] std::string viewer_data(const Facts& facts);

/// "Residuals" and its id as the head of a section.
[[nodiscard]] std::string section_head(std::string_view id, std::string_view title);

}  // namespace kinescope::report
