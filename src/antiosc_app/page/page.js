// The page of one impact: sliders, numbers, chart and picture. Sentences and error bars are those of the
// case that antiosc computed; the numbers follow the sliders.

const QUANTITIES = [["peak_force", "peak force", "N"], ["contact_time", "contact time", "s"],
  ["impulse", "impulse", "N s"], ["restitution", "restitution", ""], ["contacts", "contacts", ""]];
const MORE = [["dent", "dent", "m"], ["site_deflection", "deflection at the site", "m"], ["stress", "largest stress", "Pa"]];
const SLIDERS = [["mass", "mass of the striker", "kg"], ["speed", "closing speed", "m/s"],
  ["stiffness", "contact stiffness", ""], ["gap", "gap", "m"], ["damping", "damping ratio", ""]];
const SLIDER_RANGE = 10, SLIDER_STEPS = 200; // sliders of mass, speed and stiffness go from a tenth to tenfold, in this number of steps
const MOST_DAMPING = 0.1, LONGEST_RUN = 8, REST_TIME = 150; // longest run over the usual one; ms until the picture follows the sliders
const MANY_STEPS = 20000; // steps times modes of a run whose last digits are computed later
const SHORT_SHARE = 0.8; // share of a run up to which the chart shows the contacts alone

const find = (id) => document.getElementById(id);

function new_element(kind, parent, text = "", attributes = {}) {
  const element = document.createElement(kind);
  element.textContent = text;
  Object.assign(element, attributes);
  parent.append(element);
  return element;
}

class Page {
  constructor(data, engine, view, turned = false) {
    Object.assign(this, { data, engine, view, blow: data.blow, site: data.sites ? data.sites.first : -1 });
    find("live").hidden = false;
    document.body.classList.add("live");
    document.body.classList.toggle("flat", !view || !(data.part || data.sites));
    if (view) Object.assign(view, { framed: null }).meshes.clear();
    if (view && !turned && (data.place || data.sites)) view.face(data.place ? data.place.direction : data.sites.directions.slice(3 * this.site, 3 * this.site + 3));
    if (view && data.part) this.part = new Part(data.part, data.blow, view, data.place, data.awaited);
    if (data.sites) this.sites = new Sites(data.sites, view || { axes: () => [], put() {}, draw() {} });
    if (view && this.sites && !data.fixed) view.picked = (x, y) => this.choose(this.sites.near(x, y));
    this.chart = Chart.on(find("chart"));
    this.kind = this.sites ? "peak_force" : this.part && data.part.stress ? "stress" : "";
    this.frame = 0;
    this.computed = this.blow.computed || {};
    this.start = Object.fromEntries(SLIDERS.map(([name]) => [name, this.blow[name] ?? null]));
    this.start.damping = this.blow.ratio ?? 0;
    this.set = { ...this.start };
    this.rows = [...QUANTITIES, ...MORE.filter(([name]) => !this.sites && this.known(name))];
    this.make_sliders();
    this.make_numbers();
    this.make_views();
    this.change();
    this.rest();
    if (this.part && this.kind) this.frame = this.part.peak(this.kind);
    this.picture();
    if (view && !turned) { view.fit(); view.draw(); }
    document.documentElement.dataset.ready = performance.now().toFixed(0);
  }

  // Whether the computed case has this number.
  known(name) { return name === "stress" ? this.part && this.data.stress != null : Boolean(this.computed[name]); }


  body() { return this.sites ? this.sites.body(this.site) : this.blow.body; }

  // -- what is shown

  make_sliders() {
    this.inputs = {};
    find("sliders").replaceChildren();
    find("again").hidden = Boolean(this.data.fixed);
    if (this.data.fixed) return;
    find("back").onclick = () => { this.set = { ...this.start }; this.change(); };
    for (const [name, label, unit] of SLIDERS) {
      if (this.start[name] === null) continue;
      const row = new_element("label", find("sliders"), label), input = new_element("input", row, "", { type: "range", min: 0, max: SLIDER_STEPS, step: "any", name });
      input.oninput = () => { this.set[name] = this.value(name, Number(input.value)); this.change(); };
      this.inputs[name] = { input, output: new_element("output", row), unit: name === "stiffness" ? this.blow.law.unit : unit };
    }
  }

  // Value of a slider at a place. Mass, speed and stiffness are logarithmic; the gap goes up to the
  // distance that the striker moves in the run.
  value(name, place) {
    const share = place / SLIDER_STEPS, start = this.start[name];
    if (name === "gap") return share * Math.max(4 * start, 0.3 * (this.start.speed || 0) * this.blow.duration);
    if (name === "damping") return share * MOST_DAMPING;
    return start / SLIDER_RANGE * (SLIDER_RANGE * SLIDER_RANGE) ** share;
  }

  place(name, value) {
    if (name === "gap" || name === "damping") return value / (this.value(name, SLIDER_STEPS) || 1) * SLIDER_STEPS;
    return (Math.log(value / this.start[name]) / Math.log(SLIDER_RANGE) + 1) / 2 * SLIDER_STEPS;
  }

