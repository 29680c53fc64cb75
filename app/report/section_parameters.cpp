// SPDX-License-Identifier: Apache-2.0
//
// Every parameter with its expanded uncertainty.
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

/// What stands for a missing uncertainty: a block with no parameter in the fit was held.
std::string_view absent_word(const Facts& facts, std::string_view block) {
  for (const Parameter& parameter : facts.run.calibration.parameters) {
    if (parameter.block == block) return "not determined";
  }
  return "held";
}

std::string joints_table(const Facts& facts) {
  Table table("axes-table",
              "Joint axes in the base frame, all joints at their mean value (U: expanded "
              "uncertainty, k = 2)",
              facts.result);
  table.header({"Joint", "Type", "Direction x", "y", "z", "U direction, °", "Point x, mm", "y, mm",
                "z, mm", "U position, mm", "Scale", "U scale", "Offset", "U offset"});
  const KinematicTree& tree = facts.run.calibration.tree;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const Joint& joint = tree.joints[j];
    if (joint.type == JointType::kFixed) continue;
    const std::string at = fmt::format("/calibration/joints/{}", j);
    const bool slides = joint.type == JointType::kPrismatic;
    const std::string_view absent = absent_word(facts, joint.name);
    table.begin_row();
    table.text(joint.name);
    table.text(kinescope::to_string(joint.type));
    for (int k = 0; k < 3; ++k) {
      table.value(fmt::format("{}/axis_base/{}", at, k), at + "/direction_expanded_rad",
                  Quantity::kPlain);
    }
    table.uncertainty(at + "/direction_expanded_rad", Quantity::kAngle, absent);
    for (int k = 0; k < 3; ++k) {
      if (slides) {
        table.text("–");
      } else {
        table.value(fmt::format("{}/point_base_m/{}", at, k), at + "/position_expanded_m",
                    Quantity::kLength);
      }
    }
    if (slides) {
      table.text("–");
    } else {
      table.uncertainty(at + "/position_expanded_m", Quantity::kLength, absent);
    }
    table.number(at + "/scale", Quantity::kChannel);
    table.uncertainty(at + "/scale_expanded", Quantity::kPlain, "held");
    const Quantity quantity = joint_quantity(joint.type);
    table.number_with_unit(at + "/offset", quantity);
    table.uncertainty_with_unit(at + "/offset_expanded", quantity, "held");
  }
  return table.str();
}

std::string nominal_table(const Facts& facts) {
  if (!facts.run.nominal) return "";
  Table table("nominal-table", "Change against the nominal robot", facts.result);
  table.header({"Joint", "Frame shifted by, mm", "Frame turned by, °", "Offset changed by"});
  const KinematicTree& tree = facts.run.calibration.tree;
  for (std::size_t j = 0; j < tree.joints.size(); ++j) {
    const std::string at = fmt::format("/calibration/joints/{}/change_against_nominal", j);
    if (tree.joints[j].type == JointType::kFixed || !number_at(facts.result, at + "/shift_m"))
      continue;
    table.begin_row();
    table.text(tree.joints[j].name);
    table.number(at + "/shift_m", Quantity::kLength);
    table.number(at + "/turn_rad", Quantity::kAngle);
    table.number_with_unit(at + "/offset", joint_quantity(tree.joints[j].type));
  }
  return table.str();
}

/// Position, rotation and their uncertainties; no rotation for a point.
void pose_cells(Table& table, const std::string& at, const std::string& translation_expanded,
                const std::string& rotation_expanded, bool turns, std::string_view absent) {
  for (int k = 0; k < 3; ++k) {
    table.value(fmt::format("{}/translation_m/{}", at, k), translation_expanded, Quantity::kLength);
  }
  table.uncertainty(translation_expanded, Quantity::kLength, absent);
  if (!turns) return;
  for (int k = 0; k < 3; ++k) {
    table.value(fmt::format("{}/rpy_rad/{}", at, k), rotation_expanded, Quantity::kAngle);
  }
  table.uncertainty(rotation_expanded, Quantity::kAngle, absent);
}

