// The page of `antiosc open`: clicks and fields change the scene of the server, which runs it.

// Number fields: [key of the scene, label, unit, section of the form, number of values if several].
const FIELDS = [
  ["geometry.size", "cell size", "mm", "part-more"], ["deck.size", "cell size", "mm", "part-more"],
  ["material.thickness", "thickness", "mm", "part"], ["material.section.d", "diameter", "mm", "part"],
  ["material.E", "E", "GPa", "part"], ["material.nu", "nu", "", "part"], ["material.rho", "rho", "kg/m³", "part"],
  ["material.yield_strength", "yield strength", "MPa", "part"], ["material.yield_range", "yield range", "MPa", "part", 2],
  ["deck.yield_strength", "yield strength", "MPa", "part"], ["deck.yield_range", "yield range", "MPa", "part", 2],
  ["deck.density", "density", "kg/m³", "part"], ["deck.modulus", "modulus", "GPa", "part"],
  ["impactor.radius", "radius", "mm", "striker"], ["impactor.tip_radius", "tip radius", "mm", "striker"],
  ["impactor.mass", "mass", "kg", "striker"], ["impactor.velocity", "velocity", "m/s", "striker"],
  ["impactor.E", "E", "GPa", "striker"], ["impactor.nu", "nu", "", "striker"], ["impactor.rho", "rho", "kg/m³", "striker"],
  ["impactor.yield_strength", "yield strength", "MPa", "striker"],
  ["drop.height", "height", "m", "striker"], ["drop.toward", "downward", "", "striker", 3], ["drop.tilt", "then tilt", "°", "striker", 3],
  ["drop.floor.friction", "friction", "", "striker"], ["drop.corner_radius", "corner radius", "mm", "site-more"], ["drop.damping", "damping", "", "site-more"],
  ["sites.point", "point", "mm", "site", 3], ["sites.direction", "direction", "", "site-more", 3], ["sites.radius", "patch radius", "mm", "site-more"],
  ["extract.n", "oscillators", "", "site-more"], ["simulate.duration", "duration", "ms", "site-more"], ["extract.damping", "damping", "", "site-more"],
];
// Fields that are shown without a value in the scene: the run chooses it, or does without.
const SHOWN_EMPTY = ["sites.radius", "extract.n", "simulate.duration", "extract.damping", "drop.corner_radius", "drop.damping", "drop.toward",
  "deck.size", "geometry.size", "deck.yield_strength"];
const SI_FACTORS = { mm: 1e-3, ms: 1e-3, MPa: 1e6, GPa: 1e9 };
const OWN = "own material", KINDS = { Sphere: "ball", RigidMass: "mass", named_impactor: "hammer" };
const STRIKERS = { ball: "a ball", mass: "a mass with a round tip", hammer: "an IK hammer", floor: "the floor: it falls" };
const SEE_THROUGH = 0.6, LONG_CALL = 2, POLL_INTERVAL = 500; // cover of a face; s; ms
const DIGITS = 6;

class Bench {
  constructor() {
    this.token = location.pathname.split("/")[1];
    this.pending = 0;
    this.look();
  }

  // -- the server

  async call(name, content = {}) {
    this.called = name;
    this.busy(1);
    try {
      return await this.ask_server(name, content);
    } finally {
      this.busy(-1);
    }
  }

  async ask_server(name, content) {
    const answer = await fetch(`/${name}`, { method: "POST", body: JSON.stringify(content),
      headers: { "Content-Type": "application/json", "X-Antiosc-Token": this.token } });
    if (!answer.ok) throw new Error(await answer.text());
    const { answer: found, error } = unpacked(await answer.text());
    if (error) throw new Error(error);
    return found;
  }

  busy(change) {
    if (!this.pending && change > 0) {
      this.began = performance.now();
      this.poll = setInterval(() => this.tell_progress(), POLL_INTERVAL);
    }
    this.pending += change;
    if (!this.pending) clearInterval(this.poll);
    find("busy").style.visibility = this.pending ? "visible" : "hidden";
    find("stop").hidden = true;
  }

  async tell_progress() {
    const found = await this.ask_server("progress", {}).catch(() => null);
    if (!found || !this.pending) return;
    const seconds = Math.floor((performance.now() - this.began) / 1e3), counted = /(\d+) of (\d+)/.exec(found.doing);
    find("doing").textContent = `${found.doing || "computing"}${seconds < LONG_CALL ? "" : ` (${seconds} s)`}`;
    find("stop").hidden = seconds < LONG_CALL || ["look", "take", "write"].includes(this.called);
    if (counted) find("bar").value = counted[1] / counted[2];
    else find("bar").removeAttribute("value");
  }