  // Make the table of numbers; `antiosc open` has the rows of the answer in its place.
  make_numbers() {
    this.cells = {};
    find("numbers").replaceChildren();
    find("third").hidden = true;
    find("heads").hidden = Boolean(this.data.fixed) && !this.sites;
    if (this.data.fixed && !this.sites) return;
    [find("now").textContent, find("compared").textContent] = ["now", "computed"];
    for (const [name, label] of this.rows) {
      const row = new_element("tr", find("numbers"));
      new_element("th", row, label);
      this.cells[name] = [new_element("td", row), new_element("td", row, "", { className: "computed" })];
    }
  }

  make_views() {
    const kinds = this.sites ? Object.entries(this.data.sites.names)
      : [...(this.part && this.data.part.stress ? [["stress", "von Mises stress"]] : []),
        ...(this.part && this.data.part.motion ? [["motion", "displacement"]] : []), ["", "set-up"]];
    find("kind").replaceChildren();
    for (const [kind, label] of kinds) new_element("option", find("kind"), label, { value: kind });
    find("kind").value = this.kind;
    find("kind").onchange = () => {
      this.kind = find("kind").value;
      if (this.part && this.kind && !this.frame) this.frame = this.part.peak(this.kind);
      this.picture();
    };
    find("play").hidden = find("frame").hidden = !this.part || !this.data.part.motion;
    find("play").onclick = () => this.play(!this.playing);
    find("frame").oninput = () => { this.play(false); this.frame = Number(find("frame").value); this.picture(); };
    find("site-number").hidden = find("site-number").parentElement.hidden = !this.sites;
    if (!this.sites) return;
    Object.assign(find("site-number"), { min: 1, max: this.sites.count, value: this.site + 1 });
    find("site-number").oninput = () => this.choose(Number(find("site-number").value) - 1);
  }

  // -- what changes

  choose(i) {
    if (!(i >= 0 && i < this.sites.count)) return;
    this.site = i;
    find("site-number").value = i + 1;
    this.change();
    this.picture();
    if (this.data.chosen) this.data.chosen(i);
  }

  at_start() { return SLIDERS.every(([name]) => this.set[name] === this.start[name]); }

  // Strike: numbers and chart follow at once, the picture when the sliders rest; the last digits of
  // a run of many steps wait until then too, that every move is answered within a frame.
  change(resting = false) {
    const began = performance.now(), { engine, blow } = this, rough = 0.1 * blow.coarse, lasts = this.blow.duration, at_start = this.at_start();
    const known = at_start && blow.computed; // by the program: the march draws them alone
    let duration = lasts;
    const strike = (tol) => engine.strike(pose(this.body(), blow, this.set), duration, tol);
    let hit = strike(known ? blow.coarse : rough);
    while (hit.touching && !at_start && duration < LONGEST_RUN * lasts) {
      duration *= 2;
      hit = strike(rough);
    }
    this.rough = !resting && !at_start && hit.n_nodes * hit.modes > MANY_STEPS;
    if (!known && !this.rough) hit = strike(blow.tol);
    if (known) Object.assign(hit, this.computed, { answer: 0 });
    else if (hit.answer) for (const [name] of [...QUANTITIES, ...MORE]) hit[name] = NaN;
    this.hit = hit;
    this.used = Math.min(hit.last ? Math.max(1.25 * hit.last, 0.02 * duration) : duration, duration);
    this.until = this.used < SHORT_SHARE * duration ? this.used : duration;
    if (!known) hit.stress = hit.site_deflection = NaN; // until the picture follows
    else hit.stress = this.data.stress;
    this.bar = known ? this.computed.bar || 0 : 0;
    this.write(hit);
    this.draw_chart();
    document.documentElement.dataset.took = (performance.now() - began).toFixed(3);
    clearTimeout(this.later);
    if (!resting) this.later = setTimeout(() => this.rest(), REST_TIME);
  }

  // A number as text: the program's, of the computed case with its bar, or that of the sliders.
  text(name, unit, value) {
    if (this.at_start() && (this.computed.shown || {})[name]) return this.computed.shown[name];
    if (value == null) return "";
    return name === "contacts" ? String(value) : engineering(value, unit);
  }

  write(hit) {
    for (const [name, { input, output, unit }] of Object.entries(this.inputs)) {
      input.value = this.place(name, this.set[name]);
      output.value = name === "damping" ? percent(this.set[name]) : engineering(this.set[name], unit);
      output.dataset.value = this.set[name];
      input.setAttribute("aria-valuetext", output.value);
    }
    const at_start = this.at_start(), own = this.sites && this.sites.data.quantities;
    for (const [name, , unit] of this.rows) {
      if (!this.cells[name]) continue;
      const [now, before] = this.cells[name];
      now.textContent = this.text(name, unit, hit[name]);
      now.dataset.value = hit[name];
      before.textContent = own ? own[name] ? this.text("", unit, own[name][this.site]) : "" : at_start ? "" : (this.computed.shown || {})[name] || "";
    }
    this.write_cards(at_start, hit);
    const notes = [];
    if (hit.answer) notes.push("The run stopped before its end, so that its numbers are not known.");
    if (hit.contacts === 0) notes.push("The bodies do not touch.");
    if (hit.touching) notes.push("The bodies still touch at the end of the run.");
    if (hit.peak_force > hit.reach) notes.push("The force exceeds the range of the contact law at this patch: extract with a larger radius.");
    find("notes").textContent = notes.join(" ");
    if (this.data.fixed) return;
    find("back").disabled = at_start;
    find("case").textContent = at_start ? "the computed case" : "changed by the sliders: sentences and bars are those of the computed case";
  }

