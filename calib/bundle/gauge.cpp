// SPDX-License-Identifier: Apache-2.0
#include "calib/bundle/gauge.h"

#include <algorithm>

#include <Eigen/QR>

#include "calib/bundle/make_spec.h"
#include "kinematics/core/dense_algebra.h"

namespace kinescope::bundle {
namespace {

// Against a target's coordinates: a joint's are held where no target is left to hold.
constexpr double kLastChoice = 1e-3;

/// A change of all parameters that moves one link's frame and no prediction.
struct Freedom {
  Eigen::VectorXd direction;
  int held = -1;  ///< the parameter that stands still instead
};

class Frames {
 public:
  Frames(const Spec& spec, const State& state, const LinearBundle& linear)
      : spec_(spec),
        state_(state),
        columns_(pose_columns(linear.blocks)),
        width_(width_of(linear.blocks)) {}

  [[nodiscard]] std::vector<Freedom> freedoms() const {
    std::vector<Freedom> out;
    add_base(out);
    for (std::size_t j = 0; j < spec_.tree.joints.size(); ++j) add_joint(j, out);
    return out;
  }

 private:
  /// T <- T exp(step) of a block that is estimated; false where it is not.
  [[nodiscard]] bool move(const double* block, const Vector6d& step, bool point,
                          Eigen::VectorXd& direction) const {
    const auto found = columns_.find(block);
    if (found == columns_.end()) return false;
    for (int i = 0; i < 6; ++i) {
      const int column = found->second[static_cast<std::size_t>(i)];
      if (column >= 0) direction[column] += step[i];
      if (column < 0 && !(point && i < 3)) return false;
    }
    return true;
  }

  /// Everything on a link stays in place when the link's frame takes the step g.
  [[nodiscard]] bool stay(LinkId link, const Vector6d& g, Eigen::VectorXd& direction) const {
    const bool carries_camera = link.value != 0 && link == spec_.camera_link;
    if (carries_camera && !move_cameras(g, direction)) return false;
    for (std::size_t m = 0; m < spec_.tree.markers.size(); ++m) {
      if (spec_.tree.markers[m].link != link || !is_seen(m)) continue;
      const Pose mount = from_block(state_.mounts[m].data());
      const bool point = spec_.kind == MeasurementKind::kPoint;
      if (!move(state_.mounts[m].data(), -adjoint(mount.inverse()) * g, point, direction))
        return false;
    }
    for (std::size_t j = 0; j < spec_.tree.joints.size(); ++j) {
      const Joint& joint = spec_.tree.joints[j];
      if (joint.parent != link || !leads_to_a_sighting(j)) continue;
      const Vector6d step = -adjoint(from_block(state_.joint_frames[j].data()).inverse()) * g;
      if (move(state_.joint_frames[j].data(), step, false, direction)) continue;
      // A frame that is held, of a fixed joint or of one that stands still, moves with its
      // parent's.
      if (!is_held(j)) return false;
      const Vector6d carried = adjoint(held_motion(j).inverse()) * -step;
      if (!stay(joint.child, carried, direction)) return false;
    }
    return true;
  }

  [[nodiscard]] bool is_held(std::size_t j) const {
    return std::ranges::none_of(spec_.free_joint[j], [](bool free) { return free; });
  }

  [[nodiscard]] Pose held_motion(std::size_t j) const {
    const int channel = spec_.channel[j];
    const double reading = channel < 0 ? 0.0 : spec_.log.values(0, channel);
    const auto& [scale, offset] = state_.joint_maps[j];
    return joint_motion(spec_.tree.joints[j].type, spec_.tree.joints[j].axis,
                        scale * reading + offset);
  }

  [[nodiscard]] bool is_seen(std::size_t marker) const {
    return std::ranges::any_of(spec_.sightings, [&](const Sighting& sighting) {
      return sighting.marker == static_cast<int>(marker);
    });
  }

