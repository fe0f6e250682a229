// The human whose motion is played, beside the robot and as large: poses of each motion by its phase, as the library has
// them. What the robot alone does (layers, live joints, its limits) the human does not.
const POSE_UNIT = 8192; // as of motiondeck/export/web_page.py
const BESIDE = 0.7; // heights of the robot

motiondeck.Human = class {
  #poses; // of each motion, rows of the root's height and quaternions
  #width;
  #loops;
  #shown;
  #from; // the pose that the last fade began with
  #first = 1; // what was left to fade then
  #left = 0;

  // Of a drawing, beside a figure, with poses of motions by their names; some are loops.
  constructor(drawing, figure, motions, loops) {
    const [stands, height] = [figure.start[0][2], figure.height];
    // As long legs go as far; a robot without legs is as high.
    this.size = stands > 0.2 * height ? stands / drawing.qpos0[2] : height / drawing.height;
    this.figure = motiondeck.figureOf(drawing, this.size);
    this.aside = BESIDE * height;
    this.#loops = loops;
    this.#width = 1 + 4 * drawing.turned.length;
    this.turns = new Map(drawing.turned.map((body, number) => [body, 1 + 4 * number]));
    this.#poses = motions.map((name) => new Int16Array(motiondeck.bytes(drawing.poses[name])));
  }

  // The height of the root, m, and quaternions at a phase of a motion: a cubic through the nearest four poses.
  pose(motion, phase) {
    const [all, width] = [this.#poses[motion], this.#width];
    const last = all.length / width - 1;
    const row = (number) => all.subarray(width * number, width * (number + 1));
    const loops = this.#loops[motion]; // else a one-shot, which is held at its ends
    const near = Math.min(Math.floor(phase * last), last - 1);
    const u = phase * last - near;
    const rows = [-1, 0, 1, 2].map((step) =>
      row(loops ? (near + step + last) % last : Math.min(Math.max(near + step, 0), last)));
    const weights = [0.5 * u * (2 * u - 1 - u * u), 1 + 0.5 * u * u * (3 * u - 5), 0.5 * u * (1 + u * (4 - 3 * u)), 0.5 * u * u * (u - 1)];
    return this.#mixed(rows, weights.map((weight) => weight / POSE_UNIT));
  }

  // A mean of poses; quaternions of one sign, and of length 1.
  #mixed(rows, weights) {
    const found = new Float64Array(this.#width);
    rows.forEach((row, n) => (found[0] += weights[n] * row[0]));
    for (let at = 1; at < this.#width; at += 4) {
      const beside = (row) => [0, 1, 2, 3].reduce((sum, k) => sum + row[at + k] * rows[1][at + k], 0);
      rows.forEach((row, n) => {
        const weight = beside(row) < 0 ? -weights[n] : weights[n];
        for (let k = at; k < at + 4; k++) found[k] += weight * row[k];
      });
      found.set(unit(found.subarray(at, at + 4)), at);
    }
    return found;
  }

  // The bodies as the player plays now, beside a root that has gone somewhere, with a heading in rad.
  bodies({ playing, phase, beside, fade }, [[x, y]], heading) {
    const rest = 1 - beside.reduce((sum, [, weight]) => sum + weight, 0);
    const poses = [this.pose(playing, phase), ...beside.map(([motion, , where]) => this.pose(motion, where))];
    const now = beside.length ? this.#mixed(poses, [rest, ...beside.map(([, weight]) => weight)]) : poses[0];
    if (fade > this.#left) [this.#from, this.#first] = [this.#shown ?? now, fade];
    this.#left = fade;
    const share = fade / this.#first;
    this.#shown = share > 0 ? this.#mixed([this.#from, now], [share, 1 - share]) : now;
    const turn = [Math.cos(heading / 2), 0, 0, Math.sin(heading / 2)];
    const found = [];
    this.figure.bodies.forEach((body, number) => {
      const [above, way] = body.parent < 0 ? [[0, 0, 0], [1, 0, 0, 0]] : found[body.parent];
      const own = this.turns.get(number);
      const facing = own ? times(turn, [...this.#shown.subarray(own, own + 4)]) : times(way, body.turn);
      const root = [x, y - this.aside, this.size * this.#shown[0]];
      found.push([number === this.figure.root ? root : plus(above, turned(way, body.place)), facing]);
    });
    return found;
  }
};
