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

motiondeck.figureOf = (drawing) => {
  const d = drawing;
  const [SLIDE, HINGE] = [2, 3]; // of mjtJoint
  const bodies = d.body_parentid.map((parent, body) => {
    const own = d.jnt_bodyid.flatMap((of, joint) => (of === body && [SLIDE, HINGE].includes(d.jnt_type[joint]) ? [joint] : []));
    const joints = own.map((joint) => {
      const place = d.jnt_qposadr[joint];
      const slides = d.jnt_type[joint] === SLIDE;
      return { place, axis: d.jnt_axis[joint], anchor: d.jnt_pos[joint], rest: d.qpos0[place], slides };
    });
    return { parent: body ? parent : -1, place: d.body_pos[body], turn: d.body_quat[body], joints };
  });
  const solids = d.shapes.flatMap((shape, number) => shape.geom.map((geom, k) => ({
    shape: number,
    body: d.geom_bodyid[geom],
    place: plus(d.geom_pos[geom], turned(d.geom_quat[geom], shape.offset[k])),
    turn: d.geom_quat[geom],
    scale: shape.scale[k],
    colour: [...shape.colour[k].map((part) => part / 255), shape.opacity],
  })));
  solids.sort((one, other) => other.colour[3] - one.colour[3]); // what is seen through is drawn last
  const labels = d.labels.map((text, site) => ({ text, body: d.site_bodyid[site], place: d.site_pos[site] }));
  const [root, start] = [d.jnt_bodyid[0], [d.qpos0.slice(0, 3), d.qpos0.slice(3, 7)]];
  const moved = { rest: d.qpos0, played: d.hinge_qpos.map((place, k) => [place, d.hinge[k]]), led: d.led };
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

const SUN = unit([1.2, -1.6, 4]);
const FAR = 9; // heights of the figure: there the floor has faded into the sky
const SHADE = `#version 300 es
  precision highp float;
  uniform mat4 view; uniform mat4 model; uniform vec3 sun; uniform float flat_;
  in vec3 place; in vec3 normal; out vec3 side; out vec3 spot;
  void main() {
    vec4 p = model * vec4(place, 1.0);
    if (flat_ > 0.0) p.xyz -= sun * (max(p.z, 0.0) - flat_) / sun.z;
    spot = p.xyz; side = mat3(model) * (normal / vec3(dot(model[0], model[0]), dot(model[1], model[1]), dot(model[2], model[2])));
    gl_Position = view * p;
  }`;
const PAINT = `#version 300 es
  precision highp float;
  uniform vec4 colour; uniform vec3 sun; uniform vec3 eye; uniform float flat_; uniform float far; uniform float cell;
  uniform vec2 centre; in vec3 side; in vec3 spot; out vec4 shown;
  void main() {
    float fade = 1.0 - smoothstep(0.3, 1.0, length(spot.xy - eye.xy) / far);
    if (cell > 0.0) {
      vec2 at = (spot.xy + centre) / cell, wide = fwidth(at);
      vec2 edge = (abs(fract(at * 0.5 - 0.25) - 0.5) - 0.25) / max(wide * 0.5, 1e-6); // soft edges of squares
      vec2 s = clamp(edge, -1.0, 1.0);
      float odd = mix(0.5 - 0.5 * s.x * s.y, 0.5, smoothstep(0.3, 1.0, max(wide.x, wide.y)));
      shown = vec4(mix(vec3(0.84, 0.86, 0.89), vec3(0.745, 0.78, 0.823), odd), 1.0) * fade;
    } else if (flat_ > 0.0) shown = vec4(0.227, 0.259, 0.306, 1.0) * 0.5 * fade;
    else {
      vec3 n = normalize(side);
      float light = 0.62 + 0.16 * n.z + 0.42 * max(dot(n, sun), 0.0);
      shown = vec4(min(colour.rgb * light, 1.0), 1.0) * colour.a;
    }
  }`;

// Without a graphics card each pixel costs time: then edges stay as they are.
function drawnBySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const about = gl?.getExtension("WEBGL_debug_renderer_info");
  return !!about && /swiftshader|llvmpipe|software/i.test(gl.getParameter(about.UNMASKED_RENDERER_WEBGL));
}