  // Call a step of the answer to the present scene; null if the scene has changed meanwhile.
  async step(name, more = {}) {
    const { turn } = this;
    try {
      const found = await this.call(name, { turn, ...more });
      return found.stale || turn !== this.turn ? null : found;
    } catch (error) {
      if (turn === this.turn) this.wrong(error.message);
      return null;
    }
  }

  async stop() {
    ({ turn: this.turn } = await this.call("stop"));
    this.warn(["Stopped: a click or a field strikes again."]);
  }

  // Mark what is shown as the answer to an earlier scene, or not.
  outdated(are) {
    document.body.classList.toggle("outdated", are);
    find("save").disabled = are;
  }

  wrong(text) {
    this.warn([text]);
    document.documentElement.dataset.failed = text;
  }

  // Show the cautions, the heaviest first, and further ones (`more`) folded.
  warn(cautions, more = []) {
    find("wrong").hidden = !cautions.length;
    find("wrong").replaceChildren();
    for (const text of cautions) new_element("p", find("wrong"), text);
    if (!more.length) return;
    const folded = new_element("details", find("wrong"));
    new_element("summary", folded, `${more.length} more`);
    for (const text of more) new_element("p", folded, text);
  }

  // -- the part

  async look() {
    try {
      const found = await this.call("look");
      Object.assign(this, { facts: found, skin: found.skin, view: View.on(find("view")) });
      this.engine = await Engine.load(found.engine);
      this.divide();
      if (this.view) this.view.picked = (x, y, e) => this.click(x, y, e.shiftKey);
      find("live").hidden = find("setup").hidden = false;
      this.make_form();
      this.take(found);
      this.draw_setup();
      this.fit();
      this.answer();
    } catch (error) {
      this.wrong(error.message);
    }
  }

  fit() {
    if (!this.view) return;
    if (!this.falls) this.view.face(this.scene.sites.direction);
    this.view.fit();
    this.view.draw();
  }

  // Give each triangle of the skin its own points, so that faces have sharp ends.
  divide() {
    const { points, faces, middle, half } = this.skin;
    this.skin.of = faces; // the point of the mesh at each corner
    this.skin.points = Int16Array.from({ length: 3 * faces.length }, (_, i) => points[3 * faces[Math.floor(i / 3)] + i % 3]);
    this.skin.faces = Uint32Array.from(faces.keys());
    this.rest = Float32Array.from(this.skin.points, (x, i) => middle[i % 3] + x * half / 32767);
  }

  // For each point of the skin whether it is held: on a triangle of a held face, or a node of an edge.
  held_points() {
    const held = new Uint8Array(this.rest.length / 3), { nodes, of } = this.skin;
    for (const name of this.held) {
      const own = new Set(nodes[this.facts.faces.indexOf(name)]);
      if (own.size) of.forEach((node, corner) => { if (own.has(node)) held[corner] = 1; });
      else for (const corner of this.corners(name)) held[corner] = 1;
    }
    return held;
  }

  // The points of the triangles of the face `name`; none if there is no such face.
  corners(name) {
    const triangles = this.skin.sets[this.facts.faces.indexOf(name)] || [];
    return Array.from(triangles).flatMap((f) => [3 * f, 3 * f + 1, 3 * f + 2]);
  }

  // Highlight the face `name`, also behind others, while pointer or focus is on its name; "" ends it.
  preview(name) {
    if (!this.view) return;
    const shown = new Float32Array(this.rest.length / 3).fill(MARK);
    this.view.put("face", this.rest, shown, Uint32Array.from(this.corners(name)), SEE_THROUGH);
    this.view.draw();
  }

  // Draw the part with its held faces, and the arrow, which is grey until the answer is there.
  draw_setup() {
    if (this.page) this.page.stop();
    this.page = null;
    if (!this.view) return;
    const { point, direction } = this.scene.sites || {}, { radius, tip_radius } = this.scene.impactor || {};
    const place = this.falls ? null : { point, direction, radius: radius || tip_radius };
    this.view.meshes.clear();
    this.view.framed = null;
    this.part = new Part({ ...this.skin, held: this.held_points() }, null, this.view, place, true);
    this.part.show("", 0);
    this.view.draw();
  }

