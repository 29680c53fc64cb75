// SPDX-License-Identifier: Apache-2.0
//
// Forward kinematics in the page, from the tree that the report carries. A pose is {q: [w, x, y, z], t: [x, y, z]}
// and maps the inner frame's coordinates to the outer's, as in kinematics/core/pose.h.

export function poseFromList(list) {
  return { q: list.slice(0, 4), t: list.slice(4, 7) };
}

function multiply(a, b) {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

export function rotate(q, v) {
  const [w, x, y, z] = q;
  // v + 2 r x (r x v + w v), r the quaternion's vector part.
  const cx = y * v[2] - z * v[1] + w * v[0];
  const cy = z * v[0] - x * v[2] + w * v[1];
  const cz = x * v[1] - y * v[0] + w * v[2];
  return [
    v[0] + 2 * (y * cz - z * cy),
    v[1] + 2 * (z * cx - x * cz),
    v[2] + 2 * (x * cy - y * cx),
  ];
}

export function apply(pose, point) {
  const r = rotate(pose.q, point);
  return [r[0] + pose.t[0], r[1] + pose.t[1], r[2] + pose.t[2]];
}

export function compose(a, b) {
  return { q: multiply(a.q, b.q), t: apply(a, b.t) };
}

export function inverse(pose) {
  const q = [pose.q[0], -pose.q[1], -pose.q[2], -pose.q[3]];
  const t = rotate(q, pose.t);
  return { q, t: [-t[0], -t[1], -t[2]] };
}

function jointMotion(joint, value) {
  const a = joint.axis;
  if (joint.type === "prismatic") {
    return { q: [1, 0, 0, 0], t: [a[0] * value, a[1] * value, a[2] * value] };
  }
  const s = joint.type === "revolute" ? Math.sin(value / 2) : 0;
  const c = joint.type === "revolute" ? Math.cos(value / 2) : 1;
  return { q: [c, s * a[0], s * a[1], s * a[2]], t: [0, 0, 0] };
}

/// Poses of all links in the base frame, or null where a joint value is unknown. Parents stand before children.
export function forwardKinematics(model, values) {
  const links = new Array(model.links).fill(null);
  links[0] = { q: [1, 0, 0, 0], t: [0, 0, 0] };
  for (let j = 0; j < model.joints.length; ++j) {
    const joint = model.joints[j];
    if (values[j] === null || links[joint.parent] === null) return null;
    const origin = compose(links[joint.parent], poseFromList(joint.origin));
    links[joint.child] = compose(origin, jointMotion(joint, values[j]));
  }
  return links;
}

/// Start points and vectors of a frame's residuals in the base frame, unscaled. Corner residuals (px) are carried
/// to the marker's distance; those of poses stand in the marker's axes, those of points in the tracker's. `seenBy`:
/// the camera of the frame.
export function residualArrows(model, links, sightings, seenBy = model.camera) {
  const arrows = [];
  const camera = poseFromList(seenBy.pose);
  const toCamera = inverse(camera);
  for (const sighting of sightings) {
    const marker = model.markers[sighting[0]];
    const pose = compose(links[marker.link], poseFromList(marker.mount));
    if (model.kind !== "corners") {
      const frame = model.kind === "poses" ? pose.q : camera.q;
      arrows.push({ from: pose.t, vector: rotate(frame, sighting.slice(2, 5)), used: sighting[1] === 1 });
      continue;
    }
    const h = marker.size / 2;
    const corners = [[-h, h, 0], [h, h, 0], [h, -h, 0], [-h, -h, 0]];
    for (let k = 0; k < 4; ++k) {
      const from = apply(pose, corners[k]);
      const depth = apply(toCamera, from)[2];
      const shift = [
        (sighting[2 + 2 * k] / seenBy.fx) * depth,
        (sighting[3 + 2 * k] / seenBy.fy) * depth,
        0,
      ];
      arrows.push({ from, vector: rotate(camera.q, shift), used: sighting[1] === 1 });
    }
  }
  return arrows;
}