// A picture of the figure on a canvas; `draw` shows it.
motiondeck.Scene = class {
  constructor(canvas, figure) {
    const gl = canvas.getContext("webgl2", { stencil: true, antialias: !drawnBySoftware() });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { canvas, figure, gl, yaw: -0.54, pitch: 0.28, away: 2.35, share: 1, centre: [0, 0] });
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, SHADE], [gl.FRAGMENT_SHADER, PAINT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "place");
    gl.bindAttribLocation(program, 1, "normal");
    gl.linkProgram(program);
    gl.useProgram(program);
    this.at = {};
    for (const name of ["view", "model", "eye", "sun", "flat_", "colour", "far", "cell", "centre"])
      this.at[name] = gl.getUniformLocation(program, name);
    this.meshes = figure.shapes.map((shape) =>
      this.#upload(new Float32Array(motiondeck.bytes(shape.vertices)), new Uint16Array(motiondeck.bytes(shape.faces))));
    const wide = FAR * figure.height;
    const corners = new Float32Array([-wide, -wide, 0, wide, -wide, 0, wide, wide, 0, -wide, wide, 0]);
    this.floor = this.#upload(corners, new Uint16Array([0, 1, 2, 0, 2, 3]));
    gl.enable(gl.CULL_FACE);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniform3fv(this.at.sun, SUN);
    gl.uniform1f(this.at.far, wide);
    this.labels = figure.labels.map(({ text }) => {
      const label = document.createElement("span");
      label.textContent = text;
      canvas.parentElement.append(label);
      return label;
    });
    this.#listen();
  }

  // Vertices with the mean direction of the triangles that share them: what is sharp has its corners apart.
  #upload(vertices, faces) {
    const gl = this.gl;
    const both = new Float32Array(2 * vertices.length);
    const corner = (number) => vertices.subarray(3 * number, 3 * number + 3);
    for (let f = 0; f < faces.length; f += 3) {
      const [a, b, c] = [corner(faces[f]), corner(faces[f + 1]), corner(faces[f + 2])];
      const [u, v] = [plus(b, a, -1), plus(c, a, -1)];
      const up = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      for (let k = 0; k < 3; k++) for (let axis = 0; axis < 3; axis++) both[6 * faces[f + k] + 3 + axis] += up[axis];
    }
    for (let n = 0; n < vertices.length / 3; n++) {
      both.set(corner(n), 6 * n);
      both.set(unit([...both.subarray(6 * n + 3, 6 * n + 6)]), 6 * n + 3);
    }
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, both, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    for (const [index, first] of [[0, 0], [1, 12]]) {
      gl.enableVertexAttribArray(index);
      gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 24, first);
    }
    return { array, count: faces.length };
  }

  // One finger or button turns, two fingers and the wheel come nearer.
  #listen() {
    const held = new Map();
    const near = (factor) => (this.away = Math.min(7, Math.max(1, this.away * factor)));
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
        this.yaw -= 0.008 * (event.clientX - x);
        this.pitch = Math.min(1.5, Math.max(0.02, this.pitch + 0.006 * (event.clientY - y)));
      }
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
    this.gl.uniform3fv(this.at.eye, eye);
    this.gl.uniformMatrix4fv(this.at.view, false, [0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));
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

  // Draws the bodies where `placed` has them, seen from the centre that the camera follows.
  draw(bodies) {
    const { gl, at, canvas, figure, centre } = this;
    const ratio = Math.min(window.devicePixelRatio, 2) * this.share;
    const size = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (!size[0] || !size[1]) return;
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    gl.viewport(0, 0, ...size);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    this.#label(bodies, this.#view());
    const models = figure.solids.map((solid) => {
      const [place, turn] = bodies[solid.body];
      const here = plus(plus(place, turned(turn, solid.place)), [...centre, 0], -1);
      const facing = times(turn, solid.turn);
      const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => turned(facing, axis));
      return [...columns.flatMap((column, k) => [...column.map((part) => part * solid.scale[k]), 0]), ...here, 1];
    });
    const put = ({ array, count }, model) => {
      gl.bindVertexArray(array);
      gl.uniformMatrix4fv(at.model, false, model);
      gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_SHORT, 0);
    };
    gl.disable(gl.DEPTH_TEST);
    gl.uniform1f(at.flat_, 0);
    gl.uniform1f(at.cell, figure.height < 1 ? 0.25 : 1);
    gl.uniform2fv(at.centre, centre.map((part) => part % 8));
    put(this.floor, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    gl.uniform1f(at.cell, 0);
    // The same solids, laid on the floor along the sun, are their shadow; the stencil keeps it from being drawn twice.
    gl.uniform1f(at.flat_, 1e-4);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    figure.solids.forEach((solid, number) => put(this.meshes[solid.shape], models[number]));
    gl.disable(gl.STENCIL_TEST);
    gl.enable(gl.DEPTH_TEST);
    gl.uniform1f(at.flat_, 0);
    figure.solids.forEach((solid, number) => {
      gl.uniform4fv(at.colour, solid.colour);
      put(this.meshes[solid.shape], models[number]);
    });
  }
};
