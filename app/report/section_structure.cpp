// SPDX-License-Identifier: Apache-2.0
//
// The structure and the evidence for it.
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/report/html.h"
#include "app/report/sections.h"

namespace kinescope::report {
namespace {

std::string evidence_table(const Facts& facts, const Structure& structure) {
  Table table("structure-table",
              "Joints and the evidence for each (scale and travel: first estimates; the final ones "
              "stand under Parameters and Data quality)",
              facts.result);
  table.header({"Joint", "Type", "Parent", "Child", "Channel", "Scale, rad or m per unit", "Travel",
                "Left over, °", "Left over, mm", "Runner-up", "Odds over it"});
  const KinematicTree& tree = facts.run.calibration.tree;
  for (std::size_t k = 0; k < structure.joints.size(); ++k) {
    const StructureJoint& joint = structure.joints[k];
    const std::string at = fmt::format("/structure/joints/{}", k);
    const bool named = tree.joints.size() == structure.joints.size();
    table.begin_row();
    table.text(named ? tree.joints[k].name : fmt::format("joint{}", k + 1));
    table.text(kinescope::to_string(joint.type));
    table.text(structure_link_name(facts.run, joint.parent_link));
    table.text(structure_link_name(facts.run, joint.child_link));
    std::string channel = "–";
    const auto name = [&](const ChannelTerm& term) {
      const auto index = static_cast<std::size_t>(term.channel);
      return term.channel >= 0 && index < facts.run.log.channels.size()
                 ? facts.run.log.channels[index]
                 : std::string("?");
    };
    if (joint.channel) {
      channel = name(*joint.channel);
      for (const ChannelTerm& term : joint.couplings) {
        channel += fmt::format(" {:+.2g} {}", term.scale / joint.channel->scale, name(term));
      }
    }
    table.text(channel);
    table.number(at + "/driven_by/scale", Quantity::kChannel);
    table.number_with_unit(at + "/travel", joint_quantity(joint.type));
    table.number(at + "/rotation_rms_rad", Quantity::kAngle);
    table.number(at + "/translation_rms_m", Quantity::kLength);
    table.text(joint.runner_up.empty() ? "–" : joint.runner_up);
    table.text(odds_text(joint.log_odds));
  }
  return table.str();
}

std::string given_table(const Facts& facts) {
  Table table("structure-table", "Joints, as the nominal robot declares them", facts.result);
  table.header({"Joint", "Type", "Parent", "Child", "Channel", "Travel seen"});
  const KinematicTree& tree = facts.run.calibration.tree;
  for (std::size_t k = 0; k < tree.joints.size(); ++k) {
    const Joint& joint = tree.joints[k];
    table.begin_row();
    table.text(joint.name);
    table.text(kinescope::to_string(joint.type));
    table.text(tree.links[joint.parent.index()].name);
    table.text(tree.links[joint.child.index()].name);
    table.text(joint.channel.empty() ? "–" : joint.channel);
    const std::string pointer = fmt::format("/calibration/joints/{}/travel", k);
    if (joint.type == JointType::kFixed || !number_at(facts.result, pointer)) {
      table.text("–");
    } else {
      table.number_with_unit(pointer, joint_quantity(joint.type));
    }
  }
  return table.str();
}

std::string probability_words(const Structure& structure) {
  std::string words =
      fmt::format("Probability of the whole: {}", probability_text(structure.probability));
  if (!structure.runner_up.empty()) {
    words += fmt::format("; odds of {} over the next best structure ({})",
                         odds_text(structure.runner_up_log_odds), structure.runner_up);
  }
  return words + ".";
}

std::string doubts_list(const Structure& structure) {
  if (structure.doubts.empty()) return paragraph("No doubt is left open.", "note");
  std::string out = "<h3>What this recording cannot decide</h3><ul id=\"doubts\">";
  for (const StructureDoubt& doubt : structure.doubts) {
    out += fmt::format("<li>{} <em>{}</em></li>", escaped(doubt.what), escaped(doubt.remedy));
  }
  return out + "</ul>\n";
}

}  // namespace

std::string structure_section(const Facts& facts) {
  std::string out = section_head("structure", "Structure");
  if (facts.run.structure) {
    out += paragraph(probability_words(*facts.run.structure));
  } else {
    out += paragraph("The structure is that of the nominal robot.");
  }
  out +=
      figure(tree_drawing(facts), "Links with their markers; joints with their evidence.", "wide");
  out += facts.run.structure ? evidence_table(facts, *facts.run.structure) : given_table(facts);
  if (facts.run.structure) {
    const Structure& structure = *facts.run.structure;
    if (!structure.free_markers.empty()) {
      std::string names;
      for (const TagId id : structure.free_markers) names += " " + marker_name(id);
      out += paragraph("Markers that move with no joint (free bodies):" + names + ".");
    }
    out += doubts_list(structure);
  }
  return out + "</section>\n";
}

}  // namespace kinescope::report
