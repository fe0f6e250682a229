// Draws a figure of rigid bodies in WebGL 2: its kinematics, its solids with their shadow, a floor, and a camera.
// A figure is put together from arrays of a MuJoCo model, as `motiondeck export` writes them:
//   bodies: [{parent, place: [x, y, z], turn: [w, x, y, z], joints: [joint]}], parents first; -1 is that of the world
//   joint: {place, axis, anchor, rest, slides}; rest: positions by place; played: [[place, number of an angle]];
//   led: [[place, place of the joint that leads it, a polynomial]], in their order
//   solids: [{shape, body, place, turn, scale, colour: [r, g, b, a]}] of shapes; labels: [{text, body, place}]; height, m
const motiondeck = {};

motiondeck.bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

// Quaternions are [w, x, y, z].
const times = ([a, b, c, d], [e, f, g, h]) => [
  a * e - b * f - c * g - d * h,
  a * f + b * e + c * h - d * g,
  a * g - b * h + c * e + d * f,
  a * h + b * g - c * f + d * e,
];
const turned = ([w, x, y, z], [a, b, c]) => {
  const [u, v, t] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u];
};
const plus = ([a, b, c], [d, e, f], by = 1) => [a + by * d, b + by * e, c + by * f];
const unit = (v) => {
  const length = Math.hypot(...v) || 1;
  return v.map((part) => part / length);
};

// Of a drawing, in so many times its size.
motiondeck.figureOf = (drawing, size = 1) => {
  const d = drawing;
  const sized = (vector) => vector.map((part) => size * part);
  const [SLIDE, HINGE] = [2, 3]; // of mjtJoint
  const bodies = d.body_parentid.map((parent, body) => {
    const own = d.jnt_bodyid.flatMap((of, joint) => (of === body && [SLIDE, HINGE].includes(d.jnt_type[joint]) ? [joint] : []));
    const joints = own.map((joint) => {
      const place = d.jnt_qposadr[joint];
      const slides = d.jnt_type[joint] === SLIDE;
      return { place, axis: d.jnt_axis[joint], anchor: d.jnt_pos[joint], rest: d.qpos0[place], slides };
    });
    return { parent: body ? parent : -1, place: sized(d.body_pos[body]), turn: d.body_quat[body], joints };
  });
  const solids = d.shapes.flatMap((shape, number) => shape.geom.map((geom, k) => ({
    shape: number,
    body: d.geom_bodyid[geom],
    place: sized(plus(d.geom_pos[geom], turned(d.geom_quat[geom], shape.offset[k]))),
    turn: d.geom_quat[geom],
    scale: sized(shape.scale[k]),
    colour: [...shape.colour[k].map((part) => part / 255), shape.opacity],
  })));
  const labels = d.labels.map((text, site) => ({ text, body: d.site_bodyid[site], place: d.site_pos[site] }));
  const [root, start] = [d.jnt_bodyid[0], [d.qpos0.slice(0, 3), d.qpos0.slice(3, 7)]];
  const led = d.led.flat().map(([place, of, ...curve]) => [place, of, curve]);
  const moved = { led, rest: d.qpos0, played: d.hinge_qpos.map((place, k) => [place, d.hinge[k]]) };
  return { ...moved, bodies, solids, labels: labels.filter(({ text }) => text), shapes: d.shapes, root, start, height: d.height };
};

// Where each body is, [place, turn], for the root's place and turn and for angles, rad.
motiondeck.placed = (figure, [place, turn], angles) => {
  const found = [];
  const at = figure.rest.slice(); // positions of joints, by their places in the model
  for (const [to, number] of figure.played) at[to] = angles[number];
  for (const [to, of, curve] of figure.led) at[to] = curve.reduceRight((sum, part) => sum * at[of] + part, 0);
  figure.bodies.forEach((body, number) => {
    const [above, way] = body.parent < 0 ? [[0, 0, 0], [1, 0, 0, 0]] : found[body.parent];
    let here = plus(above, turned(way, body.place));
    let facing = times(way, body.turn);
    if (number === figure.root) [here, facing] = [place, turn];
    for (const joint of body.joints) {
      const moved = at[joint.place] - joint.rest;
      if (joint.slides) here = plus(here, turned(facing, joint.axis), moved);
      else {
        const anchor = plus(here, turned(facing, joint.anchor));
        const sine = Math.sin(moved / 2);
        facing = times(facing, [Math.cos(moved / 2), ...joint.axis.map((part) => part * sine)]);
        here = plus(anchor, turned(facing, joint.anchor), -1);
      }
    }
    found.push([here, facing]);
  });
  return found;
};

