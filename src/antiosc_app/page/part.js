// The part of the report: its points, its motion and stress from a few fields, the striker.

const ENLARGED = 0.08, FRAMES = 60, CLOSE_FRAMES = 42; // largest drawn displacement over the part's size; pictures of a run; those of its first part
const USUAL_QUANTILE = 0.995, SPIKE_RATIO = 1.5; // the colours end at this quantile of the points if the largest value exceeds it by this factor
const STRIKER_COVER = 0.15; // opacity of the striker, so that colours of the part behind it are seen
const LARGE_STRIKER = 0.25; // radius over half the part's size, from which the striker is transparent at rest, too
const ARROW_LENGTH = 0.5; // length of the arrow over half the size of the part
const MOST_DISTANCE = 1; // largest drawn distance of the striker from the part over half the part's size
const PLAIN = -1, DARK = -2, LINE = -2.4, BALL = -3, MARK = -4, FLOOR = -5, DOUBTFUL = -6; // colours of view.js
const NAMES = { motion: ["displacement", "m"], stress: ["von Mises stress", "Pa"] };

class Part {
  // place: point, direction and radius of the striker; awaited: whether results are still to come.
  constructor(data, blow, view, place, awaited = false) {
    Object.assign(this, { data, blow, view, place, awaited, count: data.points.length / 3 });
    this.rest = Float32Array.from(data.points, (x, i) => data.middle[i % 3] + x * data.half / 32767);
    this.fields = { motion: data.motion && [data.motion], stress: data.stress };
    this.shades = held_shades(data.held || new Uint8Array(this.count), data.faces);
    this.outside = place && outward(this.rest, data.faces, place.point, place.direction);
  }

  // Store the states of a run: CLOSE_FRAMES of them until the time `until` [s], others to the `end`.
  follow(engine, hit, until, end) {
    const data = this.data, close = until < end ? CLOSE_FRAMES : FRAMES, rest = (k) => (k - close) * (end - until) / (FRAMES - close);
    this.times = [...Array(FRAMES + 1).keys()].map((k) => (k > close ? until + rest(k) : k * until / close));
    const body = this.blow.body.omega.length;
    this.states = this.times.map((t) => {
      const { q, force } = engine.state(hit, t);
      let way = 0;
      for (let j = body; j < q.length; j++) way += hit.posed.beta[j] * q[j];
      const own = q.slice(0, body);
      return { x: [...own, force, ...pairs(this.blow.body.stretch, own)], way };
    });
    [this.largest, this.usual] = [{}, {}];
    if (data.motion) this.factor = Number((ENLARGED * 2 * data.half / (this.most("motion") || 1)).toPrecision(1));
  }

  // The largest value of a kind ("motion", "stress") in a run; sets also the usual largest value.
  most(kind) {
    if (!(kind in this.largest)) {
      const most = new Float32Array(this.count);
      this.states.forEach(({ x }) => this.sizes(kind, x).forEach((size, p) => { most[p] = Math.max(most[p], size); }));
      most.sort();
      [this.largest[kind], this.usual[kind]] = [most[this.count - 1], most[Math.floor(USUAL_QUANTILE * (this.count - 1))]];
    }
    return this.largest[kind];
  }

  // The largest displacement of the site along the impact, its patch left out: antiosc_app.live.site_motion.
  moved_at_site({ b, r }) {
    const moved = ({ x }) => Math.abs(b.reduce((sum, share, j) => sum + share * x[j], r * x[b.length]));
    return Math.max(...this.states.map(moved));
  }

  // Number of the frame with the largest value of a kind.
  peak(kind) {
    const sizes = this.states.map(({ x }) => this.sizes(kind, x).reduce((a, b) => Math.max(a, b), 0));
    return sizes.indexOf(Math.max(...sizes));
  }

  // The largest value of a kind: the drawn one, or a larger one known between points and times.
  largest_of(kind) { return Math.max(this.most(kind), this.known && this.known[kind] || 0); }

  // The end of the scale of colours: the largest value, or without its few peaks the usual largest.
  top(kind) {
    const largest = this.largest_of(kind), usual = this.usual[kind];
    return usual > 0 && largest > SPIKE_RATIO * usual ? usual : largest;
  }

  // Components of a field at all points for the coordinates x.
  field({ fields, scale, factors }, x) {
    const size = fields.length / scale.length, sum = new Float32Array(size), n = x.length;
    for (let k = 0; k < scale.length; k++) {
      let a = 0;
      for (let j = 0; j < n; j++) a += factors[k * n + j] * x[j];
      a *= scale[k];
      for (let i = 0, at = k * size; i < size; i++) sum[i] += a * fields[at + i];
    }
    return sum;
  }

