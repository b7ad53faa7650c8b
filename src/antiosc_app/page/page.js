// The page: sliders, numbers, the chart and the picture of one impact, and what moves them.

const QUANTITIES = [["peak_force", "peak force", "N"], ["contact_time", "contact time", "s"],
  ["impulse", "impulse", "N s"], ["restitution", "restitution", ""], ["contacts", "contacts", ""]];
const DENT = ["dent", "dent", "m"], SITE_MOVED = ["site_deflection", "deflection at the site", "m"], STRESS = ["stress", "largest stress", "Pa"], MOVED = ["deflection", "largest deflection", "m"];
const SLIDERS = [["mass", "mass of the striker", "kg"], ["speed", "closing speed", "m/s"],
  ["stiffness", "contact stiffness", ""], ["gap", "gap", "m"], ["damping", "damping ratio", ""]];
const RANGE = 10, STEPS = 200; // of the sliders of mass, speed and stiffness: a tenth to tenfold
const MOST_DAMPING = 0.1, LONGER = 8, REST = 150; // ms until the picture follows the sliders
const MANY = 20000; // steps times modes
const SHORT = 0.8; // share of a run up to which the chart shows the contacts alone

const find = (id) => document.getElementById(id);

function made(kind, parent, text = "", attributes = {}) {
  const element = document.createElement(kind);
  element.textContent = text;
  Object.assign(element, attributes);
  parent.append(element);
  return element;
}

// Texts in a cell of a table, which breaks between them alone.
function unbroken(cell, texts) {
  cell.replaceChildren();
  for (const text of texts) {
    if (cell.firstChild) cell.append(" ");
    if (text.startsWith("unknown")) cell.append(text); // with its reason it is long
    else made("span", cell, text);
  }
  return cell;
}

class Page {
  constructor(data, engine, view, turned = false) {
    Object.assign(this, { data, engine, blow: data.blow, site: data.sites ? data.sites.first : -1 });
    find("live").hidden = false;
    document.body.classList.add("live");
    document.body.classList.toggle("flat", !view || !(data.part || data.sites));
    find("again").hidden = false;
    find("now").textContent = "now";
    find("stressed").hidden = true;
    if (view) Object.assign(view, { framed: null }).meshes.clear();
    if (view && !turned && (data.place || data.sites)) view.face(data.place ? data.place.direction : data.sites.directions.slice(3 * this.site, 3 * this.site + 3));
    if (view && data.part) this.part = new Part(data.part, data.blow, view, data.place);
    if (data.sites) this.sites = new Sites(data.sites, view || { axes: () => [], put() {}, draw() {} });
    if (view && this.sites && !data.fixed) view.picked = (x, y) => this.choose(this.sites.near(x, y));
    this.chart = Chart.on(find("chart"));
    this.kind = this.sites ? "peak_force" : "";
    this.frame = 0;
    this.start = Object.fromEntries(SLIDERS.map(([name]) => [name, this.blow[name] ?? null]));
    this.start.damping = this.blow.ratio ?? 0;
    this.set = { ...this.start };
    const yields = this.blow.law.yields, slow = yields && yields.rim ? yield_speed(pose(this.body(), this.blow, this.start), this.blow.striker.mobility) / 2 : Infinity;
    if (this.blow.computed) this.blow.computed.stress ??= data.stress ?? null;
    this.least = { speed: Math.min(this.start.speed / RANGE, slow) };
    this.rows = [...QUANTITIES, ...(yields ? [DENT] : []), ...((data.fixed || this.part) && this.blow.computed && this.blow.computed.site_deflection != null ? [SITE_MOVED] : []), ...(this.part && data.part.deflection ? [MOVED] : []), ...(this.part && (data.part.stress || data.part.no_stress) ? [STRESS] : [])];
    this.said = [...document.querySelectorAll("[data-of]")].map((p) => ({ p, of: p.dataset.of, computed: p.textContent }));
    this.make_sliders();
    this.make_numbers();
    this.make_views();
    find("back").onclick = () => this.back();
    this.change();
    this.rest();
    if (view && !turned) { view.fit(); view.draw(); }
    document.documentElement.dataset.ready = performance.now().toFixed(0);
  }

  // The duration of the impact, of a map of that at its site.
  lasts() { return this.sites ? this.sites.data.durations[this.site] : this.blow.duration; }

  body() { return this.sites ? this.sites.body(this.site) : this.blow.body; }

