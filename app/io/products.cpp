// SPDX-License-Identifier: Apache-2.0
#include "app/io/products.h"

#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "kinematics/core/error.h"

namespace kinescope {
namespace {

using nlohmann::json;

// JSON has no NaN: what is not known is null.
json number(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
json number(const Sigma& value) { return value ? number(*value) : json(nullptr); }

json vector3(const Eigen::Vector3d& v) { return {number(v.x()), number(v.y()), number(v.z())}; }

json pose_json(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  return {{"translation_m", vector3(pose.translation)},
          {"quaternion_xyzw", {number(q.x()), number(q.y()), number(q.z()), number(q.w())}}};
}

json tag_list(const std::vector<TagId>& ids) {
  json out = json::array();
  for (const TagId id : ids) out.push_back(id.value);
  return out;
}

std::string link_name(int link) { return link == 0 ? "base" : fmt::format("link{}", link); }

std::string channel_name(const JointLog& log, int channel) {
  return log.channels[static_cast<std::size_t>(channel)];
}

json structure_joint_json(const StructureJoint& joint, const std::string& name,
                          const JointLog& log) {
  json out{{"name", name},
           {"type", std::string(to_string(joint.type))},
           {"parent", link_name(joint.parent_link)},
           {"child", link_name(joint.child_link)},
           {"channel", nullptr},
           {"scale", nullptr},
           {"scale_sigma", nullptr},
           {"offset", number(joint.offset)},
           {"travel", number(joint.travel)},
           {"rotation_rms_rad", number(joint.rotation_rms_rad)},
           {"translation_rms_m", number(joint.translation_rms_m)},
           {"unexplained", number(joint.unexplained)},
           {"unexplained_across", number(joint.unexplained_across)},
           {"log_odds", number(joint.log_odds)},
           {"runner_up", joint.runner_up},
           {"couplings", json::array()}};
  if (joint.channel) {
    out["channel"] = channel_name(log, joint.channel->channel);
    out["scale"] = number(joint.channel->scale);
    out["scale_sigma"] = number(joint.channel->scale_sigma);
  }
  for (const ChannelTerm& term : joint.couplings) {
    out["couplings"].push_back(
        {{"channel", channel_name(log, term.channel)}, {"scale", number(term.scale)}});
  }
  return out;
}

json tree_json(const KinematicTree& tree) {
  json out{{"name", tree.name},
           {"links", json::array()},
           {"joints", json::array()},
           {"markers", json::array()}};
  for (const Link& link : tree.links) out["links"].push_back(link.name);
  for (const Joint& joint : tree.joints) {
    json entry{{"name", joint.name},
               {"type", std::string(to_string(joint.type))},
               {"parent", tree.links[joint.parent.index()].name},
               {"child", tree.links[joint.child.index()].name},
               {"T_parent_joint", pose_json(joint.T_parent_joint)},
               {"axis", vector3(joint.axis)},
               {"channel", joint.channel},
               {"scale", number(joint.scale)},
               {"offset", number(joint.offset)}};
    for (const ChannelShare& share : joint.couplings) {
      entry["couplings"].push_back({{"channel", share.channel}, {"ratio", number(share.ratio)}});
    }
    if (!joint.copies.empty()) entry["copies"] = joint.copies;
    if (joint.limits) {
      entry["range"] = {number(joint.limits->lower), number(joint.limits->upper)};
    }
    out["joints"].push_back(std::move(entry));
  }
  for (const Marker& marker : tree.markers) {
    out["markers"].push_back({{"id", marker.id.value},
                              {"link", tree.links[marker.link.index()].name},
                              {"T_link_marker", pose_json(marker.T_link_marker)},
                              {"size_m", number(marker.size_m)}});
  }
  return out;
}

json camera_json(const CameraModel& camera, bool estimated) {
  json distortion = json::array();
  for (int i = 0; i < distortion_count(camera.model); ++i) {
    distortion.push_back(number(camera.distortion[static_cast<std::size_t>(i)]));
  }
  return {{"width", camera.width},
          {"height", camera.height},
          {"fx", number(camera.fx)},
          {"fy", number(camera.fy)},
          {"cx", number(camera.cx)},
          {"cy", number(camera.cy)},
          {"distortion_model", std::string(to_string(camera.model))},
          {"distortion", std::move(distortion)},
          {"estimated", estimated}};
}

json further_cameras_json(const Calibration& calibration) {
  json out = json::array();
  for (const CameraEstimate& camera : calibration.further_cameras) {
    out.push_back({{"name", camera.name},
                   {"T_camera_base", pose_json(camera.T_camera_base)},
                   {"rotation_sigma_rad", number(camera.rotation_sigma_rad)},
                   {"translation_sigma_m", number(camera.translation_sigma_m)},
                   {"camera", camera_json(camera.camera, camera.intrinsics_estimated)},
                   {"lag_s", number(camera.lag_s)},
                   {"lag_sigma_s", number(camera.lag_sigma_s)}});
  }
  return out;
}

// How a camera that moves does.
json camera_motion_json(const Calibration& calibration) {
  const MovingCamera& moving = *calibration.moving;
  if (!moving.on_robot()) return {{"camera_mount", "carried"}};
  return {{"camera_mount", "hand"},
          {"link", calibration.tree.links[moving.link.index()].name},
          {"T_camera_link", pose_json(moving.T_camera_link)}};
}

void append_vector(std::string& out, const std::vector<Eigen::Vector2d>& corners, std::size_t i) {
  if (i < corners.size()) {
    fmt::format_to(std::back_inserter(out), ",{:.5f},{:.5f}", corners[i].x(), corners[i].y());
  } else {
    out += ",,";
  }
}

}  // namespace

std::string observations_csv(const TagObservations& observations) {
  constexpr std::size_t kRow = 100;  // bytes, about: a film of an hour makes 200 MB
  std::size_t corners = 0;
  for (const TagObservation& seen : observations.observations) corners += seen.corners_px.size();
  std::string out = "t,tag,corner,u,v,sigma,hamming,margin\n";
  out.reserve(kRow * corners);
  for (const TagObservation& seen : observations.observations) {
    for (std::size_t c = 0; c < seen.corners_px.size(); ++c) {
      fmt::format_to(std::back_inserter(out), "{},{},{},{},{},{},{},{}\n",
                     observations.times_s[static_cast<std::size_t>(seen.frame)], seen.id.value, c,
                     seen.corners_px[c].x(), seen.corners_px[c].y(), seen.sigma_px, seen.hamming,
                     seen.decision_margin);
    }
  }
  return out;
}

std::string tracks_csv(const PoseTracks& tracks) {
  std::string out = "t,body,x,y,z,qx,qy,qz,qw,sigma_m,sigma_rad\n";
  for (const PoseTrack& track : tracks.tracks) {
    for (const PoseSample& sample : track.samples) {
      const Pose& pose = sample.T_camera_marker;
      const double sigma_rad = std::sqrt(sample.covariance.topLeftCorner<3, 3>().trace() / 3.0);
      const double sigma_m = std::sqrt(sample.covariance.bottomRightCorner<3, 3>().trace() / 3.0);
      fmt::format_to(std::back_inserter(out), "{},{},{},{},{},{},{},{},{},{},{}\n",
                     tracks.times_s[static_cast<std::size_t>(sample.frame)], track.id.value,
                     pose.translation.x(), pose.translation.y(), pose.translation.z(),
                     pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w(),
                     sigma_m, sigma_rad);
    }
  }
  return out;
}

std::string residuals_csv(const Calibration& calibration) {
  const bool corners = calibration.kind == MeasurementKind::kCorners;
  std::string out = corners ? "t,tag,corner,used,fold,du,dv,held_out_du,held_out_dv,before_du,"
                              "before_dv\n"
                            : "t,body,used,fold,rx,ry,rz,x,y,z,held_out_rx,held_out_ry,"
                              "held_out_rz,held_out_x,held_out_y,held_out_z\n";
  const bool several = calibration.cameras() > 1;
  if (several) out.insert(0, calibration.of_recordings() ? "recording," : "camera,");
  for (const SightingResidual& r : calibration.residuals) {
    std::string head = fmt::format("{},{}", calibration.own_time_s(r.frame), r.id.value);
    if (several) head = calibration.name_of_camera(calibration.camera_at(r.frame)) + "," + head;
    const std::string flags = fmt::format(",{},{}", r.used ? 1 : 0, r.fold);
    if (corners) {
      for (std::size_t c = 0; c < r.corners_px.size(); ++c) {
        out += fmt::format("{},{}{}", head, c, flags);
        append_vector(out, r.corners_px, c);
        append_vector(out, r.held_out_px, c);
        append_vector(out, r.before_px, c);
        out += '\n';
      }
      continue;
    }
    out += head + flags;
    for (const Vector6d& d : {r.displacement, r.held_out_displacement}) {
      for (int i = 0; i < 6; ++i) fmt::format_to(std::back_inserter(out), ",{}", d[i]);
    }
    out += '\n';
  }
  return out;
}

std::string camera_path_csv(const Calibration& calibration) {
  std::string out = "t,x,y,z,qx,qy,qz,qw\n";
  const std::vector<Pose>& path = value_of(calibration.moving).path;
  for (std::size_t f = 0; f < path.size(); ++f) {
    if (!path[f].translation.allFinite()) continue;
    const Pose camera = path[f].inverse();
    fmt::format_to(std::back_inserter(out), "{},{},{},{},{},{},{},{}\n", calibration.times_s[f],
                   camera.translation.x(), camera.translation.y(), camera.translation.z(),
                   camera.rotation.x(), camera.rotation.y(), camera.rotation.z(),
                   camera.rotation.w());
  }
  return out;
}

json structure_json(const Structure& structure, const JointLog& log) {
  // Joints are named as in the URDF.
  const KinematicTree tree = structure_tree(structure, log);
  json out{{"schema", "kinescope.structure"},
           {"schema_version", 1},
           {"status", std::string(to_string(structure.status))},
           {"probability", number(structure.probability)},
           {"runner_up", structure.runner_up},
           {"runner_up_log_odds", number(structure.runner_up_log_odds)},
           {"time_offset_s", number(structure.time_offset_s)},
           {"time_offset_sigma_s", number(structure.time_offset_sigma_s)},
           {"joints", json::array()},
           {"links", json::array()},
           {"tags", json::array()},
           {"free_markers", tag_list(structure.free_markers)},
           {"idle_channels", json::array()},
           {"copied_channels", json::array()},
           {"doubts", json::array()}};
  for (std::size_t j = 0; j < structure.joints.size(); ++j) {
    out["joints"].push_back(structure_joint_json(structure.joints[j], tree.joints[j].name, log));
  }
  for (std::size_t l = 0; l < structure.links.size(); ++l) {
    const std::string name = link_name(static_cast<int>(l));
    out["links"].push_back({{"name", name}, {"tags", tag_list(structure.links[l].markers)}});
    for (const TagId id : structure.links[l].markers) {
      out["tags"].push_back({{"id", id.value}, {"link", name}});
    }
  }
  for (const int channel : structure.idle_channels) {
    out["idle_channels"].push_back(channel_name(log, channel));
  }
  for (const ChannelCopy& copy : structure.copied_channels) {
    out["copied_channels"].push_back(
        {{"channel", channel_name(log, copy.channel)}, {"of", channel_name(log, copy.of)}});
  }
  for (const StructureDoubt& doubt : structure.doubts) {
    out["doubts"].push_back(
        {{"what", doubt.what}, {"remedy", doubt.remedy}, {"names", doubt.names}});
  }
  return out;
}

json calibration_json(const Calibration& calibration) {
  json out{{"schema", "kinescope.calibration"},
           {"schema_version", 1},
           {"status", std::string(to_string(calibration.status))},
           {"status_reason", calibration.status_reason},
           {"robot", tree_json(calibration.tree)},
           {"T_camera_base", pose_json(calibration.T_camera_base)},
           {"camera", camera_json(calibration.camera, calibration.intrinsics_estimated)},
           {"time_offset_s", number(calibration.time_offset_s)},
           {"time_offset_sigma_s", number(calibration.time_offset_sigma_s)},
           {"gauge", calibration.gauge},
           {"sigma_scale", number(calibration.sigma_scale)},
           {"noise_widening", number(calibration.noise_widening)},
           {"training_rms", number(calibration.training_rms)},
           {"held_out_rms", number(calibration.held_out_rms)},
           {"before_rms", number(calibration.before_rms)},
           {"final_rms", number(calibration.final_rms)},
           {"rms_unit", calibration.kind == MeasurementKind::kCorners ? "px" : "m"},
           {"parameters", json::array()},
           {"covariance", json::array()}};
  for (std::size_t j = 0; j < calibration.joints.size(); ++j) {
    out["robot"]["joints"][j]["parameters_at"] = number(calibration.joints[j].parameters_at);
  }
  if (calibration.moving) out["camera_motion"] = camera_motion_json(calibration);
  if (calibration.cameras() > 1) {
    out["camera_name"] = calibration.camera_name;
    out["further_cameras"] = further_cameras_json(calibration);
  }
  for (const Parameter& p : calibration.parameters) {
    out["parameters"].push_back({{"name", p.name},
                                 {"block", p.block},
                                 {"unit", p.unit},
                                 {"value", number(p.value)},
                                 {"sigma", number(p.sigma)},
                                 {"sigma_white", number(p.sigma_white)}});
  }
  for (Eigen::Index i = 0; i < calibration.covariance.rows(); ++i) {
    json row = json::array();
    for (Eigen::Index k = 0; k < calibration.covariance.cols(); ++k) {
      row.push_back(number(calibration.covariance(i, k)));
    }
    out["covariance"].push_back(std::move(row));
  }
  return out;
}

}  // namespace kinescope