  sizes(kind, x) {
    const sizes = new Float32Array(this.count);
    for (const one of this.fields[kind]) {
      const f = this.field(one, x);
      for (let p = 0; p < this.count; p++) {
        const size = kind === "motion" ? Math.hypot(f[3 * p], f[3 * p + 1], f[3 * p + 2]) : mises(f, 6 * p);
        sizes[p] = Math.max(sizes[p], size);
      }
    }
    return sizes;
  }

  // Draw the part at rest (kind ""), or deformed and coloured by a kind of values at a frame.
  show(kind, frame) {
    const { data, rest, place } = this, values = new Float32Array(this.count);
    let at = rest, way = [0, 0, 0];
    values.set(this.shades);
    if (kind && this.states) {
      const { x, way: moved } = this.states[frame], sizes = this.sizes(kind, x), top = this.top(kind) || 1;
      const u = this.field(data.motion, x);
      at = rest.map((r, i) => r + this.factor * u[i]);
      sizes.forEach((size, p) => { values[p] = size / top; });
      if (place) way = this.touching(u, moved);
    }
    this.view.put("part", at, values, data.faces);
    if (place) this.striker(way, !kind);
    this.view.draw();
  }

  // Drawn displacement of the striker: that of the surface that it touches, or less once it is off.
  // Indentation is not enlarged. u: displacements of the points; moved: that of the striker [m].
  touching(u, moved) {
    const { point, direction } = this.place, d = unit(direction);
    this.nearest ??= nearest(this.rest, point);
    const own = [0, 1, 2].map((i) => u[3 * this.nearest + i]), behind = Math.max(dot(own, d) - moved, 0);
    const off = Math.min(this.factor * behind, MOST_DISTANCE * this.data.half);
    return own.map((x, i) => this.factor * x - off * d[i]);
  }

  // Length of the chord of the resting ball along the direction of impact.
  through() { return -2 * dot(this.outside, unit(this.place.direction)) * (this.place.radius || 0); }

  striker(way, resting) {
    const { point, direction, radius } = this.place, d = unit(direction);
    const to = point.map((x, i) => x + way[i]), into = this.outside.map((x) => -x);
    const mesh = radius ? ball(to, into, radius) : { points: new Float32Array(3), faces: new Uint32Array(3) };
    this.view.put("ball", mesh.points, new Float32Array(mesh.points.length / 3).fill(BALL), mesh.faces, resting && radius < LARGE_STRIKER * this.data.half ? 1 : STRIKER_COVER);
    // the arrow begins behind the ball, whose surface is left along d at twice its cosine
    const tip = point.map((x, i) => x - 1.05 * this.through() * d[i]);
    const shaft = resting ? arrow(tip, d, ARROW_LENGTH * this.data.half) : { points: new Float32Array(3), faces: new Uint32Array(3) };
    this.view.put("arrow", shaft.points, new Float32Array(shaft.points.length / 3).fill(this.awaited ? BALL : MARK), shaft.faces);
  }
}

// Colour codes of points. Triangles with three held corners are dark up to their sides; at held points
// and lines, which have no such triangle, a band of the neighbouring cells is.
function held_shades(held, faces) {
  const shades = Float32Array.from(held, (one) => (one ? LINE : PLAIN));
  for (let k = 0; k < faces.length; k += 3) {
    const corners = faces.slice(k, k + 3);
    if (corners.every((p) => held[p])) for (const p of corners) shades[p] = DARK;
  }
  return shades;
}

// Outward normal of the surface at its crossing, nearest to the point, with the line of impact.
function outward(points, faces, point, direction) {
  const d = unit(direction), found = crossings(points, faces, point, d);
  if (!found.length) return d.map((x) => -x);
  const { normal } = found.reduce((a, b) => (Math.abs(b.at) < Math.abs(a.at) ? b : a));
  return dot(normal, d) > 0 ? normal.map((x) => -x) : normal;
}

function nearest(points, point) {
  let best = 0, least = Infinity;
  for (let k = 0; k < points.length; k += 3) {
    const far = Math.hypot(points[k] - point[0], points[k + 1] - point[1], points[k + 2] - point[2]);
    if (far < least) [best, least] = [k / 3, far];
  }
  return best;
}

function mises(s, i) {
  const [a, b, c] = [s[i], s[i + 1], s[i + 2]], shear = s[i + 3] ** 2 + s[i + 4] ** 2 + s[i + 5] ** 2;
  return Math.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3 * shear);
}
