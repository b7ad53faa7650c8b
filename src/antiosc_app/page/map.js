// The sites of a map, each with its own model: all are struck for the colours, one at a click.

const LOGARITHMIC_RATIO = 20; // largest over least value from which a scale is logarithmic

class Sites {
  constructor(data, view) {
    Object.assign(this, { data, view, count: data.start.length - 1, values: {} });
    const { skin } = data;
    this.size = skin ? 2 * skin.half : Math.max(...[0, 1, 2].map((i) => spread(data.points, i))) || 1;
    if (skin) {
      const at = Float32Array.from(skin.points, (x, i) => skin.middle[i % 3] + x * skin.half / 32767);
      view.put("skin", at, new Float32Array(at.length / 3).fill(PLAIN), skin.faces);
    }
  }

  body(i) {
    const { data } = this, part = (name) => Array.from(data[name].subarray(data.start[i], data.start[i + 1]));
    const omega = part("omega"), none = omega.map(() => 0);
    const kind = data.laws && data.laws.kind, size = data.laws ? data.laws.size : 0;
    const law = size ? { kind, params: Array.from(data.laws.params.subarray(size * i, size * (i + 1))) } : null;
    return { omega, b: part("b"), decay: none, v: none, load: none, r: data.r[i], mobility: data.mobility[i], local: data.local[i], law };
  }

  // Strike every site with the sliders' values `set`; null shows the computed case of the data.
  strike(engine, set, blow) {
    if (!set) return void (this.values = {});
    const force = new Float64Array(this.count), time = new Float64Array(this.count);
    for (let i = 0; i < this.count; i++) {
      const hit = engine.strike(pose(this.body(i), blow, set), blow.duration, blow.coarse);
      [force[i], time[i]] = [hit.peak_force, hit.contact_time];
    }
    this.values = { peak_force: force, contact_time: time };
  }

  quantity(kind) { return this.values[kind] || this.data.quantities[kind]; }

  // Whether all sites are doubtful; they are then coloured and not hatched.
  all_doubtful() { return this.data.doubtful.every(Boolean); }

  // For each site whether it is hatched.
  hatched() { return this.all_doubtful() ? this.data.doubtful.map(() => false) : this.data.doubtful; }

  // Whether a site that is not hatched has no value, as without a computed stress.
  lacks(kind) {
    const hatched = this.hatched();
    return Boolean(kind) && Array.from(this.quantity(kind)).some((v, i) => !hatched[i] && !Number.isFinite(v));
  }

  range(kind) {
    const hatched = this.hatched(), known = Array.from(this.quantity(kind)).filter((v, i) => Number.isFinite(v) && !hatched[i]);
    if (!known.length) return [0, 0];
    return [Math.min(...known), Math.max(...known)];
  }

  // Whether colours follow the logarithm: on a linear scale most values would have one colour.
  logarithmic(kind) {
    const [low, high] = this.range(kind);
    return low > 0 && high > LOGARITHMIC_RATIO * low;
  }

  show(kind, chosen) {
    const { data, view } = this, hatched = this.hatched(), values = this.quantity(kind), scale = this.logarithmic(kind) ? Math.log : Number;
    const [low, high] = this.range(kind).map((end) => scale(end));
    const shade = Float32Array.from(values, (v, i) => (hatched[i] ? DOUBTFUL : Number.isFinite(v) ? (scale(v) - low) / (high - low || 1) : PLAIN));
    if (data.faces.length) this.surface(shade);
    const dots = { points: [], faces: [], values: [] };
    this.bare(shade).forEach((i) => add(dots, ball(before(this.at(i), this.along(i), -0.012 * this.size), this.along(i), 0.012 * this.size), shade[i]));
    const d = this.along(chosen);
    add(dots, ball(before(this.at(chosen), d, 0.012 * this.size), d, 0.012 * this.size), MARK);
    add(dots, arrow(before(this.at(chosen), d, 0.024 * this.size), d, 0.18 * this.size), MARK);
    view.put("dots", Float32Array.from(dots.points), Float32Array.from(dots.values), Uint32Array.from(dots.faces));
    view.draw();
  }

  // The sites drawn as dots: those of no triangle, and those whose colour no triangle shows.
  bare(shade) {
    const { faces, alone } = this.data, shown = new Set(), single = new Set(alone);
    for (let f = 0; f < faces.length; f += 3) {
      const own = faces.subarray(f, f + 3);
      if (own.every((i) => shade[i] >= 0)) own.forEach((i) => shown.add(i));
    }
    return [...shade.keys()].filter((i) => single.has(i) || shade[i] >= 0 && !shown.has(i));
  }

  // Draw the triangles between sites; one is hatched if any of its sites is.
  surface(shade) {
    const { faces, points } = this.data, values = new Float32Array(faces.length);
    this.corners ??= Float32Array.from({ length: 3 * faces.length }, (_, i) => points[3 * faces[Math.floor(i / 3)] + i % 3]);
    for (let f = 0; f < faces.length; f += 3) {
      const own = [0, 1, 2].map((k) => shade[faces[f + k]]), least = Math.min(...own);
      own.forEach((value, k) => { values[f + k] = least < 0 ? least : value; });
    }
    this.view.put("part", this.corners, values, Uint32Array.from(faces.keys()));
  }

  at(i) { return Array.from(this.data.points.subarray(3 * i, 3 * i + 3)); }

  along(i) { return Array.from(this.data.directions.subarray(3 * i, 3 * i + 3)); }

  // Number of the site at the pixel (x, y), one that faces the viewer if possible; -1 if none is near.
  near(x, y) {
    const out = this.view.axes()[2];
    let best = -1, least = 30;
    for (let i = 0; i < this.count; i++) {
      const [a, b, depth] = this.view.seen(this.at(i)), hidden = dot(this.along(i), out) > 0.05 ? 15 : 0;
      const far = Math.hypot(a - x, b - y) + hidden - 20 * depth;
      if (far < least && Math.hypot(a - x, b - y) < 30) [best, least] = [i, far];
    }
    return best;
  }
}

const before = (point, d, way) => point.map((x, i) => x - way * d[i]);
const every = (points, i) => Array.from(points).filter((_, k) => k % 3 === i);
const spread = (points, i) => Math.max(...every(points, i)) - Math.min(...every(points, i));

function add(to, mesh, value) {
  const first = to.points.length / 3;
  to.points.push(...mesh.points);
  to.faces.push(...mesh.faces.map((f) => f + first));
  to.values.push(...Array(mesh.points.length / 3).fill(value));
}