  [[nodiscard]] bool leads_to_a_sighting(std::size_t joint) const {
    return std::ranges::any_of(spec_.sightings, [&](const Sighting& sighting) {
      const Marker& marker = spec_.tree.markers[static_cast<std::size_t>(sighting.marker)];
      const std::vector<int>& path = spec_.path[marker.link.index()];
      return std::ranges::find(path, static_cast<int>(joint)) != path.end();
    });
  }

  void add_base(std::vector<Freedom>& out) const {
    const auto anchor = first_seen_base_marker(spec_);
    const auto held =
        columns_.find(anchor ? state_.mounts[*anchor].data() : state_.cameras.front().base.data());
    if (held == columns_.end()) return add_base_by_targets(out);
    for (int i = 0; i < 6; ++i) {
      const Vector6d g = Vector6d::Unit(i);
      Freedom freedom{Eigen::VectorXd::Zero(width_), held->second[static_cast<std::size_t>(i)]};
      const bool on_robot = spec_.camera_link.value != 0;
      if (freedom.held >= 0 && (on_robot || move_cameras(g, freedom.direction)) &&
          stay(LinkId{0}, g, freedom.direction))
        out.push_back(std::move(freedom));
    }
  }

  /// All of them see the frame of the link that they are on take the step; those without a sighting
  /// see nothing, and a camera that is carried is where it must be.
  [[nodiscard]] bool move_cameras(const Vector6d& g, Eigen::VectorXd& direction) const {
    if (spec_.carried) return true;
    return std::ranges::all_of(state_.cameras, [&](const CameraState& camera) {
      const bool further = &camera != &state_.cameras.front();
      return (further && !columns_.contains(camera.base.data())) ||
             move(camera.base.data(), g, false, direction);
    });
  }

  /// Where only targets are measured, the camera's (tracker's) frame is nobody's: they move with
  /// the robot, and six of their coordinates are held; of the joints' frames where they are too
  /// few.
  void add_base_by_targets(std::vector<Freedom>& out) const {
    if (state_.targets.empty()) return;
    const Pose T_camera_base = from_block(state_.cameras.front().base.data());
    Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(width_, 6);
    Eigen::MatrixXd choice = Eigen::MatrixXd::Zero(6, width_);
    for (int i = 0; i < 6; ++i) {
      const Vector6d g = Vector6d::Unit(i);
      Eigen::VectorXd direction = Eigen::VectorXd::Zero(width_);
      if (!stay(LinkId{0}, g, direction)) return;
      choice.row(i) = kLastChoice * direction.transpose();
      for (const std::array<double, 3>& target : state_.targets) {
        const auto found = columns_.find(target.data());
        if (found == columns_.end()) continue;
        const Eigen::Vector3d in_base =
            T_camera_base.inverse() * Eigen::Vector3d(target[0], target[1], target[2]);
        const Eigen::Vector3d moved =
            -(T_camera_base.rotation * (g.head<3>().cross(in_base) + g.tail<3>()));
        for (int k = 0; k < 3; ++k) {
          const int column = found->second[static_cast<std::size_t>(k)];
          direction[column] += moved[k];
          choice(i, column) = moved[k];
        }
      }
      directions.col(i) = direction;
    }
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(choice);
    if (qr.rank() < 6) return;
    for (int i = 0; i < 6; ++i)
      out.push_back({directions.col(i), static_cast<int>(qr.colsPermutation().indices()[i])});
  }

  void add_joint(std::size_t j, std::vector<Freedom>& out) const {
    const Joint& joint = spec_.tree.joints[j];
    const auto found = columns_.find(state_.joint_frames[j].data());
    if (joint.type == JointType::kFixed || found == columns_.end()) return;
    Eigen::Index along = 0;
    joint.axis.cwiseAbs().maxCoeff(&along);
    const auto& columns = found->second;
    Vector6d turn = Vector6d::Zero(), slide = Vector6d::Zero();
    turn.head<3>() = joint.axis;
    slide.tail<3>() = joint.axis;
    const double* block = state_.joint_frames[j].data();
    add(columns[static_cast<std::size_t>(along)], block, joint.child, turn, out);
    if (joint.type == JointType::kRevolute) {
      add(columns[static_cast<std::size_t>(along + 3)], block, joint.child, slide, out);
      return;
    }
    // What slides has no place of its own.
    for (int i = 3; i < 6; ++i)
      add(columns[static_cast<std::size_t>(i)], block, joint.child, Vector6d::Unit(i), out);
  }

