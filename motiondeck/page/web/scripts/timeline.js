// The last minutes as a strip over the scene: what was played, marks of what happened, and where the page looks.
// state: {seconds, runs: [[from, to, name]], marks: [[at, kind, text]], back: s ago or 0}; times are s before now, <= 0.
// sends {back: s ago}, 0 for now. It lies on the page itself, so that no panel hides it.
motiondeck.part("timeline", (element, state, send) => {
  const { child, write } = motiondeck;
  const strip = child(document.body, "timeline", "div", "timeline-strip");
  const place = (at) => `${(100 * (state.seconds + at)) / state.seconds}%`;
  const LEGIBLE = 36; // pixels, of a strip with a word that ends in dots
  const hue = (name) => [...name].reduce((sum, letter) => (sum * 31 + letter.charCodeAt(0)) % 360, 7);
  const bar = child(strip, "bar", "div", "bar");
  bar.setAttribute("role", "slider");
  bar.setAttribute("aria-label", "look back");
  bar.setAttribute("aria-valuenow", -state.back);
  bar.replaceChildren(
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
  const hand = document.createElement("i");
  hand.className = "hand";
  hand.style.left = place(-state.back);
  bar.append(hand);
  const look = (event) => {
    const { left, width } = bar.getBoundingClientRect();
    const back = state.seconds * (1 - (event.clientX - left) / width);
    send({ back: Math.round(10 * Math.min(state.seconds, Math.max(0, back))) / 10 });
  };
  bar.onpointerdown = (event) => (bar.setPointerCapture(event.pointerId), look(event));
  bar.onpointermove = (event) => bar.hasPointerCapture(event.pointerId) && look(event);
  const now = child(strip, "now", "button", "now");
  now.onclick = () => send({ back: 0 });
  now.disabled = !state.back;
  write(now, state.back ? `${state.back.toFixed(1)} s ago: back to now` : "now");
});
