// SPDX-License-Identifier: Apache-2.0
//
// The robot as a three.js scene: bones between the link frames, joints on their axes, markers, the camera's
// frustum and the residual arrows.
import {
  AmbientLight, BackSide, BoxBufferGeometry, BufferAttribute, BufferGeometry, CanvasTexture, CylinderBufferGeometry,
  DirectionalLight, Group, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  PerspectiveCamera, PlaneBufferGeometry, Scene, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "orbit-controls";
import { apply, compose, forwardKinematics, poseFromList, residualArrows, rotate } from "./kinematics.js";

const SERIES = 8;
const UNIT_Y = new Vector3(0, 1, 0);

function cssColour(name, fallback) {
  const found = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return found || fallback;
}

function setPose(object, pose) {
  object.position.set(pose.t[0], pose.t[1], pose.t[2]);
  object.quaternion.set(pose.q[1], pose.q[2], pose.q[3], pose.q[0]);
}

/// A square with the marker's id, seen from the side of the tag that the camera sees (its -z).
function markerTexture(id, colour) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const draw = canvas.getContext("2d");
  draw.fillStyle = colour;
  draw.fillRect(0, 0, 128, 128);
  draw.fillStyle = "#fff";
  draw.fillRect(14, 14, 100, 100);
  draw.fillStyle = "#111";
  draw.font = "bold 60px sans-serif";
  draw.textAlign = "center";
  draw.textBaseline = "middle";
  draw.fillText(String(id), 64, 68, 92);
  return new CanvasTexture(canvas);
}