std::string mounts_table(const Facts& facts) {
  const bool points = facts.run.calibration.kind == MeasurementKind::kPoint;
  Table table("mounts-table",
              points ? "Points on their links"
                     : "Markers on their links (roll, pitch, yaw as in URDF: about fixed x, y, z)",
              facts.result);
  std::vector<std::string> head = {
      points ? "Point" : "Marker", "Link", "x, mm", "y, mm", "z, mm", "U position, mm"};
  if (!points) head.insert(head.end(), {"roll, °", "pitch, °", "yaw, °", "U rotation, °"});
  table.header(head);
  const KinematicTree& tree = facts.run.calibration.tree;
  for (std::size_t m = 0; m < tree.markers.size(); ++m) {
    const std::string at = fmt::format("/calibration/markers/{}", m);
    const std::string name = marker_name(tree.markers[m].id);
    table.begin_row();
    table.text(name);
    table.text(marker_link(tree, tree.markers[m].id));
    pose_cells(table, at + "/mount", at + "/translation_expanded_m", at + "/rotation_expanded_rad",
               !points, absent_word(facts, name));
  }
  return table.str();
}

std::string camera_table(const Facts& facts) {
  const bool corners = facts.run.calibration.kind == MeasurementKind::kCorners;
  const std::optional<MovingCamera>& moving = facts.run.calibration.moving;
  const bool on_robot = moving && moving->on_robot();
  const std::string caption = fmt::format(
      "The {} in the {} frame{}{}", corners ? "camera" : "tracker",
      on_robot ? facts.run.calibration.tree.links[moving->link.index()].name + "'s" : "base",
      moving && !on_robot ? ", in the middle frame" : "",
      corners ? " (x right, y down, z along the view)" : "");
  Table table("camera-table", caption, facts.result);
  table.header({"", "x, mm", "y, mm", "z, mm", "U of each, mm", "roll, °", "pitch, °", "yaw, °",
                "U of each, °"});
  table.begin_row();
  table.text(corners ? "camera" : "tracker");
  const std::string at = "/calibration/camera";
  pose_cells(table, at + (on_robot ? "/pose_on_link" : "/pose_in_base"),
             at + "/translation_expanded_m", at + "/rotation_expanded_rad", true,
             absent_word(facts, "camera"));
  return table.str();
}

/// Each of several cameras: where it stands, what it saw, how well that is predicted.
std::string cameras_table(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  if (calibration.cameras() < 2) return "";
  const bool corners = calibration.kind == MeasurementKind::kCorners;
  const std::string unit = corners ? "px" : "mm";
  const std::string_view key = corners ? "px" : "m";
  const Quantity quantity = corners ? Quantity::kPixels : Quantity::kLength;
  Table table("cameras-table",
              calibration.of_recordings()
                  ? "The recordings' cameras in the base frame; U of the length of an error. The "
                    "first is of the reference recording; lags are beyond the clocks' offsets that "
                    "the fit began with"
                  : "The cameras in the base frame; U of the length of an error. The first is the "
                    "reference camera, on whose clock the frames' times are",
              facts.result);
  table.header({"Camera", "x, mm", "y, mm", "z, mm", "U, mm", "roll, °", "pitch, °", "yaw, °",
                "U, °", "Lag of the clock, ms", "U, ms", "Sightings used", "left out",
                "Rms, final fit, " + unit, "Rms, held out, " + unit});
  for (std::size_t c = 0; c < calibration.cameras(); ++c) {
    const std::string at = fmt::format("/calibration/cameras/{}", c);
    const std::string& name = calibration.name_of_camera(c);
    table.begin_row();
    table.text(name);
    pose_cells(table, at + "/pose_in_base", at + "/translation_expanded_m",
               at + "/rotation_expanded_rad", true,
               absent_word(facts, c == 0 ? "camera" : "camera " + name));
    table.value(at + "/lag_s", at + "/lag_expanded_s", Quantity::kDelay);
    table.uncertainty(at + "/lag_expanded_s", Quantity::kDelay, "held");
    table.number(at + "/sightings_used", Quantity::kCount);
    table.number(at + "/sightings_rejected", Quantity::kCount);
    table.number(fmt::format("{}/final_{}", at, key), quantity);
    table.number(fmt::format("{}/held_out_{}", at, key), quantity);
  }
  return table.str();
}

