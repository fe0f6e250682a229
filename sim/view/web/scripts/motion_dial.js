// A ring for the phase, and in it a pad for blends: what plays is in the middle, what it can be blended with around it.
// state: {phase: 0..1 or null, playing, others: [name], blend: [name, weight] or null, weights: [least, most], enabled}
// sends {phase} and {blend: [name, weight]}. A press takes the nearest motion, and pulling changes its weight alone: 1 is
// where its name stands, farther out is more; through the middle, on the other side, is less than none.
motiondeck.part("motion-dial", (element, state, send) => {
  const space = "http://www.w3.org/2000/svg";
  const RING = 92, PAD = 74, ONE = 52;
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
    const [x, y] = at(angle(index), ONE);
    shape(`to ${name}`, "text", { x: x.toFixed(1), y: (y + 3).toFixed(1), class: "other" }, name);
  });
  shape("here", "text", { x: 0, y: 4, class: "here" }, state.others.length ? state.playing : "");
  const [least, most] = state.weights;
  const index = state.blend ? state.others.indexOf(state.blend[0]) : -1;
  shape("whole", "circle", { r: ONE, class: "whole" });
  const puck = shape("puck", "circle", { r: 6, class: "puck" });
  const slider = { role: "slider", tabindex: 0, "aria-label": "blend weight", "aria-valuemin": least, "aria-valuemax": most };
  for (const [name, value] of Object.entries(slider)) pad.setAttribute(name, value);
  const show = (taken, weight) => {
    const [x, y] = taken < 0 ? [0, 14] : at(angle(taken), ONE * weight);
    puck.setAttribute("cx", x.toFixed(1));
    puck.setAttribute("cy", y.toFixed(1));
    pad.dataset.taken = String(taken);
    pad.setAttribute("aria-valuenow", weight);
  };
  show(index, index < 0 ? 0 : state.blend[1]);
  pad.dataset.empty = String(!state.others.length);
  const blend = (taken, wanted) => {
    const weight = Math.round(Math.min(most, Math.max(least, wanted)) * 20) / 20;
    show(taken, weight);
    send({ blend: [state.others[taken], weight] });
  };
  const nearest = ([px, py]) => {
    const [x, y] = [Number(puck.getAttribute("cx")), Number(puck.getAttribute("cy"))];
    const taken = Number(pad.dataset.taken);
    // Below 0 the puck is on the side of other motions.
    if (taken >= 0 && Math.hypot(px - x, py - y) < 12) return taken;
    const turn = (Math.atan2(px, -py) / (2 * Math.PI) + 1) % 1;
    return Math.round(turn * state.others.length) % state.others.length;
  };
  const pull = (taken, [px, py]) => {
    const [x, y] = at(angle(taken), 1);
    blend(taken, (px * x + py * y) / ONE);
  };
  let last = 0;
  pad.onpointerdown = (event) => {
    if (!state.others.length || !state.enabled) return;
    pad.setPointerCapture(event.pointerId);
    pull(nearest(point(event)), point(event));
  };
  pad.onpointermove = (event) => {
    if (!pad.hasPointerCapture(event.pointerId) || performance.now() - last < 120) return;
    last = performance.now();
    pull(Number(pad.dataset.taken), point(event));
  };
  pad.onkeydown = (event) => {
    const step = { ArrowRight: 0.05, ArrowUp: 0.05, ArrowLeft: -0.05, ArrowDown: -0.05 }[event.key];
    if (!step || !state.others.length || !state.enabled) return;
    blend(Math.max(0, Number(pad.dataset.taken)), Number(pad.getAttribute("aria-valuenow")) + step);
  };
});
