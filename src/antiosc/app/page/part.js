// The part of the report: its points, its motion and stress from a few fields, the striker.

const ENLARGED = 0.08, FRAMES = 60; // of the size of the part; of a run
const PLAIN = -1, DARK = -2, BALL = -3, MARK = -4; // colours of view.js
const NAMES = { motion: ["displacement", "m"], stress: ["von Mises stress", "Pa"] };

class Part {
  constructor(data, blow, view, place) {
    Object.assign(this, { data, blow, view, place, count: data.points.length / 3 });
    this.rest = Float32Array.from(data.points, (x, i) => data.middle[i % 3] + x * data.half / 32767);
    this.fields = { motion: data.motion && [data.motion], stress: data.stress };
    view.centre = data.middle;
    view.reach = data.half * 1.25;
    if (place && place.radius) view.reach = Math.max(view.reach, 1.2 * place.radius);
  }

  // What a run looked like at even times; the largest values of a kind in it.
  follow(engine, hit, until) {
    const data = this.data;
    this.times = [...Array(FRAMES + 1).keys()].map((k) => k * until / FRAMES);
    const body = this.blow.body.omega.length;
    this.states = this.times.map((t) => {
      const { q, force } = engine.state(hit, t);
      let way = 0;
      for (let j = body; j < q.length; j++) way += hit.posed.beta[j] * q[j];
      return { x: [...q.slice(0, body), force], way };
    });
    this.largest = {};
    // the magnification is that of the first impact, so that others are seen as larger or smaller
    if (data.motion) this.factor ??= Number((ENLARGED * 2 * data.half / (this.most("motion") || 1)).toPrecision(1));
  }

  most(kind) {
    if (!(kind in this.largest)) {
      const every = this.states.filter((_, k) => k % 3 === 0);
      this.largest[kind] = Math.max(...every.map(({ x }) => this.sizes(kind, x).reduce((a, b) => Math.max(a, b), 0)));
    }
    return this.largest[kind];
  }

  // A field at one state: components of all points.
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

  // Draw the set-up (kind ""), or a kind of values at a frame.
  show(kind, frame) {
    const { data, rest, place } = this, values = new Float32Array(this.count);
    let at = rest, way = 0;
    if (kind && this.states) {
      const { x, way: moved } = this.states[frame], sizes = this.sizes(kind, x), most = this.most(kind) || 1;
      const u = this.field(data.motion, x);
      at = rest.map((r, i) => r + this.factor * u[i]);
      sizes.forEach((size, p) => { values[p] = size / most; });
      way = this.factor * moved;
    } else values.forEach((_, p) => { values[p] = data.held && data.held[p] ? DARK : PLAIN; });
    this.view.put("part", at, values, data.faces);
    if (place) this.striker(way, !kind);
    this.view.draw();
  }

  striker(way, resting) {
    const { point, direction, radius } = this.place, d = unit(direction);
    const to = point.map((x, i) => x + way * d[i]);
    const mesh = radius ? ball(to, d, radius) : { points: new Float32Array(3), faces: new Uint32Array(3) };
    this.view.put("ball", mesh.points, new Float32Array(mesh.points.length / 3).fill(BALL), mesh.faces);
    const length = 0.5 * this.data.half, tail = point.map((x, i) => x - (2.1 * (radius || 0)) * d[i]);
    const shaft = resting ? arrow(tail, d, length) : { points: new Float32Array(3), faces: new Uint32Array(3) };
    this.view.put("arrow", shaft.points, new Float32Array(shaft.points.length / 3).fill(MARK), shaft.faces);
  }
}

function mises(s, i) {
  const [a, b, c] = [s[i], s[i + 1], s[i + 2]], shear = s[i + 3] ** 2 + s[i + 4] ** 2 + s[i + 5] ** 2;
  return Math.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) + 3 * shear);
}
