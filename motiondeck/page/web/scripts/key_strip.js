// The keys of a motion over its time: curves of its joints, a mark for each key, and where a limit holds a joint back.
// state: {length, keys: [[at, title]], curves: [[name, [0 to 1, ...]]], held: [[from, to, text]]}; times in s.
// sends {at} where it is pressed, {move: [from, to]} for a key that is dragged, {remove: at} for Delete on a key.
// The hand is a part of its own, since it moves all the time. state: {length, at}
(() => {
  const { child } = motiondeck;
  const SNAP = 0.05; // s
  const strip = () => child(document.body, "keys", "div", "key-strip");
  motiondeck.part("key-strip", (element, state, send) => {
    const bar = child(strip(), "bar", "div", "bar");
    const place = (at) => `${(100 * at) / state.length}%`;
    const seconds = (event, snap) => {
      const { left, width } = bar.getBoundingClientRect();
      const at = (state.length * (event.clientX - left)) / width;
      return Math.min(state.length, Math.max(0, Number((Math.round(at / snap) * snap).toFixed(3))));
    };
    const line = ([name, values], index) => {
      const points = values.map((value, at) => `${(100 * at) / (values.length - 1)},${96 - 92 * value}`).join(" ");
      const colour = `hsl(${(index * 137 + 210) % 360} 60% 45%)`;
      return `<polyline points="${points}" stroke="${colour}"><title>${name}</title></polyline>`;
    };
    bar.innerHTML = `<svg viewBox="0 0 100 100" preserveAspectRatio="none">${state.curves.map(line).join("")}</svg>`;
    for (const [from, to, text] of state.held) {
      const held = document.createElement("span");
      held.className = "held";
      held.style.cssText = `left:${place(from)};width:max(3px, ${place(to - from)})`;
      held.title = text;
      bar.append(held);
    }
    bar.onpointerdown = (event) => {
      if (event.target.dataset.at) return;
      bar.setPointerCapture(event.pointerId);
      send({ at: seconds(event, SNAP) });
    };
    bar.onpointermove = (event) => bar.hasPointerCapture(event.pointerId) && send({ at: seconds(event, SNAP) });
    for (const [at, title] of state.keys) {
      const key = document.createElement("button");
      key.className = "key";
      key.dataset.at = at;
      key.style.left = place(at);
      key.title = `${title}. Drag it, or use the arrow keys, to move it; Delete deletes it.`;
      key.setAttribute("aria-label", `key at ${at} s`);
      let dragged;
      key.onpointerdown = (event) => (key.setPointerCapture(event.pointerId), (dragged = undefined));
      key.onpointermove = (event) => {
        if (!key.hasPointerCapture(event.pointerId)) return;
        if (dragged === undefined && Math.abs(event.movementX) < 1) return;
        dragged = seconds(event, SNAP);
        key.style.left = place(dragged);
      };
      key.onpointerup = () => send(dragged === undefined || dragged === at ? { at } : { move: [at, dragged] });
      key.onkeydown = (event) => {
        const step = { ArrowLeft: -SNAP, ArrowRight: SNAP }[event.key];
        if (step) send({ move: [at, Math.min(state.length, Math.max(0, Number((at + step).toFixed(3))))] });
        else if (event.key === "Delete" || event.key === "Backspace") send({ remove: at });
        else if (event.key === "Enter") send({ at });
      };
      bar.append(key);
    }
  });
  motiondeck.part("key-hand", (element, state) => {
    const hand = child(strip(), "hand", "div", "hand");
    hand.style.left = `${(100 * state.at) / state.length}%`;
    hand.dataset.time = `${state.at.toFixed(2)} s`;
  });
})();
