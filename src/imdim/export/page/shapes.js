// Primitives as meshes: each is a grid of points that is placed by its matrix and centre; outlined ones bring their own surface.

const CLOSED_BOX = [0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4, 2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5];

/** Local points and faces of a primitive with `n` edges per circle. */
function shapeOf(kind, size, n) {
  const shapes = {
    box: ([x, y, z]) => ({ points: corners(x / 2, y / 2, z / 2), faces: CLOSED_BOX }),
    sphere: ([r]) => turned(arc(n, r, r), n),
    ellipsoid: ([x, y, z]) => stretched(turned(arc(n, 1, 1), n), [x, y, z]),
    cylinder: ([r, h]) => turned([[0, -h / 2], [r, -h / 2], [r, h / 2], [0, h / 2]], n),
    cone: ([a, b, h]) => turned([[0, -h / 2], [a, -h / 2], [b, h / 2], [0, h / 2]], n),
    torus: ([major, minor]) => turned(tube(n, major, minor), n),
  };
  return shapes[kind](size);
}

function corners(x, y, z) {
  const out = [];
  for (const c of [-z, z]) for (const b of [-y, y]) for (const a of [-x, x]) out.push([a, b, c]);
  return out;
}

/** Half a circle from pole to pole, as [radius, height]. */
function arc(n, r, h) {
  const steps = Math.ceil(n / 2);
  return Array.from({ length: steps + 1 }, (_, i) => {
    const angle = (Math.PI * i) / steps;
    return [i % steps ? r * Math.sin(angle) : 0, -h * Math.cos(angle)];
  });
}

function tube(n, major, minor) {
  const steps = Math.ceil(n / 2);
  return Array.from({ length: steps + 1 }, (_, i) => {
    const angle = (2 * Math.PI * (i % steps)) / steps;
    return [major + minor * Math.cos(angle), minor * Math.sin(angle)];
  });
}

/** A line of [radius, height] turned about z; its points on the axis are shared, and so is its end where it closes. */
function turned(line, n) {
  const [first, last] = [line[0], line[line.length - 1]];
  const closed = first[0] === last[0] && first[1] === last[1];
  const points = [];
  const rings = line.slice(0, closed ? -1 : undefined).map(([r, z]) => {
    const start = points.length;
    for (let i = 0; i < (r ? n : 1); i++) points.push([r * Math.cos((2 * Math.PI * i) / n), r * Math.sin((2 * Math.PI * i) / n), z]);
    return (i) => (r ? start + (i % n) : start);
  });
  if (closed) rings.push(rings[0]);
  const faces = [];
  for (let k = 0; k + 1 < rings.length; k++) {
    for (let i = 0; i < n; i++) {
      const [a, b, c, d] = [rings[k](i), rings[k](i + 1), rings[k + 1](i), rings[k + 1](i + 1)];
      if (a !== b) faces.push(a, b, d);
      if (c !== d) faces.push(a, d, c);
    }
  }
  return { points, faces };
}

function stretched(shape, by) {
  return { ...shape, points: shape.points.map((p) => [p[0] * by[0], p[1] * by[1], p[2] * by[2]]) };
}

/** A leaf of the data as a drawable mesh in the frame of the page. */
function leafMesh(leaf, box, n) {
  const local = leaf.surface || shapeOf(leaf.kind, leaf.sizes.map((size) => size.value), n);
  const middle = scale(add(box.low, box.high), 0.5);
  const offset = sub(leaf.center.map((c) => c.value), middle);
  const m = leaf.matrix;
  const points = new Float32Array(3 * local.points.length);
  local.points.forEach((p, i) => {
    const world = [dot(m.slice(0, 3), p), dot(m.slice(3, 6), p), dot(m.slice(6, 9), p)];
    points.set(scale(add(world, offset), 1 / box.diagonal), 3 * i);
  });
  return drawable(points, local.faces);
}
