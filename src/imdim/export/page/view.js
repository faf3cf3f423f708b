// The 3D view: target and result side by side from one camera.

const SLOPE = Math.tan((14 * Math.PI) / 180);
const PAPER = [246, 248, 250];
const COLORS = { adds: [124, 166, 210], cuts: [229, 138, 112], bounds: [166, 142, 208] };
const PLAIN = [168, 178, 190];
const CUTTER = [214, 40, 40, 255];
const PICKED = [255, 170, 20, 255];
const LINE = [38, 46, 58, 255];
const RAMP = [[222, 226, 230], [250, 214, 140], [244, 142, 60], [204, 40, 40], [96, 0, 30]];
const COVERAGES = { seen: [112, 158, 204], inferred: [186, 164, 214], unknown: [228, 128, 96] };
const VERDICTS = { exact: [222, 226, 230], approximated: [244, 178, 60], "left out": [190, 30, 60] };

/** The colour of a distance, as a share of the scale from 0 to 1. */
function rampColor(share) {
  const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(at), RAMP.length - 2);
  return RAMP[low].map((c, i) => Math.round(c + (at - low) * (RAMP[low + 1][i] - c)));
}

const faded = (color) => color.map((c, i) => Math.round(0.45 * c + 0.55 * PAPER[i]));

class Camera {
  constructor() {
    this.reset();
  }

  reset() {
    this.look(-0.62, 0.5);
    this.center = [0, 0, 0];
    this.distance = 2.2;
  }

  look(yaw, pitch) {
    this.yaw = yaw;
    this.pitch = Math.min(Math.max(pitch, -Math.PI / 2), Math.PI / 2);
  }

  turn(right, up) {
    this.look(this.yaw - right, this.pitch + up);
  }

  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.15), 12);
  }

  /** Move what is seen by shares of the view's shorter side. */
  pan(right, up) {
    const size = 2 * SLOPE * this.distance;
    const [x, y] = this.axes();
    this.center = sub(this.center, add(scale(x, right * size), scale(y, up * size)));
  }

  /** Unit vectors to the right, up and towards the eye; z is up on the page. */
  axes() {
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const right = [c, s, 0];
    const back = [s * Math.cos(this.pitch), -c * Math.cos(this.pitch), Math.sin(this.pitch)];
    return [right, cross(back, right), back];
  }

  eye() {
    return add(this.center, scale(this.axes()[2], this.distance));
  }

  matrix(aspect) {
    return projection(this.eye(), this.axes(), SLOPE, aspect, Math.max(this.distance - 3, 0.02), this.distance + 3);
  }

  /** The direction of the ray through a place in a pane, `x` and `y` from -1 to 1. */
  ray(x, y, aspect) {
    const [right, up, back] = this.axes();
    const wide = SLOPE * Math.max(aspect, 1);
    return unit(sub(add(scale(right, x * wide), scale(up, (y * wide) / aspect)), back));
  }
}

class View {
  /** `panes` are the elements, named "target" and "result", over which each is drawn. */
  constructor(canvas, data, panes) {
    this.renderer = new Renderer(canvas);
    this.canvas = canvas;
    this.panes = panes;
    this.leaves = data.leaves;
    this.box = { low: data.low, high: data.high, diagonal: norm(sub(data.high, data.low)) || 1 };
    this.show = { distances: true, verdicts: false, coverage: false, operations: true, cutters: false, edges: true };
    this.picked = new Set();
    this.camera = new Camera();
    this.shapes = new Map();
    this.onPick = () => {};
    this.onPoint = () => {};
    this.#load(data);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => window.location.reload());
    new ResizeObserver(() => this.redraw()).observe(canvas);
  }