  // {point [m], outward normal, name of the face} at the pixel (x, y) of the canvas; null beside the part.
  seen(x, y) {
    const sight = this.view.sight(x, y), [from, d] = this.page && this.page.into ? this.page.into(sight) : sight;
    const found = crossings(this.rest, this.skin.faces, from, d);
    if (!found.length) return null;
    const { at, face, normal } = found.reduce((a, b) => (b.at < a.at ? b : a)), tag = this.skin.tags[face];
    return { point: from.map((c, i) => c + at * d[i]), normal: dot(normal, d) > 0 ? normal.map((c) => -c) : normal,
      name: tag ? this.facts.faces[tag - 1] : this.beside(face) };
  }

  // Name of the smallest edge or set of nodes of a sheet at a triangle; "" if there is none.
  beside(triangle) {
    const near = this.facts.faces.map((name, i) => [this.skin.sets[i].length, name, this.skin.sets[i]]).filter(([, , set]) => Array.from(set).includes(triangle));
    return near.length ? near.reduce((a, b) => (b[0] < a[0] ? b : a))[1] : "";
  }

  // A point [m] on the skin, rounded to the resolution of the skin's 16-bit coordinates.
  placed(point) {
    const digit = 10 ** Math.ceil(Math.log10(this.skin.half / 32767));
    return point.map((x) => exact(Math.round(x / digit) * digit));
  }

  click(x, y, hold) {
    const { page } = this;
    if (page && page.sites) return page.choose(page.sites.near(x, y));
    if (page && page.into && page.near(x, y) >= 0) return page.pick(x, y);
    const seen = this.seen(x, y);
    if (!seen) return;
    this.face = seen.name;
    if (this.falls) this.edit({ set: { "drop.toward": aimed(seen.normal) } });
    else if (!hold && document.querySelector("input[name=click]:checked").value === "strike") {
      this.edit({ set: { "sites.point": this.placed(seen.point), "sites.direction": aimed(seen.normal.map((c) => -c)) } });
    } else if (seen.name) this.edit({ hold: seen.name });
    else this.warn(["Nothing with a name lies there: a face that is not flat cannot be held by a click."]);
  }

  // -- the form

  make_form() {
    const { facts } = this, on = (id, work) => { find(id).onclick = work; };
    this.shown = [];
    find("notes").before(find("rows"));
    for (const text of facts.told) new_element("p", find("file"), text);
    this.anew("piece", facts.pieces, facts.piece, Number);
    this.anew("contact", Object.entries(facts.contacts), facts.contact, String);
    this.list("part", "material", facts.materials, () => this.scene.material.name || OWN, () => this.scene.material);
    if (facts.of_deck) this.list("part", "yields like", ["", ...facts.strengths], () => this.scene.deck.yield_strength, () => facts.strengths.length, (name) => this.edit({ set: { "deck.yield_strength": name || null } }));
    this.list("striker", "striker", Object.keys(STRIKERS), () => (this.falls ? "floor" : KINDS[this.scene.impactor.kind]), () => true, undefined, STRIKERS);
    this.list("striker", "of", facts.striker_materials, () => this.scene.impactor.material || OWN, () => !this.falls && this.scene.impactor.kind !== "named_impactor");
    this.list("striker", "name", facts.hammers, () => this.scene.impactor.name, () => !this.falls && this.scene.impactor.kind === "named_impactor", (name) => this.edit({ set: { "impactor.name": name } }));
    this.list("striker", "onto", facts.floors, () => (this.scene.drop.floor || {}).material || "rigid", () => this.falls);
    for (const field of FIELDS) this.field(...field);
    const names = [...facts.faces].sort((a, b) => a.localeCompare(b, "en", { numeric: true }));
    const buttons = names.map((name) => this.face_button(find("hold"), name));
    this.shown.push(() => buttons.forEach((one) => one.setAttribute("aria-pressed", this.held.includes(one.value))));
    on("undo", () => this.edit({ undo: true }));
    on("finer", () => this.edit({ finer: true }));
    on("stop", () => this.stop());
    on("save", () => this.save());
    on("map", () => this.map());
    document.addEventListener("keydown", (e) => {
      if (e.ctrlKey && e.key === "z" && e.target.type !== "number") { e.preventDefault(); this.edit({ undo: true }); }
    });
    find("python").onfocus = () => find("python").select();
  }

  // A button that holds a face or frees it.
  face_button(where, name, text = name) {
    const [on, off] = [() => this.preview(name), () => this.preview("")];
    const button = new_element("button", where, text, { type: "button", value: name, title: `hold or free ${name}`, onclick: () => this.edit({ hold: name }),
      onmouseenter: on, onfocus: on, onmouseleave: off, onblur: off });
    if (this.facts.places[name]) new_element("small", button, this.facts.places[name]);
    return button;
  }

