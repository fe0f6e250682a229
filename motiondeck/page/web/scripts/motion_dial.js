// A ring for the phase, and in it a pad for blends: what plays is in the middle, what it can be blended with around it.
// state: {phase: 0..1 or null, playing, others: [name], apart: [why each and the next cannot be blended, or ""],
//   refused: {name: why}, never: why nothing can be, or "", blend: [[name, weight]], weights: [least, most], enabled}
// sends {phase} and, when the point is let go, {blend: [[name, weight]]}. Between the middle and two neighbours the point
// is the mean of the three with their weights. Outside, on the line through a name, its weight rises above 1; with Shift
// the point stays on the line of the nearest name, and through the middle, on the other side, its weight is below 0.
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

  drawing.classList.toggle("off", !state.enabled);
  const ring = shape("ring", "circle", { r: RING, class: "ring" });
  if (state.phase === null) ring.style.display = "none";
  else {
    const [x, y] = at(2 * Math.PI * state.phase, RING);
    shape("hand", "circle", { r: 7, cx: x.toFixed(1), cy: y.toFixed(1), class: "hand" });
    const names = { role: "slider", tabindex: 0, "aria-label": "phase", "aria-valuemin": 0, "aria-valuemax": 1 };
    for (const [name, value] of Object.entries(names)) ring.setAttribute(name, value);
    ring.setAttribute("aria-valuenow", state.phase);
    ring.onpointerdown = (event) => {
      if (!state.enabled) return;
      const [px, py] = point(event);
      send({ phase: ((Math.atan2(px, -py) / (2 * Math.PI)) % 1 + 1) % 1 });
    };
    ring.onkeydown = (event) => {
      const step = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01 }[event.key];
      if (step && state.enabled) send({ phase: Math.round(1000 * ((state.phase + step + 1) % 1)) / 1000 });
    };
  }

  const pad = shape("pad", "circle", { r: PAD, class: "pad" });
  const [least, most] = state.weights;
  const places = Math.max(3, state.others.length); // with fewer, two neighbours would be opposite each other
  const angle = (index) => (2 * Math.PI * index) / places;
  const rounded = (weight) => Math.round(weight * 20) / 20;
  if (pad.playing !== state.playing) pad.pulled = null; // what is around has changed under the hand
  pad.playing = state.playing;
  // Where the deck would refuse three at once: between two neighbours that are too far from each other.
  drawing.querySelectorAll(".apart").forEach((wedge) => wedge.remove());
  state.apart.forEach((why, index) => {
    if (!why || (index + 1 === state.others.length && places > state.others.length)) return;
    const [[x, y], [u, v]] = [at(angle(index + 0.1), PAD), at(angle(index + 0.9), PAD)];
    const wedge = shape(`apart ${index}`, "path", { d: `M0 0L${x} ${y}A${PAD} ${PAD} 0 0 1 ${u} ${v}Z`, class: "apart" });
    const title = document.createElementNS(space, "title");
    title.textContent = why;
    wedge.append(title);
    wedge.onpointerdown = (event) => pad.onpointerdown(event);
    pad.after(wedge); // below the names and the point
  });
  shape("whole", "circle", { r: ONE, class: "whole" });
  const puck = shape("puck", "circle", { r: 6, class: "puck" });
  pad.dataset.empty = String(!state.others.length);

  const show = (parts) => {
    drawing.querySelectorAll("text").forEach((text) => text.remove());
    const percent = (weight) => ` ${Math.round(100 * weight)} %`;
    const weights = new Map(parts);
    state.others.forEach((name, index) => {
      const [x, y] = at(angle(index), ONE);
      const text = name + (weights.has(name) ? percent(weights.get(name)) : "");
      shape(`to ${name}`, "text", { x: x.toFixed(1), y: (y + 3).toFixed(1), class: weights.has(name) ? "other part" : "other" }, text);
    });
    const rest = parts.reduce((left, [, weight]) => left - weight, 1);
    const here = state.playing + (parts.length ? percent(rest) : "");
    shape("here", "text", { x: 0, y: 4, class: "here" }, state.others.length ? here : "");
    const known = parts.map(([name, weight]) => [state.others.indexOf(name), weight]).filter(([index]) => index >= 0);
    const [x, y] = known
      .map(([index, weight]) => at(angle(index), ONE * weight))
      .reduce(([ax, ay], [bx, by]) => [ax + bx, ay + by], known.length ? [0, 0] : [0, 14]);
    puck.setAttribute("cx", x.toFixed(1));
    puck.setAttribute("cy", y.toFixed(1));
    const slider = { role: "slider", tabindex: 0, "aria-label": "blend weight", "aria-valuemin": least, "aria-valuemax": most };
    slider["aria-valuenow"] = parts.length ? parts[0][1] : 0;
    slider["aria-valuetext"] = parts.map(([name, weight]) => name + percent(weight)).join(", ");
    for (const [name, value] of Object.entries(slider)) pad.setAttribute(name, value);
  };
  show(pad.pulled ?? state.blend);

  // What has no place on the pad, and why; opened for those who cannot point at it.
  const refused = Object.entries(state.refused);
  const why = state.never || refused.map(([, reason]) => reason).join("\n");
  const note = motiondeck.child(element, "refused", "details", "refused");
  if (note.why !== why) {
    note.why = why;
    note.hidden = !why;
    note.title = why;
    const short = document.createElement("summary");
    short.textContent = state.never || `no blend with ${refused.map(([name]) => name).join(", ")}`;
    const reasons = document.createElement("div");
    reasons.textContent = why;
    note.replaceChildren(short, reasons);
  }

  // How far a point is along the line through a name; 1 is where the name stands.
  const along = (index, [px, py]) => {
    const [x, y] = at(angle(index), 1);
    return (px * x + py * y) / ONE;
  };
  const onLine = (index, point) => [[state.others[index], rounded(Math.min(most, Math.max(least, along(index, point))))]];
  const nearest = (point) => {
    const indices = state.others.map((_, index) => index);
    return indices.reduce((best, index) => (along(index, point) > along(best, point) ? index : best), 0);
  };
  const within = (point) => {
    const turn = (Math.atan2(point[0], -point[1]) / (2 * Math.PI) + 1) % 1;
    const first = Math.floor(turn * places) % places;
    const second = (first + 1) % places;
    if (first >= state.others.length || second >= state.others.length) {
      const index = nearest(point);
      return along(index, point) > 0 ? onLine(index, point) : [[state.others[index], 0]];
    }
    if (state.apart[first]) return onLine(along(first, point) > along(second, point) ? first : second, point);
    // The point is a first + b second, which both are ONE from the middle.
    const sine = Math.sin(angle(1));
    const away = Math.hypot(...point) / ONE;
    const past = 2 * Math.PI * turn - angle(first);
    let [a, b] = [(away * Math.sin(angle(1) - past)) / sine, (away * Math.sin(past)) / sine];
    if (Math.min(a, b) < 0.1 * (a + b)) return onLine(a > b ? first : second, point);
    const beyond = Math.max(1, a + b);
    [a, b] = [rounded(a / beyond), rounded(b / beyond)];
    if (a + b > 1) a = rounded(1 - b);
    const parts = [[state.others[first], a], [state.others[second], b]].filter(([, weight]) => weight > 0);
    return parts.length ? parts : [[state.others[first], 0]];
  };
  const pull = (event) => {
    if (!event.shiftKey) pad.line = null;
    else if (pad.line === null) pad.line = nearest(point(event));
    pad.pulled = pad.line === null ? within(point(event)) : onLine(pad.line, point(event));
    show(pad.pulled);
  };
  pad.onpointerdown = (event) => {
    if (!state.others.length || !state.enabled) return;
    pad.setPointerCapture(event.pointerId);
    pad.line = null;
    pull(event);
  };
  pad.onpointermove = (event) => pad.pulled && pad.hasPointerCapture(event.pointerId) && pull(event);
  pad.onpointerup = () => {
    if (pad.pulled) send({ blend: pad.pulled });
    pad.pulled = null;
  };
  pad.onpointercancel = () => {
    pad.pulled = null;
    show(state.blend);
  };
  pad.onkeydown = (event) => {
    const step = { ArrowRight: 0.05, ArrowUp: 0.05, ArrowLeft: -0.05, ArrowDown: -0.05 }[event.key];
    if (!step || !state.others.length || !state.enabled) return;
    const [[name, weight], ...further] = state.blend.length ? state.blend : [[state.others[0], 0]];
    const rest = further.reduce((left, [, part]) => left - part, 1);
    const [low, high] = further.length ? [0, rest] : [least, most];
    state.blend = [[name, rounded(Math.min(high, Math.max(low, weight + step)))], ...further];
    show(state.blend);
    send({ blend: state.blend });
  };
});