  // The answers in the head of a report: the numbers of the sliders, or the computed ones with their bars.
  write_cards(at_start, hit) {
    for (const card of this.data.fixed || this.sites ? [] : document.querySelectorAll("[data-card]")) {
      card.dataset.computed ??= card.textContent;
      const [, , unit] = [...QUANTITIES, ...MORE].find(([name]) => name === card.dataset.card) || [];
      card.classList.toggle("before", !at_start && unit === undefined);
      card.textContent = at_start || unit === undefined ? card.dataset.computed : engineering(hit[card.dataset.card], unit);
    }
  }

  // End timers and the animation of this impact, which another replaces.
  stop() {
    clearTimeout(this.later);
    this.playing = false;
  }

  draw_chart() {
    const playing = this.part && this.kind ? this.time() : null, beside = this.data.fixed || this.at_start() ? null : this.computed;
    this.chart.show({ until: this.until, now: this.hit, computed: beside, bar: this.bar, at: playing });
    find("told").textContent = `Contact force${beside ? "; dashed: the computed case" : ""}${this.bar ? "; the band: its error bar" : ""}${this.until < this.hit.duration ? `; none later, until ${engineering(this.hit.duration, "s")}` : ""}.`;
  }

  // The picture of the present impact, and the numbers that are read from it.
  rest() {
    if (this.rough) this.change(true);
    if (this.sites) this.sites.strike(this.engine, this.at_start() ? null : this.set, this.blow);
    if (this.part) {
      const { hit, part, data } = this, run = this.engine.strike(hit.posed, hit.duration, this.blow.coarse);
      const reached = run.answer ? run.time[run.time.length - 1] || 0 : hit.duration;
      part.follow(this.engine, hit, Math.min(Math.max(this.used, 1.02 * (data.stress_time || 0)), reached), reached);
      this.follow_picture();
    }
    this.picture();
  }

  // The time [s] of the picture.
  time() { return this.part && this.part.times ? this.part.times[this.frame] : 0; }

  // Largest stress and deflection: those of the computed case times the ratio by which the drawn ones grew.
  follow_picture() {
    const { data, part, hit } = this, stress = part.fields.stress ? part.most("stress") : NaN, moved = part.moved_at_site(this.body());
    this.drawn ??= { stress, moved }; // the first impact is the computed one
    if (!this.at_start()) {
      hit.stress = data.stress_place ? data.stress * stress / (this.drawn.stress || 1) : NaN; // beside a contact it is not the picture's
      hit.site_deflection = this.computed.site_deflection * moved / (this.drawn.moved || 1);
    }
    part.known = { stress: hit.stress };
    this.write(hit);
  }

  picture() {
    find("legend").hidden = !this.kind;
    find("held").hidden = Boolean(this.kind) || Boolean(this.sites);
    find("doubtful").hidden = !this.sites || !this.sites.hatched().some(Boolean);
    find("without").hidden = !this.sites || !this.sites.lacks(this.kind);
    if (this.sites) this.sites.show(this.kind, this.site);
    else if (this.part) this.part.show(this.kind, this.frame);
    find("frame").value = this.frame;
    find("frame").setAttribute("aria-valuetext", engineering(this.time(), "s"));
    if (this.kind) this.legend();
    this.draw_chart();
  }

  legend() {
    const [label, unit] = this.sites ? [this.data.sites.names[this.kind], this.data.sites.units[this.kind]] : NAMES[this.kind];
    const [low, high] = this.sites ? this.sites.range(this.kind) : [0, this.part.top(this.kind)];
    const most = this.sites ? high : this.part.largest_of(this.kind);
    find("low").textContent = engineering(low, unit);
    find("high").textContent = engineering(high, unit) + (most > high ? ` and more, up to ${engineering(most, unit)}` : "");
    const drawn = this.part ? `, motion drawn × ${this.part.factor}, ${engineering(this.time(), "s")}` : "";
    const wide = this.sites && this.sites.logarithmic(this.kind) ? `, logarithmic: in the middle ${engineering(Math.sqrt(low * high), unit)}` : "";
    find("what").textContent = label + (this.sites && this.sites.all_doubtful() ? ", all sites doubtful" : "") + drawn + wide;
  }

  play(on) {
    this.playing = on;
    find("play").textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (!this.kind) find("kind").value = this.kind = "motion";
    const step = () => {
      if (!this.playing) return;
      this.frame = (this.frame + 1) % (FRAMES + 1);
      this.picture();
      setTimeout(() => requestAnimationFrame(step), 50);
    };
    step();
  }
}