  // A select element for a change of the scene.
  list(where, label, options, value, counts, change = (name) => this.edit({ [label]: name }), texts = {}) {
    if (!options.length) return;
    const row = new_element("label", find(where), label), select = new_element("select", row, "", { name: label });
    for (const one of options) new_element("option", select, texts[one] || one || "none", { value: one });
    select.onchange = () => change(select.value);
    this.shown.push(() => { row.hidden = !counts(); if (!row.hidden) select.value = value(); });
  }

  // A select element whose change opens the file anew (another piece, another contact).
  anew(name, entries, chosen, as) {
    if (!entries.length) return;
    const row = new_element("label", find("part"), name), select = new_element("select", row, "", { name });
    for (const [value, text] of entries) new_element("option", select, text, { value });
    select.value = chosen;
    select.onchange = async () => {
      try {
        await this.call("stop");
        await this.call("take", { [name]: as(select.value) });
        location.reload();
      } catch (error) {
        select.value = chosen;
        this.wrong(error.message);
      }
    };
  }

  // Input fields of one key of the scene; an empty field leaves its value to the run.
  field(place, label, unit, where, count = 1) {
    const row = new_element("label", find(where), label, { className: count > 1 ? "many" : "one" }), size = SI_FACTORS[unit] || 1;
    const inputs = Array.from({ length: count }, (_, i) => new_element("input", row, "", { type: "number", step: "any", name: place,
      ariaLabel: `${label}${count > 1 ? ` ${i + 1}` : ""} in ${unit || "1"}` }));
    new_element("span", row, unit);
    const note = new_element("small", row, "", { className: "rule", hidden: true });
    const change = async () => {
      const values = inputs.map(({ value, validity }) => (value === "" && !validity.badInput ? null : Number(value)));
      const empty = values.every((x) => x === null), whole = values.every((x) => x !== null);
      if (!empty && !whole) return; // the others are still to be typed
      if (count === 3 && empty && place !== "drop.toward") return this.show_form();
      const given = values.map((x) => exact(x * size)), refused = await this.edit({ set: { [place]: empty ? null : count > 1 ? given : given[0] } });
      Object.assign(note, { textContent: refused, hidden: !refused });
      inputs.forEach((input) => input.setAttribute("aria-invalid", Boolean(refused)));
    };
    inputs.forEach((input) => { input.onchange = change; });
    this.shown.push(() => {
      const [section, ...keys] = place.split("."), own = this.scene[section], value = keys.reduce((table, key) => (table || {})[key], own);
      row.hidden = !own || value === undefined && !this.opens(place);
      const taken = (this.taken || {})[place];
      inputs.forEach((input, i) => {
        const one = Array.isArray(value) ? value[i] : value, open = typeof one !== "number";
        input.placeholder = typeof one === "string" && one !== "auto" ? one : taken ? `auto: ${short(taken / size)}` : one === "auto" ? "auto" : "";
        if (input === document.activeElement && input.value !== input.dataset.shown) return; // not yet confirmed
        input.value = input.dataset.shown = open ? "" : short(one / size);
        input.setAttribute("aria-invalid", false);
      });
      note.hidden = true;
    });
  }

  // Whether the field of a key that the scene lacks is shown.
  opens(place) {
    if (place === "sites.radius") return this.facts.family === "Solid";
    if (place === "deck.yield_range") return Boolean(this.scene.deck.yield_strength);
    return SHOWN_EMPTY.includes(place) || place === "material.yield_strength" && !this.scene.material.name;
  }

  show_form() {
    for (const one of this.shown) one();
    find("undo").disabled = !this.can.undo;
    find("finer").hidden = !this.facts.refines;
    find("save").hidden = !this.facts.saves;
    for (const one of document.querySelectorAll(".of-impact")) one.hidden = this.falls;
    find("held-list").replaceChildren();
    for (const name of this.held) this.face_button(find("held-list"), name, `${name} ×`);
    if (!this.held.length && !this.facts.of_deck) new_element("small", find("held-list"), "free: no face is held");
    this.name_map();
  }

  // Take over the scene that the server sent.
  take({ scene, held, falls, undo, turn }) {
    Object.assign(this, { scene, held, falls, turn, can: { undo }, taken: null });
    this.show_form();
  }

  // -- what changes

