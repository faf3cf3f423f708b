// Vectors of three numbers, and 4 x 4 matrices as WebGL takes them: column after column.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const unit = (a) => scale(a, 1 / (norm(a) || 1));

/** The view of a pinhole at `eye`; `axes` are right, up and towards the eye, `slope` the tangent of half the opening of the shorter side. */
function projection(eye, axes, slope, aspect, near, far) {
  const [right, up, back] = axes;
  const x = 1 / (slope * Math.max(aspect, 1));
  const y = x * aspect;
  const a = (near + far) / (near - far);
  const b = (2 * near * far) / (near - far);
  const shift = [-dot(right, eye), -dot(up, eye), -dot(back, eye)];
  const column = (i) => [x * right[i], y * up[i], a * back[i], -back[i]];
  return new Float32Array([...column(0), ...column(1), ...column(2), x * shift[0], y * shift[1], a * shift[2] + b, -shift[2]]);
}
