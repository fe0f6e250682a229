// The player: the C player of a figure as WebAssembly, one tick after another, in the time of the page.
// Joints named "root ..." say how the root of a robot goes: see controller/motion/encodings/robot_joints.py.
const ROOT = ["turn", "forward", "sideways", "height", "ahead x", "ahead y", "ahead z", "left x", "left y", "left z"];
const LIGHT = 0.01; // what rates of the root's path are multiplied with as angles

motiondeck.load = async (words, start) => {
  const { module } = await WebAssembly.instantiate(motiondeck.bytes(motiondeck.wasm));
  return new motiondeck.Player(module, motiondeck.bytes(words), start);
};

motiondeck.Player = class {
  #c;
  #at;
  #figure;
  #due = 0; // s that have passed since the last tick
  #way; // where among the joints those of the root are
  #heading = 0;
  #root; // place and turn, at the last tick
  #last; // joints, root, heading and phase at the tick before

  // Of a compiled module, a figure's words as bytes, and where its root stands: [a place, m, and a quaternion].
  constructor(module, words, start) {
    this.#c = new WebAssembly.Instance(module).exports;
    const { memory, __heap_base, md_size, md_rate, md_joints, md_motions } = this.#c;
    const even = (at) => 16 * Math.ceil(at / 16);
    this.#at = even(__heap_base.value);
    this.#figure = even(this.#at + md_size());
    const lacking = this.#figure + words.byteLength - memory.buffer.byteLength;
    if (lacking > 0) memory.grow(Math.ceil(lacking / 65536));
    new Uint8Array(memory.buffer).set(new Uint8Array(words), this.#figure);
    if (this.#ask("begin", this.#figure, 0) < 0) throw new Error("the figure is damaged");
    this.tick = 1 / md_rate(this.#figure); // s
    this.joints = this.#names("joint", md_joints(this.#figure));
    this.motions = this.#names("motion", md_motions(this.#figure));
    this.loops = this.motions.map((_, motion) => !!this.#ask("is_loop", motion));
    this.waiting = []; // the motions that have been queued
    this.paused = false;
    this.#way = ROOT.map((name) => this.joints.indexOf(`root ${name}`));
    this.#root = start;
    if (this.#way[0] >= 0) this.#root = [[0, 0, 0], [1, 0, 0, 0]];
    this.step();
    this.#last = this.#now;
  }

  get #now() {
    return [this.targets, this.#root, this.#heading, this.phase];
  }

  #names(kind, count) {
    const letters = new Uint8Array(this.#c.memory.buffer);
    return Array.from({ length: count }, (_, number) => {
      const first = this.#c[`md_${kind}_name`](this.#figure, number);
      return new TextDecoder().decode(letters.subarray(first, letters.indexOf(0, first)));
    });
  }

  // The answer of a function of player.h that takes the player.
  #ask(name, ...given) {
    return this.#c[`md_${name}`](this.#at, ...given);
  }

  #angles(first) {
    return new Float32Array(this.#c.memory.buffer, first, this.joints.length).slice();
  }

  // The joints, rad, and the root's place and turn at a phase of a motion, whatever plays.
  moment(motion, phase) {
    const angles = this.#angles(this.#ask("moment", motion, phase));
    if (this.#way[0] < 0) return [angles, this.#root];
    const [height, ...axes] = this.#way.slice(3).map((joint) => angles[joint]);
    return [angles, [[0, 0, height], standing(axes.slice(0, 3), axes.slice(3))]];
  }

  // Plays one tick; the joints' targets, rad.
  step() {
    this.#last = this.#now;
    this.targets = this.#angles(this.#ask("step"));
    if (this.#way[0] >= 0) this.#walk(this.#way.map((joint) => this.targets[joint]));
    this.waiting.splice(0, this.waiting.length - this.#ask("queued"));
    return this.targets;
  }

  #walk([turn, forward, sideways, height, ...axes]) {
    const passed = this.mode === "playing" ? (this.#ask("present_tempo") * this.tick) / LIGHT : 0;
    this.#heading += passed * turn;
    const [cosine, sine] = [Math.cos(this.#heading), Math.sin(this.#heading)];
    const [x, y] = this.#root[0];
    const place = [x + passed * (cosine * forward - sine * sideways), y + passed * (sine * forward + cosine * sideways), height];
    const heading = [Math.cos(this.#heading / 2), 0, 0, Math.sin(this.#heading / 2)];
    this.#root = [place, times(heading, standing(axes.slice(0, 3), axes.slice(3)))];
  }

  // Lets time pass, s.
  advance(seconds) {
    for (this.#due += seconds; this.#due >= this.tick; this.#due -= this.tick) this.step();
  }

  // The joints, rad, and the root's place and turn, at the moment of a picture, which lies between the last two ticks.
  get posture() {
    const between = (first, second) => first.map((value, k) => value + (this.#due / this.tick) * (second[k] - value));
    const [targets, [place, turn]] = this.#last;
    const [there, facing] = this.#root;
    const near = turn.reduce((sum, part, k) => sum + part * facing[k], 0) < 0 ? turn.map((part) => -part) : turn;
    return [between(targets, this.targets), [between(place, there), unit(between(near, facing))]];
  }
  // What each satellite of a motion's network responds at a phase, from 0 to 1; none of a motion that is held as keys.
  responses(motion, phase) {
    return Array.from({ length: this.#ask("satellites", motion) }, (_, k) => this.#ask("response", motion, phase, k));
  }
  // The motions that play: their numbers, weights, and phases.
  get blended() {
    const every = this.motions.map((_, motion) => [motion, this.#ask("weight", motion)]);
    return every.flatMap(([motion, weight]) => (weight ? [[motion, weight, ((this.#ask("rounds", motion) % 1) + 1) % 1]] : []));
  }
  // What plays, and where it is, at that moment; and the heading, rad.
  get course() {
    const [, , heading, phase] = this.#last;
    const share = this.#due / this.tick;
    const way = this.phase - phase;
    const on = Math.abs(way) < 0.1 ? phase + share * way : this.phase;
    const beside = this.blended.filter(([motion]) => motion !== this.playing);
    return { playing: this.playing, phase: on, beside, fade: this.fade, heading: heading + share * (this.#heading - heading) };
  }

  get mode() {
    return ["playing", "approaching", "held", "stopped"][this.#ask("mode")]; // as MD_PLAYING and so on of player.h
  }
  get playing() {
    return this.#ask("playing");
  }
  get next() {
    return this.#ask("going_to");
  }
  get phase() {
    return this.#ask("phase");
  }
  // What is left of the difference that fades, from 1 to 0.
  get fade() {
    return this.#ask("fade_left");
  }
  // The phase at which the next motion will be entered, below 0 while none is looked for; and that at which the round ends.
  get entry() {
    return this.#ask("entry_phase");
  }
  get end() {
    return (((this.phase + this.#ask("round_left")) % 1) + 1) % 1;
  }
  // Layers: [motion, share from 0 to 1].
  get layers() {
    return Array.from({ length: this.#ask("layers") }, (_, k) => [this.#ask("layer_motion", k), this.#ask("layer_share", k)]);
  }
  // The motion on some joints, by their numbers, that does not end; or -1.
  layerOf(joints) {
    const layer = this.#ask("layer_of", bits(joints));
    return layer < 0 ? layer : this.#ask("layer_motion", layer);
  }
  // The robot's joints, without those of its root; and those that follow live values.
  get robot() {
    return this.joints.slice(0, this.#way[0] < 0 ? this.joints.length : this.#way[0]);
  }
  get live() {
    return this.robot.flatMap((_, joint) => (this.#ask("is_live", joint) ? [joint] : []));
  }
  // The farthest that the limits hold a joint from where its motion has it, rad; 0 unless it plays.
  get held() {
    if (this.mode !== "playing") return 0;
    const aims = new Float32Array(this.#c.memory.buffer, this.#ask("targets"), this.joints.length);
    return this.robot.reduce((most, _, joint) => Math.max(most, Math.abs(aims[joint] - this.targets[joint])), 0);
  }

  // Commands, as `motiondeck send` has them; the answer is 0, or negative if it cannot be done now.
  switch(motion, direct = false) {
    return this.#play("switch", motion, direct) || ((this.waiting = []), 0);
  }
  queue(motion) {
    return this.#play("queue", motion) || (this.waiting.push(motion), 0);
  }
  // A motion with a weight, -0.3 to 1.3, of another one in it; and the one that is blended in, or is to be, or -1.
  blend(first, second, weight) {
    return this.#play("blend", first, second, weight) || ((this.waiting = []), 0);
  }
  get with() {
    return this.#ask("blended_with");
  }
  // A motion ends being held, but not a pause.
  #play(name, ...given) {
    const held = this.mode === "held";
    const answer = this.#ask(name, ...given);
    if (held && answer === 0) this.paused = false;
    return answer;
  }
  // A motion on joints by their numbers, over what else plays; -1 ends it.
  layer(joints, motion, weight) {
    return this.#play("layer", bits(joints), motion, weight, 1);
  }
  // A joint from -1, its lower limit, over 0 to 1, for some seconds.
  hold(joint, value, seconds) {
    return this.#ask("live", joint, value, seconds);
  }
  tempo(factor) {
    return this.#ask("tempo", factor, 0);
  }
  jump(phase) {
    return this.#ask("jump", phase);
  }
  pause() {
    const answer = this.#ask("pause");
    if (answer === 0) this.paused = true;
    return answer;
  }
  resume() {
    const answer = this.#ask("resume");
    if (answer === 0) this.paused = false;
    return answer;
  }
  stop() {
    this.#ask("stop");
    this.paused = true;
  }
  reset() {
    return this.#ask("reset");
  }
};

// A bit for each joint.
const bits = (joints) => joints.reduce((sum, joint) => sum | (1n << BigInt(joint)), 0n);

// The rotation whose forward axis has the first direction, and whose left axis lies towards the second.
function standing(ahead, left) {
  const a = unit(ahead);
  const along = a.reduce((sum, part, k) => sum + part * left[k], 0);
  const l = unit(plus(left, a, -along));
  const u = [a[1] * l[2] - a[2] * l[1], a[2] * l[0] - a[0] * l[2], a[0] * l[1] - a[1] * l[0]];
  // Of the four ways to take a quaternion from a matrix the one that divides by its largest part.
  const parts = [1 + a[0] + l[1] + u[2], 1 + a[0] - l[1] - u[2], 1 - a[0] + l[1] - u[2], 1 - a[0] - l[1] + u[2]];
  const largest = parts.indexOf(Math.max(...parts));
  const rows = [
    [parts[0], l[2] - u[1], u[0] - a[2], a[1] - l[0]],
    [l[2] - u[1], parts[1], l[0] + a[1], u[0] + a[2]],
    [u[0] - a[2], l[0] + a[1], parts[2], u[1] + l[2]],
    [a[1] - l[0], u[0] + a[2], u[1] + l[2], parts[3]],
  ];
  return unit(rows[largest]);
}
