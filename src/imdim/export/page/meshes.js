// Triangle meshes, from packed values to what is drawn: corners with normals that break at creases, and the creases as lines.

const CREASE = Math.cos((28 * Math.PI) / 180);

function bytesOf(text) {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
  return out;
}

/** Points in the frame of the page: the box's centre is the origin, its diagonal is 1. */
function pointsOf(text, box) {
  const steps = new Uint16Array(bytesOf(text).buffer);
  const out = new Float32Array(steps.length);
  for (let i = 0; i < steps.length; i++) {
    const side = box.high[i % 3] - box.low[i % 3];
    out[i] = ((steps[i] / 65535 - 0.5) * side) / box.diagonal;
  }
  return out;
}

function facesOf(text, vertices) {
  const bytes = bytesOf(text).buffer;
  return vertices <= 65535 ? new Uint16Array(bytes) : new Uint32Array(bytes);
}

/** The corners of all faces one after another: `positions` and `normals` [9 a face], `lines` [6 a crease]. */
function drawable(points, faces) {
  const flat = faceNormals(points, faces);
  const positions = new Float32Array(3 * faces.length);
  for (let i = 0; i < positions.length; i++) positions[i] = points[3 * faces[Math.floor(i / 3)] + (i % 3)];
  return { positions, normals: cornerNormals(faces, flat, points.length / 3), lines: creases(points, faces, flat) };
}

/** Unit normals of faces, and `weights`, their areas: no area, no say in what a corner's normal is. */
function faceNormals(points, faces) {
  const count = faces.length / 3;
  const normals = new Float32Array(faces.length);
  const weights = new Float32Array(count);
  for (let f = 0; f < count; f++) {
    // no arrays in here: there are many faces
    const a = 3 * faces[3 * f];
    const b = 3 * faces[3 * f + 1];
    const c = 3 * faces[3 * f + 2];
    const ux = points[b] - points[a];
    const uy = points[b + 1] - points[a + 1];
    const uz = points[b + 2] - points[a + 2];
    const vx = points[c] - points[a];
    const vy = points[c + 1] - points[a + 1];
    const vz = points[c + 2] - points[a + 2];
    const x = uy * vz - uz * vy;
    const y = uz * vx - ux * vz;
    const z = ux * vy - uy * vx;
    const area = Math.sqrt(x * x + y * y + z * z);
    weights[f] = area;
    normals[3 * f] = x / (area || 1);
    normals[3 * f + 1] = y / (area || 1);
    normals[3 * f + 2] = z / (area || 1);
  }
  return { normals, weights };
}

/** For each corner the mean normal of the faces around its vertex that are not beyond a crease. */
function cornerNormals(faces, flat, vertices) {
  const start = new Uint32Array(vertices + 1);
  for (const v of faces) start[v + 1]++;
  for (let v = 0; v < vertices; v++) start[v + 1] += start[v];
  const around = new Uint32Array(faces.length);
  const next = start.slice();
  for (let i = 0; i < faces.length; i++) around[next[faces[i]]++] = Math.floor(i / 3);
  const out = new Float32Array(3 * faces.length);
  const n = flat.normals;
  for (let i = 0; i < faces.length; i++) {
    const own = 3 * Math.floor(i / 3);
    let x = 0;
    let y = 0;
    let z = 0;
    for (let j = start[faces[i]]; j < start[faces[i] + 1]; j++) {
      const f = 3 * around[j];
      if (n[own] * n[f] + n[own + 1] * n[f + 1] + n[own + 2] * n[f + 2] < CREASE) continue;
      const weight = flat.weights[around[j]];
      x += weight * n[f];
      y += weight * n[f + 1];
      z += weight * n[f + 2];
    }
    const length = Math.sqrt(x * x + y * y + z * z);
    out[3 * i] = length > 0 ? x / length : n[own];
    out[3 * i + 1] = length > 0 ? y / length : n[own + 1];
    out[3 * i + 2] = length > 0 ? z / length : n[own + 2];
  }
  return out;
}

/** Lines along edges whose two faces turn by more than the crease; slivers, whose normals are noise, draw none. */
function creases(points, faces, flat) {
  const waiting = new Map();
  const out = [];
  const vertices = points.length / 3;
  const n = flat.normals;
  for (let i = 0; i < faces.length; i++) {
    const f = Math.floor(i / 3);
    const a = faces[i];
    const b = faces[i % 3 === 2 ? i - 2 : i + 1];
    const key = Math.min(a, b) * vertices + Math.max(a, b);
    const other = waiting.get(key);
    if (other === undefined) {
      waiting.set(key, f);
      continue;
    }
    waiting.delete(key);
    if (Math.min(flat.weights[f], flat.weights[other]) < 1e-9) continue;
    const turned = n[3 * f] * n[3 * other] + n[3 * f + 1] * n[3 * other + 1] + n[3 * f + 2] * n[3 * other + 2];
    if (turned < CREASE) out.push(...points.subarray(3 * a, 3 * a + 3), ...points.subarray(3 * b, 3 * b + 3));
  }
  return new Float32Array(out);
}

/** The first triangle that a ray meets: its number, the distance along the ray, and the shares of its corners; null if none. */
function firstHit(positions, from, along) {
  let best = null;
  for (let f = 0; f < positions.length / 9; f++) {
    const p = positions.subarray(9 * f, 9 * f + 9);
    const e1 = [p[3] - p[0], p[4] - p[1], p[5] - p[2]];
    const e2 = [p[6] - p[0], p[7] - p[1], p[8] - p[2]];
    const h = cross(along, e2);
    const det = dot(e1, h);
    if (Math.abs(det) < 1e-14) continue;
    const s = [from[0] - p[0], from[1] - p[1], from[2] - p[2]];
    const u = dot(s, h) / det;
    if (u < 0 || u > 1) continue;
    const q = cross(s, e1);
    const v = dot(along, q) / det;
    if (v < 0 || u + v > 1) continue;
    const t = dot(e2, q) / det;
    if (t > 0 && (best === null || t < best.t)) best = { face: f, t, shares: [1 - u - v, u, v] };
  }
  return best;
}