  // -- what is shown

  make_sliders() {
    this.inputs = {};
    find("sliders").replaceChildren();
    if (this.data.fixed) return;
    for (const [name, label, unit] of SLIDERS) {
      if (this.start[name] === null) continue;
      const row = made("label", find("sliders"), label), input = made("input", row, "", { type: "range", min: 0, max: STEPS, step: "any", name });
      input.oninput = () => { this.set[name] = this.value(name, Number(input.value)); this.change(); };
      this.inputs[name] = { input, output: made("output", row), unit: name === "stiffness" ? this.blow.law.unit : unit };
    }
  }

  // Sliders of mass, speed and stiffness are logarithmic; that of the gap goes over the way of the run.
  value(name, place) {
    const share = place / STEPS, start = this.start[name];
    if (name === "gap") return share * Math.max(4 * start, 0.3 * (this.start.speed || 0) * this.blow.duration);
    if (name === "damping") return share * MOST_DAMPING;
    const low = this.least[name] ?? start / RANGE;
    return low * (RANGE * start / low) ** share;
  }

  place(name, value) {
    if (name === "gap" || name === "damping") return value / (this.value(name, STEPS) || 1) * STEPS;
    const low = this.least[name] ?? this.start[name] / RANGE;
    return Math.log(value / low) / Math.log(RANGE * this.start[name] / low) * STEPS;
  }

  make_numbers() {
    [this.cells, this.remarks] = [{}, {}];
    find("numbers").replaceChildren();
    for (const [name, label] of this.rows) {
      const row = made("tr", find("numbers"));
      made("th", row, label);
      this.cells[name] = [made("td", row), made("td", row, "", { className: "computed" })];
      const below = made("tr", find("numbers"), "", { className: "note", hidden: true });
      this.remarks[name] = made("td", below, "", { colSpan: 3 });
    }
  }

  make_views() {
    const kinds = this.sites ? Object.entries(this.data.sites.names)
      : [["", "set-up"], ...(this.part && this.data.part.motion ? [["motion", "displacement"]] : []),
        ...(this.part && this.data.part.stress ? [["stress", "von Mises stress"]] : [])];
    find("kind").replaceChildren();
    for (const [kind, label] of kinds) made("option", find("kind"), label, { value: kind });
    find("kind").onchange = () => {
      this.kind = find("kind").value;
      if (this.part && this.kind && !this.frame) this.frame = this.part.peak(this.kind);
      this.picture();
    };
    find("play").hidden = find("frame").hidden = !this.part || !this.data.part.motion;
    find("play").onclick = () => this.play(!this.playing);
    find("frame").oninput = () => { this.play(false); this.frame = Number(find("frame").value); this.picture(); };
    find("site").hidden = find("site").parentElement.hidden = !this.sites;
    if (!this.sites) return;
    Object.assign(find("site"), { min: 1, max: this.sites.count, value: this.site + 1 });
    find("site").oninput = () => this.choose(Number(find("site").value) - 1);
  }

  // -- what changes

  back() {
    this.set = { ...this.start };
    this.change();
  }

  choose(i) {
    if (!(i >= 0 && i < this.sites.count)) return;
    this.site = i;
    find("site").value = i + 1;
    this.change();
    this.picture();
    if (this.data.chosen) this.data.chosen(i);
  }

  // Show the first of some kinds that there is.
  show_kind(kinds) {
    find("kind").value = this.kind = kinds.find((kind) => kind in this.data.sites.names);
    this.picture();
  }

  at_start() { return SLIDERS.every(([name]) => this.set[name] === this.start[name]); }