motiondeck.at = ([place, turn], offset) => plus(place, turned(turn, offset));

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const SUN = unit([1.2, -1.6, 4]);
const [STEP, NEARER] = [20, 0.9]; // pixels that an arrow counts as, and by how much a key comes nearer
const KEYS = {
  ...{ ArrowLeft: [-STEP, 0, 0], ArrowRight: [STEP, 0, 0], ArrowUp: [0, -STEP, 0], ArrowDown: [0, STEP, 0] },
  ...{ "+": [0, 0, NEARER], "-": [0, 0, 1 / NEARER] },
};
const FAR = 9; // heights of the figure: there the floor has faded into the sky
const [RINGS, SECTORS] = [12, 36]; // of the floor, about the eye
const [PICTURE, SLOW] = [1 / 60, 1 / 56]; // s
const [PATIENCE, LONGEST] = [4, 120]; // s until more pixels are tried
const STEPS = 4; // from all pixels to half of them in each direction
const WORDS = 20; // of a solid: its matrix and colour
// GLSL. Software computes both sides of a branch, so floor, shadows and solids have programs of their own, and what changes
// little from pixel to pixel is computed at corners.
const UNIFORMS = ["view", "eye", "sun", "far", "tones", "blur", "cell", "centre"];
const HEAD = `#version 300 es
  precision highp float;
  uniform mat4 view; uniform vec3 eye; uniform vec3 sun; uniform float far; uniform vec3 tones[3];
  float fade(vec2 spot) { return 1.0 - smoothstep(0.3, 1.0, length(spot - eye.xy) / far); }`;
const SOLID = `uniform highp sampler2D solids; in vec3 place; in vec3 normal; in float solid;
  vec4 word(int number) { return texelFetch(solids, ivec2(number, int(solid)), 0); }
  mat4 model() { return mat4(word(0), word(1), word(2), word(3)); }`;
const PROGRAMS = {
  floor: [
    `uniform vec4 blur; uniform float cell; uniform vec2 centre;
    in vec3 place; out vec2 tile; out vec2 sharp; out vec2 seen;
    void main() {
      vec2 spot = eye.xy + far * place.xy;
      gl_Position = view * vec4(spot, 0.0, 1.0);
      tile = 0.5 * (spot + centre) / cell - 0.25;
      vec2 wide = gl_Position.w * (blur.xy + max(gl_Position.w, 0.0) * blur.zw) / cell; // a pixel there, in tiles
      sharp = 2.0 / max(wide, 1e-6);
      seen = fade(spot) * vec2(1.0, 1.0 - smoothstep(0.3, 1.0, max(wide.x, wide.y)));
    }`,
    `in vec2 tile; in vec2 sharp; in vec2 seen; out vec4 shown;
    void main() {
      vec2 side = clamp((abs(fract(tile) - 0.5) - 0.25) * sharp, -1.0, 1.0); // soft edges of squares
      shown = vec4(tones[0] * seen.x + tones[1] * (side.x * side.y * seen.y), seen.x);
    }`,
  ],
  shadows: [
    `${SOLID} out float dark;
    void main() {
      vec4 p = model() * vec4(place, 1.0);
      p.xyz -= sun * (max(p.z, 0.0) - 1e-4) / sun.z;
      dark = 0.5 * fade(p.xy);
      gl_Position = view * p;
    }`,
    `in float dark; out vec4 shown;
    void main() { shown = vec4(tones[2], 1.0) * dark; }`,
  ],
  meshes: [
    `${SOLID} out vec3 side; flat out vec4 tint;
    void main() {
      mat4 m = model();
      side = mat3(m) * (normal / vec3(dot(m[0], m[0]), dot(m[1], m[1]), dot(m[2], m[2])));
      tint = word(4);
      gl_Position = view * (m * vec4(place, 1.0));
    }`,
    `in vec3 side; flat in vec4 tint; out vec4 shown;
    void main() {
      vec3 n = normalize(side);
      float light = 0.62 + 0.16 * n.z + 0.42 * max(dot(n, sun), 0.0);
      shown = vec4(min(tint.rgb * light, 1.0), 1.0) * tint.a;
    }`,
  ],
};
// The mean of two colours of tiles, what the first has more than it, and the colour of shadows; by day and in the dark.
const TONES = [[[0.84, 0.86, 0.89], [0.745, 0.78, 0.823], [0.227, 0.259, 0.306]], [[0.2, 0.225, 0.26], [0.15, 0.17, 0.2], [0, 0, 0]]].map(
  ([one, other, shadow]) => [...one.map((part, k) => (part + other[k]) / 2), ...one.map((part, k) => (part - other[k]) / 2), ...shadow],
);