std::string clock_and_lens(const Facts& facts) {
  const Calibration& calibration = facts.run.calibration;
  std::string out;
  if (!facts.run.log.empty()) {
    Table table("clock-table", "Clock", facts.result);
    table.header({"Joint log time = frame time + offset", "Offset, ms", "U, ms"});
    table.begin_row();
    table.text(calibration.time_offset_sigma_s ? "estimated" : "held");
    table.value("/calibration/time_offset_s", "/calibration/time_offset_expanded_s",
                Quantity::kDelay);
    table.uncertainty("/calibration/time_offset_expanded_s", Quantity::kDelay, "held");
    out += table.str();
  }
  if (calibration.kind != MeasurementKind::kCorners) return out;
  Table table("intrinsics-table",
              fmt::format("Camera: {}, {} × {} px", kinescope::to_string(calibration.camera.model),
                          calibration.camera.width, calibration.camera.height),
              facts.result);
  table.header({"Intrinsic", "Value", "U"});
  const nlohmann::json& values =
      facts.result.at("calibration").at("camera").at("intrinsics").at("values");
  for (std::size_t k = 0; k < values.size(); ++k) {
    const std::string at = fmt::format("/calibration/camera/intrinsics/values/{}", k);
    const bool pixels = values[k].at("unit") == "px";
    table.begin_row();
    table.text(values[k].at("name").get<std::string>() + (pixels ? ", px" : ""));
    const Quantity quantity = pixels ? Quantity::kPixels : Quantity::kPlain;
    table.value(at + "/value", at + "/expanded", quantity);
    if (calibration.intrinsics_estimated) {
      table.uncertainty(at + "/expanded", quantity);
    } else {
      table.text("declared");
    }
  }
  return out + table.str();
}

std::string all_parameters_table(const Facts& facts) {
  Table table("parameters-table",
              "All parameters of the fit, in the order of the covariance. Turns and shifts are "
              "counted from the result, in the frame that they move: U says how far it may be "
              "off.",
              facts.result);
  table.header({"Parameter", "Block", "Unit", "Value", "U (k = 2)", "u, noise independent"});
  const auto& parameters = facts.run.calibration.parameters;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const std::string at = fmt::format("/calibration/parameters/{}", k);
    const Quantity quantity = quantity_of(parameters[k].unit);
    const std::string_view unit = display_unit(quantity).text;
    table.begin_row();
    table.text(parameters[k].name);
    table.text(parameters[k].block);
    table.text(unit.empty() ? std::string_view(parameters[k].unit) : unit);
    const bool of_result =
        parameters[k].value == 0.0 && (parameters[k].unit == "rad" || parameters[k].unit == "m");
    if (of_result) {
      table.text("–");
    } else {
      table.value(at + "/value", at + "/expanded", quantity);
    }
    table.uncertainty(at + "/expanded", quantity);
    table.uncertainty(at + "/sigma_white", quantity);
  }
  return table.str();
}

}  // namespace

std::string parameters_section(const Facts& facts) {
  std::string out = section_head("parameters", "Parameters");
  out += paragraph(
      "Expanded uncertainties U = 2 u. Of a direction or a position, the largest over the "
      "directions in which it "
      "can move.");
  out += joints_table(facts) + nominal_table(facts) + mounts_table(facts) +
         (facts.run.calibration.cameras() < 2 ? camera_table(facts) : cameras_table(facts));
  out += "<div class=\"columns\">" + clock_and_lens(facts) + "</div>\n";
  out += all_parameters_table(facts);
  return out + "</section>\n";
}

}  // namespace kinescope::report