  // Strike: numbers and chart follow at once, the picture when the sliders rest; the last digits of
  // a run of many steps wait until then too, that every move is answered within a frame.
  change(resting = false) {
    const began = performance.now(), { engine, blow } = this, rough = 0.1 * blow.coarse, lasts = this.lasts();
    const known = this.at_start() && blow.computed; // by the program: the march draws them alone
    let duration = lasts;
    const strike = (tol) => engine.strike(pose(this.body(), blow, this.set), duration, tol);
    let hit = strike(known ? blow.coarse : rough);
    while (hit.touching && !this.at_start() && duration < LONGER * lasts) {
      duration *= 2;
      hit = strike(rough);
    }
    this.rough = !resting && !this.at_start() && hit.n_nodes * hit.modes > MANY;
    if (!known && !this.rough) hit = strike(blow.tol);
    const bars = this.known_bars = this.bars(hit, duration);
    if (this.at_start()) Object.assign(hit, this.blow.computed || {}, { answer: 0 });
    else if (hit.answer) Object.assign(hit, UNKNOWN);
    this.hit = hit;
    hit.touches = touches(hit);
    hit.main = hit.touches.length ? main_impact(hit) : null;
    this.used = Math.min(hit.last ? Math.max(1.25 * hit.last, 0.02 * duration) : duration, duration);
    this.until = this.used < SHORT * duration ? this.used : duration;
    hit.stress = hit.deflection = NaN; // until the picture follows
    this.bar = [this.sides("peak_force", hit, bars) ?? 0].flat().at(-1);
    this.write(hit, bars);
    this.draw_chart();
    document.documentElement.dataset.took = (performance.now() - began).toFixed(3);
    clearTimeout(this.later);
    if (!resting) this.later = setTimeout(() => this.rest(), REST);
  }

  // Relative errors of the present impact, as far as they are known. The bar of a cause with a body
  // of its own (mesh, truncation) grows as the difference that this body makes.
  bars(hit, duration) {
    const { shares } = this.blow.bars || { shares: {} }, names = Object.keys(shares), total = {};
    const now = this.at_start() ? {} : this.apart(hit, this.set, duration);
    for (const name of names) {
      total[name] = 0;
      for (const [cause, share] of Object.entries(shares[name])) {
        const before = now[cause] && this.apart_at_start()[cause][name];
        total[name] += before ? share * now[cause][name] / before : share;
      }
    }
    return total;
  }

  // By cause, how far an impact is from that of the cause's body.
  apart(hit, set, duration) {
    const { shares, variants } = this.blow.bars || { shares: {}, variants: {} };
    return Object.fromEntries(Object.entries(variants).map(([cause, body]) => {
      const other = this.engine.strike(pose(body, this.blow, set), duration, 0.1 * this.blow.coarse);
      return [cause, differences(hit, other, Object.keys(shares))];
    }));
  }

  apart_at_start() {
    if (!this.known) {
      const { blow, start } = this, hit = this.engine.strike(pose(this.body(), blow, start), blow.duration, blow.tol);
      this.known = this.apart(hit, start, blow.duration);
    }
    return this.known;
  }

  // A number and its bar, with its condition: a line may end between them.
  with_bar(name, plain, bar, value, unit) {
    const [number, told] = bar_texts(name, plain, bar, value, unit);
    return [number, told + (this.blow.bars && this.blow.bars.condition || "")];
  }

  // The error below and above a number; that of the restitution is not relative.
  sides(name, hit, bars) {
    if (name === "stress") return this.data.stress_bar;
    if (name === "site_deflection") return this.at_start() ? this.blow.computed.site.bar : null;
    if (name === "deflection") return this.data.part.deflection.at_site ? this.sides("site_deflection") : null;
    const total = bars[name === "restitution" ? "impulse" : name], { rebounds } = this.blow.bars || {};
    return Number.isFinite(total) ? sides_of(name, total, rebounds ? hit.restitution : NaN) : this.bars_here()[name];
  }

  // What is said below a number: where it holds, or why it has no bar.
  remark(name, has_bar) {
    const { data, blow: { bars } } = this;
    if (name === "stress" && data.part.no_stress) return data.part.no_stress;
    if (name === "stress") return [data.scope, has_bar ? "" : data.stress_note].filter(Boolean).join("; ");
    if (this.sites && name === "peak_force" && !has_bar) return "no error bar at this site: it has one when it is struck by itself";
    if (name === "deflection") return this.at_start() ? `${data.part.deflection.told}${has_bar ? "" : ", no bar"}` : "no bar";
    if (name === "site_deflection") return this.at_start() ? `along the impact, ${this.blow.computed.site.told}${has_bar ? "" : "; no bar"}` : "along the impact, no bar";
    const unknown = (bars && bars.unknown || {})[name] || "";
    return name === "contact_time" ? [contact_time_note(this.hit), unknown].filter(Boolean).join("; ") : unknown;
  }

  // The bars of a site of a map that was struck by itself.
  bars_here() { return this.sites && this.at_start() && (this.data.barred || {})[this.site] || {}; }

