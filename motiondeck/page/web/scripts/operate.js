// The operate view over the whole window: state, cues, emergency stop, motions, tempo, layers, and a lock against touch.
// fixed: {motions: [name], verdicts, groups: [name], tempo: [least, most]}; without motions only cues
// state: {line: [word, doing, next, colour], buttons: [[label, commands, held]], none when the run is over,
//   cues: [[mark, name, detail, commands that take it out]]; of a deck tempo and layers; of a show decks: [[name, words, colour]]}
// sends [[word, ...], ...]: commands as they are typed
motiondeck.operate ??= (() => {
  const HOLD = 1500; // ms that a lock, a reset or an end is held
  const STILL = 30; // pixels that a finger may move meanwhile
  const BROAD = 70; // pixels: what is broader is no finger but a sleeve or an arm
  const TEMPO_STEP = 0.1;
  const HAND_ON = 1000; // ms in which a hand on the tempo is believed before the deck's own value
  const { child, write } = motiondeck;
  const root = document.documentElement;

  // Calls a function when a button has been held by one still finger, or with Enter or Space; `when` says whether it counts.
  function held(button, then, when = () => true) {
    let timer, from;
    const end = () => (clearTimeout(timer), (timer = undefined), button.classList.remove("holding"));
    const begin = () => {
      if (timer !== undefined || button.disabled || !when()) return;
      button.classList.add("holding");
      timer = setTimeout(() => (end(), (button.dataset.fired = 1), then()), HOLD);
    };
    button.onpointerdown = (event) => {
      delete button.dataset.fired; // the click that ends a hold is none
      from = [event.clientX, event.clientY];
      if (event.isPrimary && Math.max(event.width, event.height) < BROAD) begin();
    };
    button.onpointermove = ({ clientX, clientY }) => from && Math.hypot(clientX - from[0], clientY - from[1]) > STILL && end();
    button.onpointerup = button.onpointerleave = button.onpointercancel = button.onblur = button.onkeyup = end;
    button.onkeydown = (event) => {
      if (!["Enter", " "].includes(event.key) || event.repeat) return;
      delete button.dataset.fired;
      if (when()) event.preventDefault();
      begin();
    };
    button.oncontextmenu = (event) => event.preventDefault();
    addEventListener("pointerdown", (event) => event.isPrimary || end()); // a second finger
  }

  const part = (parent, key, kind, fixed = {}) => {
    const element = child(parent, key, "div", "part");
    Object.assign(element.dataset, { part: kind, of: key, fixed: JSON.stringify(fixed) });
    return element;
  };
  const titled = (parent, key, title) => {
    const section = child(parent, key, "section", key);
    write(child(section, "title", "h2", ""), title);
    return section;
  };
  const named = (element, name) => (element.setAttribute("aria-label", name), element);

  function choice(parent, key, name, options) {
    const field = named(child(parent, key, "select", ""), name);
    if (!field.options.length) field.append(...options.map(([text, value]) => new Option(text, value ?? text)));
    return field;
  }

  function drawTempo(parent, { tempo: [least, most] }, { tempo = 1, buttons }, send) {
    const row = child(titled(parent, "tempo", "Tempo"), "row", "div", "row");
    const shown = child(row, "now", "output", "");
    const now = () => (Date.now() - (row.moved ?? 0) < HAND_ON ? row.wanted : tempo);
    const press = (key, text, name, to) => {
      const button = named(child(row, key, "button", ""), name);
      write(button, text);
      button.disabled = !buttons.length;
      button.onclick = () => {
        row.wanted = Number(Math.min(most, Math.max(least, to())).toFixed(2));
        row.moved = Date.now();
        write(shown, `${row.wanted.toFixed(2)} ×`);
        send([["tempo", String(row.wanted)]]);
      };
    };
    press("slower", "−", "slower", () => now() - TEMPO_STEP);
    press("usual", "1", "tempo 1", () => 1);
    press("faster", "+", "faster", () => now() + TEMPO_STEP);
    row.append(shown);
    write(shown, `${now().toFixed(2)} ×`);
  }

  function drawLayers(section, { groups, motions }, { layers, buttons }, send) {
    write(child(section, "now", "p", ""), layers || "no layers");
    const row = child(section, "row", "div", "row");
    const group = choice(row, "group", "joints of the layer", groups.map((name) => [name]));
    const motion = choice(row, "motion", "motion of the layer", motions.map((name) => [name]));
    const weight = choice(row, "weight", "weight of the layer", [1, 0.75, 0.5, 0.25].map((part) => [`${100 * part} %`, part]));
    const press = (key, text, command) => {
      const button = child(row, key, "button", "");
      write(button, text);
      button.disabled = !buttons.length;
      button.onclick = () => send([command()]);
    };
    press("on", "Layer on", () => ["layer", group.value, motion.value, weight.value]);
    press("off", "Layer off", () => ["layer", group.value]);
    press("none", "All off", () => ["layer", "off"]);
  }

  function drawCues(parent, cues, send) {
    const list = child(titled(parent, "cues", "Cues"), "list", "ol", "");
    list.tabIndex = 0; // it scrolls
    const rows = cues.map(([mark, name, detail, out]) => {
      const row = document.createElement("li");
      row.dataset.mark = mark;
      for (const [tag, text] of [["i", mark], ["b", name], ["span", detail]]) row.append(Object.assign(document.createElement(tag), { textContent: text }));
      if (out.length) {
        const button = named(document.createElement("button"), `take out: ${name}`);
        button.textContent = "✕";
        button.onclick = () => send(out);
        row.append(button);
      }
      return row;
    });
    const text = JSON.stringify(cues);
    if (list.drawn === text) return;
    list.drawn = text;
    list.replaceChildren(...rows);
    list.querySelector('[data-mark="now"]')?.scrollIntoView({ block: "nearest" });
  }

  function drawLine(view, [word, doing, next, colour]) {
    const line = child(view, "line", "div", "line");
    line.setAttribute("role", "status");
    line.style.background = colour;
    write(child(line, "link", "strong", "link"), "NO CONNECTION");
    write(child(line, "word", "h1", "word"), word);
    write(child(line, "doing", "b", ""), doing || "\u00a0");
    write(child(line, "next", "span", ""), next || "\u00a0");
  }

  function draw(view, fixed, state, send) {
    drawLine(view, state.line);
    const isLocked = () => root.dataset.locked === "true";
    const locked = isLocked();
    const lock = child(view, "lock", "button", "lock");
    if (!lock.onclick) held(lock, () => motiondeck.browser.choose("locked", "no"), isLocked);
    lock.onclick = () => isLocked() || lock.dataset.fired || motiondeck.browser.choose("locked", "yes");
    write(lock, locked ? "Locked: hold" : "Lock");
    lock.title = locked ? "Hold it for 1.5 s, or hold Enter, to unlock this browser" : "No touch but the stop does anything in this browser";
    named(child(view, "robot", "div", "robot"), "robot").setAttribute("role", "img"); // seen through this
    const free = child(view, "free", "div", "free");
    free.inert = locked;
    part(free, "notices", "notices");
    const deeds = child(free, "deeds", "div", "deeds");
    const desk = child(free, "desk", "div", "desk");
    const labels = state.buttons.length ? state.buttons : JSON.parse(deeds.dataset.last ?? "[]").map(([label]) => [label, [], false]);
    deeds.dataset.last = JSON.stringify(labels);
    labels.forEach(([label, commands, hold], place) => {
      const button = child(deeds, String(place), "button", hold ? "hold" : "");
      write(button, hold ? `${label}: hold` : label);
      button.disabled = !commands.length;
      button.commands = commands;
      if (hold) button.onkeydown ?? held(button, () => send(button.commands));
      else button.onclick = () => send(commands);
    });
    drawCues(desk, state.cues, send);
    if (state.decks) {
      const chips = state.decks.map(([name, words, colour]) => {
        const chip = Object.assign(document.createElement("li"), { textContent: `${name}: ${words}` });
        chip.style.background = colour;
        return chip;
      });
      child(titled(desk, "decks", "Decks"), "list", "ul", "").replaceChildren(...chips);
    }
    if (fixed.motions) {
      drawTempo(desk, fixed, state, send);
      if (fixed.groups.length) drawLayers(titled(desk, "layers", "Layers"), fixed, state, send);
      const motions = titled(desk, "motions-of", "Motions");
      part(motions, "motions", "motion-grid", { motions: fixed.motions, searched: 1e9, verdicts: fixed.verdicts });
      part(motions, "motion-pictures", "motion-pictures");
    }
    motiondeck.browser.switches(child(desk, "switches", "div", "switches"));
    const stop = child(view, "stop", "button", "stop");
    write(stop, "EMERGENCY STOP");
    stop.disabled = !state.buttons.length;
    stop.title = "Key: Esc. It works while the page is locked, too.";
    stop.onpointerdown = motiondeck.escape; // at once, also of a finger that slips off
    stop.onclick = (event) => event.detail || motiondeck.escape(); // by a key or a screen reader
  }

  let redraw = () => {};
  motiondeck.part("operate", (element, state, send) => {
    const fixed = JSON.parse(element.dataset.fixed);
    redraw = () => {
      const shown = root.dataset.view === "operate";
      const view = shown && child(document.body, "operate", "main", "operate");
      document.querySelector(".operate:not([data-key=operate])")?.remove();
      if (shown) draw(view, fixed, state, send);
      else document.querySelector("body > .operate")?.remove();
    };
    motiondeck.browser.update();
    redraw();
  });
  addEventListener("motiondeck-view", () => redraw());
  const fixedOf = () => JSON.parse(document.querySelector('[data-part="operate"]').dataset.fixed);
  motiondeck.part("layers", (element, state, send) => drawLayers(element, fixedOf(), state, send)); // in the panel

  // What is locked has no keys but Esc and those of its lock and stop.
  const own = (event) => event.target.closest?.(".operate button") && ["Enter", " "].includes(event.key);
  const shut = (event) => {
    if (root.dataset.locked !== "true" || ["Escape", "Tab"].includes(event.key) || own(event)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
  };
  addEventListener("keydown", shut, true);

  // The robot is drawn where this view has room for it; and the stop of a page that has lost its deck says so.
  setInterval(() => {
    const view = document.querySelector("body > .operate");
    if (!view) return;
    const { left, top, width, height } = view.querySelector(".robot").getBoundingClientRect();
    for (const [name, value] of Object.entries({ left, top, width, height })) root.style.setProperty(`--robot-${name}`, `${value}px`);
    write(view.querySelector(".stop"), root.dataset.link ? "STOP NOT CONNECTED" : "EMERGENCY STOP");
  }, 100);
  return true;
})();
