// The page: it steps the player in the time of the screen, draws the figure, and turns buttons and keys into commands.
// Keys: Esc stops, space pauses, 1 to 9 play a motion, with shift queue it.
(async () => {
  const get = (name) => document.getElementById(name);
  // What changes on the page costs a browser without a graphics card more than the scene: only what is new is written.
  const write = (element, text) => {
    if (element.textContent !== text) element.textContent = text;
  };
  const mark = (element, name, value) => {
    if (element.getAttribute(name) !== value) element.setAttribute(name, value);
  };
  const say = (...texts) => {
    mark(get("state"), "data-word", texts[0]);
    texts.forEach((text, place) => write(get("state").children[place], text));
  };
  const figure = motiondeck.figureOf(motiondeck.figure.drawing);
  let player, scene;
  try {
    player = await motiondeck.load(motiondeck.figure.words, figure.start);
    scene = new motiondeck.Scene(get("scene"), figure);
  } catch (error) {
    say("NO PICTURE", "", error.message);
    throw error;
  }
  const motions = player.motions;
  const page = (motiondeck.page = { player, scene, figure, frames: 0 });
  document.title = motiondeck.figure.title;
  get("about").textContent = motiondeck.figure.about;

  // Three moments of a motion as lines from body to body and to the ends of limbs, the last one dark; none of dials.
  const limbs = figure.bodies.map(({ parent }, body) => [parent, body]).filter(([parent]) => parent >= figure.root);
  const picture = (motion) => {
    if (limbs.every(([parent]) => parent === figure.root)) return "";
    const flat = ([x, y, z]) => [0.82 * x + 0.57 * y, -z]; // from the side, and a little from the front
    const poses = [0.1, 0.25, 0.4].map((phase) => {
      const [angles, root] = player.moment(motion, phase);
      const bodies = motiondeck.placed(figure, root, angles);
      const ends = limbs.filter(([, body]) => !limbs.some(([parent]) => parent === body)).map(([, body]) => {
        const own = figure.solids.filter((solid) => solid.body === body).map(({ place }) => place);
        const middle = [0, 1, 2].map((axis) => own.reduce((sum, place) => sum + place[axis], 0) / (own.length || 1));
        return [bodies[body][0], motiondeck.at(bodies[body], middle.map((part) => 2 * part))];
      });
      return [...limbs.map(([parent, body]) => [bodies[parent][0], bodies[body][0]]), ...ends].map((line) => line.map(flat));
    });
    const points = poses.flat(2);
    const [low, high] = [Math.min, Math.max].map((edge) => [0, 1].map((axis) => edge(...points.map((at) => at[axis]))));
    const scale = 88 / Math.max(high[0] - low[0], high[1] - low[1], 1e-6);
    const on = (at) => at.map((part, axis) => (50 + scale * (part - 0.5 * (low[axis] + high[axis]))).toFixed(0)).join(" ");
    const paths = poses.map((lines) => `<path d="${lines.map(([from, to]) => `M${on(from)}L${on(to)}`).join("")}"/>`);
    return `<svg viewBox="0 0 100 100" aria-hidden="true">${paths.join("")}</svg>`;
  };

  let direct = false;
  const press = (number, later) => (later ? player.queue(number) : player.switch(number, direct));
  const hold = () => (player.paused ? player.resume() : player.pause());
  motions.forEach((name, number) => {
    const box = document.createElement("div");
    box.className = "motion";
    if (number < 9) box.dataset.number = number + 1;
    box.innerHTML = '<button class="play"><b></b><i></i></button><button class="later">+</button>';
    const [play, later] = box.children;
    play.insertAdjacentHTML("afterbegin", picture(number));
    play.querySelector("b").textContent = name;
    play.title = number < 9 ? `${name}: key ${number + 1}` : name;
    play.onclick = (event) => press(number, event.shiftKey);
    later.setAttribute("aria-label", (later.title = `queue ${name}`));
    later.onclick = () => press(number, true);
    get("motions").append(box);
  });
  const tempo = get("tempo");
  tempo.oninput = () => {
    player.tempo(+tempo.value);
    tempo.parentElement.querySelector("output").textContent = `${(+tempo.value).toFixed(2)} x`;
  };
  tempo.oninput();
  get("direct").onchange = (event) => (direct = event.target.checked);
  get("stop").onclick = () => (player.mode === "stopped" ? player.reset() : player.stop());
  get("pause").onclick = hold;

  const ring = get("ring");
  const turn = (event) => {
    const box = ring.getBoundingClientRect();
    const [x, y] = [event.clientX - box.x - box.width / 2, event.clientY - box.y - box.height / 2];
    player.jump((Math.atan2(x, -y) / (2 * Math.PI) + 1) % 1);
  };
  ring.onpointerdown = turn;
  ring.onkeydown = (event) => {
    const step = { ArrowRight: 0.01, ArrowUp: 0.01, ArrowLeft: -0.01, ArrowDown: -0.01 }[event.key];
    if (step) player.jump((player.phase + step + 1) % 1);
  };
  window.onclick = () => show();
  window.onkeydown = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const number = /^Digit[1-9]$/.test(event.code) ? +event.code[5] - 1 : -1;
    if (event.key === "Escape") player.stop();
    else if (event.key === " ") hold();
    else if (number >= 0 && number < motions.length) press(number, event.shiftKey);
    else return;
    event.preventDefault();
    show();
  };

  const show = () => {
    const { mode, playing, next } = player;
    const queue = player.waiting.map((number) => motions[number]);
    const then = queue.length ? `next: ${queue.join(", ")}` : "";
    if (mode === "stopped") say("STOPPED", "every joint is held", "Reset releases it");
    else if (mode === "held") say("HELD", "nothing moves", "choose a motion, or Resume");
    else if (player.paused) say("PAUSED", motions[playing], then);
    else if (mode === "approaching") say("ON ITS WAY", `slowly to ${motions[next]}`, then);
    else if (next !== playing) say("ON ITS WAY", `${motions[playing]} → ${motions[next]}`, then);
    else say("PLAYING", motions[playing], then);
    write(get("stop"), mode === "stopped" ? "Reset" : "Stop");
    write(get("pause"), player.paused ? "Resume" : "Pause");
    [...get("motions").children].forEach((box, number) => {
      const look = number === playing ? "playing" : number === next ? "next" : "";
      const place = player.waiting.indexOf(number) + 1;
      mark(box, "data-look", look);
      write(box.querySelector("i"), look || (place ? `queued ${place}` : ""));
    });
    write(get("queue"), then || "+ (or shift and click) queues a motion");
    mark(ring, "aria-valuenow", player.phase.toFixed(2));
  };

  let last = null;
  let slow = 0.01; // s from picture to picture, smoothed
  const frame = (now) => {
    const passed = last === null ? 0 : (now - last) / 1000;
    last = now;
    // After a pause of the window time goes on from where it was.
    player.advance(Math.min(passed, 0.1));
    const [angles, root] = player.posture;
    const share = 1 - Math.exp(-5 * Math.min(passed, 0.1));
    scene.centre = scene.centre.map((at, axis) => at + (page.frames ? share : 1) * (root[0][axis] - at));
    scene.draw(motiondeck.placed(figure, root, angles));
    get("hand").style.transform = `rotate(${player.phase}turn)`;
    if (page.frames % 6 === 0) show();
    page.frames += 1;
    // A computer that cannot keep up with its screen draws fewer pixels.
    slow = 0.9 * slow + 0.1 * Math.min(passed, 0.2);
    if (slow > 0.021 && scene.share > 0.5) [scene.share, slow] = [Math.max(0.5, scene.share * Math.sqrt(0.015 / slow)), 0.01];
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
})();