  // A number as text; of a dent that is 0 only as far as is known, that it is unknown.
  plain(name, value, unit, unknown) {
    if (name === "contacts") return String(value);
    if (name === "restitution") return engineering(value) + approaching(value);
    if (name === "dent" && !(value > 0) && unknown) return unknown;
    return engineering(value, unit);
  }

  write(hit, bars) {
    for (const [name, { input, output, unit }] of Object.entries(this.inputs)) {
      input.value = this.place(name, this.set[name]);
      output.value = name === "damping" ? percent(this.set[name]) : engineering(this.set[name], unit);
      output.dataset.value = this.set[name];
      input.setAttribute("aria-valuetext", output.value);
    }
    const computed = this.sites ? this.computed_here() : this.compared();
    const { unknown = "" } = this.blow.law.yields || { unknown: "unknown" };
    hit.unknown = unknown;
    for (const [name, , unit] of this.rows) {
      const [now, before] = this.cells[name], value = hit[name];
      const plain = this.plain(name, value, unit, unknown), kept = computed[name] ?? null;
      if (name === "dent") now.parentElement.hidden = plain !== unknown && !(value > 0 || kept > 0);
      const bar = this.sides(name, hit, bars);
      const has_bar = (Array.isArray(bar) || Number.isFinite(bar)) && Number.isFinite(value);
      const parts = has_bar ? this.with_bar(name, plain, bar, value, unit) : [plain];
      unbroken(now, parts);
      const remark = this.remarks[name], no_stress = name === "stress" && this.data.part.no_stress;
      const text = Number.isFinite(value) || no_stress ? this.remark(name, has_bar) : "";
      Object.assign(remark, { textContent: text }).parentElement.hidden = !text;
      now.dataset.value = value;
      unbroken(before, kept === null ? [] : [this.plain(name, kept, unit, computed.unknown ?? unknown)]);
    }
    this.say(hit);
    for (const fact of this.sites ? [] : document.querySelectorAll(".facts [data-fact]")) this.head(fact);
    const notes = [];
    if (hit.answer) notes.push("The run stopped before its end, so that its numbers are not known.");
    if (this.reached < hit.duration) notes.push(`The picture ends at ${engineering(this.reached, "s")}: the page has no memory for more of its steps.`);
    if (hit.contacts === 0) notes.push("The bodies do not touch.");
    if (hit.touching) notes.push("The bodies still touch at the end of the run.");
    if (hit.peak_force > hit.reach) {
      notes.push("The force exceeds the range of the contact law at this patch: extract with a larger radius.");
    }
    if (this.blow.law.limit && hit.peak_force > this.blow.law.limit) notes.push("The force exceeds the range of the contact law.");
    find("notes").textContent = notes.join(" ");
    const { footnote } = this.blow.bars || {};
    Object.assign(find("footnote"), { textContent: footnote, hidden: !footnote || !this.data.fixed }); // a report has it below its headline
    find("back").disabled = this.at_start();
    if (!this.data.fixed) find("case").textContent = this.at_start() ? "the computed case" : "changed by the sliders";
    const dashed = this.data.before ? "; dashed: the blow before" : this.at_start() ? "" : "; dashed: the computed case";
    find("told").textContent = "Contact force" + dashed
      + (this.bar ? `; the band: the error bar${this.blow.bars && this.blow.bars.condition || ""}` : "") + (hit.contacts > 1 ? "; the thick line: the contact time" : "")
      + (this.until < hit.duration ? `; none from the last release to the end, ${engineering(hit.duration, "s")}` : "") + ".";
  }

  // A number of the headline: that of the computed case, or the present one, which is not known of a probe; of a map it is of all sites.
  head(shown) {
    const [now] = this.cells[shown.dataset.fact] || [{ textContent: "–" }];
    shown.dataset.computed ??= shown.textContent;
    shown.textContent = this.at_start() ? shown.dataset.computed : now.textContent;
  }

  // The sentences of the headline: those of the computed case, or what is known of the present one.
  say(hit) {
    const live = { contact: () => contact_sentence(hit, this.blow.law), stress: () => stress_sentence(hit.stress, this.data.strength, this.data.scope) };
    const block = this.said.length ? this.said[0].p.parentElement : null;
    if (block) block.style.minHeight ||= `${block.offsetHeight}px`; // what is below does not jump
    if (block) block.classList.toggle("now", !this.at_start());
    for (const { p, of, computed } of this.said) {
      p.textContent = this.at_start() ? computed : of in live ? live[of]() : "";
      p.hidden = !p.textContent;
    }
  }