  void add(int held, const double* frame, LinkId link, const Vector6d& g,
           std::vector<Freedom>& out) const {
    if (held < 0) return;
    Freedom freedom{Eigen::VectorXd::Zero(width_), held};
    if (move(frame, g, false, freedom.direction) && stay(link, g, freedom.direction))
      out.push_back(std::move(freedom));
  }

  const Spec& spec_;
  const State& state_;
  std::map<const double*, PoseColumns> columns_;
  int width_;
};

std::vector<FreeBlock> without(const std::vector<FreeBlock>& blocks,
                               const std::vector<bool>& held) {
  std::vector<FreeBlock> out;
  std::size_t next = 0;
  for (const FreeBlock& block : blocks) {
    FreeBlock rest{block.data, block.block, {}, {}, {}, block.local_frame};
    for (std::size_t i = 0; i < block.names.size(); ++i, ++next) {
      if (held[next]) continue;
      rest.names.push_back(block.names[i]);
      rest.units.push_back(block.units[i]);
      rest.components.push_back(block.components[i]);
    }
    if (!rest.names.empty()) out.push_back(std::move(rest));
  }
  return out;
}

}  // namespace

LinearBundle with_frames_held(const Spec& spec, const State& state, LinearBundle linear) {
  const std::vector<Freedom> freedoms = Frames(spec, state, linear).freedoms();
  if (freedoms.empty()) return linear;
  const auto n = static_cast<Eigen::Index>(width_of(linear.blocks));
  const auto k = static_cast<Eigen::Index>(freedoms.size());
  Eigen::MatrixXd G(n, k), held_part(k, k);
  std::vector<bool> held(static_cast<std::size_t>(n), false);
  for (Eigen::Index c = 0; c < k; ++c) {
    const Freedom& freedom = freedoms[static_cast<std::size_t>(c)];
    G.col(c) = freedom.direction;
    held[static_cast<std::size_t>(freedom.held)] = true;
  }
  std::vector<Eigen::Index> kept;
  std::vector<Eigen::Index> place(static_cast<std::size_t>(n), -1);  // among those that are kept
  for (Eigen::Index i = 0; i < n; ++i) {
    if (held[static_cast<std::size_t>(i)]) continue;
    place[static_cast<std::size_t>(i)] = std::ssize(kept);
    kept.push_back(i);
  }

  const Eigen::MatrixXd P = linear.prior_information;
  const Eigen::MatrixXd PG = P * G;
  const LdltFactor factor(Eigen::MatrixXd(G.transpose() * PG));
  const Eigen::MatrixXd marginal = P - PG * factor.solve(Eigen::MatrixXd(PG.transpose()));
  LinearBundle out;
  out.blocks = without(linear.blocks, held);
  out.prior_information = Eigen::MatrixXd(marginal(kept, kept)).sparseView();
  for (const auto& [frame, rows] : linear.frames) {
    std::vector<Eigen::Index> shown, from;
    for (std::size_t i = 0; i < rows.shown.size(); ++i) {
      const Eigen::Index at = place[static_cast<std::size_t>(rows.shown[i])];
      if (at < 0) continue;
      shown.push_back(at);
      from.push_back(static_cast<Eigen::Index>(i));
    }
    out.frames.emplace(
        frame, FrameRows{std::move(shown), Eigen::MatrixXd(rows.J(Eigen::all, from)), rows.r});
  }
  return out;
}

}  // namespace kinescope::bundle