export class RobotScene {
  constructor(holder, model) {
    this.model = model;
    this.renderer = new WebGLRenderer({ antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    holder.appendChild(this.renderer.domElement);
    this.holder = holder;
    this.scene = new Scene();
    this.first = model.values.map((v) => forwardKinematics(model, v)).find((links) => links !== null);
    this.measure();
    this.build();
    this.placeEye();
  }

  /// Centre and size of what the robot spans, from postures spread over the recording.
  measure() {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const step = Math.max(1, Math.floor(this.model.values.length / 40));
    for (let f = 0; f < this.model.values.length; f += step) {
      const links = forwardKinematics(this.model, this.model.values[f]);
      if (links === null) continue;
      // A base that is the camera's frame is no part of the robot.
      const points = links.slice(this.model.baseIsCamera ? 1 : 0).map((link) => link.t);
      for (const marker of this.model.markers) points.push(apply(links[marker.link], marker.mount.slice(4, 7)));
      for (const point of points) {
        for (let k = 0; k < 3; ++k) {
          low[k] = Math.min(low[k], point[k]);
          high[k] = Math.max(high[k], point[k]);
        }
      }
    }
    this.centre = new Vector3((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
    this.extent = Math.max(1e-3, Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]));
  }

  build() {
    this.scene.add(new AmbientLight(0xffffff, 0.65));
    const sun = new DirectionalLight(0xffffff, 0.55);
    sun.position.set(1, 2, 3);
    this.scene.add(sun);
    this.bones = this.model.joints.map(() => this.addBone(0.012, "--robot", "#8a96a3"));
    this.stems = this.model.markers.map(() => this.addBone(0.005, "--robot", "#8a96a3"));
    this.jointMeshes = this.model.joints.map((joint) => this.addJoint(joint));
    this.markerMeshes = this.model.markers.map((marker, k) => this.addMarker(marker, k));
    if (this.model.kind === "corners") this.scene.add(this.frustum());
    this.addArrows();
  }

  addBone(share, variable, fallback) {
    const radius = share * this.extent;
    const bone = new Mesh(new CylinderBufferGeometry(radius, radius, 1, 12),
      new MeshLambertMaterial({ color: cssColour(variable, fallback) }));
    this.scene.add(bone);
    return bone;
  }

  addJoint(joint) {
    const size = 0.028 * this.extent;
    const turns = joint.type === "revolute";
    const colour = cssColour(turns ? "--turn" : "--slide", turns ? "#c0392b" : "#2471a3");
    const shape = turns ? new CylinderBufferGeometry(size, size, 2.6 * size, 20)
      : new BoxBufferGeometry(1.6 * size, 3.2 * size, 1.6 * size);
    const body = new Mesh(shape, new MeshLambertMaterial({ color: colour }));
    body.quaternion.setFromUnitVectors(UNIT_Y, new Vector3(joint.axis[0], joint.axis[1], joint.axis[2]));
    const group = new Group();
    if (joint.type !== "fixed") group.add(body);
    this.scene.add(group);
    return group;
  }

  addMarker(marker, index) {
    const size = marker.size > 0 ? marker.size : 0.03 * this.extent;
    const colour = cssColour(`--c${index % SERIES}`, "#0072b2");
    const group = new Group();
    const plane = new PlaneBufferGeometry(size, size);
    const front = new Mesh(plane, new MeshBasicMaterial({ map: markerTexture(marker.id, colour) }));
    const back = new Mesh(plane, new MeshBasicMaterial({ color: colour, side: BackSide }));
    front.rotation.x = back.rotation.x = Math.PI;  // tag axes: y down, z into the tag
    group.add(front, back);
    this.scene.add(group);
    return group;
  }

  seenBy(frame) {
    return this.model.cameras ? this.model.cameras[this.model.cameraOf[frame]] : this.model.camera;
  }

  /// Of all cameras.
  frustum() {
    const group = new Group();
    for (const camera of this.model.cameras ?? [this.model.camera]) group.add(this.frustumOf(camera));
    return group;
  }

  frustumOf(camera) {
    const pose = poseFromList(camera.pose);
    const depth = 0.14 * this.extent;
    const corners = [[0, 0], [camera.width, 0], [camera.width, camera.height], [0, camera.height]].map(([u, v]) =>
      apply(pose, [((u - camera.cx) / camera.fx) * depth, ((v - camera.cy) / camera.fy) * depth, depth]));
    const points = [];
    for (let k = 0; k < 4; ++k) points.push(...pose.t, ...corners[k], ...corners[k], ...corners[(k + 1) % 4]);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
    return new LineSegments(geometry, new LineBasicMaterial({ color: cssColour("--frame", "#888888") }));
  }

  addArrows() {
    const most = this.model.residuals.reduce((n, frame) => Math.max(n, frame.length), 0);
    this.arrowRoom = most * (this.model.kind === "corners" ? 4 : 1);
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(new Float32Array(6 * this.arrowRoom), 3));
    this.arrows = new LineSegments(geometry, new LineBasicMaterial({ color: cssColour("--residual", "#d55e00") }));
    this.arrows.frustumCulled = false;
    this.scene.add(this.arrows);
  }

  /// The eye starts where the camera stood, a little to its side, so that the picture is that of the video.
  placeEye() {
    const rect = this.holder.getBoundingClientRect();
    this.eye = new PerspectiveCamera(40, rect.width / Math.max(1, rect.height), this.extent / 100, this.extent * 100);
    const camera = poseFromList(this.model.camera.pose);
    const video = this.model.kind === "corners";
    const up = video ? rotate(camera.q, [0, -1, 0]) : [0, 0, 1];
    this.eye.up.set(up[0], up[1], up[2]);
    const back = video ? rotate(camera.q, [0.45, -0.3, -1]) : [1, -1.2, 0.6];
    this.home = new Vector3(back[0], back[1], back[2]).normalize().multiplyScalar(1.05 * this.extent).add(this.centre);
    this.controls = new OrbitControls(this.eye, this.renderer.domElement);
    this.controls.enableKeys = false;
    this.controls.enableZoom = false;
    this.controls.addEventListener("change", () => this.draw());
    this.reset();
  }

  reset() {
    this.eye.position.copy(this.home);
    this.controls.target.copy(this.centre);
    this.controls.update();
    this.draw();
  }

  /// Looks from where the camera (or tracker) stood.
  lookFromCamera() {
    const pose = poseFromList(this.model.camera.pose);
    this.eye.position.set(pose.t[0], pose.t[1], pose.t[2]);
    this.controls.target.copy(this.centre);
    this.controls.update();
    this.draw();
  }

  resize() {
    const rect = this.holder.getBoundingClientRect();
    if (rect.width < 1 || rect.height < 1) return;
    this.renderer.setSize(rect.width, rect.height);
    this.eye.aspect = rect.width / rect.height;
    this.eye.updateProjectionMatrix();
    this.draw();
  }

  /// Moves everything to one frame of the recording; false where its posture is unknown.
  show(frame, arrowScale) {
    const links = forwardKinematics(this.model, this.model.values[frame]) || null;
    const shown = links || this.first;
    if (!shown) return false;
    this.model.joints.forEach((joint, j) => {
      setPose(this.jointMeshes[j], shown[joint.child]);
      this.stretch(this.bones[j], shown[joint.parent].t, shown[joint.child].t, this.isPart(joint.parent));
    });
    this.model.markers.forEach((marker, m) => {
      const pose = compose(shown[marker.link], poseFromList(marker.mount));
      setPose(this.markerMeshes[m], pose);
      this.stretch(this.stems[m], shown[marker.link].t, pose.t, this.isPart(marker.link));
    });
    this.setArrows(links ? residualArrows(this.model, links, this.model.residuals[frame], this.seenBy(frame)) : [], arrowScale);
    this.draw();
    return links !== null;
  }

  isPart(link) {
    return link !== 0 || !this.model.baseIsCamera;
  }

  stretch(bone, from, to, isPart) {
    const a = new Vector3(from[0], from[1], from[2]);
    const run = new Vector3(to[0], to[1], to[2]).sub(a);
    const length = run.length();
    bone.visible = isPart && length > 1e-6 * this.extent;
    if (!bone.visible) return;
    bone.scale.set(1, length, 1);
    bone.position.copy(a).addScaledVector(run, 0.5);
    bone.quaternion.setFromUnitVectors(UNIT_Y, run.multiplyScalar(1 / length));
  }

  setArrows(arrows, scale) {
    const attribute = this.arrows.geometry.getAttribute("position");
    const place = attribute.array;
    place.fill(0);
    arrows.slice(0, this.arrowRoom).forEach((arrow, k) => {
      for (let axis = 0; axis < 3; ++axis) {
        place[6 * k + axis] = arrow.from[axis];
        place[6 * k + 3 + axis] = arrow.from[axis] + scale * arrow.vector[axis];
      }
    });
    attribute.needsUpdate = true;
    this.arrows.geometry.setDrawRange(0, 2 * arrows.length);
  }

  /// Rms length of the residual arrows over some frames, unscaled.
  typicalArrow() {
    let sum = 0, count = 0;
    const step = Math.max(1, Math.floor(this.model.values.length / 30));
    for (let f = 0; f < this.model.values.length; f += step) {
      const links = forwardKinematics(this.model, this.model.values[f]);
      if (links === null) continue;
      for (const { vector } of residualArrows(this.model, links, this.model.residuals[f], this.seenBy(f))) {
        sum += vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2;
        ++count;
      }
    }
    return count > 0 ? Math.sqrt(sum / count) : 0;
  }

  draw() {
    this.renderer.render(this.scene, this.eye);
  }
}
