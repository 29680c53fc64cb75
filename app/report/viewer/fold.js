// SPDX-License-Identifier: Apache-2.0
//
// Folds what stands below the first screen: a verdict first, everything else on demand. Without scripts, and in
// print, all of it is there.

/// Stays as it is.
const kOpen = "verdict";

function fold(section) {
  const details = document.createElement("details");
  details.className = "fold";
  const summary = document.createElement("summary");
  summary.append(section.querySelector(":scope > h2"));
  details.append(summary, ...section.childNodes);
  section.append(details);
  return details;
}

/// What an address names is opened, whether it is a section or stands inside one.
function openTarget(folds) {
  const target = document.getElementById(decodeURIComponent(window.location.hash.slice(1)));
  if (target === null) return;
  const around = folds.find((details) => details.parentElement === target || details.contains(target));
  if (around === undefined) return;
  around.open = true;
  target.scrollIntoView();
}

function openAllButton(folds) {
  const button = document.createElement("button");
  button.type = "button";
  const show = () => {
    const all = folds.every((details) => details.open);
    button.textContent = all ? "Fold all sections" : "Open all sections";
    return all;
  };
  button.addEventListener("click", () => {
    const open = !show();
    for (const details of folds) details.open = open;
  });
  for (const details of folds) details.addEventListener("toggle", show);
  show();
  return button;
}

export function foldSections() {
  const sections = [...document.querySelectorAll("section[id]")].filter(
      (section) => section.id !== kOpen && section.querySelector(":scope > h2") !== null);
  const folds = sections.map(fold);
  if (folds.length === 0) return;
  const item = document.createElement("li");
  item.append(openAllButton(folds));
  document.querySelector("nav ol").append(item);
  // A second click on the same entry of the contents changes no address.
  document.querySelector("nav").addEventListener("click", (event) => {
    const entry = event.target.closest("a");
    if (entry !== null && entry.hash === window.location.hash) openTarget(folds);
  });
  window.addEventListener("hashchange", () => openTarget(folds));
  openTarget(folds);
  let closed = [];
  window.addEventListener("beforeprint", () => {
    closed = folds.filter((details) => !details.open);
    for (const details of closed) details.open = true;
  });
  window.addEventListener("afterprint", () => {
    for (const details of closed) details.open = false;
  });
}
