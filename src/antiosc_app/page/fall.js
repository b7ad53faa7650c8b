// The page of a fall: the part on its path, and its impacts, each of which can be chosen.

const VIEWS = [["near", "the part"], ["whole", "the whole fall"]];
const SHOCK = "CFC1000"; // filter of the acceleration of the centre of mass
const PATH_RADIUS = 0.008, DOT_RADIUS = 0.04; // radii of the path and of an impact over half of what is framed

class FallPage {
  constructor(data, view) {
    Object.assign(this, { data, view, kind: "near", frame: 0, impact: 0, until: 1 });
    find("live").hidden = false;
    document.body.classList.add("live");
    document.body.classList.toggle("flat", !view);
    for (const id of ["again", "legend", "doubtful", "without"]) find(id).hidden = true;
    find("site-number").parentElement.hidden = true;
    find("sliders").replaceChildren();
    const { part, impacts } = data;
    this.rest = Float32Array.from(part.points, (x, i) => part.middle[i % 3] + x * part.half / 32767);
    this.shade = part.values || new Float32Array(this.rest.length / 3).fill(PLAIN);
    this.chart = Chart.on(find("chart"));
    if (view) {
      view.meshes.clear();
      view.picked = (x, y) => this.pick(x, y);
    }
    this.make_table();
    this.make_views();
    const peaks = impacts.map((one) => one.peak_force);
    this.choose(peaks.length ? peaks.indexOf(Math.max(...peaks)) : -1);
    document.documentElement.dataset.ready = performance.now().toFixed(0);
  }

  make_table() {
    find("heads").hidden = false;
    [find("now").textContent, find("compared").textContent] = ["peak force", "contact time"];
    Object.assign(find("third"), { hidden: false, textContent: `shock (${SHOCK})` });
    find("numbers").replaceChildren();
    this.rows = this.data.impacts.map((one, k) => {
      const row = new_element("tr", find("numbers")), head = new_element("th", row);
      for (const text of one.shown) new_element("td", row, text);
      return new_element("button", head, `impact ${k + 1}`, { type: "button", onclick: () => this.choose(k) });
    });
  }

  make_views() {
    find("kind").replaceChildren();
    for (const [kind, label] of VIEWS) new_element("option", find("kind"), label, { value: kind });
    find("kind").onchange = () => { this.kind = find("kind").value; this.picture(); };
    find("play").hidden = find("frame").hidden = false;
    find("play").onclick = () => this.play(!this.playing);
    Object.assign(find("frame"), { max: this.data.time.length - 1 });
    find("frame").oninput = () => { this.play(false); this.frame = Number(find("frame").value); this.picture(); };
    if (this.view) find("held").textContent = "Drag to turn; red: the impacts, click one.";
    find("held").hidden = !this.view;
    find("legend").hidden = !this.data.most;
    [find("what").textContent, find("low").textContent, find("high").textContent] = [this.data.what, "0", this.data.most || ""];
  }

  choose(k) {
    const one = this.data.impacts[k];
    this.impact = k;
    this.rows.forEach((row, i) => row.setAttribute("aria-pressed", i === k));
    if (one) {
      this.frame = one.frame;
      const { time, force } = one.curve;
      this.chart.show({ until: time[time.length - 1], now: { time, force }, computed: null, bar: one.bar, at: null });
      find("told").textContent = `Impact ${k + 1} at ${engineering(one.time, "s")}, on ${one.at}: impulse `
        + `${engineering(one.impulse, "N s")}; this point meets the floor with ${engineering(one.speed_before, "m/s")} `
        + `and leaves it with ${engineering(one.speed_after, "m/s")}; ${engineering(one.lost, "J")} are lost.`;
    }
    this.picture();
  }

  pick(x, y) {
    const k = this.near(x, y);
    if (k >= 0) this.choose(k);
  }

  // Number of the impact drawn nearest to the pixel (x, y) of the canvas; -1 if none is near.
  near(x, y) {
    let best = -1, least = 20;
    this.data.impacts.forEach(({ place }, k) => {
      const [a, b] = this.view.seen(place), far = Math.hypot(a - x, b - y);
      if (far < least) [best, least] = [k, far];
    });
    return best;
  }

  // [point, direction] in the axes of the floor -> the same in the axes of the drawn part.
  into([point, direction]) {
    const { centre } = this.data, [c, R] = this.pose();
    const back = (v) => [0, 1, 2].map((j) => R[j] * v[0] + R[3 + j] * v[1] + R[6 + j] * v[2]);
    return [back(less(point, c)).map((x, i) => x + centre[i]), back(direction)];
  }

  pose() {
    const { places, turns } = this.data, k = this.frame;
    return [Array.from(places.subarray(3 * k, 3 * k + 3)), Array.from(turns.subarray(9 * k, 9 * k + 9))];
  }

  picture() {
    find("frame").value = this.frame;
    find("frame").setAttribute("aria-valuetext", engineering(this.data.time[this.frame], "s"));
    find("case").textContent = "";
    if (!this.view) return;
    const { view, rest } = this, [c, R] = this.pose(), at = new Float32Array(rest.length);
    for (let p = 0; p < rest.length; p += 3) {
      for (let i = 0; i < 3; i++) at[p + i] = c[i] + R[3 * i] * rest[p] + R[3 * i + 1] * rest[p + 1] + R[3 * i + 2] * rest[p + 2];
    }
    view.put("part", at, this.shade, this.data.part.faces);
    this.floor();
    view.framed = this.kind === "near" ? ["part"] : null;
    const zoom = view.zoom;
    view.fit();
    view.zoom = zoom;
    view.draw();
  }

  // Draw the floor, the path of the centre of mass, and the impacts.
  floor() {
    const { places, impacts, part } = this.data, n = places.length / 3, near = this.kind === "near";
    const half = near ? part.half : 0.5 * Math.max(spread(places, 2), part.half), way = { points: [], faces: [], values: [] };
    for (let k = 0; k + 1 < n; k++) {
      const [a, b] = [k, k + 1].map((i) => Array.from(places.subarray(3 * i, 3 * i + 3))), step = less(b, a);
      const length = Math.hypot(...step), r = PATH_RADIUS * half;
      if (length) add(way, turned(a, unit(step), [[0, r], [length, r]], 6), DARK);
    }
    impacts.forEach(({ place }, k) => add(way, ball(before(place, [0, 0, -1], -DOT_RADIUS * half), [0, 0, -1], DOT_RADIUS * half * (k === this.impact ? 1.6 : 1)), MARK));
    this.view.put("way", Float32Array.from(way.points), Float32Array.from(way.values), Uint32Array.from(way.faces));
    const ends = [0, 1].map((i) => [Math.min(...every(places, i)) - 2 * part.half, Math.max(...every(places, i)) + 2 * part.half]);
    const [[x, X], [y, Y]] = ends, corners = [x, y, 0, X, y, 0, X, Y, 0, x, Y, 0];
    this.view.put("floor", Float32Array.from(corners), new Float32Array(4).fill(FLOOR), Uint32Array.from([0, 1, 2, 0, 2, 3]));
  }

  stop() { this.playing = false; }

  play(on) {
    this.playing = on;
    find("play").textContent = on ? "Pause" : "Play";
    const step = () => {
      if (!this.playing) return;
      this.frame = (this.frame + 1) % this.data.time.length;
      this.picture();
      setTimeout(() => requestAnimationFrame(step), 50);
    };
    if (on) step();
  }
}
