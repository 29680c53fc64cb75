// SPDX-License-Identifier: Apache-2.0
#include "app/capture/page.h"

#include <string_view>

#include "app/io/output_folder.h"
#include "app/report/page.h"

namespace kinescope {
namespace {

// Behind the style of all pages.
constexpr std::string_view kStyle = R"css(<style>
#live { display: grid; grid-template-columns: minmax(0, 3fr) minmax(0, 2fr); gap: 10px 28px; }
#picture { position: relative; background: var(--panel); border: 1px solid var(--line); border-radius: 6px; overflow: hidden; min-height: 120px; }
#picture img { display: block; width: 100%; }
#picture svg { position: absolute; inset: 0; height: 100%; }
#picture polygon { fill: none; stroke: #2fc79a; stroke-width: 2; vector-effect: non-scaling-stroke; }
#picture polygon.refused { stroke: #ff9d4d; stroke-dasharray: 5 3; }
#picture text { font-weight: 700; fill: #fff; stroke: #000; stroke-width: .22em; paint-order: stroke; }
#buttons { display: flex; gap: 10px; align-items: baseline; flex-wrap: wrap; margin: 12px 0; }
#buttons button { font-size: 16px; padding: 6px 22px; }
#buttons button:disabled { opacity: .45; cursor: default; }
#start:enabled { border-color: var(--good); color: var(--good); } #stop:enabled { border-color: var(--poor); color: var(--poor); }
#missing { padding-left: 1.2em; } #missing li { margin: 4px 0; }
#grid { display: grid; gap: 2px; max-width: 300px; }
#grid i { aspect-ratio: 5 / 4; border: 1px solid var(--line); border-radius: 2px; } #grid i.seen { background: var(--good); border-color: var(--good); }
@media (max-width: 700px) { #live { grid-template-columns: minmax(0, 1fr); } }
</style>
)css";

constexpr std::string_view kBody = R"html(<main>
<p class="headline" id="phase" role="status">Connecting ..</p>
<div id="buttons"><button id="start" disabled>Start recording</button><button id="stop" disabled>Stop</button>
<span class="note" id="counts"></span></div>
<div id="live"><div>
<div id="picture"><img id="image" alt="what the camera sees"><svg id="outlines" aria-hidden="true"></svg></div>
<p class="note" id="now"></p></div>
<div><h3>Still missing</h3><ul id="missing"></ul><ul class="warned" id="warnings"></ul></div></div>
<div class="columns">
<div class="scroll"><table id="markers"><caption>Markers</caption><thead><tr><th>marker</th><th>seen in, frames</th><th>of use in, frames</th><th>width, px</th><th>now, px</th><th>tilt now, °</th><th>most, °</th><th>now</th></tr></thead><tbody></tbody></table></div>
<div class="scroll"><table id="joints" hidden><caption>Joint values</caption><thead><tr><th>channel</th><th>from</th><th>to</th><th>range</th><th>unit</th></tr></thead><tbody></tbody></table></div>
<figure><figcaption>Parts of the image with markers: <span id="coverage"></span></figcaption><div id="grid" role="img" aria-labelledby="coverage"></div></figure>
<div class="scroll"><table id="refused"><caption>Frames refused</caption><tbody></tbody></table></div>
</div>
</main>
<script>
)html";

// Texts are set as text: a channel may be called anything.
constexpr std::string_view kScript = R"js("use strict";
const at = id => document.getElementById(id);
const kPhases = { waiting: "Ready: check the picture, then start", recording: "Recording", ended: "Ended" };
const kTurn_ms = 250;
const kSvg = "http://www.w3.org/2000/svg";

function fill(parent, tag, texts) {
  parent.replaceChildren(...texts.map(text => Object.assign(document.createElement(tag), { textContent: text })));
}
function fill_rows(table, rows) {
  at(table).tBodies[0].replaceChildren(...rows.map(cells => {
    const row = document.createElement("tr");
    cells.forEach((cell, i) => {
      const td = row.insertCell();
      td.textContent = cell;
      if (typeof cell === "number" || (i > 0 && /^[-\d.]+$/.test(cell))) td.className = "n";
    });
    return row;
  }));
}
function svg(tag, attributes) {
  const out = document.createElementNS(kSvg, tag);
  for (const [name, value] of Object.entries(attributes)) out.setAttribute(name, value);
  return out;
}
function outline(now) {
  at("outlines").setAttribute("viewBox", `0 0 ${now.width || 1} ${now.height || 1}`);
  at("outlines").replaceChildren(...now.markers.flatMap(marker => {
    const polygon = svg("polygon", { points: marker.corners.map(c => c.join(",")).join(" "),
                                     class: marker.refusal ? "refused" : "good" });
    const [x, y] = marker.corners[0];
    const name = svg("text", { x, y, style: `font-size: ${now.width / 40}px` });
    name.textContent = marker.id;
    return [polygon, name];
  }));
}
function show(state) {
  at("phase").textContent = kPhases[state.phase] + (state.end ? ": " + state.end : "");
  at("start").disabled = state.phase !== "waiting";
  at("stop").disabled = state.phase !== "recording";
  at("counts").textContent = `${state.frames} frames in ${state.seconds.toFixed(1)} s; ${state.used} of ${state.examined} looked at are of use`;
  const now = state.now;
  outline(now);
  at("now").textContent = now.refusal ? "This frame is refused: " + now.refusal : "";
  fill(at("missing"), "li", state.missing.length ? state.missing : ["nothing: the recording will do"]);
  fill(at("warnings"), "li", state.warnings);
  const seen = new Map(now.markers.map(marker => [marker.id, marker]));
  fill_rows("markers", state.markers.map(marker => {
    const here = seen.get(marker.id);
    return [`tag ${marker.id}`, marker.frames, marker.used, marker.edge_px.toFixed(0), here ? here.edge_px.toFixed(0) : "",
            here ? here.tilt_deg.toFixed(0) : "", marker.most_tilt_deg.toFixed(0), here ? here.refusal || "good" : "not seen"];
  }));
  at("joints").hidden = !state.joints.length;
  fill_rows("joints", state.joints.map(joint => [joint.channel, joint.lower.toPrecision(4), joint.upper.toPrecision(4),
                                                 (joint.upper - joint.lower).toPrecision(3), joint.unit]));
  fill_rows("refused", Object.entries(state.refused));
  at("refused").hidden = !Object.keys(state.refused).length;
  at("coverage").textContent = `${(100 * state.coverage).toFixed(0)} %`;
  at("grid").style.gridTemplateColumns = `repeat(${state.grid.columns}, 1fr)`;
  at("grid").replaceChildren(...state.grid.counts.map(count =>
    Object.assign(document.createElement("i"), { className: count ? "seen" : "" })));
}
async function show_picture() {
  const answer = await fetch("/picture.jpg");
  if (answer.status !== 200) return;
  const old = at("image").src;
  at("image").src = URL.createObjectURL(await answer.blob());
  if (old) URL.revokeObjectURL(old);
}
async function turn() {
  try {
    const state = await (await fetch("/state")).json();
    if (state.phase !== "ended") await show_picture();
    show(state);
    if (state.phase === "ended") {
      document.documentElement.dataset.capture = "ended";
      return;
    }
    document.documentElement.dataset.capture = "shown";
  } catch (error) {
    at("phase").textContent = "kinescope capture is not running any more";
    at("start").disabled = at("stop").disabled = true;
    return;
  }
  setTimeout(turn, kTurn_ms);
}
for (const button of ["start", "stop"])
  at(button).addEventListener("click", () => fetch("/" + button, { method: "POST" }));
turn();
</script>
</body>
</html>
)js";

}  // namespace

std::string capture_page(const std::string& source, const std::string& folder) {
  // Its own server only, for the picture and the state.
  std::string out =
      report::page_begin("capture", folder, source, program_version(), {}, "; connect-src 'self'");
  out += kStyle;
  out += kBody;
  out += kScript;
  return out;
}

}  // namespace kinescope
