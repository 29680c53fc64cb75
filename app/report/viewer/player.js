// SPDX-License-Identifier: Apache-2.0
//
// Time: the slider, play and pause, the keyboard, and whoever wants to know where it stands.

/// Index of the time nearest to one.
export function nearest(times, time) {
  let best = 0;
  for (let k = 1; k < times.length; ++k) {
    if (Math.abs(times[k] - time) < Math.abs(times[best] - time)) best = k;
  }
  return best;
}

export class Player {
  constructor(times) {
    this.times = times;
    this.frame = 0;
    this.playing = false;
    this.listeners = [];
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  setFrame(frame) {
    this.frame = Math.min(this.times.length - 1, Math.max(0, frame));
    for (const listener of this.listeners) listener(this.frame);
  }

  setTime(time) {
    this.setFrame(nearest(this.times, time));
  }

  toggle() {
    this.playing = !this.playing;
    if (this.playing) {
      if (this.frame >= this.times.length - 1) this.setFrame(0);
      this.startTime = this.times[this.frame];
      this.startClock = null;
      requestAnimationFrame((clock) => this.advance(clock));
    }
    for (const listener of this.listeners) listener(this.frame);
  }

  advance(clock) {
    if (!this.playing) return;
    if (this.startClock === null) this.startClock = clock;
    const time = this.startTime + (clock - this.startClock) / 1000;
    let frame = this.frame;
    while (frame + 1 < this.times.length && this.times[frame + 1] <= time) ++frame;
    if (frame >= this.times.length - 1) this.playing = false;
    if (frame !== this.frame || !this.playing) this.setFrame(frame);
    if (this.playing) requestAnimationFrame((next) => this.advance(next));
  }
}

/// Connects the page's controls. `view` offers reset() and lookFromCamera(); `scale` gets and sets the power of ten
/// of the residual arrows.
export function connectControls(player, view, scale, holder) {
  const byId = (id) => document.getElementById(id);
  const slider = byId("viewer-time");
  const play = byId("viewer-play");
  const clock = byId("viewer-clock");
  slider.max = String(player.times.length - 1);
  slider.addEventListener("input", () => {
    player.playing = false;
    player.setFrame(Number(slider.value));
  });
  play.addEventListener("click", () => player.toggle());
  byId("viewer-reset").addEventListener("click", () => view.reset());
  byId("viewer-camera").addEventListener("click", () => view.lookFromCamera());
  player.onChange((frame) => {
    slider.value = String(frame);
    play.textContent = player.playing ? "Pause" : "Play";
    clock.textContent = `${player.times[frame].toFixed(2)} s`;
  });
  const keys = {
    " ": () => player.toggle(),
    ArrowLeft: (step) => player.setFrame(player.frame - step),
    ArrowRight: (step) => player.setFrame(player.frame + step),
    Home: () => player.setFrame(0),
    End: () => player.setFrame(player.times.length - 1),
    "+": () => scale.change(0.2),
    "-": () => scale.change(-0.2),
    r: () => view.reset(),
    c: () => view.lookFromCamera(),
  };
  holder.addEventListener("keydown", (event) => {
    const action = keys[event.key];
    if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    action(event.shiftKey ? 10 : 1);
  });
}
