// The last minutes as a strip over the scene: what was played, and marks of what happened.
// state: {seconds, runs: [[from, to, name]], marks: [[at, kind, text]]}; times are s before now, <= 0.
// sends {back: s ago}, 0 for now. It lies on the page itself, so that no panel hides it.
motiondeck.part("timeline", (element, state, send) => {
  const { child, write } = motiondeck;
  const strip = child(document.body, "timeline", "div", "timeline-strip");
  strip.dataset.in = "inspect";
  const place = (at) => `${(100 * (state.seconds + at)) / state.seconds}%`;
  const LEGIBLE = 36; // pixels, of a strip with a word that ends in dots
  const hue = (name) => [...name].reduce((sum, letter) => (sum * 31 + letter.charCodeAt(0)) % 360, 7);
  const bar = child(strip, "bar", "div", "bar");
  const about = { role: "slider", tabindex: 0, "aria-label": "look back, s", "aria-valuemax": 0 };
  Object.assign(about, { "aria-valuemin": -state.seconds, "aria-valuenow": -(bar.dataset.back ?? 0) });
  for (const [name, value] of Object.entries(about)) bar.setAttribute(name, value);
  child(bar, "runs", "span", "").replaceChildren(
    ...state.runs.map(([from, to, name]) => {
      const run = document.createElement("span");
      run.className = "run";
      run.style.cssText = `left:${place(from)};width:${(100 * (to - from)) / state.seconds}%;background:hsl(${hue(name)} 45% 78%)`;
      run.textContent = run.title = name;
      return run;
    }),
    ...state.marks.map(([at, kind, text]) => {
      const mark = document.createElement("i");
      mark.className = `mark ${kind}`;
      mark.style.left = place(at);
      mark.title = text;
      return mark;
    }),
  );
  // A strip that is too narrow for its name has a shorter one, or none; the pointer on it shows it all. A blend is not
  // cut: its first letters would read as one motion alone.
  const isCut = (run) => run.scrollWidth > run.clientWidth;
  for (const run of bar.querySelectorAll(".run")) {
    const [first, ...others] = run.title.split(" + ");
    if (others.length && isCut(run)) run.textContent = `${first} + ${others.length}`;
    if (isCut(run) && (others.length || run.clientWidth < LEGIBLE)) run.textContent = "";
  }
  const ask = (back) => send({ back: Math.round(10 * Math.min(state.seconds, back)) / 10 });
  const look = (event) => {
    const { left, width } = bar.getBoundingClientRect();
    ask(Math.max(0.1, state.seconds * (1 - (event.clientX - left) / width)));
  };
  bar.onpointerdown = (event) => (bar.setPointerCapture(event.pointerId), (bar.dataset.held = 1), look(event));
  bar.onpointermove = (event) => bar.dataset.held && bar.hasPointerCapture(event.pointerId) && look(event);
  bar.onkeydown = ({ key }) => {
    const step = { ArrowLeft: 1, ArrowRight: -1 }[key];
    if (step) ask(Math.max(0, Number(bar.dataset.back ?? 0) + step));
  };
});

// A frame about the scene while this browser looks back. state, of one browser: {back: whole s ago, 0 for now, seconds}
// sends {back: 0}: back to now
motiondeck.part("past", (element, { back, seconds }, send) => {
  const { child, write } = motiondeck;
  const bar = child(child(document.body, "timeline", "div", "timeline-strip"), "bar", "div", "bar");
  const frame = child(document.body, "past", "div", "past-frame");
  frame.dataset.in = "inspect";
  const now = child(frame, "now", "button", "");
  const hand = child(bar, "hand", "i", "hand");
  frame.hidden = hand.hidden = !back;
  bar.dataset.back = back;
  bar.setAttribute("aria-valuenow", -back);
  if (!back) delete bar.dataset.held; // called back to now, a hand that still drags is let go
  hand.style.left = `${Math.max(0, 100 * (1 - back / seconds))}%`;
  write(child(now, "ago", "b", ""), `PAST −${back} s`);
  write(child(now, "back", "span", ""), "back to now");
  now.onclick = () => send({ back: 0 });
});
