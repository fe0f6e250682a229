// A ring for the phase, and in it a pad for blends: what plays is in the middle, what it can be blended with around it.
// state: {phase: 0..1 or null, playing, others: [name], blend: [name, weight] or null, enabled}
// sends {phase} and {blend: [name, weight]}; the farther from the middle, the more of the other motion.
motiondeck.part("motion-dial", (element, state, send) => {
  const space = "http://www.w3.org/2000/svg";
  const RING = 92, PAD = 62;
  const shape = (key, tag, attributes, text) => {
    let found = drawing.querySelector(`[data-key="${CSS.escape(key)}"]`);
    if (!found) {
      found = document.createElementNS(space, tag);
      found.dataset.key = key;
      drawing.append(found);
    }
    for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
    if (text !== undefined && found.textContent !== text) found.textContent = text;
    return found;
  };
  let drawing = element.querySelector("svg");
  if (!drawing) {
    drawing = document.createElementNS(space, "svg");
    drawing.setAttribute("viewBox", "-130 -100 260 200");
    element.append(drawing);
  }
  const at = (angle, radius) => [radius * Math.sin(angle), -radius * Math.cos(angle)];
  const point = (event) => {
    const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    return [x, y];
  };

  const ring = shape("ring", "circle", { r: RING, class: "ring" });
  if (state.phase === null) ring.style.display = "none";
  else {
    const [x, y] = at(2 * Math.PI * state.phase, RING);
    shape("hand", "circle", { r: 7, cx: x.toFixed(1), cy: y.toFixed(1), class: "hand" });
    const names = { role: "slider", tabindex: 0, "aria-label": "phase", "aria-valuemin": 0, "aria-valuemax": 1 };
    for (const [name, value] of Object.entries(names)) ring.setAttribute(name, value);
    ring.setAttribute("aria-valuenow", state.phase);
    ring.onpointerdown = (event) => {
      const [px, py] = point(event);
      send({ phase: ((Math.atan2(px, -py) / (2 * Math.PI)) % 1 + 1) % 1 });
    };
    ring.onkeydown = (event) => {
      const step = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01 }[event.key];
      if (step) send({ phase: Math.round(1000 * ((state.phase + step + 1) % 1)) / 1000 });
    };
  }

  const pad = shape("pad", "circle", { r: PAD, class: "pad" });
  const angle = (index) => (2 * Math.PI * index) / state.others.length;
  drawing.querySelectorAll("text").forEach((text) => text.remove());
  state.others.forEach((name, index) => {
    const [x, y] = at(angle(index), PAD - 12);
    shape(`to ${name}`, "text", { x: x.toFixed(1), y: (y + 3).toFixed(1), class: "other" }, name);
  });
  shape("here", "text", { x: 0, y: 4, class: "here" }, state.others.length ? state.playing : "");
  const index = state.blend ? state.others.indexOf(state.blend[0]) : -1;
  const [x, y] = index < 0 ? [0, 14] : at(angle(index), 14 + (PAD - 14) * state.blend[1]);
  shape("puck", "circle", { r: 6, cx: x.toFixed(1), cy: y.toFixed(1), class: "puck" });
  pad.dataset.empty = String(!state.others.length);
  const move = (event) => {
    const [px, py] = point(event);
    const turn = (Math.atan2(px, -py) / (2 * Math.PI) + 1) % 1;
    const nearest = Math.round(turn * state.others.length) % state.others.length;
    const weight = Math.min(1, Math.max(0, (Math.hypot(px, py) - 14) / (PAD - 18)));
    send({ blend: [state.others[nearest], Math.round(weight * 20) / 20] });
  };
  let last = 0;
  pad.onpointerdown = (event) => {
    if (!state.others.length || !state.enabled) return;
    pad.setPointerCapture(event.pointerId);
    move(event);
  };
  pad.onpointermove = (event) => {
    if (!pad.hasPointerCapture(event.pointerId) || performance.now() - last < 120) return;
    last = performance.now();
    move(event);
  };
});
