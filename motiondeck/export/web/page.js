// The page: it steps the player in the time of the screen, draws the figure, and turns buttons and keys into commands.
// Keys: Esc stops, space pauses, 1 to 9 play a motion, with shift queue it. Space on a button presses it.
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
  let player, scene, human;
  try {
    player = await motiondeck.load(motiondeck.figure.words, figure.start);
    const drawn = motiondeck.figure.human;
    human = drawn && new motiondeck.Human(drawn, figure, player.motions, player.loops);
    scene = new motiondeck.Scene(get("scene"), human ? [figure, human.figure] : [figure]);
  } catch (error) {
    say("NO PICTURE", "", error.message);
    throw error;
  }
  const motions = player.motions;
  const trace = new motiondeck.Trace(get("trace"));
  const page = (motiondeck.page = { player, scene, figure, human, frames: 0 });
  document.title = document.querySelector("h1").textContent = motiondeck.figure.title;
  get("beside").hidden = !human;
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
  // A slider, with its value beside it in words; `set` is told of a new one.
  const slider = (name, words, set) => {
    const input = get(name);
    const shown = () => {
      input.parentElement.querySelector("output").textContent = words(+input.value);
      input.setAttribute("aria-valuetext", words(+input.value));
    };
    input.oninput = () => {
      shown();
      set(+input.value);
    };
    shown();
    return input;
  };
  const percent = (share) => `${Math.round(100 * share)} %`;
  slider("tempo", (value) => `${value.toFixed(2)} x`, (value) => player.tempo(value));

  // A blend of two loops; it is that of what plays, or comes next.
  const second = get("with");
  second.append(new Option("nothing", -1), ...motions.flatMap((name, number) => (player.loops[number] ? [new Option(name, number)] : [])));
  const blend = () => {
    const ended = +second.value < 0;
    if (ended && player.with < 0) return;
    const answer = player.blend(player.next, ended ? player.with : +second.value, ended ? 0 : +get("share").value);
    write(get("answer"), answer < 0 ? `${motions[player.next]} is not blended with ${second.selectedOptions[0].text}` : "");
  };
  second.onchange = blend;
  slider("share", percent, () => +second.value >= 0 && blend());

  // Layers of the robot's groups, else of single joints, and live values of joints.

  const named = Object.entries(motiondeck.figure.groups ?? {});
  const members = named.length ? named : player.robot.map((name) => [name, [name]]);
  const groups = Object.fromEntries(members.map(([name, own]) => [name, own.map((one) => player.robot.indexOf(one))]));
  const [group, over, joint] = [get("group"), get("over"), get("joint")];
  group.append(...Object.keys(groups).map((name) => new Option(name.replace("_", " "), name)));
  over.append(new Option("nothing", -1), ...motions.map((name, number) => new Option(name, number)));
  joint.append(...player.robot.map((name, number) => new Option(name, number)));
  const layer = () => player.layer(groups[group.value], +over.value, +get("weight").value);
  over.onchange = layer;
  group.onchange = () => (over.value = player.layerOf(groups[group.value]));
  slider("weight", percent, () => +over.value >= 0 && layer());
  const value = slider("value", (share) => share.toFixed(2), (share) => player.hold(+joint.value, share, 3600));
  joint.onchange = () => {
    value.value = 0;
    value.parentElement.querySelector("output").textContent = "";
  };
  joint.onchange();
  get("release").onclick = () => player.live.forEach((number) => player.hold(number, 0, 0.05));
  get("direct").onchange = (event) => (direct = event.target.checked);
  get("stop").onclick = () => (player.mode === "stopped" ? player.reset() : player.stop());
  get("pause").onclick = hold;

  // A press on the ring aims, and its end jumps there.
  const ring = get("ring");
  const place = (name, phase) => {
    mark(get(name), "class", phase < 0 ? "" : "seen");
    if (phase >= 0) get(name).style.transform = `rotate(${phase.toFixed(3)}turn)`;
  };
  let aimed = -1;
  const aim = (event) => {
    const box = ring.getBoundingClientRect();
    const [x, y] = [event.clientX - box.x - box.width / 2, event.clientY - box.y - box.height / 2];
    aimed = (Math.atan2(x, -y) / (2 * Math.PI) + 1) % 1;
    place("aim", aimed);
  };
  ring.onpointerdown = (event) => {
    ring.setPointerCapture(event.pointerId);
    aim(event);
  };
  ring.onpointermove = (event) => aimed >= 0 && aim(event);
  ring.onpointerup = () => player.jump(aimed);
  ring.onlostpointercapture = () => place("aim", (aimed = -1));
  ring.onkeydown = (event) => {
    const step = { ArrowRight: 0.05, ArrowUp: 0.05, ArrowLeft: -0.05, ArrowDown: -0.05, Home: -player.phase }[event.key];
    if (step === undefined) return;
    player.jump((player.phase + step + 1) % 1);
    event.preventDefault();
  };
  window.onclick = (event) => {
    if (event.detail) event.target.closest("button")?.blur(); // so that space pauses after a press by mouse or finger
    show();
  };
  window.onkeydown = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.repeat && event.target.matches("button")) return void (event.key === "Enter" && event.preventDefault());
    if (event.key !== "Escape" && event.target.matches(event.key === " " ? "button, select, input, summary" : "select")) return;
    const number = /^Digit[1-9]$/.test(event.code) ? +event.code[5] - 1 : -1;
    const once = !event.repeat; // a key that is held toggles nothing
    if (event.key === "Escape") player.stop();
    else if (event.key === " ") once && hold();
    else if (number >= 0 && number < motions.length) once && press(number, event.shiftKey);
    else return;
    event.preventDefault();
    show();
  };

  const show = () => {
    const { mode, playing, next, blended } = player;
    const named = blended.length > 1 ? blended.map(([motion, share]) => `${motions[motion]} ${percent(share)}`).join(", ") : motions[playing];
    const queue = player.waiting.map((number) => motions[number]);
    const then = queue.length ? `next: ${queue.join(", ")}` : "";
    if (mode === "stopped") say("STOPPED", "every joint is held", "Reset releases it");
    else if (mode === "held") say("HELD", "nothing moves", "choose a motion, or Resume");
    else if (player.paused) say("PAUSED", motions[playing], then);
    else if (mode === "approaching") say("ON ITS WAY", `slowly to ${motions[next]}`, then);
    else if (next !== playing) say("ON ITS WAY", `${motions[playing]} → ${motions[next]}`, then);
    else say("PLAYING", named, then);
    write(get("stop"), mode === "stopped" ? "Reset" : "Stop");
    write(get("pause"), player.paused ? "Resume" : "Pause");
    [...get("motions").children].forEach((box, number) => {
      const look = number === playing || blended.some(([motion]) => motion === number) ? "playing" : number === next ? "next" : "";
      const place = player.waiting.indexOf(number) + 1;
      mark(box, "data-look", look);
      write(box.querySelector("i"), look || (place ? `queued ${place}` : ""));
    });
    write(get("queue"), then || "+ (or shift and click) queues a motion");
    mark(ring, "aria-valuenow", player.phase.toFixed(2));
    place("end", queue.length ? player.end : -1);
    if (second !== document.activeElement) second.value = player.with;
    if (over !== document.activeElement) over.value = player.layerOf(groups[group.value]);
    get("release").disabled = !player.live.length;
    const shares = [...blended.slice(blended.length > 1 ? 0 : 1), ...player.layers];
    const parts = shares.map(([motion, share]) => `${motions[motion]} ${percent(share)}`);
    write(inside[1], ["fade " + percent(player.fade), ...parts].join(", "));
    write(inside[2], `limits hold back ${(1000 * player.held).toFixed(0)} mrad`);
    if (network.hidden) return;
    const responses = player.responses(playing, player.phase);
    write(network.children[0], responses.length ? `${responses.length} satellites of ${motions[playing]}` : `${motions[playing]} is held as keys`);
    motiondeck.bars(network.children[1], responses);
  };
  const inside = get("inside").querySelectorAll("span");
  const network = get("network");
  network.hidden = motions.every((_, number) => !player.responses(number, 0).length);

  let last = null;
  let [entered, faded, since] = [-1, 0, 0];
  const frame = (now) => {
    const passed = last === null ? 0 : (now - last) / 1000;
    last = now;
    // After a pause of the window time goes on from where it was.
    player.advance(Math.min(passed, 0.1));
    const [angles, root] = player.posture;
    const share = 1 - Math.exp(-5 * Math.min(passed, 0.1));
    const beside = human && get("human").checked;
    const middle = [root[0][0], root[0][1] - (beside ? human.aside / 2 : 0)];
    scene.centre = scene.centre.map((at, axis) => at + (page.frames ? share : 1) * (middle[axis] - at));
    const course = player.course;
    scene.draw([motiondeck.placed(figure, root, angles), beside && human.bodies(course, root, course.heading)]);
    get("hand").style.transform = `rotate(${course.phase}turn)`;
    // Where the motion is entered, from when it is looked for until nothing is left of the one before.
    if (player.entry >= 0) entered = player.entry;
    else if (course.fade > 0 && faded <= 0) entered = course.phase;
    else if (course.fade <= 0) entered = -1;
    faded = course.fade;
    place("entry", entered);
    since += passed;
    if (!page.frames || since > 0.09) {
      show();
      trace.draw(since, player.targets.subarray(0, player.robot.length), player.fade, [...course.beside, ...player.layers].map(([, part]) => part), player.held);
      since = 0;
    }
    page.frames += 1;
    scene.pixels.shown(passed);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
})();