  #load(data) {
    const { gl } = this.renderer;
    const solid = pointsOf(data.solid.points, this.box);
    const faces = facesOf(data.solid.faces, solid.length / 3);
    this.owners = data.solid.owners.flatMap(([leaf, count]) => Array(count).fill(leaf));
    this.solid = this.#surface(drawable(solid, faces), new Uint8Array(4 * faces.length));
    this.coverage = data.solid.coverage ? bytesOf(data.solid.coverage) : null;
    this.target = null;
    if (data.target) {
      const points = pointsOf(data.target.points, this.box);
      const far = bytesOf(data.target.distances);
      this.top = data.target.top;
      this.verdicts = data.target.verdicts ? bytesOf(data.target.verdicts) : null;
      if (data.target.faces) {
        const corners = facesOf(data.target.faces, points.length / 3);
        this.far = Uint8Array.from(corners, (i) => far[i]);
        this.target = this.#surface(drawable(points, corners), new Uint8Array(4 * corners.length));
      } else {
        this.far = far;
        this.target = { body: this.renderer.body(gl.POINTS, points, null, new Uint8Array(4 * far.length)), lines: null };
        this.pointSize = Math.min(Math.max(420 / Math.sqrt(far.length), 2), 6);
      }
    }
    this.#repaint();
  }

  #surface(mesh, colors) {
    const { gl } = this.renderer;
    const body = this.renderer.body(gl.TRIANGLES, mesh.positions, mesh.normals, colors);
    return { body, lines: this.renderer.body(gl.LINES, mesh.lines, null, LINE), positions: mesh.positions };
  }

  set(what, on) {
    this.show[what] = on;
    this.#repaint();
  }

  /** Highlight leaves: their faces, and their whole shapes shining through. */
  pick(leaves) {
    this.picked = new Set(leaves);
    this.#repaint();
  }

  #repaint() {
    const any = this.picked.size > 0;
    const tint = this.leaves.map((leaf, i) => {
      if (this.picked.has(i)) return PICKED;
      const color = this.show.operations ? COLORS[leaf.role] : COLORS.adds;
      return any ? faded(color) : color;
    });
    const colors = new Uint8Array(12 * this.owners.length).fill(255);
    const shown = this.show.coverage && this.coverage && Object.values(COVERAGES);
    this.owners.forEach((leaf, f) => {
      const color = shown && !this.picked.has(leaf) ? shown[this.coverage[f]] : tint[leaf];
      for (let c = 0; c < 3; c++) for (let k = 0; k < 3; k++) colors[12 * f + 4 * c + k] = color[k];
    });
    this.renderer.recolor(this.solid.body, colors);
    if (this.target) this.renderer.recolor(this.target.body, this.#targetColors());
    this.redraw();
  }

  #targetColors() {
    const table = Array.from({ length: 256 }, (_, i) => (this.show.distances ? rampColor(i / 255) : PLAIN));
    const colors = new Uint8Array(4 * this.far.length).fill(255);
    const found = Object.values(VERDICTS);
    const [verdicts, corners] = [this.show.verdicts ? this.verdicts : null, this.target.lines ? 3 : 1];
    for (let i = 0; i < this.far.length; i++) {
      const color = verdicts ? found[verdicts[Math.floor(i / corners)]] : table[this.far[i]];
      for (let k = 0; k < 3; k++) colors[4 * i + k] = color[k];
    }
    return colors;
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      this.#draw();
    });
  }

  #draw() {
    if (!this.renderer.resize()) return;
    this.renderer.clear(PAPER);
    for (const [name, pane] of Object.entries(this.panes)) {
      this.renderer.pane(this.#placeOf(pane), this.camera);
      this.#drawBody(name === "target" ? this.target : this.solid);
      if (name === "result" && this.show.cutters) this.#drawShapes(this.#cutters(), CUTTER, 0.14, 0.38);
      if (this.picked.size) this.#drawShapes([...this.picked], PICKED, 0.22, 0.3);
    }
    document.documentElement.dataset.drawn = "yes";
  }

  #drawBody({ body, lines }) {
    this.renderer.draw(body, { pointSize: this.pointSize, lit: lines !== null });
    if (lines && this.show.edges) this.renderer.draw(lines, { lit: false, opacity: 0.75 });
  }

  #cutters() {
    return this.leaves.flatMap((leaf, i) => (leaf.role === "cuts" && !this.picked.has(i) ? [i] : []));
  }

  /** Whole primitives in one colour, with `hidden` and `seen` opacity. */
  #drawShapes(leaves, color, hidden, seen) {
    const shapes = leaves.map((leaf) => this.#shape(leaf, color));
    for (const { body, lines } of shapes) {
      this.renderer.draw(body, { behind: true, through: true, opacity: hidden });
      this.renderer.draw(lines, { behind: true, through: true, lit: false, opacity: 0.35 });
    }
    for (const { body, lines } of shapes) {
      this.renderer.draw(body, { through: true, opacity: seen });
      this.renderer.draw(lines, { through: true, lit: false, opacity: 0.9 });
    }
  }

  #shape(leaf, color) {
    const key = `${leaf} ${color}`;
    if (!this.shapes.has(key)) {
      const { gl } = this.renderer;
      const mesh = leafMesh(this.leaves[leaf], this.box, this.leaves.length > 200 ? 24 : 64);
      const dark = [...color.slice(0, 3).map((c) => 0.55 * c), 255];
      const body = this.renderer.body(gl.TRIANGLES, mesh.positions, mesh.normals, color);
      this.shapes.set(key, { body, lines: this.renderer.body(gl.LINES, mesh.lines, null, dark) });
    }
    return this.shapes.get(key);
  }

  #placeOf(pane) {
    const [own, canvas] = [pane.getBoundingClientRect(), this.canvas.getBoundingClientRect()];
    return { left: own.left - canvas.left, top: own.top - canvas.top, width: own.width, height: own.height };
  }

  /** What lies under a place of the window: the pane's name and the ray into it; null between panes. */
  #under(x, y) {
    for (const [name, pane] of Object.entries(this.panes)) {
      const box = pane.getBoundingClientRect();
      const [u, v] = [(2 * (x - box.left)) / box.width - 1, 1 - (2 * (y - box.top)) / box.height];
      if (Math.abs(u) <= 1 && Math.abs(v) <= 1) return { name, along: this.camera.ray(u, v, box.width / box.height) };
    }
    return null;
  }

  /** A click: the leaf under it in the result, the distance under it in the target. */
  click(x, y) {
    const under = this.#under(x, y);
    const surface = under && (under.name === "target" ? this.target : this.solid);
    if (!surface || !surface.positions) return;
    const hit = firstHit(surface.positions, this.camera.eye(), under.along);
    if (under.name === "result") this.onPick(hit ? this.owners[hit.face] : null);
    else this.onPoint(hit ? this.#distanceAt(hit) : null);
  }

  #distanceAt({ face, shares }) {
    return (shares.reduce((sum, share, c) => sum + share * this.far[3 * face + c], 0) / 255) * this.top;
  }
}
