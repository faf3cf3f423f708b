// WebGL: buffers, two programs, and the few ways in which surfaces, lines and points are drawn.

const SURFACE_VERTEX = `#version 300 es
uniform mat4 projection;
uniform float pointSize;
in vec3 position;
in vec3 normal;
in vec4 color;
out vec3 facing;
out vec4 tint;
out float away;
void main() {
  gl_Position = projection * vec4(position, 1.0);
  away = gl_Position.w;
  gl_PointSize = pointSize;
  facing = normal;
  tint = color;
}`;

const SURFACE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 right, up, back;
uniform float lit, round, opacity, reach;
in vec3 facing;
in vec4 tint;
in float away;
out vec4 outColor;
void main() {
  if (round > 0.5 && length(gl_PointCoord - 0.5) > 0.5) discard;
  vec3 n = length(facing) > 0.0 ? normalize(facing) : back;
  n *= dot(n, back) < 0.0 ? -1.0 : 1.0;
  float key = max(dot(n, normalize(0.6 * back + 0.9 * up - 0.5 * right)), 0.0);
  float fill = max(dot(n, normalize(back - 0.2 * up + 0.7 * right)), 0.0);
  float light = mix(1.0, 0.42 + 0.44 * key + 0.3 * fill, lit);
  // points have no normals: what is nearer is brighter
  if (round > 0.5) light = clamp(0.8 - 0.7 * (away - reach), 0.45, 1.0);
  outColor = vec4(tint.rgb * light, tint.a * opacity);
}`;

class Renderer {
  /** Throws where the browser has no WebGL 2. */
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: false });
    if (!this.gl) throw new Error("no WebGL 2");
    this.canvas = canvas;
    const gl = this.gl;
    this.program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, SURFACE_VERTEX], [gl.FRAGMENT_SHADER, SURFACE_FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
    gl.useProgram(this.program);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Buffers of `positions`, with `normals` or none; `colors` are four bytes a corner, or one colour [r, g, b, a] for all. */
  body(mode, positions, normals, colors) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const body = { array, mode, count: positions.length / 3, colors: null, flat: null };
    this.#attribute("position", positions, 3, gl.FLOAT, false);
    if (normals) this.#attribute("normal", normals, 3, gl.FLOAT, false);
    if (colors.length === 4) body.flat = colors.map((c) => c / 255);
    else body.colors = this.#attribute("color", colors, 4, gl.UNSIGNED_BYTE, true);
    return body;
  }

  recolor(body, colors) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, body.colors);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, colors);
  }

  remove(body) {
    this.gl.deleteVertexArray(body.array);
  }

  #attribute(name, values, size, type, normalized) {
    const gl = this.gl;
    const place = gl.getAttribLocation(this.program, name);
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, normalized, 0, 0);
    return buffer;
  }

  /** Fit the canvas to its box on the page; true if it has an area. */
  resize() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((side) => Math.round(side * ratio));
    if (this.canvas.width !== width || this.canvas.height !== height) Object.assign(this.canvas, { width, height });
    this.ratio = ratio;
    return width > 0 && height > 0;
  }

  clear([r, g, b]) {
    const gl = this.gl;
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(r / 255, g / 255, b / 255, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  /** Draw into the box {left, top, width, height} of the canvas, in CSS pixels, from a camera. */
  pane(box, camera) {
    const gl = this.gl;
    const at = [box.left, this.canvas.clientHeight - box.top - box.height, box.width, box.height].map((v) => Math.round(v * this.ratio));
    gl.viewport(...at);
    gl.scissor(...at);
    gl.enable(gl.SCISSOR_TEST);
    gl.uniformMatrix4fv(this.#at("projection"), false, camera.matrix(box.width / box.height));
    gl.uniform1f(this.#at("reach"), camera.distance);
    ["right", "up", "back"].forEach((name, i) => gl.uniform3fv(this.#at(name), camera.axes()[i]));
  }

  /** `how`: lit, opacity, pointSize in CSS pixels, behind (only what other surfaces hide), and `through` (writes no depth). */
  draw(body, how = {}) {
    const gl = this.gl;
    const { lit = true, opacity = 1, pointSize = 1, behind = false, through = false } = how;
    gl.bindVertexArray(body.array);
    if (body.flat) gl.vertexAttrib4fv(gl.getAttribLocation(this.program, "color"), body.flat);
    gl.uniform1f(this.#at("lit"), lit ? 1 : 0);
    gl.uniform1f(this.#at("opacity"), opacity);
    gl.uniform1f(this.#at("pointSize"), pointSize * this.ratio);
    gl.uniform1f(this.#at("round"), body.mode === gl.POINTS ? 1 : 0);
    gl.depthFunc(behind ? gl.GREATER : gl.LEQUAL);
    gl.depthMask(!through);
    this.#switch(gl.BLEND, through || opacity < 1);
    this.#switch(gl.POLYGON_OFFSET_FILL, body.mode === gl.TRIANGLES && !through);
    gl.polygonOffset(1, 1);
    gl.drawArrays(body.mode, 0, body.count);
    gl.depthMask(true);
  }

  #switch(what, on) {
    if (on) this.gl.enable(what);
    else this.gl.disable(what);
  }

  #at(name) {
    return this.gl.getUniformLocation(this.program, name);
  }
}
