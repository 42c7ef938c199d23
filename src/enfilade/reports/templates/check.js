"use strict";

// Two pictures with a movable boundary. The state is a frame, an object, and whether the difference is shown.

(() => {
  const { frames, boxes } = JSON.parse(document.getElementById("data").textContent);
  const pair = document.getElementById("pair");
  const split = document.getElementById("split");
  const box = document.getElementById("box");
  const differenceButton = document.getElementById("difference");
  const frameButtons = [...document.querySelectorAll("[data-frame]")];
  const rows = [...document.querySelectorAll("[data-object]")];
  const at = { frame: 0, object: null, isDifference: false };

  function draw() {
    const frame = frames[at.frame];
    const source = (name) => `data:image/webp;base64,${frame[name]}`;
    document.getElementById("left").src = source(at.isDifference ? "difference" : "cycles");
    document.getElementById("right").src = source(at.isDifference ? "difference" : "imported");
    for (const part of pair.querySelectorAll(".side, .line")) part.hidden = at.isDifference;
    const place = at.object === null ? null : boxes[at.object][at.frame];
    box.hidden = place === null;
    if (place) ["left", "top", "width", "height"].forEach((side, i) => { box.style[side] = `${place[i]}%`; });
    frameButtons.forEach((button, i) => button.setAttribute("aria-pressed", String(i === at.frame)));
    differenceButton.setAttribute("aria-pressed", String(at.isDifference));
    rows.forEach((row, i) => row.classList.toggle("chosen", i === at.object));
    pair.dataset.shown = `${frame.number}${at.isDifference ? " difference" : ""}`;
  }

  // The frame in which the object is largest, unless the present one shows it.
  function choose(object) {
    at.object = at.object === object ? null : object;
    const places = boxes[object];
    if (at.object !== null && !places[at.frame]) {
      const areas = places.map((place) => (place ? place[2] * place[3] : 0));
      at.frame = areas.indexOf(Math.max(...areas));
    }
    draw();
  }

  function move(percent) {
    const value = Math.min(Math.max(percent, 0), 100);
    split.value = value;
    pair.style.setProperty("--split", `${value}%`);
  }

  function follow(event) {
    const area = pair.getBoundingClientRect();
    move((100 * (event.clientX - area.left)) / area.width);
  }

  frameButtons.forEach((button, i) => button.addEventListener("click", () => { at.frame = i; draw(); }));
  rows.forEach((row, i) => row.addEventListener("click", () => choose(i)));
  differenceButton.addEventListener("click", () => { at.isDifference = !at.isDifference; draw(); });
  split.addEventListener("input", () => move(Number(split.value)));
  pair.addEventListener("pointerdown", (event) => { pair.setPointerCapture(event.pointerId); follow(event); });
  pair.addEventListener("pointermove", (event) => { if (event.buttons) follow(event); });
  draw();
})();
