"use strict";

// Frames, layers and charts of a run. The state is one frame and one layer; whoever changes it calls
// show(), and everything else follows.

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const frames = data.frames;
  const root = document.documentElement;
  const at = { frame: 0, layer: data.layers.length ? data.layers[0].name : "" };

  // ---- theme

  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
  const stored = (value) => {
    try {
      if (value) localStorage.setItem("enfilade-theme", value);
      return localStorage.getItem("enfilade-theme");
    } catch {
      return null; // a browser may keep nothing for pages from the disk
    }
  };
  const swatch = root.appendChild(document.createElement("i"));
  swatch.hidden = true;
  const color = (name) => {
    swatch.style.color = `var(--${name})`;
    return getComputedStyle(swatch).color; // with light-dark() resolved
  };

  if (["light", "dark"].includes(stored())) root.dataset.theme = stored();
  document.getElementById("theme").addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    stored(root.dataset.theme);
    drawPlots();
  });
  dark.addEventListener("change", () => drawPlots());

  // ---- pictures

  const KEPT = 240; // decoded pictures
  const pictures = new Map();

  function picture(index, layer) {
    const key = `${index} ${layer}`;
    let found = pictures.get(key);
    if (found) {
      pictures.delete(key); // and to the end again: the first is the one longest unused
    } else {
      const image = new Image();
      found = { image, isReady: false };
      image.src = `data:image/webp;base64,${frames[index].layers[layer]}`;
      found.ready = image.decode().then(() => { found.isReady = true; });
      if (pictures.size >= KEPT) pictures.delete(pictures.keys().next().value);
    }
    pictures.set(key, found);
    return found;
  }

  function needed(index) {
    const layer = data.layers.find((one) => one.name === at.layer);
    const has = at.layer in frames[index].layers;
    if (!has) return [];
    return layer.isOverlay ? [picture(index, "result"), picture(index, layer.name)] : [picture(index, layer.name)];
  }

  const canvas = document.getElementById("screen");
  const context = canvas ? canvas.getContext("2d") : null;

  function draw() {
    const index = at.frame, layer = at.layer;
    const images = needed(index);
    if (images.every((one) => one.isReady)) {
      paint(images.map((one) => one.image));
    } else {
      Promise.all(images.map((one) => one.ready)).then(() => {
        if (index === at.frame && layer === at.layer) paint(images.map((one) => one.image));
      });
    }
  }

  function paint([below, above]) {
    const { width, height } = canvas;
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 1;
    context.clearRect(0, 0, width, height);
    canvas.dataset.shown = `${frames[at.frame].number} ${below ? at.layer : "nothing"}`;
    if (!below) return;
    context.drawImage(below, 0, 0, width, height);
    if (!above) return;
    context.globalCompositeOperation = "saturation";
    context.fillStyle = "#000";
    context.fillRect(0, 0, width, height);
    context.globalCompositeOperation = "source-over";
    context.globalAlpha = 0.72;
    context.imageSmoothingEnabled = false;
    context.drawImage(above, 0, 0, width, height);
    context.imageSmoothingEnabled = true;
  }

  // ---- state

  const scrubber = document.getElementById("scrubber");
  const counter = document.getElementById("counter");
  const fact = (name, text) => {
    const place = document.getElementById(`fact-${name}`);
    if (place) place.textContent = text;
  };
  const number = (value, digits, unit) =>
    value === null || value === undefined ? "–" : `${value.toFixed(digits)} ${unit}`;

  function show(frame, layer = at.layer) {
    if (!frames.length) return;
    at.frame = Math.min(Math.max(frame, 0), frames.length - 1);
    at.layer = layer;
    const here = frames[at.frame];
    const name = [`${here.number}`, here.kind, here.isRaw && "not antialiased"].filter(Boolean).join(", ");
    const title = data.layers.find((one) => one.name === layer).title;
    scrubber.value = at.frame;
    scrubber.setAttribute("aria-valuetext", `frame ${name}`);
    counter.textContent = `${here.number} / ${data.range[1]}`;
    canvas.setAttribute("aria-label", `Frame ${name}: ${title}`);
    fact("frame", name);
    fact("velocity", number(here.velocity, 2, "deg/s"));
    fact("effort", number(here.effort, 1, data.unit));
    fact("score", number(here.score, 2, "JND"));
    fact("psnr", number(here.psnr, 1, "dB"));
    for (const button of document.querySelectorAll("[data-layer]")) {
      button.setAttribute("aria-pressed", String(button.dataset.layer === layer));
    }
    for (const legend of document.querySelectorAll("[data-legend]")) {
      legend.hidden = legend.dataset.legend !== layer;
    }
    draw();
    moveCursors();
  }

  // The frame on the page that is nearest to a number.
  function nearest(wanted) {
    let best = 0;
    frames.forEach((frame, index) => {
      if (Math.abs(frame.number - wanted) < Math.abs(frames[best].number - wanted)) best = index;
    });
    return best;
  }

  // ---- playing

  const AHEAD = 10; // pictures decoded before they are shown
  const playButton = document.getElementById("play");
  let playing = 0; // number of the animation frame that is asked for

  function play(isOn) {
    if (!playButton || frames.length < 2) return;
    cancelAnimationFrame(playing);
    playing = 0;
    playButton.classList.toggle("playing", isOn);
    playButton.setAttribute("aria-label", isOn ? "Pause" : "Play");
    if (!isOn) return;
    const isAtEnd = at.frame === frames.length - 1;
    const start = { s: performance.now() / 1000, index: isAtEnd ? frames[0].index : frames[at.frame].index };
    const first = frames[0].index, length = frames[frames.length - 1].index + 1 - first;
    const tick = () => {
      const passed = Math.floor((performance.now() / 1000 - start.s) * data.fps);
      const index = first + ((start.index - first + passed) % length);
      let now = isAtEnd && !passed ? 0 : at.frame;
      if (frames[now].index > index) now = 0;
      while (now + 1 < frames.length && frames[now + 1].index <= index) now += 1;
      if (now !== at.frame) show(now);
      for (let i = 1; i <= AHEAD; i += 1) needed((now + i) % frames.length);
      playing = requestAnimationFrame(tick);
    };
    playing = requestAnimationFrame(tick);
  }

  const seek = (frame) => {
    play(false);
    show(frame);
  };

  // ---- charts

  const MARGIN = { l: 40, r: 12, t: 8, b: 22 };
  const half = data.panels.length && data.range[0] === data.range[1] ? 1 : 0.5;
  const span = [data.range[0] - half, data.range[1] + half];
  const plots = [...document.querySelectorAll(".plot")].map((place) => ({
    place,
    cursor: place.querySelector(".cursor"),
    panel: data.panels.find((panel) => panel.name === place.dataset.panel),
  }));

  function drawPlots() {
    for (const { place, panel } of plots) {
      const axis = {
        fixedrange: true, color: color("ink-soft"), gridcolor: color("grid"), linecolor: color("rule"),
        zeroline: false, ticks: "", tickfont: { size: 11 },
      };
      const level = panel.level && {
        type: "line", xref: "paper", x0: 0, x1: 1, y0: panel.level.value, y1: panel.level.value,
        line: { color: color("ink-soft"), width: 1.2, dash: "dash" },
      };
      const layout = {
        margin: MARGIN, autosize: true, barmode: "stack", bargap: 0, showlegend: false, dragmode: false,
        hovermode: "x unified", paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
        font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: color("ink") },
        hoverlabel: { bgcolor: color("paper"), bordercolor: color("rule"), font: { color: color("ink") } },
        xaxis: { ...axis, range: span, showgrid: false, showline: true, tickformat: "d", nticks: 12, hoverformat: "d" },
        yaxis: { ...axis, range: [panel.bottom, panel.top], nticks: 5, ...(panel.ticks && { tickvals: panel.ticks }) },
        shapes: level ? [level] : [],
      };
      const config = { displayModeBar: false, responsive: true, displaylogo: false, scrollZoom: false };
      Plotly.react(place.querySelector(".canvas"), panel.traces, layout, config);
    }
  }

  function moveCursors() {
    const here = frames[at.frame];
    for (const { place, cursor } of plots) {
      const width = place.clientWidth - MARGIN.l - MARGIN.r;
      cursor.hidden = !here;
      if (here) {
        cursor.style.left = `${MARGIN.l + (width * (here.number - span[0])) / (span[1] - span[0])}px`;
        cursor.dataset.frame = here.number;
      }
    }
  }

  function follow(place) {
    const to = (event) => {
      const box = place.getBoundingClientRect();
      const share = (event.clientX - box.left - MARGIN.l) / (box.width - MARGIN.l - MARGIN.r);
      if (frames.length) seek(nearest(span[0] + share * (span[1] - span[0])));
    };
    let isHeld = false;
    place.addEventListener("pointerdown", (event) => {
      if (event.button === 0) {
        isHeld = true;
        to(event);
      }
    }, true);
    // On the window: Plotly lays a cover over the page while a button is held.
    window.addEventListener("pointermove", (event) => { if (isHeld) to(event); }, true);
    for (const name of ["pointerup", "pointercancel"]) {
      window.addEventListener(name, () => { isHeld = false; });
    }
  }

  // ---- hands

  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !frames.length) return;
    const step = event.shiftKey ? 10 : 1;
    const isPressing = event.target.closest("button, summary") && event.key === " ";
    const layer = data.layers.find((one) => String(one.key) === event.key);
    if (event.key === "ArrowRight" || event.key === "ArrowUp" && event.target === scrubber) seek(at.frame + step);
    else if (event.key === "ArrowLeft" || event.key === "ArrowDown" && event.target === scrubber) seek(at.frame - step);
    else if (event.key === "Home") seek(0);
    else if (event.key === "End") seek(frames.length - 1);
    else if (event.key === " " && !isPressing) play(!playing);
    else if (layer) show(at.frame, layer.name);
    else return;
    event.preventDefault();
  }

  // ---- a page that takes the place of this one, as a running run goes on, shows the same

  const PLACE = `enfilade-place ${location.pathname}`;
  const folds = [...document.querySelectorAll("details")];

  function keepPlace() {
    const place = {
      frame: frames.length ? frames[at.frame].number : null,
      layer: at.layer,
      isPlaying: playing !== 0,
      open: folds.map((one) => one.open),
      scroll: [scrollX, scrollY],
    };
    try {
      sessionStorage.setItem(PLACE, JSON.stringify(place));
    } catch {
      // a browser may keep nothing for pages from the disk
    }
  }

  function keptPlace() {
    try {
      return JSON.parse(sessionStorage.getItem(PLACE));
    } catch {
      return null;
    }
  }

  document.addEventListener("keydown", onKey);
  for (const button of document.querySelectorAll("[data-layer]")) {
    button.addEventListener("click", (event) => {
      show(at.frame, button.dataset.layer);
      if (event.detail) button.blur(); // after a click of the mouse, space plays
    });
  }
  plots.forEach(({ place }) => follow(place));
  if (frames.length) { // first: its height is that of the charts
    [canvas.width, canvas.height] = data.size;
    root.style.setProperty("--ratio", data.size[0] / data.size[1]);
  }
  drawPlots();
  new ResizeObserver(moveCursors).observe(document.body);
  if (frames.length) {
    scrubber.max = frames.length - 1;
    scrubber.addEventListener("input", () => seek(Number(scrubber.value)));
    playButton.addEventListener("click", (event) => {
      play(!playing);
      if (event.detail) playButton.blur();
    });
    show(0);
  }
  const kept = keptPlace();
  if (kept) {
    const hasLayer = data.layers.some((one) => one.name === kept.layer);
    if (kept.frame !== null && frames.length) show(nearest(kept.frame), hasLayer ? kept.layer : at.layer);
    folds.forEach((one, index) => { one.open = Boolean(kept.open[index]); });
    scrollTo(...kept.scroll);
    if (kept.isPlaying) play(true);
  }
  addEventListener("pagehide", keepPlace);
  root.dataset.ready = "yes";
})();
