// Shares from 0 to 1 as bars side by side.
const [BAR, HIGH] = [8, 32]; // pixels of a bar with the gap beside it, and of a share of 1
motiondeck.bars = (canvas, shares) => {
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  [canvas.width, canvas.height] = [BAR * shares.length, HIGH]; // which clears it
  pen.fillStyle = getComputedStyle(canvas).color;
  shares.forEach((share, place) => pen.fillRect(BAR * place, HIGH * (1 - share), BAR - 2, HIGH * share));
};

// What goes on in the player, over the last seconds: a line sweeps to the right and draws over what it drew before.
const SWEEP = 10; // s from side to side
const ROWS = [0.5, 0.25, 0.25]; // heights: of joints, of fade and layers, and of what limits hold back
const [WIDEST, HELD] = [1.6, 0.2]; // rad: what a row of joints shows, and of what is held back

motiondeck.Trace = class {
  #canvas;
  #pen;
  #x = 0;
  #before = [];
  #colours;

  constructor(canvas) {
    this.#canvas = canvas;
    this.#pen = canvas.getContext("2d", { willReadFrequently: true }); // kept out of a graphics card: little changes
    const dark = window.matchMedia("(prefers-color-scheme: dark)");
    (dark.onchange = () => this.#restart())();
  }

  #restart() {
    const { clientWidth, clientHeight } = this.#canvas;
    [this.#canvas.width, this.#canvas.height, this.#x, this.#before] = [clientWidth, clientHeight, 0, []];
    const style = getComputedStyle(this.#canvas);
    this.#colours = ["--quiet", "--next", "--here", "--stop"].map((name) => style.getPropertyValue(name));
  }

  // Goes some seconds on, to joints in rad, the fade's and layers' shares, and how far limits hold a joint back, rad.
  draw(seconds, joints, fade, layers, held) {
    const [canvas, pen] = [this.#canvas, this.#pen];
    if (canvas.width !== canvas.clientWidth || canvas.height !== canvas.clientHeight) this.#restart();
    const { width, height } = canvas;
    if (!width) return;
    const to = this.#x + (seconds / SWEEP) * width;
    const edges = [0, ROWS[0], ROWS[0] + ROWS[1]].map((edge, row) => [height * edge + 2, height * ROWS[row] - 4]);
    const at = (row, share) => edges[row][0] + edges[row][1] * (1 - Math.min(Math.max(share, 0), 1));
    const [quiet, next, here, stop] = this.#colours;
    const lines = [
      ...Array.from(joints, (angle) => [quiet, at(0, 0.5 + angle / WIDEST / 2)]),
      [next, at(1, fade)],
      [stop, at(2, held / HELD)],
      ...layers.map((share) => [here, at(1, share)]),
    ];
    pen.clearRect(this.#x, 0, to - this.#x + 12, height);
    lines.forEach(([colour, y], number) => {
      pen.strokeStyle = colour;
      pen.lineWidth = number < joints.length ? 1 : 2;
      pen.beginPath();
      pen.moveTo(this.#x, this.#before[number] ?? y);
      pen.lineTo(to, y);
      pen.stroke();
    });
    [this.#x, this.#before] = to < width ? [to, lines.map(([, y]) => y)] : [0, []];
  }
};
