"use strict";

// The player of a run, in step with its charts. The state is one frame and one layer; show() changes it.

(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { frames, layers } = data;
  document.documentElement.dataset.ready = "yes";
  if (!frames.length) return;

  const screen = document.getElementById("screen");
  const scrubber = document.getElementById("scrubber");
  const counter = document.getElementById("counter");
  const playButton = document.getElementById("play");
  const plots = [...document.querySelectorAll(".plot")];
  const at = { frame: 0, layer: layers[0].name };

  // ---- pictures

  const KEPT = 240; // decoded pictures
  const pictures = new Map();

  function picture(index, layer) {
    const key = `${index} ${layer}`;
    const found = pictures.get(key) || Object.assign(new Image(), {
      alt: "", src: `data:image/webp;base64,${frames[index].layers[layer]}`,
    });
    pictures.delete(key); // and to the end again: the first is the least recently used
    pictures.set(key, found);
    if (pictures.size > KEPT) pictures.delete(pictures.keys().next().value);
    return found;
  }

  function stack(index) {
    if (!(at.layer in frames[index].layers)) return [];
    const isOverlay = layers.find((layer) => layer.name === at.layer).isOverlay;
    return (isOverlay ? ["result", at.layer] : [at.layer]).map((layer) => picture(index, layer));
  }

  async function draw() {
    const { frame, layer } = at;
    const images = stack(frame);
    await Promise.all(images.map((image) => image.decode()));
    if (frame !== at.frame || layer !== at.layer) return;
    screen.replaceChildren(...images);
    screen.dataset.shown = `${frames[frame].number} ${images.length ? layer : "nothing"}`;
  }

  // ---- state

  const shortened = (value) => (value === null ? "" : value.toFixed(Math.abs(value) < 100 ? 2 : 1));

  function show(frame, layer = at.layer) {
    at.frame = Math.min(Math.max(frame, 0), frames.length - 1);
    at.layer = layer;
    const { number, kind } = frames[at.frame];
    const name = kind ? `${number}, ${kind}` : `${number}`;
    scrubber.value = at.frame;
    scrubber.setAttribute("aria-valuetext", `frame ${name}`);
    counter.textContent = `${number} / ${data.last}`;
    screen.setAttribute("aria-label", `Frame ${name}: ${layers.find((one) => one.name === layer).title}`);
    for (const button of document.querySelectorAll("[data-layer]")) {
      button.setAttribute("aria-pressed", String(button.dataset.layer === layer));
    }
    for (const legend of document.querySelectorAll("[data-legend]")) {
      legend.hidden = legend.dataset.legend !== layer;
    }
    plots.forEach((plot, index) => mark(plot, data.values[index], number));
    draw();
  }

  // The cursor of a chart, and the values of its series at the frame.
  function mark(plot, values, number) {
    const { left, right, first, last } = plot.dataset;
    const share = (number - first) / (last - first);
    const cursor = plot.querySelector(".cursor");
    cursor.hidden = false;
    cursor.dataset.frame = number;
    cursor.style.left = `${100 * (Number(left) + share * (right - left))}%`;
    const places = plot.parentElement.querySelectorAll(".keyed b");
    values.forEach((series, index) => { places[index].textContent = shortened(series[at.frame]); });
  }

  // The frame of the player that is nearest to a number.
  function nearest(wanted) {
    const far = frames.map((frame) => Math.abs(frame.number - wanted));
    return far.indexOf(Math.min(...far));
  }

  // ---- playing

  const AHEAD = 10; // pictures decoded before they are shown
  let playing = 0; // number of the animation frame that is requested

  function play(isOn) {
    cancelAnimationFrame(playing);
    playing = 0;
    playButton.classList.toggle("playing", isOn);
    playButton.setAttribute("aria-label", isOn ? "Pause" : "Play");
    if (!isOn) return;
    const first = frames[0].index, length = frames[frames.length - 1].index + 1 - first;
    const begun = at.frame === frames.length - 1 ? first : frames[at.frame].index;
    const start = performance.now();
    const tick = () => {
      const passed = Math.floor(((performance.now() - start) / 1000) * data.fps);
      const index = first + ((begun - first + passed) % length);
      const now = frames.findLastIndex((frame) => frame.index <= index);
      if (now !== at.frame) show(now);
      for (let i = 1; i <= AHEAD; i += 1) stack((now + i) % frames.length).forEach((image) => image.decode());
      playing = requestAnimationFrame(tick);
    };
    playing = requestAnimationFrame(tick);
  }

  function seek(frame) {
    play(false);
    show(frame);
  }

  // ---- input

  function onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = event.shiftKey ? 10 : 1;
    const isPressing = event.key === " " && event.target.closest("button, summary");
    const isOnScrubber = event.target === scrubber;
    const layer = layers[Number(event.key) - 1];
    if (event.key === "ArrowRight" || (isOnScrubber && event.key === "ArrowUp")) seek(at.frame + step);
    else if (event.key === "ArrowLeft" || (isOnScrubber && event.key === "ArrowDown")) seek(at.frame - step);
    else if (event.key === "Home") seek(0);
    else if (event.key === "End") seek(frames.length - 1);
    else if (event.key === " " && !isPressing) play(!playing);
    else if (event.key !== " " && layer) show(at.frame, layer.name);
    else return;
    event.preventDefault();
  }

  function follow(plot) {
    const { left, right, first, last } = plot.dataset;
    const to = (event) => {
      const box = plot.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - left) / (right - left);
      seek(nearest(Number(first) + share * (last - first)));
    };
    plot.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      plot.setPointerCapture(event.pointerId);
      to(event);
    });
    plot.addEventListener("pointermove", (event) => { if (plot.hasPointerCapture(event.pointerId)) to(event); });
  }

  document.addEventListener("keydown", onKey);
  for (const button of document.querySelectorAll("[data-layer]")) {
    button.addEventListener("click", (event) => {
      show(at.frame, button.dataset.layer);
      if (event.detail) button.blur(); // after a click of the mouse, space plays
    });
  }
  playButton.addEventListener("click", (event) => {
    play(!playing);
    if (event.detail) playButton.blur();
  });
  plots.forEach(follow);
  document.documentElement.style.setProperty("--ratio", data.size[0] / data.size[1]);
  scrubber.max = frames.length - 1;
  scrubber.addEventListener("input", () => seek(Number(scrubber.value)));
  show(0);
})();
