// Plots of curves that are chosen here: a pane for each unit, one time axis. Nothing is sent while they are not in sight.
// fixed: {columns: a name a line, most}; asks with {curves: [column], seconds} each second while they are in sight. Here a curve is
// "group/name", such as "error/l_knee", which is drawn from one or two columns.
// A button anywhere with data-plot="group/name" adds that curve and opens the tab of the plots.
window.motiondeck.plots ??= (() => {
  const { child, write } = motiondeck;
  const COLOURS = ["#1c7ed6", "#d9480f", "#2b8a3e", "#c2255c", "#7048e8", "#0b7285", "#846358", "#868e96"];
  const SPANS = [10, 60, 180];
  const NAMES = { angle: "angle: goal and measured", error: "error: goal less measured", loop: "loop and bus", recording: "off the recording" };
  const UNITS = { current: "A", temperature: "°C", voltage: "V" };
  const LOOP = { lateness: "late_us", work: "work_us" };
  const degrees = (angle) => (angle === null ? null : Math.round((180000 * angle) / Math.PI) / 1000);
  const AXIS = 46; // pixels left of a pane
  const EVERY = 1000; // ms
  let [curves, seconds, large, last, card, asked, told, columns] = [[], 60, false, null, null, "", 0, new Set()];
  let send = () => {};

  // What is drawn of a curve: its unit, and lines with a label, the columns that they need, and how they come from these.
  function parts(curve) {
    const [group, name] = [curve.slice(0, curve.indexOf("/")), curve.slice(curve.indexOf("/") + 1)];
    const angle = (what) => ({ label: `${name} ${what}`, needs: [`${name} ${what}`], of: (values) => values.map(degrees) });
    const alone = (label, column) => ({ label, needs: [column], of: (values) => values });
    if (group === "angle") return ["°", [angle("measured"), angle("goal")].filter(({ needs }) => columns.has(needs[0]))];
    const apart = (here, there) => here.map((one, k) => (one === null || there[k] === null ? null : degrees(there[k] - one)));
    if (group === "error") return ["°", [{ label: `${name} error`, needs: [`${name} measured`, `${name} goal`], of: apart }]];
    if (group === "recording") return ["mm", [alone(`${name} off the recording`, `recording ${name}`)]];
    if (group === "neuron") return ["", [alone(`neuron ${name}`, `neuron ${name}`)]];
    if (name === "bus load") return ["%", [{ label: name, needs: ["busy 1"], of: load }]];
    if (group === "loop") return ["µs", [alone(name, LOOP[name])]];
    return [UNITS[group], [alone(`${name} ${group}`, `${name} ${group}`)]];
  }

  // From each picture to the next of these; not known where a bus was opened anew.
  function load(busy) {
    return busy.map((one, k) => {
      const passed = last.run[k] - last.run[k - 1];
      const used = one - busy[k - 1];
      return k && used >= 0 && passed > 0 ? Math.round((10000 * used) / passed) / 100 : null;
    });
  }

  function offers() {
    const named = (suffix) => [...columns].filter((one) => one.endsWith(` ${suffix}`)).map((one) => one.slice(0, -suffix.length - 1));
    const found = { angle: named("measured"), error: named("goal"), loop: [...Object.keys(LOOP), ...(columns.has("busy 1") ? ["bus load"] : [])] };
    for (const group of Object.keys(UNITS)) found[group] = named(group);
    for (const group of ["recording", "neuron"])
      found[group] = [...columns].filter((one) => one.startsWith(`${group} `)).map((one) => one.slice(group.length + 1));
    return Object.entries(found).filter(([, names]) => names.length);
  }

  function tell() {
    const seen = card?.isConnected && card.getClientRects().length && document.visibilityState === "visible";
    const needed = curves.flatMap((one) => parts(one)[1].flatMap(({ needs }) => needs));
    const text = JSON.stringify({ curves: [...new Set(needed)], seconds });
    const waited = performance.now() - told >= EVERY;
    if (!seen || !needed.length || (text === asked && !waited)) return;
    [asked, told] = [text, performance.now()];
    send(JSON.parse(text));
  }

  function choose(name) {
    if (name && !curves.includes(name)) curves = [...curves, name];
    show();
  }

  function button(parent, key, words, act, pressed) {
    const made = child(parent, key, "button", "");
    write(made, words);
    made.onclick = act;
    if (pressed !== undefined) made.setAttribute("aria-pressed", pressed);
    return made;
  }

  function show() {
    if (!card) return;
    const chips = child(card, "chips", "div", "chips");
    const kept = new Set(curves);
    for (const chip of [...chips.children]) if (!kept.has(chip.dataset.key)) chip.remove();
    for (const name of curves) {
      const chip = button(chips, name, "", () => ((curves = curves.filter((one) => one !== name)), show()));
      chip.className = "chip";
      child(chip, "colour", "i", "").style.background = COLOURS[curves.indexOf(name) % COLOURS.length];
      write(child(chip, "name", "span", ""), `${name.replace("/", " ").replaceAll("_", " ")} ×`);
      chip.setAttribute("aria-label", `remove ${name}`);
    }
    for (const span of SPANS) button(card.spans, `${span}`, `${span} s`, () => ((seconds = span), show()), span === seconds);
    button(card.deeds, "csv", "CSV", saveTable);
    button(card.deeds, "png", "PNG", savePicture);
    button(card.deeds, "large", large ? "Smaller" : "Larger", () => ((large = !large), show()));
    card.classList.toggle("large", large);
    card.dataset.in = "inspect";
    const home = large ? document.body : card.home;
    if (card.parentElement !== home) home.append(card);
    for (const name of ["csv", "png"]) card.deeds.querySelector(`[data-key=${name}]`).disabled = !curves.length;
    tell();
    draw();
  }

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function panes() {
    const units = new Map();
    const unknown = [];
    curves.forEach((curve, place) => {
      const [unit, lines] = parts(curve);
      const drawn = lines.filter(({ needs }) => needs.every((one) => last?.curves[one]));
      for (const { label, needs, of } of drawn) {
        const values = of(...needs.map((one) => last.curves[one]));
        if (values.every((one) => one === null)) {
          unknown.push(label);
          continue;
        }
        if (!units.has(unit)) units.set(unit, []);
        units.get(unit).push({ label, values, hue: COLOURS[place % COLOURS.length], dashed: label.endsWith(" goal") });
      }
    });
    const hint = unknown.length ? `Not known: ${unknown.join(", ")}` : "Choose a curve, or several.";
    write(child(card, "hint", "div", "hint"), curves.length && !unknown.length ? "" : hint);
    return [...units];
  }

  function ticks(least, most, count) {
    const rough = (most - least) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough);
    const found = [];
    for (let at = Math.ceil(least / step) * step; at <= most + 1e-9; at += step) found.push(Number(at.toPrecision(10)));
    return found;
  }

  function draw() {
    const canvas = child(card, "canvas", "canvas", "");
    const drawn = panes();
    canvas.hidden = !drawn.length;
    if (!drawn.length) return;
    const room = large ? Math.max(card.getBoundingClientRect().bottom - canvas.getBoundingClientRect().top - 10, 120) : 520;
    const [width, height] = [canvas.clientWidth, large ? room : Math.min(130 * drawn.length, room)];
    canvas.style.height = `${height}px`;
    const scale = Math.max(devicePixelRatio, 2);
    [canvas.width, canvas.height] = [width * scale, height * scale];
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    const [ink, quiet, line] = [colour("--ink") || "#212529", colour("--quiet") || "#495057", colour("--line") || "#ced4da"];
    pen.fillStyle = colour("--ground") || "white";
    pen.fillRect(0, 0, width, height);
    pen.font = "12px sans-serif";
    const BELOW = 18;
    const tall = (height - BELOW) / drawn.length;
    const across = (at) => AXIS + ((width - AXIS - 6) * (last.seconds + at)) / last.seconds;
    pen.fillStyle = quiet;
    for (const at of ticks(-last.seconds, 0, Math.max(2, width / 90))) {
      pen.textAlign = at ? "center" : "right";
      pen.fillText(`${Math.round(10 * (at + last.ends)) / 10} s`.replace("-", "−"), across(at), height - 4);
    }
    drawn.forEach(([unit, lines], row) => {
      const top = row * tall + 18;
      const bottom = (row + 1) * tall - 4;
      const every = lines.flatMap(({ values }) => values.filter((one) => one !== null));
      let [least, most] = [Math.min(...every), Math.max(...every)];
      const margin = Math.max(0.08 * (most - least), 0.02 * Math.abs(most), 1e-3);
      [least, most] = [least - margin, most + margin];
      const up = (value) => bottom - ((bottom - top) * (value - least)) / (most - least);
      pen.strokeStyle = line;
      pen.lineWidth = 1;
      pen.textAlign = "right";
      let label = Infinity; // the last one's place: a pane that is not tall has no room for all
      for (const at of ticks(least, most, Math.max(2, tall / 40))) {
        pen.beginPath();
        pen.moveTo(AXIS, up(at));
        pen.lineTo(width - 6, up(at));
        pen.stroke();
        if (label - up(at) < 12) continue;
        label = up(at);
        pen.fillText(`${at}`.replace("-", "−"), AXIS - 5, label + 4);
      }
      pen.save();
      pen.beginPath();
      pen.rect(AXIS, top - 2, width - AXIS - 6, bottom - top + 4);
      pen.clip();
      for (const { values, hue, dashed } of lines) {
        pen.strokeStyle = hue;
        pen.lineWidth = dashed ? 2 : 1.4;
        pen.setLineDash(dashed ? [5, 3] : []);
        pen.beginPath();
        let open = false;
        values.forEach((value, place) => {
          if (value === null) return void (open = false);
          pen[open ? "lineTo" : "moveTo"](across(last.at[place]), up(value));
          open = true;
        });
        pen.stroke();
      }
      pen.setLineDash([]);
      if (last.hand !== null) {
        pen.strokeStyle = ink;
        pen.lineWidth = 2;
        pen.beginPath();
        pen.moveTo(across(last.hand), top);
        pen.lineTo(across(last.hand), bottom);
        pen.stroke();
      }
      pen.restore();
      pen.textAlign = "left";
      let left = AXIS;
      pen.fillStyle = quiet;
      if (unit) pen.fillText(unit, 4, top - 6);
      // Measured and goal of a joint are one name, so that there is room for those of several.
      const names = new Map(lines.map(({ label, hue }) => [label.replace(/ (measured|goal)$/, "").replaceAll("_", " "), hue]));
      if (lines.some(({ dashed }) => dashed)) names.set("dashed: goal", quiet);
      for (const [words, hue] of names) {
        if (left + pen.measureText(words).width + 16 > width) break; // the buttons above name them all
        pen.fillStyle = hue;
        pen.fillRect(left, top - 11, 8, 3);
        pen.fillStyle = ink;
        pen.fillText(words, left + 12, top - 6);
        left += pen.measureText(words).width + 24;
      }
    });
    canvas.setAttribute("role", "img");
    const latest = drawn.flatMap(([unit, lines]) => lines.map(({ label, values }) => `${label} ${values.findLast((one) => one !== null)} ${unit}`));
    canvas.setAttribute("aria-label", `plot: ${latest.join(", ")}`);
  }

  function save(blob, kind) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `motiondeck-${Math.round(last.run.at(-1) ?? 0)}s.${kind}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  function saveTable() {
    const lines = panes().flatMap(([unit, found]) => found.map((one) => ({ ...one, unit })));
    const head = ["run_s", ...lines.map(({ label, unit }) => (unit ? `${label} (${unit})` : label))];
    const rows = last.run.map((at, place) => [at, ...lines.map(({ values }) => values[place] ?? "")]);
    const quoted = head.map((one) => `"${one.replaceAll('"', '""')}"`);
    save(new Blob([[quoted, ...rows].map((row) => row.join(",")).join("\n") + "\n"], { type: "text/csv" }), "csv");
  }

  function savePicture() {
    child(card, "canvas", "canvas", "").toBlob((blob) => save(blob, "png"));
  }

  function build(element, say) {
    const { columns: names, most } = JSON.parse(element.dataset.fixed);
    columns = new Set(names.split("\n"));
    send = say;
    if (!card) {
      card = document.createElement("div");
      card.className = "plots";
      const select = child(card, "add", "select", "");
      select.setAttribute("aria-label", "add a curve");
      select.add(new Option("add a curve …", ""));
      for (const [group, names] of offers()) {
        const section = document.createElement("optgroup");
        section.label = NAMES[group] ?? group;
        section.append(...names.map((name) => new Option(name.replaceAll("_", " "), `${group}/${name}`)));
        select.add(section);
      }
      select.onchange = () => {
        if (curves.length < most / 2) choose(select.value);
        select.value = "";
      };
      card.spans = child(card, "spans", "span", "row");
      card.deeds = child(card, "deeds", "span", "row");
      setInterval(tell, 200);
      addEventListener("resize", () => last && draw());
      addEventListener("motiondeck-view", () => last && draw());
      document.addEventListener("click", ({ target }) => {
        const name = target.closest?.("[data-plot]")?.dataset.plot;
        if (!name) return;
        [...document.querySelectorAll('[role="tab"]')].find((tab) => tab.textContent === "Plots")?.click();
        choose(name);
      });
    }
    card.home = element;
    if (!large) element.append(card);
    show();
  }

  return { build, take: (state) => ((last = state), card && draw()) };
})();
motiondeck.part("plots", (element, state, send) => motiondeck.plots.build(element, send));

// state, of one browser: {seconds, ends: s from now, hand: s from the end or null, at: [s from the end], run: [s of the
// run], curves: {column: [value]}}
motiondeck.part("plot-curves", (element, state) => motiondeck.plots.take(state));
