// The C library in WebAssembly: an impact of two bodies, as antiosc.impact.two_bodies computes it.

// csrc/antiosc_march.h; antiosc.engine.contact.base.TAKEN
const LINEAR = 0, HERTZ = 2, ELASTIC_PLASTIC = 6, TAKEN = 0.7;
const NUMBERS = ["answer", "peak_force", "impulse", "contact_time", "restitution", "contacts",
  "touching", "first", "last", "force_error", "peak_error", "lasting", "n_nodes", "time", "force",
  "depth", "reach", "deepest", "dent", "work"]; // `found` of csrc/page/engine.c
const MOST_STEPS = 200000;

class Engine {
  static async load(bytes) {
    const { instance } = await WebAssembly.instantiate(bytes, { env: Math });
    return new Engine(instance.exports);
  }

  constructor(wasm) { this.wasm = wasm; }

  // views are made anew at each use: the memory may have grown
  view(at, count) { return new Float64Array(this.wasm.memory.buffer, at, count); }

  given(values) {
    const at = this.wasm.page_take(8 * values.length);
    this.view(at, values.length).set(values);
    return at;
  }

  // The numbers of an impact, and its time (n) [s] and force (n) [N]. The last one is kept: the steps
  // of an answer (bars, motion, stress) ask for the same impact, and one took 8 s.
  strike(posed, duration, tol) {
    const asked = JSON.stringify([posed, duration, tol], (_, x) => (ArrayBuffer.isView(x) ? [...x] : x));
    if (asked !== this.asked) [this.asked, this.last] = [asked, this.march(posed, duration, tol)];
    return { ...this.last };
  }

  march(posed, duration, tol) {
    const wasm = this.wasm, n = posed.omega.length, m = posed.beta.length / n;
    wasm.page_clear();
    const arrays = ["omega", "decay", "beta", "load", "v"].map((name) => this.given(posed[name]));
    const at = wasm.page_strike(n, ...arrays, posed.residual, posed.gap, posed.kind,
      posed.params.length, this.given(posed.params), posed.mobility, duration, tol, MOST_STEPS,
      m - 1, this.given(posed.quadratic), this.given(posed.cubic));
    const read = this.view(at, NUMBERS.length), hit = { posed, duration, modes: n };
    NUMBERS.forEach((name, i) => { hit[name] = read[i]; });
    hit.time = this.view(hit.time, hit.n_nodes).slice();
    hit.force = this.view(hit.force, m * hit.n_nodes).filter((_, i) => i % m === 0);
    this.out = wasm.page_take(8 * 2 * (n + m));
    return hit;
  }

  // Modal displacements q and contact force [N] of the last impact at the time t [s].
  state(hit, t) {
    this.wasm.page_state(t, this.out);
    const read = this.view(this.out, 2 * hit.modes + 1);
    return { q: read.slice(0, hit.modes), force: read[2 * hit.modes] };
  }
}

// A system for the engine: the free modes of the struck body beside those of the striker.
// body: omega, decay, b, load, v, r, mobility, a law of its own or none, stretch or none; blow: striker (as a body), law, gap, mass, speed;
// set: mass, speed, stiffness, gap, damping.
function pose(body, blow, set) {
  const striker = blow.striker, faster = blow.speed ? set.speed / blow.speed : 1;
  const heavier = blow.mass ? Math.sqrt(set.mass / blow.mass) : 1;
  const both = (name, change) => Float64Array.from([...body[name], ...striker[name].map(change)]);
  const same = (x) => x, omega = both("omega", same), law = body.law || blow.law;
  const k = set.stiffness === null ? null : set.stiffness * (law.params[0] / blow.law.params[0]);
  const decay = both("decay", same), n = omega.length, own = body.omega.length;
  const stretch = body.stretch || { rows: [], modes: [], quadratic: [], cubic: [] };
  const beta = new Float64Array(n * (1 + stretch.rows.length / own)); // the striker does not stretch
  beta.set(both("b", (x) => x / heavier).map((x) => -x));
  stretch.rows.forEach((x, i) => { beta[n * (1 + Math.floor(i / own)) + i % own] = x; });
  for (let j = 0; j < body.omega.length; j++) {
    decay[j] = blow.ratio === null ? decay[j] + set.damping * omega[j] : set.damping * omega[j];
  }
  return {
    omega, decay, beta, gap: set.gap, quadratic: stretch.quadratic, cubic: stretch.cubic,
    load: both("load", (x) => x * heavier),
    v: both("v", (x) => x * heavier).map((x) => x * faster),
    residual: body.r + striker.r,
    mobility: body.mobility + striker.mobility / heavier ** 2,
    kind: law.kind, params: parameters(law, body.local, k),
  };
}

// The amplitudes of second-order displacements: products of the amplitudes of two stretching modes.
function pairs(stretch, q) {
  if (!stretch) return [];
  const n = q.length, a = [];
  for (let at = 0; at < stretch.modes.length; at += n) {
    a.push(q.reduce((sum, x, j) => sum + x * stretch.modes[at + j], 0));
  }
  return a.flatMap((x, i) => a.slice(i).map((y, k) => (k ? 2 : 1) * x * y));
}

// The parameters of a law with the stiffness k (null: its own), less the local compliance c [m/N] of the
// body's modes. For a sphere that yields, another stiffness means another modulus.
function parameters(law, c, k) {
  const old = law.params;
  if (k === null) return [...old.slice(0, -1), c];
  if (law.kind === LINEAR) return [k, c * k > TAKEN ? 0 : c];
  if (law.kind === ELASTIC_PLASTIC) return [k, old[1] * (old[0] / k) ** 2, old[2], k ** (-2 / 3), c];
  if (law.kind !== HERTZ) return [k, ...old.slice(1, -1), c];
  const a = k ** (-2 / 3), end = c > 0 ? TAKEN * 2 * a / (3 * c) : Infinity;
  return [k, c, a, end, c > 0 ? 2 / 3 * a / end - c : 0];
}
