// SPDX-License-Identifier: Apache-2.0
//
// A cursor in every plot over time: follows the 3-D view, and a click on the plot sets the time.

const SVG = "http://www.w3.org/2000/svg";

export function connectTimePlots(player) {
  const cursors = [];
  for (const plot of document.querySelectorAll("svg[data-t0]")) {
    const number = (name) => Number(plot.dataset[name]);
    const line = document.createElementNS(SVG, "line");
    line.setAttribute("class", "cursor");
    line.setAttribute("y1", plot.dataset.y0);
    line.setAttribute("y2", plot.dataset.y1);
    plot.appendChild(line);
    cursors.push((time) => {
      const share = (time - number("t0")) / (number("t1") - number("t0"));
      const x = number("x0") + share * (number("x1") - number("x0"));
      line.setAttribute("x1", String(x));
      line.setAttribute("x2", String(x));
    });
    plot.style.cursor = "crosshair";
    plot.addEventListener("click", (event) => {
      const box = plot.getBoundingClientRect();
      const x = ((event.clientX - box.left) / box.width) * plot.viewBox.baseVal.width;
      const share = (x - number("x0")) / (number("x1") - number("x0"));
      player.playing = false;
      player.setTime(number("t0") + share * (number("t1") - number("t0")));
    });
  }
  player.onChange((frame) => cursors.forEach((move) => move(player.times[frame])));
}