  // The impact beside the present one: the computed one, or that before a change of the set-up.
  compared() { return this.data.fixed ? this.data.before || {} : this.blow.computed; }

  computed_here() {
    const own = this.data.sites.quantities;
    return Object.fromEntries(QUANTITIES.map(([name]) => [name, own[name] ? own[name][this.site] : null]));
  }

  // Nothing more of this impact: another takes its place.
  stop() {
    clearTimeout(this.later);
    this.playing = false;
  }

  draw_chart() {
    const playing = this.part && this.kind ? this.time() : null;
    this.chart.show({ until: this.until, now: this.hit, computed: this.sites ? this.blow.computed : this.compared(), bar: this.bar, at: playing });
  }

  // The picture of the present impact.
  rest() {
    if (this.rough) this.change(true);
    if (this.sites) this.sites.strike(this.engine, this.at_start() ? null : this.set, this.blow);
    if (this.part) {
      const { hit } = this, run = this.engine.strike(hit.posed, hit.duration, this.blow.coarse);
      this.reached = run.answer ? run.time[run.time.length - 1] || 0 : hit.duration;
      this.part.follow(this.engine, hit, this.closely(), this.reached);
      this.follow_picture();
    }
    this.picture();
  }

  // Up to when the pictures follow closely: the end of the contacts, or the time of the largest stress where it comes later.
  closely() { return Math.min(Math.max(this.used, 1.02 * (this.data.stress_time || 0)), this.reached); }

  // The time of the picture.
  time() { return this.part && this.part.times ? this.part.times[this.frame] : 0; }

  // Largest stress and deflection: those of the computed case, as the picture's largest grows; no stress before the verdict that judges it.
  follow_picture() {
    const { data, part, hit } = this, kinds = Object.keys(part.fields).filter((kind) => part.fields[kind]);
    const drawn = Object.fromEntries(kinds.map((kind) => [kind, part.most(kind)]));
    this.drawn ??= drawn; // the first impact is the computed one
    const grown = (kind, known) => known * drawn[kind] / (this.drawn[kind] || 1);
    if (data.part.stress && !data.awaited) hit.stress = grown("stress", data.stress ?? this.drawn.stress);
    const { site_deflection: known } = this.blow.computed || {}, moved = part.moved_at_site(this.body());
    this.moved ??= moved;
    if (known != null) hit.site_deflection = this.at_start() ? known : known * moved / (this.moved || 1);
    if (data.part.deflection) hit.deflection = grown("motion", data.part.deflection.value);
    part.known = { stress: hit.stress, motion: hit.deflection };
    if (kinds.length) this.write(hit, this.known_bars);
  }

  picture() {
    find("legend").hidden = !this.kind;
    find("held").hidden = Boolean(this.kind) || Boolean(this.sites);
    find("doubtful").hidden = !this.sites || !this.sites.hatched().some(Boolean);
    find("without").hidden = !this.sites || !this.sites.lacks(this.kind);
    find("lacking").textContent = NOT_SOUGHT[this.kind] || "no result";
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
    const wide = this.sites && this.sites.logarithmic(this.kind);
    const doubtful = this.sites && this.sites.all_doubtful() ? ", all sites doubtful" : "";
    const lacks = this.sites && this.kind in NOT_SOUGHT && this.sites.data.radii.length ? ", without what the radius of the patch hides" : "";
    find("what").textContent = label + lacks + doubtful + drawn + (wide ? `, logarithmic: in the middle ${engineering(Math.sqrt(low * high), unit)}` : "");
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

// The numbers of a run that the page could not compute to its end.
const NOT_SOUGHT = { peak_stress: "stress not sought", exposure: "stress not sought" }; // quantities of some sites of a map
const UNKNOWN = Object.fromEntries([...QUANTITIES, DENT, SITE_MOVED].map(([name]) => [name, NaN]));

// Relative differences of two impacts, each at least half the largest: antiosc.impact.quantities.
function differences(one, other, names) {
  const off = Object.fromEntries(names.map((name) => {
    const a = one[name], b = other[name];
    return [name, a === b ? 0 : Math.abs(a - b) / Math.max(Math.abs(a), Math.abs(b))];
  }));
  const worst = Math.max(...Object.values(off));
  for (const name of names) off[name] = Math.max(off[name], 0.5 * worst);
  return off;
}

