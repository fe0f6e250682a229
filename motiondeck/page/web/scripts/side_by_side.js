// Two networks side by side: neurons and outputs over the phase, and how far the outputs are apart. fixed: {libraries}
// sends [side, library, motion] when it is in sight: "left" what plays, "right" what is chosen; "" is its own library.
window.motiondeck.sideBySide ??= (() => {
  const { child, write } = motiondeck;
  const COLOURS = ["#1c7ed6", "#d9480f", "#2b8a3e"];
  const SHOWN = 3; // neurons and outputs, those that vary most
  let [card, chosen, asked] = [null, ["", ""], {}];
  const courses = {};
  let send = () => {};

  // Asks for one course at a time, as of what one part says at once only the last is sent.
  function tell() {
    const seen = card?.isConnected && card.getClientRects().length && document.visibilityState === "visible";
    if (!seen) return;
    for (const line of card.querySelectorAll(".phase")) mark(line);
    const strip = document.querySelector('[data-state-of="timeline"]')?.dataset.state;
    const playing = strip ? (JSON.parse(strip).runs.at(-1)?.[2] ?? "").split(" + ")[0] : "";
    const wanted = { left: ["", playing], right: chosen };
    const side = ["left", "right"].find((one) => JSON.stringify(wanted[one]) !== asked[one]);
    if (side) send([side, ...wanted[side]]);
    if (side) asked[side] = JSON.stringify(wanted[side]);
  }

  // The phase of the motion that plays, where the page shows one.
  function mark(line) {
    const phase = document.querySelector('[role="slider"][aria-label="phase"]')?.getAttribute("aria-valuenow");
    line.setAttribute("visibility", phase ? "visible" : "hidden");
    if (phase) for (const end of ["x1", "x2"]) line.setAttribute(end, 100 * Number(phase));
  }

  function varied(curves) {
    const spread = (values) => {
      const mean = values.reduce((sum, one) => sum + one, 0) / values.length;
      return values.reduce((sum, one) => sum + (one - mean) ** 2, 0);
    };
    return Object.keys(curves).sort((a, b) => spread(curves[b]) - spread(curves[a])).slice(0, SHOWN);
  }

  const some = (curves, names) => Object.fromEntries(names.filter((name) => curves[name]).map((name) => [name, curves[name]]));

  // One pane: curves over the phase from 0 to 1, between the least and the most of both columns.
  function pane(title, curves, [least, most]) {
    const up = (value) => 58 - (56 * (value - least)) / Math.max(most - least, 1e-9);
    const lines = Object.values(curves).map((values, place) => {
      const points = values.map((value, k) => `${(100 * k) / (values.length - 1)},${up(value).toFixed(1)}`).join(" ");
      return `<polyline points="${points}" fill="none" stroke="${COLOURS[place % 3]}" stroke-width="1.4" vector-effect="non-scaling-stroke"/>`;
    });
    const figure = document.createElement("figure");
    figure.innerHTML = `<figcaption></figcaption><svg viewBox="0 0 100 60" preserveAspectRatio="none" role="img">${lines.join("")}
      <line class="phase" y1="0" y2="60" stroke="currentColor" stroke-width="1" vector-effect="non-scaling-stroke"/></svg>`;
    figure.firstChild.textContent = title;
    figure.querySelector("svg").setAttribute("aria-label", title);
    return figure;
  }

  function range(...groups) {
    const every = groups.flatMap((curves) => Object.values(curves).flat());
    return [Math.min(...every), Math.max(...every)];
  }

  function show() {
    const { left, right } = courses;
    if (!card || !left || !right) return;
    const wrong = left.reason ?? right.reason;
    if (wrong) return void write(card.columns, wrong);
    card.motion.replaceChildren(...right.motions.map((name) => new Option(name, name, false, name === right.motion)));
    const same = left.encoding === right.encoding && left.outputs.length === right.outputs.length;
    const common = chosen[0] ? [] : varied(some(left.neurons, Object.keys(right.neurons)));
    const drawn = [left, right].map(({ motion, outputs, neurons }) => ({
      motion,
      outputs: some({ ...outputs }, varied({ ...(same ? left.outputs : outputs) })),
      neurons: some(neurons, common.length ? common : varied(neurons)),
    }));
    const counted = (names, one) => names.map((name) => Number(name) + one).join(", ");
    card.columns.replaceChildren(
      ...drawn.map(({ motion, outputs, neurons }, side) => {
        const column = document.createElement("div");
        write(child(column, "title", "b", ""), side && chosen[0] ? `${motion} of ${chosen[0]}` : motion);
        const names = Object.keys(neurons);
        if (names.length) column.append(pane(`neurons ${counted(names, 0)}`, neurons, range(...drawn.map((one) => one.neurons))));
        column.append(pane(`outputs ${counted(Object.keys(outputs), 1)}`, outputs, range(...drawn.map((one) => one.outputs))));
        return column;
      }),
    );
    if (!same) return;
    const apart = left.outputs[0].map((_, k) => {
      const squares = left.outputs.map((values, place) => (values[k] - right.outputs[place][k]) ** 2);
      return Math.sqrt(squares.reduce((sum, one) => sum + one, 0) / squares.length);
    });
    const mean = apart.reduce((sum, one) => sum + one, 0) / apart.length;
    card.columns.append(pane(`all outputs: ${mean.toPrecision(2)} apart (root mean square)`, { apart }, [0, Math.max(...apart)]));
    card.columns.lastChild.className = "both";
  }

  function build(element, say) {
    send = say;
    if (!card) {
      const { libraries } = JSON.parse(element.dataset.fixed);
      card = document.createElement("div");
      card.className = "side-by-side";
      const library = child(card, "library", "select", "");
      library.setAttribute("aria-label", "library beside");
      library.append(...libraries.map((name) => new Option(name || "the network that plays", name)));
      card.motion = child(card, "motion", "select", "");
      card.motion.setAttribute("aria-label", "motion beside");
      library.onchange = () => (chosen = [library.value, ""]);
      card.motion.onchange = () => (chosen = [chosen[0], card.motion.value]);
      card.columns = child(card, "columns", "div", "columns");
      setInterval(tell, 200);
    }
    element.append(card);
  }

  return { build, take: (side, course) => ((courses[side] = course), show()) };
})();
motiondeck.part("side-by-side", (element, state, send) => motiondeck.sideBySide.build(element, send));
// state, of one browser: {motion, motions, encoding, outputs: [[value]], neurons: {number: [value]}}, or {reason}
for (const side of ["left", "right"]) motiondeck.part(`course-${side}`, (element, state) => motiondeck.sideBySide.take(side, state));