  // Change the scene and show its answer; returns the reason of a refusal, or "".
  async edit(changes) {
    try {
      const before = this.scene, held = String(this.held), kind = this.falls;
      this.take(await this.call("edit", { ...changes, opening: this.facts.opening }));
      const place = ({ sites, impactor }) => JSON.stringify([sites, impactor]);
      if (kind !== this.falls || held !== String(this.held) || place(before) !== place(this.scene) || this.page && this.page.sites) this.draw_setup();
      this.answer();
      return "";
    } catch (error) {
      this.wrong(error.message);
      return error.message;
    }
  }

  // Ask for the answer in steps, and show each: force with error bars, then motion and stress.
  async answer() {
    const { turn } = this;
    delete document.documentElement.dataset.failed;
    this.outdated(true);
    this.warn([]);
    this.wrote("");
    const settled = await this.step("settle");
    if (!settled) return;
    if (settled.summary) this.tell(settled.summary);
    document.documentElement.dataset.settled = turn;
    const found = await this.step("show");
    if (!found) return;
    this.show(found);
    this.outdated(false);
    document.documentElement.dataset.complete = turn;
  }

  show(found) {
    const { view } = this;
    if (this.page) this.page.stop();
    if (found.fall) {
      this.page = new FallPage(found.fall, view);
      if (view) view.picked = (x, y, e) => this.click(x, y, e.shiftKey);
    } else {
      const part = found.part || { ...this.skin, held: this.held_points() };
      this.page = new Page({ ...found, part, fixed: true }, this.engine, view, true);
      this.taken = found.taken;
      find("python").value = found.python;
    }
    globalThis.page = this.page;
    this.tell(found.summary);
    this.show_form();
  }

  // Show answers, rows and cautions; the text of `antiosc run` is folded.
  tell({ cards, rows, sentences, cautions = [], more = [], text = "" }) {
    find("cards").replaceChildren();
    for (const [name, told, tone = ""] of cards) {
      const card = new_element("div", find("cards"), "", { className: `card ${tone}` });
      new_element("dt", card, name);
      new_element("dd", card, told);
    }
    find("rows").replaceChildren();
    for (const [name, told] of rows) {
      const row = new_element("tr", find("rows"));
      new_element("th", row, name);
      new_element("td", row, told);
    }
    find("sentences").replaceChildren();
    for (const one of sentences) new_element("p", find("sentences"), one);
    this.warn(cautions, more);
    find("text").textContent = text;
  }

  // -- a map

  // Name the map button by what it does: strike the chosen site, or map the clicked face or the part.
  name_map() {
    find("map").textContent = this.page && this.page.sites ? "Strike this site" : `Map ${this.face || "the part"}`;
    find("most-sites").hidden = Boolean(this.falls || this.page && this.page.sites);
  }

  async map() {
    if (this.page && this.page.sites) return this.strike_chosen();
    const most = Number(find("most-sites").value) || undefined;
    ({ turn: this.turn } = await this.call("stop")); // motion and stress of the blow would replace the map
    const found = await this.step("map", { ...(this.face ? { where: this.face } : {}), ...(most ? { most_sites: most } : {}) });
    if (!found) return;
    if (this.page) this.page.stop();
    this.page = globalThis.page = new Page({ ...found, fixed: true }, this.engine, this.view, true);
    this.tell(found.summary);
    this.outdated(false);
    this.name_map();
  }

  strike_chosen() {
    const { sites, site } = this.page;
    this.edit({ set: { "sites.point": this.placed(sites.at(site)), "sites.direction": aimed(sites.along(site)) } });
  }

  // -- files

  wrote(text) { Object.assign(find("written"), { textContent: text, hidden: !text }); }

  async save() {
    const { folder, names } = await this.call("names");
    find("question").textContent = `Write ${names.join(" and ")} into ${folder}?`;
    find("no").onclick = () => find("ask").close();
    find("yes").onclick = async () => {
      find("ask").close();
      this.wrote("The scene and its report are being written …");
      const found = await this.step("write", { agreed: names });
      if (!found) return this.wrote("");
      this.wrote(`Written into ${found.folder}: ${found.written.join(" and ")}. The same numbers again: ${found.again} `);
      new_element("a", find("written"), "Open the report", { href: found.report, target: "_blank", rel: "noopener" });
      find("written").scrollIntoView({ block: "nearest" });
    };
    find("ask").showModal();
  }
}

const exact = (x) => Number(Number(x).toPrecision(9)); // without the last digits of a change of unit
const short = (x) => { const whole = exact(x); return String(whole).length > DIGITS ? Number(whole.toPrecision(4)) : whole; };
const aimed = (direction) => direction.map((x) => Math.round(1e3 * x) / 1e3 + 0); // as far as the skin knows it; no -0

globalThis.bench = new Bench();