// Rings about a middle, wider farther out, to a distance of 1.
function disc() {
  const around = Array.from({ length: SECTORS }, (_, sector) => (2 * Math.PI * sector) / SECTORS);
  const [vertices, faces] = [[0, 0, 0], []];
  for (let ring = 0; ring < RINGS; ring++) {
    const radius = ((1 + ring) / RINGS) ** 2;
    around.forEach((turn, sector) => {
      const [here, next] = [sector, (sector + 1) % SECTORS].map((place) => 1 + SECTORS * ring + place);
      vertices.push(radius * Math.cos(turn), radius * Math.sin(turn), 0);
      faces.push(...(ring ? [here - SECTORS, here, next, here - SECTORS, next, next - SECTORS] : [0, here, next]));
    });
  }
  return { vertices, faces, solid: 0 };
}

// Without a graphics card each pixel costs time: then edges stay as they are, and `Pixels` may become fewer.
function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const about = gl?.getExtension("WEBGL_debug_renderer_info");
  return !!about && /swiftshader|llvmpipe|software/i.test(gl.getParameter(about.UNMASKED_RENDERER_WEBGL));
}

// How many pixels are drawn: a step fewer while pictures come more slowly than a screen shows them, and a step more after
// some seconds in which they did not. Where that was too much, the next try comes after twice as long.
motiondeck.Pixels = class {
  level = 0;
  #last;
  #between = PICTURE; // from picture to picture, s, smoothed
  #calm = -1; // s since the last step; the first second is slow for other reasons
  #patience = PATIENCE;
  #tried = false; // whether the last step was one up

  // With so many steps down; without any, all pixels are drawn always.
  constructor(steps) {
    this.#last = steps;
  }

  // Of all pixels in each direction.
  get share() {
    return 2 ** (-this.level / STEPS);
  }

  // Takes note of a picture that is shown so many seconds after the one before.
  shown(passed) {
    this.#calm += passed;
    if (this.#calm < 0) return;
    this.#between += 0.02 * (Math.min(passed, 2 * PICTURE) - this.#between);
    if (this.#between > SLOW) {
      if (this.#tried) this.#patience = Math.min(2 * this.#patience, LONGEST);
      this.#step(1);
    } else if (this.#calm > this.#patience) this.#step(-1);
  }

  #step(down) {
    const before = this.level;
    this.level = Math.min(Math.max(before + down, 0), this.#last);
    [this.#tried, this.#between, this.#calm] = [this.level < before, PICTURE, 0];
  }
};

// A picture of figures on a canvas; `draw` shows it. The first one's size is that of the scene, and its labels are seen.
motiondeck.Scene = class {
  constructor(canvas, figures) {
    const [figure] = figures;
    const bySoftware = drawnBySoftware();
    const gl = canvas.getContext("webgl2", { stencil: true, antialias: !bySoftware });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { canvas, figure, gl, pixels: new motiondeck.Pixels(bySoftware ? STEPS : 0), yaw: -0.54, pitch: 0.28, away: 2.35, centre: [0, 0] });
    this.programs = Object.fromEntries(Object.entries(PROGRAMS).map(([kind, texts]) => [kind, this.#program(texts)]));
    // All that is alike is drawn at once, as software takes as long to begin a mesh as to draw one: what is solid, then
    // what is seen through, of one figure after the other.
    this.solids = figures.flatMap(({ shapes, solids }, number) =>
      solids.map((solid) => ({ ...solid, figure: number, shape: shapes[solid.shape] })));
    this.solids.sort((one, other) => other.colour[3] - one.colour[3] || one.figure - other.figure);
    // A figure beside the first one is drawn of few triangles, as shadows are: a human has a hundred round solids.
    const drawn = (kind) => this.solids.map(({ shape, figure }, number) => {
      const [vertices, faces] = shape[figure ? "shadow" : kind].map(motiondeck.bytes);
      return { vertices: new Float32Array(vertices), faces: new Uint16Array(faces), solid: number + 1, figure };
    });
    this.floor = this.#upload([disc()]);
    this.meshes = this.#upload(drawn("mesh"));
    this.shadows = this.#upload(drawn("shadow"));
    this.words = new Float32Array(WORDS * (1 + this.solids.length));
    [0, 5, 10, 15].forEach((place) => (this.words[place] = 1));
    this.solids.forEach(({ colour }, number) => this.words.set(colour, WORDS * (number + 1) + 16));
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, WORDS / 4, 1 + this.solids.length);
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    (dark.onchange = () => this.#set("tones", "3fv", TONES[+dark.matches]))();
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.#set("sun", "3fv", SUN);
    this.#set("far", "1f", FAR * figure.height);
    this.#set("cell", "1f", figure.height < 1 ? 0.25 : 1);
    this.labels = figure.labels.map(({ text }) => {
      const label = document.createElement("span");
      label.textContent = text;
      canvas.parentElement.append(label);
      return label;
    });
    this.#listen();
  }

  // A program of the texts of two shaders.
  #program(texts) {
    const gl = this.gl;
    const program = gl.createProgram();
    texts.forEach((text, place) => {
      const shader = gl.createShader([gl.VERTEX_SHADER, gl.FRAGMENT_SHADER][place]);
      gl.shaderSource(shader, HEAD + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    });
    ["place", "normal", "solid"].forEach((name, place) => gl.bindAttribLocation(program, place, name));
    gl.linkProgram(program);
    const places = Object.fromEntries(UNIFORMS.map((name) => [name, gl.getUniformLocation(program, name)]));
    return { program, places };
  }

  // Sets a uniform in all programs, as gl.uniform... of a kind.
  #set(name, kind, ...values) {
    for (const { program, places } of Object.values(this.programs)) {
      this.gl.useProgram(program);
      this.gl[`uniform${kind}`](places[name], ...values);
    }
  }

  // Meshes as one: vertices with the mean direction of the triangles that share them (what is sharp has its corners
  // apart) and with their solid; where those of each figure are.
  #upload(meshes) {
    const gl = this.gl;
    const [points, corners, runs] = [[], [], []];
    for (const { vertices, faces, solid, figure } of meshes) {
      const first = points.length / 7;
      const at = (number) => [0, 1, 2].map((axis) => vertices[3 * number + axis]);
      const ups = Array.from({ length: vertices.length / 3 }, () => [0, 0, 0]);
      for (let f = 0; f < faces.length; f += 3) {
        const own = [0, 1, 2].map((k) => faces[f + k]);
        const [a, b, c] = own.map(at);
        const [u, v] = [plus(b, a, -1), plus(c, a, -1)];
        const up = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for (const corner of own) ups[corner] = plus(ups[corner], up);
      }
      ups.forEach((up, number) => points.push(...at(number), ...unit(up), solid));
      if (runs.at(-1)?.figure !== figure || !runs.length) runs.push({ figure, first: corners.length, count: 0 });
      runs.at(-1).count += faces.length;
      for (const corner of faces) corners.push(first + corner);
    }
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners), gl.STATIC_DRAW);
    [3, 3, 1].forEach((size, index) => {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, size, gl.FLOAT, false, 28, 12 * index);
    });
    return { array, runs, corners: corners.length };
  }

  // One finger, button or arrow turns, two fingers, the wheel, + and - come nearer.
  #listen() {
    const held = new Map();
    const near = (factor) => (this.away = Math.min(7, Math.max(1, this.away * factor)));
    const turn = (across, down) => {
      this.yaw -= 0.008 * across;
      this.pitch = Math.min(1.5, Math.max(0.02, this.pitch + 0.006 * down));
    };
    const apart = () => Math.hypot(...[0, 1].map((axis) => [...held.values()].reduce((a, b) => a[axis] - b[axis])));
    this.canvas.onpointerdown = (event) => {
      held.set(event.pointerId, [event.clientX, event.clientY]);
      this.canvas.setPointerCapture(event.pointerId);
    };
    this.canvas.onpointermove = (event) => {
      if (!held.has(event.pointerId)) return;
      const [x, y] = held.get(event.pointerId);
      const before = held.size === 2 ? apart() : 0;
      held.set(event.pointerId, [event.clientX, event.clientY]);
      if (before) near(before / Math.max(apart(), 1));
      else {
        turn(event.clientX - x, event.clientY - y);
      }
    };
    this.canvas.onkeydown = (event) => {
      const [across, down, nearer] = KEYS[event.key] ?? [];
      if (nearer) near(nearer);
      else if (nearer === 0) turn(across, down);
      else return;
      event.preventDefault();
    };
    this.canvas.onpointerup = this.canvas.onpointercancel = (event) => held.delete(event.pointerId);
    this.canvas.onwheel = (event) => {
      if (window !== window.top && !event.ctrlKey) return; // within another page, which scrolls
      event.preventDefault();
      near(Math.exp(0.001 * event.deltaY));
    };
  }

  // The view of a camera that looks at the figure's middle from afar; in a window on end it stands farther away.
  #view() {
    const { width, height } = this.canvas;
    const size = this.figure.height;
    const distance = this.away * size * Math.max(1, 0.75 * (height / width));
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const eye = [distance * cp * cy, distance * cp * sy, 0.46 * size + distance * sp];
    const [right, up, back] = [[-sy, cy, 0], [-sp * cy, -sp * sy, cp], [cp * cy, cp * sy, sp]];
    const lens = 1 / Math.tan(0.5 * 0.73);
    const [near, far] = [0.1 * size, 40 * size];
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    const rows = [
      [...right, dot(right)].map((part) => (part * lens * height) / width),
      [...up, dot(up)].map((part) => part * lens),
      [...back, dot(back)].map((part) => (part * (far + near)) / (near - far)),
      [...back, dot(back)].map((part) => -part),
    ];
    rows[2][3] += (2 * far * near) / (near - far);
    const pixel = 2 / (lens * height); // at a distance of 1
    this.#set("eye", "3fv", eye);
    this.#set("view", "Matrix4fv", false, [0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
    this.#set("blur", "4fv", [sy, cy, cy / eye[2], sy / eye[2]].map((part) => pixel * Math.abs(part)));
    return rows;
  }

  // Puts labels where their places are seen.
  #label(bodies, view) {
    this.labels.forEach((label, number) => {
      const { body, place } = this.figure.labels[number];
      const at = [...plus(motiondeck.at(bodies[body], place), [...this.centre, 0], -1), 1];
      const [x, y, , w] = view.map((row) => row.reduce((sum, part, k) => sum + part * at[k], 0));
      const left = `translate(-50%) translate(${Math.round((0.5 + (0.5 * x) / w) * this.canvas.clientWidth)}px, `;
      const moved = `${left}${Math.round((0.5 - (0.5 * y) / w) * this.canvas.clientHeight)}px)`;
      if (label.style.transform !== moved) label.style.transform = moved;
    });
  }

  // Draws the bodies of each figure where `placed` has them, seen from the centre that the camera follows; one without
  // bodies is not drawn.
  draw(figures) {
    const { gl, canvas, centre, words } = this;
    const ratio = Math.min(window.devicePixelRatio, 2) * this.pixels.share;
    const size = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (!size[0] || !size[1]) return;
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    gl.viewport(0, 0, ...size);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    this.#label(figures[0], this.#view());
    this.solids.forEach((solid, number) => {
      const body = figures[solid.figure]?.[solid.body];
      if (!body) return;
      const [place, turn] = body;
      const facing = times(turn, solid.turn);
      const first = WORDS * (number + 1);
      AXES.forEach((axis, k) => words.set(turned(facing, axis).map((part) => part * solid.scale[k]), first + 4 * k));
      words.set(plus(plus(place, turned(turn, solid.place)), [...centre, 0], -1), first + 12);
      words[first + 15] = 1;
    });
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WORDS / 4, words.length / WORDS, gl.RGBA, gl.FLOAT, words);
    this.#set("centre", "2fv", centre.map((part) => part % 8));
    const put = (kind) => {
      const { array, runs, corners } = this[kind];
      gl.useProgram(this.programs[kind].program);
      gl.bindVertexArray(array);
      const shown = runs.filter(({ figure }) => figure === undefined || figures[figure]);
      const whole = shown.length === runs.length; // which is one mesh, then
      for (const { first, count } of whole ? [{ first: 0, count: corners }] : shown)
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    };
    gl.disable(gl.DEPTH_TEST);
    put("floor");
    // The same solids, coarser and laid on the floor along the sun, are their shadow; the stencil keeps it from being drawn twice.
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    put("shadows");
    gl.disable(gl.STENCIL_TEST);
    gl.enable(gl.DEPTH_TEST);
    put("meshes");
  }
};
