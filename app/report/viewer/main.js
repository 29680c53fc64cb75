// SPDX-License-Identifier: Apache-2.0
//
// Starts the 3-D view. The page is complete without it: where it cannot start, it stays hidden and the root
// element says why in data-viewer-error (tests read that too).
import { connectTimePlots } from "./cursor.js";
import { connectFilm } from "./film.js";
import { foldSections } from "./fold.js";
import { connectControls, Player } from "./player.js";
import { RobotScene } from "./scene.js";

const root = document.documentElement;

/// Power of ten of the arrows: the slider runs from 1 to 10 000 times.
class ArrowScale {
  constructor(typical, extent) {
    this.slider = document.getElementById("viewer-scale");
    this.text = document.getElementById("viewer-scale-text");
    const wanted = typical > 0 ? Math.log10((0.06 * extent) / typical) : 2;
    this.slider.value = String(Math.min(4, Math.max(0, wanted)));
    this.show();
  }
  get factor() {
    return 10 ** Number(this.slider.value);
  }
  show() {
    this.text.textContent = `× ${this.factor < 10 ? this.factor.toFixed(1) : this.factor.toFixed(0)}`;
  }
  change(step) {
    this.slider.value = String(Number(this.slider.value) + step);
    this.slider.dispatchEvent(new Event("input"));
  }
}

/// #t=3.53 opens the page at that time.
function timeOfAddress() {
  const found = /[#&]t=([0-9.]+)/.exec(window.location.hash);
  return found ? Number(found[1]) : null;
}

function start() {
  const model = JSON.parse(document.getElementById("viewer-data").textContent);
  if (model.times.length === 0 || model.joints.length + model.markers.length === 0) {
    root.dataset.viewer = "empty";
    return;
  }
  const panel = document.getElementById("viewer");
  const holder = document.getElementById("viewer-canvas");
  panel.hidden = false;
  let scene;
  try {
    scene = new RobotScene(holder, model);
  } catch (error) {
    panel.hidden = true;  // no WebGL: the drawings stay
    root.dataset.viewer = "no-webgl";
    root.dataset.viewerReason = String(error);
    return;
  }
  const scale = new ArrowScale(scene.typicalArrow(), scene.extent);
  const player = new Player(model.times);
  const show = () => scene.show(player.frame, scale.factor);
  player.onChange(show);
  scale.slider.addEventListener("input", () => {
    scale.show();
    show();
  });
  connectControls(player, scene, scale, holder);
  connectTimePlots(player);
  connectFilm(player);
  holder.addEventListener("focusin", () => { scene.controls.enableZoom = true; });
  holder.addEventListener("focusout", () => { scene.controls.enableZoom = false; });
  holder.addEventListener("mousedown", () => holder.focus());
  window.addEventListener("resize", () => scene.resize());
  const jump = () => {
    const time = timeOfAddress();
    if (time !== null) player.setTime(time);
  };
  window.addEventListener("hashchange", jump);
  scene.resize();
  player.setFrame(0);
  jump();
  root.dataset.viewer = "running";
}

window.addEventListener("error", (event) => { root.dataset.viewerError = String(event.message); });
try {
  foldSections();
  start();
} catch (error) {
  root.dataset.viewerError = String(error);
  console.error(error);
}
