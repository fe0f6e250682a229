// Live values by hand: a slider for each group of joints, and a pad for where it looks, as seen by one who faces it.
// fixed: {groups: [name], gaze: whether there is a pad}; state: {}
// sends [name, -1..1] and {gaze: [left, up]}, m at a distance of 1 m, again and again while a slider or the pad is held.
motiondeck.part("live-values", (element, state, send) => {
  const EVERY = 100; // ms; joints fall back half a second after the last value
  const REACH = 1; // m, from the middle of the pad to its edge
  const { groups, gaze } = JSON.parse(element.dataset.fixed);
  const { child, write } = motiondeck;
  const held = (control, value, release) => {
    let timer;
    const say = () => send(value());
    const end = () => (clearInterval(timer), (timer = undefined), release());
    control.addEventListener("pointerdown", (event) => {
      control.setPointerCapture(event.pointerId);
      clearInterval(timer);
      timer = setInterval(() => (control.isConnected ? say() : clearInterval(timer)), EVERY);
    });
    control.addEventListener("lostpointercapture", end);
    control.addEventListener("input", () => timer === undefined && say()); // by a key
    control.addEventListener("blur", () => timer !== undefined && end());
  };
  if (gaze) {
    const pad = child(element, "gaze", "div", "gaze");
    pad.title = "Look there while it is pressed, as seen by one who faces the robot; the edge is 45 degrees away.";
    pad.setAttribute("aria-label", "gaze");
    const point = child(pad, "point", "i", "");
    let [left, up] = [0, 0];
    const put = (event) => {
      const { x, y, width, height } = pad.getBoundingClientRect();
      const within = (share) => Math.min(1, Math.max(-1, 2 * share - 1));
      [left, up] = [REACH * within((event.clientX - x) / width), -REACH * within((event.clientY - y) / height)];
      show();
    };
    const show = () => (point.style.cssText = `left:${50 + (50 * left) / REACH}%;top:${50 - (50 * up) / REACH}%`);
    pad.addEventListener("pointerdown", put);
    pad.addEventListener("pointermove", (event) => pad.hasPointerCapture(event.pointerId) && put(event));
    held(pad, () => ({ gaze: [left, up].map((way) => Number(way.toFixed(3))) }), () => (([left, up] = [0, 0]), show()));
    show();
  }
  for (const name of groups) {
    const row = child(element, name, "label", "row");
    write(child(row, "name", "span", ""), name.replaceAll("_", " "));
    const slider = child(row, "slider", "input", "");
    Object.assign(slider, { type: "range", min: -1, max: 1, step: 0.01, value: 0, title: `input ${name}, while it is held` });
    const figure = child(row, "figure", "output", "");
    const show = () => write(figure, Number(slider.value).toFixed(2));
    slider.addEventListener("input", show);
    held(slider, () => [name, Number(slider.value)], () => ((slider.value = 0), show()));
    show();
  }
});
