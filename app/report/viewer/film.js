// SPDX-License-Identifier: Apache-2.0
//
// The video's frames beside the 3-D view: of those that the page carries, the one nearest to its time.
import { nearest } from "./player.js";

export function connectFilm(player) {
  const frames = [...document.querySelectorAll("#film svg")];
  if (frames.length === 0) return;
  const times = frames.map((frame) => Number(frame.dataset.t));
  const clock = document.getElementById("film-clock");
  player.onChange((frame) => {
    const best = nearest(times, player.times[frame]);
    frames.forEach((one, k) => one.classList.toggle("shown", k === best));
    clock.textContent = times[best].toFixed(2);
  });
}
