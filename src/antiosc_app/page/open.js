// The page of `antiosc open`: clicks and fields change a set-up, which the server strikes.

// Fields of the set-up: name, label, unit, least and largest value of the slider; of the striker
// also the kinds that have it.
const FIELDS = {
  striker: [["radius", "radius", "mm", 1, 200, ["ball", "mass"]], ["mass", "mass", "kg", 0.01, 100, ["mass"]],
    ["speed", "speed", "m/s", 0.05, 50, ["ball", "mass"]], ["from_height", "from height", "m", 0.0002, 100, ["ball", "mass"]], ["height", "height", "m", 0.01, 20, ["floor"]],
    ["corner_radius", "corner radius", "mm", 0.01, 10, ["floor"]],
    ["friction", "friction", "", 0, 1, ["floor"]],
    ["layer_thickness", "layer thickness", "mm", 1, 200, ["floor"]], ["layer_modulus", "layer modulus", "MPa", 0.05, 1000, ["floor"]]],
  "site-fields": [["radius", "patch radius", "mm", 0.1, 100], ["duration", "duration", "ms", 0.1, 100],
    ["n", "anti-oscillators", "", 5]],
  part: [["thickness", "thickness", "mm", 0.1, 100], ["damping", "damping ratio", "", 0, 0.1],
    ["yield_strength", "yield strength", "MPa", 50, 3000], ["density", "density", "kg/m³", 100, 20000],
    ["modulus", "Young's modulus", "GPa", 0.001, 1000]],
};
// Fields that show another value: which, what they show of it, and the value of what is typed.
const GRAVITY = 9.80665, DERIVED = { from_height: ["speed", (speed) => speed ** 2 / (2 * GRAVITY), (height) => Math.sqrt(2 * GRAVITY * height)] };
// A material that is not in the list, and its constants: name, label, unit; the last is a range.
const OWN = "own material", CONSTANTS = [["E", "Young's modulus", "GPa"], ["nu", "Poisson's ratio", ""], ["rho", "density", "kg/m³"],
  ["yield_strength", "yield strength", "MPa"]], STRENGTHS = ["yield_range", "its range", "MPa"];
const UNSTATED = ["density", "modulus"]; // of decks that do not state them
const SIZES = { mm: 1e-3, ms: 1e-3, MPa: 1e6, GPa: 1e9 }; // of units of the fields that are not those of the set-up
const WHOLE = ["n"]; // fields of whole numbers
const OPTIONAL = { damping: "none", friction: "none", yield_strength: "unknown" }; // fields that are shown without a value, and what they say then
// What a number field takes, in its unit: the rule as it is told beside it, and whether a number keeps it.
const ANY = ["a number", () => true], ABOVE_0 = ["a number above 0", (x) => x > 0];
const AT_LEAST_0 = ["a number of at least 0", (x) => x >= 0];
const RULES = { damping: AT_LEAST_0, friction: AT_LEAST_0, nu: ["a number between -1 and 0.5", (x) => x > -1 && x < 0.5],
  n: ["a whole number of at least 1", (x) => Number.isInteger(x) && x >= 1] };
const rule_of = (name) => RULES[name] || ABOVE_0;
const SET = "set by you, at every site "; // beside a field that the page chooses otherwise
const OF_CELLS = ["point", "finer", "size"]; // what a patch as the cells resolve it depends on
const STRUCK = ["ball", "mass", "hammer"];
const KINDS_OF_STRIKER = { ball: "a ball", mass: "a mass with a round tip", hammer: "an IK hammer", floor: "the floor: it falls" };
const PAUSE = 250, MOST_UNDO = 200; // ms until a set-up is settled; set-ups that are kept
const MOST_ANSWERS = 12; // that are kept whole
// What a call of the server computes, where it does not say it more closely.
const STAGES = { look: "opening", take: "opening the piece", blow: "striking", settle: "striking, with error bars", fields: "motion and stress for the picture",
  verdict: "the largest stress", speeds: "the speed from which it yields", map: "striking all sites", map_forecast: "counting the sites of the map", write: "writing" };
const WRITING = "The scene and its report are being written:", WRITTEN = "is written and may be used; its report follows:";
const LONG = 20, SOON = 60, FEWEST = 50, SAVES = 0.75; // s of a map that is asked for, and of that with fewer sites; their number, and share of the time
const LASTS = 2; // s from which on an answer tells its time
const STOPPED = ["blow", "settle", "fields", "verdict", "speeds", "map"]; // calls that can be stopped
const CONTINUED = ["settle", "fields", "verdict", "speeds"]; // steps of an answer that has begun
const ADDING = ["fields", "verdict", "speeds", "write"]; // steps whose warnings join those of the impact
const MARGINS = 28; // pixels of a list beside its text
const MOST_NUMBERED = 12; // faces without a name of their own that are not folded away
const is_numbered = (name) => /^(face|flat side) \d+$/.test(name);
const NOTE = 3; // weight of a note of what was chosen
const MOST_DIGITS = 6; // of a number that fits into its field
const HEAVY = 1000; // times the mass of the part from which on a striker's mass is questioned before it strikes
const GRIP = 22; // pixels around the tail of the arrow that drag it
const SEE_THROUGH = 0.6; // cover of a face that stands out
// What a tab keeps over a reload; nothing where the browser forbids it.
const STORAGE = (() => { try { return sessionStorage; } catch { return { getItem: () => null, setItem() {} }; } })();

class Bench {
  constructor() {
    this.token = location.pathname.split("/")[1];
    this.tab = String(Math.random());
    this.turn = 0;
    this.pending = 0;
    [this.past, this.future, this.warned, this.caution] = [[], [], [], ""];
    this.answers = new Map(); // set-up -> its whole answer
    this.followed = false; // whether the direction has followed a place that was typed
    this.narrowed = new Set(); // set-ups after which smaller cells at the largest stress have followed
    this.refusing = []; // fields that are marked as those of a refused set-up, and with what
    this.lent = []; // radii of patches of sites of maps that were struck
    this.look();
  }

  // -- the server

  async call(name, content = {}) {
    this.called = name;
    if (!CONTINUED.includes(name)) this.began_all = performance.now();
    this.busy(1);
    try {
      const answer = await fetch(`/${name}`, { method: "POST", body: JSON.stringify(content),
        headers: { "Content-Type": "application/json", "X-Antiosc-Token": this.token } });
      if (!answer.ok) throw new Error(await answer.text());
      const { answer: found, error, field } = unpacked(await answer.text());
      if (error) throw Object.assign(new Error(error), { field });
      return found;
    } finally {
      this.busy(-1);
    }
  }

  busy(change) {
    this.pending += change;
    if (change > 0 && this.pending === 1) this.asking = setTimeout(() => this.ask_progress(), 300);
    if (!this.pending) {
      clearTimeout(this.asking);
      find("stop").hidden = true;
    }
    find("busy").style.visibility = this.pending ? "visible" : "hidden";
  }

  async ask_progress() {
    const answer = await fetch("/progress", { method: "POST", body: "{}",
      headers: { "Content-Type": "application/json", "X-Antiosc-Token": this.token } }).catch(() => null);
    if (answer && answer.ok && this.pending) { // else it is of work that has ended, whose result is told
      const { answer: found } = await answer.json();
      this.tell_progress(found.doing || STAGES[this.called] || "computing", found);
    }
    if (this.pending) this.asking = setTimeout(() => this.ask_progress(), 300);
  }

  // What the server does, and how much of it is done where it counts; if it lasts, for how long the
  // answer is computed, by the clock of the server where the page was loaded again meanwhile.
  tell_progress(doing, { takes, lasted = 0, written } = {}) {
    const counted = /(\d+) of (\d+)/.exec(doing), bar = find("bar");
    const seconds = Math.floor(Math.max(lasted, (performance.now() - this.began_all) / 1e3));
    const told = seconds < LASTS && !takes ? doing : `${doing} (${[clock(seconds), takes].filter(Boolean).join(" ")})`;
    find("doing").title = doing;
    find("doing").textContent = told;
    if (this.called === "write") this.wrote(`${written ? `${written} ${WRITTEN}` : WRITING} ${told}`); // beside the button
    if (seconds >= LASTS && STOPPED.includes(this.called)) find("stop").hidden = false;
    if (counted) bar.value = counted[1] / counted[2];
    else bar.removeAttribute("value");
  }

  // A step of the answer to the present set-up; null once there is a later one.
  async step(name, more = {}) {
    const turn = this.turn, { setup, tab } = this;
    try {
      const found = await this.call(name, { tab, turn, setup, opening: this.facts.opening, ...more });
      if (turn !== this.turn || found.stale) return null;
      this.warned = [...(ADDING.includes(name) ? this.warned : []), ...found.warnings];
      this.wrong("", false);
      if (["blow", "map"].includes(name)) this.outdated(false);
      return found;
    } catch (error) {
      if (turn !== this.turn) return null;
      if (name === "blow") this.refused(error.message, error.field);
      else this.wrong(error.message, true);
      return null;
    }
  }

  // The work for the present set-up is given up at its next step; what is shown stays.
  async stop() {
    const blow = this.called === "blow";
    this.turn += 1;
    await this.call("stop", { tab: this.tab, turn: this.turn });
    this.wrong("Stopped: a click or a field strikes again.", false);
    if (find("case").textContent) find("case").textContent = "stopped before the error bars";
    if (blow) this.outdated(true);
  }

  // Whether the numbers shown are of an earlier set-up, because the present one has no answer, or none yet.
  outdated(are) {
    document.body.classList.toggle("outdated", are);
    find("save").disabled = are;
    if (are) find("python").value = ""; // it would be the site before
    else this.accepted();
  }

  // An error or a hint, the caution, and the warnings of what is shown.
  wrong(text, failed) {
    const first = [text, this.caution].filter(Boolean), known = [...new Map(this.warned.map((one) => [one[1], one])).values()];
    const others = known.filter(([, one]) => !this.caution.includes(one)).sort((a, b) => a[0] - b[0]);
    notice(find("wrong"), [...first.map((one) => [0, one]), ...others]);
    if (failed) document.documentElement.dataset.failed = text;
  }

  // -- the part

  async look() {
    try {
      const found = await this.call("look");
      Object.assign(this, { facts: found, skin: found.skin, setup: found.setup, view: View.on(find("view")) });
      this.engine = await Engine.load(found.engine);
    } catch (error) {
      this.wrong(error.message, true);
      return;
    }
    this.divide();
    const kept = JSON.parse(STORAGE.getItem(this.token)) || {};
    if (kept.opening === this.facts.opening) Object.assign(this, kept); // else it is of another piece
    find("sliders").before(find("notices")); // they change their height, which moves no picture there
    find("live").hidden = find("setup").hidden = false;
    const wide = matchMedia("(min-width: 1151px)"), place = () => (wide.matches ? find("stage").append(find("verdict")) : find("live").after(find("verdict")));
    wide.onchange = place; // below the picture there is room for the sentences beside the numbers
    place();
    if (this.view) {
      const { point, direction, striker: { radius } } = this.setup, place = this.falls() ? null : { point, direction, radius };
      new Part({ ...this.skin, held: this.held() }, null, this.view, place, true).show("", 0); // with the striker, which would move the part later
      this.view.face(direction);
      this.view.fit();
      this.view.draw();
      this.view.picked = (x, y, e) => this.click(x, y, e.shiftKey);
      this.view.grabbed = (x, y) => this.grab(x, y);
    }
    this.make_fields();
    this.strike();
    if (kept.opening !== this.facts.opening && this.facts.opening > 1) this.wrote("Opened as a new part, with a set-up of its own: the list of pieces leads back, Undo does not.");
    if (this.past.length) this.wrote("The set-up is that of before the page was loaded again; Undo goes back step by step.");
  }

  // The set-up, and those of Undo and Redo, for a reload of the page.
  keep() {
    const { setup, past, future, face, lent, turned, facts: { opening } } = this;
    STORAGE.setItem(this.token, JSON.stringify({ opening, setup, past, future, face, lent, turned }));
  }

  // Each triangle of the skin gets points of its own, so that faces end sharply.
  divide() {
    const { points, faces, middle, half } = this.skin;
    this.skin.of = faces; // the point of the mesh at each corner
    const corners = new Map(Array.from(faces, (point, corner) => [point, corner])), of_corners = (lines = []) => Uint32Array.from(lines, (point) => corners.get(point));
    Object.assign(this.skin, { edges: of_corners(this.skin.edges), seams: of_corners(this.skin.seams) });
    this.skin.points = Int16Array.from({ length: 3 * faces.length }, (_, i) => points[3 * faces[Math.floor(i / 3)] + i % 3]);
    this.skin.faces = Uint32Array.from(faces.keys());
    this.rest = Float32Array.from(this.skin.points, (x, i) => middle[i % 3] + x * half / 32767);
  }

  // Which points of the skin are held: the corners of triangles of a face, or the nodes of an edge.
  held() {
    const held = new Uint8Array(this.rest.length / 3), { nodes, of } = this.skin;
    for (const name of this.setup.held) {
      const own = new Set(nodes[this.facts.faces.indexOf(name)]);
      if (own.size) of.forEach((node, corner) => { if (own.has(node)) held[corner] = 1; });
      else for (const corner of this.corners(name)) held[corner] = 1;
    }
    return held;
  }

  // The points of the triangles of a face; none of a name that is no face.
  corners(name) {
    const triangles = this.skin.sets[this.facts.faces.indexOf(name)] || [];
    return Array.from(triangles).flatMap((f) => [3 * f, 3 * f + 1, 3 * f + 2]);
  }

  // A face stands out while the pointer or the focus is on its name, also behind others; "" ends it.
  preview(name) {
    if (!this.view) return;
    const shown = new Float32Array(this.rest.length / 3).fill(MARK), corners = this.corners(name);
    this.view.put("face", this.rest, shown, Uint32Array.from(corners), SEE_THROUGH);
    this.view.draw();
  }

  // A button with the name of a face.
  face_button(where, name, text, title) {
    const [on, off] = [() => this.preview(name), () => this.preview("")];
    const button = made("button", where, text, { type: "button", value: name, title, onclick: () => this.toggle(name),
      onmouseenter: on, onfocus: on, onmouseleave: off, onblur: off });
    if (this.facts.places[name]) made("small", button, this.facts.places[name]);
    return button;
  }

  // What is seen at a place of the canvas: point, outward normal, name of its face; or null.
  seen(x, y) {
    const sight = this.view.sight(x, y), [from, d] = this.page && this.page.into ? this.page.into(sight) : sight;
    const found = crossings(this.rest, this.skin.faces, from, d);
    if (!found.length) return null;
    const { at, face, normal } = found.reduce((a, b) => (b.at < a.at ? b : a)), tag = this.skin.tags[face];
    return { point: from.map((c, i) => c + at * d[i]), normal: dot(normal, d) > 0 ? normal.map((c) => -c) : normal,
      name: tag ? this.facts.faces[tag - 1] : "", triangle: face };
  }

  // A place on the skin, whose points have coordinates of 16 bits, without digits that these do not know.
  placed(point) {
    const digit = 10 ** Math.ceil(Math.log10(this.skin.half / 32767));
    return point.map((x) => exact(Math.round(x / digit) * digit));
  }

  click(x, y, hold) {
    const { page } = this;
    if (page && page.sites) return page.choose(page.sites.near(x, y));
    if (page && page.into && page.near(x, y) >= 0) return page.pick(x, y);
    const seen = this.seen(x, y), of_sheet = this.beside(seen);
    if (!seen) return;
    if (this.falls() || !hold && document.querySelector("input[name=click]:checked").value === "strike") {
      this.face = seen.name;
      if (this.falls()) this.striker({ down: aimed(seen.normal) });
      else this.change({ point: this.placed(seen.point), direction: aimed(seen.normal.map((c) => -c)) });
    } else if (seen.name || of_sheet) this.toggle(seen.name || of_sheet);
    else this.wrong("Nothing with a name lies there: a face that is not flat cannot be held by a click.", false);
  }

  // The name of the smallest edge or set of nodes of a sheet that lies at the triangle which is seen; "" if none does.
  beside(seen) {
    const { sets } = this.skin, at = seen ? seen.triangle : -1;
    const near = this.facts.faces.map((name, i) => [sets[i].length, name, sets[i]]).filter(([, , set]) => Array.from(set).includes(at));
    return near.length ? near.reduce((a, b) => (b[0] < a[0] ? b : a))[1] : "";
  }

  toggle(name) {
    const { held } = this.setup;
    this.change({ held: held.includes(name) ? held.filter((one) => one !== name) : [...held, name] });
  }

  // Dragging the tail of the arrow turns it about the site.
  grab(x, y) {
    const { page, view } = this, place = page && !page.sites && !page.kind && page.data.place;
    if (!place) return null;
    const tail = page.part.tail(), [a, b] = view.seen(tail);
    if (Math.hypot(a - x, b - y) > GRIP) return null;
    const reach = Math.hypot(...less(tail, place.point));
    return (to_x, to_y, done) => {
      const [from, d] = view.sight(to_x, to_y), out = less(from, place.point), along = dot(out, d);
      const near = out.map((c, i) => c - along * d[i]), across = Math.hypot(...near);
      const up = Math.sqrt(Math.max(reach ** 2 - across ** 2, 0)), direction = aimed(unit(near.map((c, i) => up * d[i] - c)));
      place.direction = direction;
      page.picture();
      if (done) this.turn_to(direction);
    };
  }

  // A direction that the user has chosen: a place that is typed keeps it.
  turn_to(direction, inputs = []) {
    this.turned = direction;
    this.change({ ...this.chosen, direction }, true, inputs);
  }

  is_turned() { return String(this.turned) === String(this.setup.direction); }

  // The place that is typed, with the direction into the surface there unless the user has turned it.
  move_to(point, inputs) {
    const { facts, setup, chosen, skin, rest } = this, before = { ...setup, ...chosen }.direction;
    const normal = facts.family === "Beam" || this.is_turned() ? null : normal_at(rest, skin.faces, point, facts.family === "Solid" ? null : before);
    const aim = normal ? { direction: aimed(normal) } : {};
    this.change({ ...chosen, point, ...aim }, true, inputs);
    this.followed = Boolean(normal) && String(aim.direction) !== String(before);
    this.show_fields();
  }

  // -- fields

  // Names of faces as a reader looks for them: holes, groups of the file, then faces by their numbers.
  in_order(names) {
    const rank = (name) => (/^hole .*mm/.test(name) ? 0 : is_numbered(name) ? 2 : 1);
    return [...names].sort((a, b) => rank(a) - rank(b) || a.localeCompare(b, "en", { numeric: true }));
  }

  make_fields() {
    const { facts } = this;
    const ordered = this.in_order(facts.faces), numbered = ordered.filter(is_numbered), folds = numbered.length > MOST_NUMBERED && numbered.length < ordered.length;
    const rest = folds ? made("details", find("hold-row")) : null;
    if (folds) made("summary", rest, `${numbered.length} faces by number`);
    const lists = [find("hold"), folds ? made("div", rest, "", { className: "row faces" }) : find("hold")];
    const names = ordered.map((name) => this.face_button(lists[Number(is_numbered(name))], name, folds ? name.replace(/^face /, "") : name, `hold or free ${name}`));
    this.pieces();
    this.shown = [() => names.forEach((one) => one.setAttribute("aria-pressed", this.setup.held.includes(one.value)))];
    const part = [() => this.setup, (...values) => this.change(...values)], striker = [() => this.setup.striker, (...values) => this.striker(...values)];
    this.choice(find("part"), "material", facts.materials, () => this.setup.material, (material) => this.choose_material(material, ...part));
    if (facts.materials.length) {
      this.own_material("part", [...CONSTANTS.map((one) => [...one, 1]), [...STRENGTHS, 2]], ...part);
      this.lent_of_own();
    }
    this.choice(find("striker"), "kind", facts.strikers, () => this.setup.striker.kind, (kind) => this.striker({ kind }), KINDS_OF_STRIKER);
    this.choice(find("striker"), "of", facts.striker_materials, () => this.setup.striker.material,
      (material) => this.choose_material(material, ...striker), {}, ["ball", "mass"]);
    this.own_material("striker", CONSTANTS.map((one) => [...one, 1]), ...striker);
    this.choice(find("striker"), "name", facts.hammers, () => this.setup.striker.name, (name) => this.striker({ name }), {}, ["hammer"]);
    this.choice(find("striker"), "onto", facts.floors, () => this.setup.striker.floor, (floor) => this.striker({ floor }), {}, ["floor"],
      () => !this.layered());
    this.choice(find("striker"), "soft layer", facts.layers, () => this.setup.striker.layer, (layer) => this.striker({ layer, layer_modulus: null }), {}, ["floor"]);
    this.triple("site-fields", "point", "place", "mm");
    this.triple("site-fields", "direction", "direction", "");
    this.triple("striker", "down", "what points down", "", ["floor"]);
    this.triple("striker", "tilt", "then tilted about x, y, z", "°", ["floor"]);
    this.cell_size();
    for (const [where, fields] of Object.entries(FIELDS)) fields.forEach((one) => this.slider(where, ...one));
    // before the handler of the field, which may fill it
    find("setup").addEventListener("change", ({ target }) => { target.dataset.shown = target.value; }, true);
    find("undo").onclick = () => this.undo(this.past, this.future);
    find("redo").onclick = () => this.undo(this.future, this.past);
    document.addEventListener("keydown", (e) => {
      if (e.ctrlKey && e.key === "z" && e.target.type !== "number") { e.preventDefault(); this.undo(this.past, this.future); }
    });
    find("finer").hidden = !facts.refines;
    find("finer").onclick = () => this.finer();
    find("coarser").onclick = () => this.coarser();
    find("stop").onclick = () => this.stop();
    find("save").hidden = !facts.saves;
    find("save").onclick = () => this.save();
    find("map").onclick = () => (this.page && this.page.sites ? this.map() : this.ask_map(this.face || ""));
    find("map-all").onclick = () => this.ask_map("");
    find("most-sites").onchange = () => this.limit_sites();
    find("stresses").onclick = () => this.stresses();
    find("python").onfocus = () => find("python").select();
    this.show_fields();
  }

  // The pieces of the file, of which another one is opened as a new part.
  pieces() {
    const { pieces, piece, contact, contacts } = this.facts;
    this.opens_anew(`piece (of ${pieces.filter(([rank]) => rank).length})`, "piece", pieces, piece, Number);
    this.opens_anew("contact pairs", "contact", Object.entries(contacts), contact, String);
  }

  // A list of which another entry opens the file as a new part.
  opens_anew(label, name, entries, chosen, as) {
    if (!entries.length) return;
    const row = made("label", find("pieces"), label), select = made("select", row, "", { name });
    for (const [value, text] of entries) made("option", select, text, { value });
    select.value = chosen;
    select.onchange = () => this.take(select, { [name]: as(select.value) });
    full_text(select);
  }

  async take(select, choice) {
    try {
      this.turn += 1; // what is computed for this piece ends
      await this.call("stop", { tab: this.tab, turn: this.turn });
      await this.call("take", choice);
      location.reload();
    } catch (error) {
      select.value = this.facts[select.name];
      full_text(select);
      this.wrong(error.message, true);
    }
  }

  // A material of one's own starts from the constants of the material before it, also at the second time:
  // constants that were typed before are found by Undo.
  choose_material(material, owner, change) {
    const { own, material: before } = owner();
    change(material === OWN ? { material, own: before === OWN ? own : this.facts.constants[before] } : { material });
  }

  // The constants of a material that is not in the list, of the part or the striker; yield strength and range may be empty.
  own_material(where, fields, owner, change) {
    const kinds = { striker: ["ball", "mass"], part: [...STRUCK, "floor"] }[where], of = where === "striker" ? "striker's " : "";
    for (const [name, label, unit, count] of fields) {
      const row = made("label", find(where), label, { className: "own" }), size = SIZES[unit] || 1;
      const inputs = Array.from({ length: count }, (_, i) => made("input", row, "", { type: "number", step: "any", name: `${of}${name}`,
        ariaLabel: `${of}${label}${count > 1 ? [", from", ", to"][i] : ""} in ${unit || "1"}` }));
      made("span", row, unit);
      inputs.forEach((input) => { input.onchange = () => this.set_constant(name, inputs, size, owner, change); });
      this.shown.push(() => {
        const { kind } = this.setup.striker, { material, own } = owner(), value = (own || {})[name];
        row.hidden = material !== OWN || !kinds.includes(kind) || name === "rho" && where === "striker" && kind === "mass";
        inputs.forEach((input, i) => fill(input, value == null ? "" : exact((count > 1 ? value[i] : value) / size)));
      });
    }
  }

  // What the part's own material has of the one that it began as.
  lent_of_own() {
    const lent = made("small", find("part"));
    this.shown.push(() => {
      const { own } = this.setup, { origin = "" } = own || {};
      lent.hidden = this.setup.material !== OWN || !own.yield_strength || !origin;
      if (!lent.hidden) lent.textContent = this.lent_text(own, origin);
    });
  }

  // What a material of one's own has of that which it began as: `same_kind` of antiosc.base.materials.
  lent_text(own, origin) {
    const before = this.facts.constants[origin];
    const alike = ["E", "rho"].every((name) => Math.abs(own[name] - before[name]) <= this.facts.same_kind * before[name]);
    const lends = [own, before].every((one) => one.yield_range) && own.yield_range.every((end, i) => {
      return Math.abs(end / own.yield_strength / (before.yield_range[i] / before.yield_strength) - 1) < 1e-3;
    });
    const range = lends ? ` Its range of the yield strength is that of ${origin}, in proportion, until you change it.` : "";
    if (!alike) return `It is another kind of material than ${origin}: its strength does not grow with the strain rate.${range}`;
    return `The growth of its strength with the strain rate is that of ${origin}, in proportion to the yield strength.${range}`;
  }

  // The yield strength of a deck and its range, be they those of a name.
  strength() {
    const { yield_strength: own, yield_range: range } = this.setup, named = this.facts.constants[own];
    return named ? { ...named, ...(range ? { yield_range: range } : {}) } : this.setup;
  }

  // The names of materials that are like those of a deck, for its yield strength.
  strength_list() {
    const names = this.facts.strengths, by_name = () => (names.includes(this.setup.yield_strength) ? this.setup.yield_strength : "");
    if (!names.length) return;
    this.choice(find("part"), "yields like", ["", ...names], by_name, (name) => this.change({ yield_strength: name || null, yield_range: null }),
      { "": "none of these" });
  }

  // The range of the yield strength of a deck, once that is given.
  deck_range() {
    const [name, label, unit] = STRENGTHS, row = made("label", find("part"), label, { className: "own" }), size = SIZES[unit];
    const inputs = ["from", "to"].map((end) => made("input", row, "", { type: "number", step: "any", name, ariaLabel: `${label}, ${end} in ${unit}` }));
    made("span", row, unit);
    const set = () => {
      const values = typed(inputs, size, ABOVE_0, true);
      if (!values) return;
      if (values.includes(null) && values.some((one) => one !== null)) return inputs.forEach((input) => mark(input, input.value ? "" : "both ends, or none"));
      this.change({ yield_strength: this.strength().yield_strength, yield_range: values.includes(null) ? null : values }, true, inputs);
    };
    inputs.forEach((input) => { input.onchange = set; });
    this.shown.push(() => {
      const { yield_strength: strength, yield_range: range } = this.strength();
      row.hidden = !strength;
      inputs.forEach((input, i) => fill(input, range ? exact(range[i] / size) : ""));
    });
  }

  // Whether the part is a deck, with materials and supports of its own.
  of_deck() { return !this.facts.materials.length && this.facts.saves; }

  // A constant of one number, or a range, which counts once both its ends are there, or none. The range
  // of a yield strength grows with it.
  set_constant(name, inputs, size, owner, change) {
    const { own } = owner(), optional = name.startsWith("yield_"), values = typed(inputs, size, rule_of(name), optional);
    if (!values) return;
    if (values.some((one) => one !== null) && values.includes(null)) return inputs.forEach((input) => mark(input, input.value ? "" : "both ends, or none"));
    const value = values.includes(null) ? null : values.length > 1 ? values : values[0];
    const scaled = name === "yield_strength" ? { yield_range: grown(own, value) } : {};
    change({ own: { ...own, ...scaled, [name]: value } }, true, inputs);
  }

  // The largest cell of the mesh: a number alone, for every value makes another mesh.
  cell_size() {
    if (!this.facts.size) return;
    const row = made("label", find("part"), "cell size", { className: "slider" });
    const number = made("input", row, "", { type: "number", step: "any", min: 0, name: "size", ariaLabel: "cell size in mm" });
    made("span", row, "mm");
    number.onchange = () => {
      const size = typed([number], SIZES.mm, ABOVE_0, true);
      if (size) this.resize(size[0], [number]);
    };
    const finer = made("div", find("part"), "", { className: "row" });
    this.shown.push(() => {
      const now = this.setup.size ?? (this.by_server && this.by_server.size) ?? this.facts.size;
      fill(number, Number((now / SIZES.mm).toPrecision(4)));
      this.offer_sizes(finer, now);
    });
  }

  // The next finer sizes of the cells, with what they take, and the way back to the first.
  offer_sizes(row, now) {
    const button = (size, text, title) => made("button", row, text, { type: "button", title, onclick: () => this.resize(size) });
    row.replaceChildren();
    row.hidden = !this.facts.sizes.length;
    made("small", row, "finer cells, and what the whole answer with them takes:");
    for (const [size, takes] of this.facts.sizes.filter(([size]) => size < 0.99 * now).slice(0, 2)) {
      button(size, `${exact(size / SIZES.mm)} mm`, `a cell size of ${exact(size / SIZES.mm)} mm`);
      made("small", row, takes);
    }
    if (this.setup.size !== null) button(null, "first size", "the cell size with which the page began");
  }

  // Another size of the cells; a mesh that takes long is made once the user has agreed.
  async resize(size, inputs = []) {
    try {
      const { question, larger, fits = true } = await this.call("forecast", { setup: { ...this.setup, size } });
      const make = () => this.change({ size }, true, inputs);
      const other = larger ? [`Rather ${exact(larger / SIZES.mm)} mm`, () => this.resize(larger, inputs)] : undefined;
      if (!question) return make();
      this.ask(question, fits ? "Make it" : "Make it all the same", make, () => this.show_fields(), other);
      if (!fits) find(larger ? "other" : "no").focus();
    } catch (error) {
      inputs.forEach((input) => mark(input, error.message));
      this.wrong(error.message, true);
    }
  }

  choice(where, label, options, get, set, texts = {}, kinds = null, counts = () => true) {
    if (!options.length) return;
    const row = made("label", where, label), select = made("select", row, "", { name: label });
    for (const one of options) made("option", select, texts[one] || one, { value: one });
    select.onchange = () => set(select.value);
    this.shown.push(() => { select.value = get(); row.hidden = !counts() || Boolean(kinds) && !kinds.includes(this.setup.striker.kind); full_text(select); });
  }

  // Three coordinates, of the set-up or of the striker of some kinds.
  triple(where, name, label, unit, kinds = null) {
    const row = made("label", find(where), "", { className: "triple" }), size = SIZES[unit] || 1;
    made("span", row, unit ? `${label} (${unit})` : label);
    const inputs = [0, 1, 2].map((i) =>
      made("input", row, "", { type: "number", step: "any", name: `${name} ${"xyz"[i]}`, ariaLabel: `${label}, ${"xyz"[i]}${unit && ` in ${unit}`}` }));
    const set = { point: (values) => this.move_to(values, inputs), direction: (values) => this.turn_to(values, inputs) }[name]
      || ((values) => this.striker({ [name]: values }, true, inputs));
    inputs.forEach((input) => {
      input.onchange = () => {
        const values = typed(inputs, size, ANY);
        if (values) set(values);
      };
    });
    this.shown.push(() => {
      const values = (kinds ? this.setup.striker : { ...this.setup, ...this.chosen })[name];
      row.hidden = !(kinds || STRUCK).includes(this.setup.striker.kind);
      inputs.forEach((input, i) => fill(input, exact(values[i] / size)));
    });
  }

  slider(where, name, label, unit, least, most = this.facts.most_n, kinds = null) {
    const { setup } = this.facts, open = (kinds ? setup.striker : setup)[name] === null; // an emptied field leaves the choice to the server
    if (open && name === "thickness") return;
    if (name === "yield_strength" && !(this.of_deck() && this.facts.yields)) return; // others have materials with a name, or layers
    if (UNSTATED.includes(name) && !this.facts.unstated[name]) return;
    if (name === "yield_strength") this.strength_list(); // above it
    const row = made("label", find(where), label, { className: "slider" });
    const range = made("input", row, "", { type: "range", min: 0, max: 1, step: 0.002, name, ariaLabel: label });
    const number = made("input", row, "", { type: "number", step: "any", min: 0, name, ariaLabel: `${label} in ${unit || "1"}` });
    made("span", row, unit);
    const size = SIZES[unit] || 1, [of, seen, meant] = DERIVED[name] || [name, (x) => x, (x) => x];
    number.placeholder = OPTIONAL[name] || "";
    const change = (value) => ({ [name]: value, ...(name === "yield_strength" ? { yield_range: grown(this.strength(), value) } : {}) });
    const set = (value, done, inputs) => (kinds ? this.striker({ [of]: value && exact(meant(value)) }, done, inputs) : this.change(change(value), done, inputs));
    const value = () => {
      const value = least ? least * (most / least) ** range.value : range.value * most;
      return WHOLE.includes(name) ? Math.round(value) : Number(value.toPrecision(3));
    };
    range.oninput = range.onchange = ({ type }) => {
      mark(number, "");
      set(exact(value() * size), type === "change", []);
    };
    number.onchange = () => {
      const values = typed([number], size, rule_of(name), open);
      if (values) set(values[0], true, [number]);
    };
    const own = made("small", row, SET, { className: "own-value", hidden: true });
    made("button", own, "automatic", { type: "button", title: "let the page choose it", onclick: () => set(null, true, []) });
    this.shown.push(() => {
      const { kind } = this.setup.striker, given = seen((kinds ? this.setup.striker : name === "yield_strength" ? this.strength() : this.setup)[of]);
      const now = given === null || given === undefined ? rounded(this.taken(name) / size) : exact(given / size), wanted = kinds || (where === "site-fields" ? STRUCK : [kind]);
      row.hidden = !wanted.includes(kind) || !now && !(name in OPTIONAL) || name.startsWith("layer_") && !this.layered();
      own.hidden = !open || name === "radius" && !kinds && this.is_lent() || name in OPTIONAL || given === null || given === undefined;
      if (row.hidden) return;
      range.value = least && now ? Math.log(now / least) / Math.log(most / least) : now / most;
      fill(number, now || !(name in OPTIONAL) ? fitting(now) : "");
      number.title = now;
      range.setAttribute("aria-valuetext", engineering(now, unit));
    });
    if (name === "yield_strength") this.deck_range(); // beside it
  }

  // Whether the radius of the patch is that of a site of a map that was struck.
  is_lent() { return this.lent.includes(this.setup.radius); }

  falls() { return this.setup.striker.kind === "floor"; }

  // The sentences on what the page guessed at first, as long as it is so.
  guesses() {
    const { facts, setup } = this, first = facts.setup;
    const kept = { striker: this.is_first_striker(), held: !this.falls() && String(setup.held) === String(first.held), material: setup.material === first.material };
    return Object.keys(kept).filter((name) => kept[name]).map((name) => facts[`first_${name}`]);
  }

  // Whether the striker is still the one with which the page began, be it faster.
  is_first_striker() {
    const { facts, setup } = this;
    return ["kind", "radius", "material"].every((name) => setup.striker[name] === facts.setup.striker[name]);
  }

  // Smaller cells around the site and the largest stress, or where the impacts of a fall strike and its stress is largest.
  async finer() {
    const { data = {} } = this.page || {}, places = (data.impacts || []).map((one) => one.point);
    if (this.falls()) return this.striker({ finer: places.concat(data.stressed ? [data.stressed] : []) });
    const more = data.stress_place ? [data.stress_place] : [], near = data.cells ? { near: data.cells } : {};
    const make = () => this.change({ ...this.chosen, finer: true, stressed: [...(this.is_finer() ? this.setup.stressed : []), ...more], ...near });
    try {
      const { question, fits = true } = this.chosen ? {} : await this.call("forecast", { setup: this.setup, finer: true });
      if (question) this.ask(question, fits ? "Make it" : "Make it all the same", make);
      else make();
    } catch (error) {
      this.wrong(error.message, true);
    }
  }

  coarser() {
    if (this.falls()) return this.striker({ finer: [] });
    this.change({ finer: false, stressed: [], near: null });
  }

  // Whether the largest stress lies at another place than those with smaller cells.
  stressed_elsewhere() {
    const { stress_place: place } = this.page ? this.page.data : {}, { stressed } = this.setup;
    const near = (one) => Math.hypot(...less(one, place)) < this.facts.size / 2;
    return Boolean(place) && !this.falls() && stressed.length < this.facts.most_stressed && !stressed.some(near);
  }

  is_finer() {
    const { finer, striker } = this.setup;
    return this.falls() ? striker.finer.length > 0 : finer ?? Boolean(this.by_server && this.by_server.finer);
  }

  layered() { return this.setup.striker.layer in this.facts.moduli; }

  // The value of a field that the set-up leaves open.
  taken(name) {
    if (name === "layer_modulus") return this.facts.moduli[this.setup.striker.layer] || 0;
    if (name === "radius") return this.site ? this.site.radius : 0;
    if (name === "duration") return this.lasts || 0;
    if (UNSTATED.includes(name)) return this.facts.unstated[name];
    if (name === "n") return this.by_server ? this.by_server.n : this.facts.n;
    if (name === "yield_strength") return 0;
    return this.falls() || name !== "damping" ? this.facts.fall[name] : 0;
  }

  show_fields() {
    for (const one of this.shown) one();
    forget("[hidden]");
    const falls = this.falls();
    find("file").textContent = [this.facts.told, ...this.guesses()].filter(Boolean).join(" ");
    find("site-fields").hidden = find("strikes").hidden = falls;
    const clicks_hold = !falls && this.facts.faces.length;
    for (const one of document.querySelectorAll(".of-click")) one.hidden = !clicks_hold;
    find("in-python").hidden = falls || Boolean(this.chosen);
    if (falls) find("stresses").hidden = true;
    for (const id of ["hold-row", "held-list", "map"]) find(id).hidden = falls || id === "hold-row" && !this.facts.faces.length;
    const refines = falls ? this.facts.geometry : this.facts.refines;
    find("finer").hidden = !refines || this.is_finer() && !this.stressed_elsewhere();
    find("coarser").hidden = !refines || !this.is_finer();
    const turned = this.followed ? "The direction has turned into the surface at the place that was typed. " : "";
    const strikes = clicks_hold ? turned : `${turned}A click strikes there. `;
    find("how").textContent = falls ? "The face that you click points down, then the part is tilted." : `${strikes}Drag the tail of the arrow to change the direction.`;
    this.name_map();
    find("held-list").replaceChildren();
    if (this.setup.held.length) made("span", find("held-list"), "held:");
    this.preview("");
    for (const name of this.setup.held) this.face_button(find("held-list"), name, name, "free it").append(" ×");
    for (const name of this.setup.held) if (this.facts.large_faces[name]) made("small", find("held-list"), this.facts.large_faces[name]);
    if (!this.setup.held.length && this.facts.faces.length) made("small", find("held-list"), this.facts.unheld);
    find("finer").textContent = this.is_finer() ? "Finer mesh at the largest stress" : "Finer mesh here";
    [find("undo").disabled, find("redo").disabled] = [!this.past.length, !this.future.length];
  }

  // -- what changes

  striker(values, done = true, inputs = []) { this.change({ striker: { ...this.setup.striker, ...values } }, done, inputs); }

  // Another set-up, by some fields; while a slider moves (`done` false) it is the same one for Undo.
  change(values, done = true, inputs = []) {
    this.inputs = inputs;
    if (!inputs.length) forget(); // a click has given what was typed
    this.chosen = null; // before the fields show it again
    this.followed = false;
    if (!this.moving) {
      this.past.push(this.setup);
      this.past.splice(0, this.past.length - MOST_UNDO);
      this.future = [];
    }
    this.moving = !done;
    const elsewhere = values.point ? { stressed: [], near: null } : {};
    // the patch of a site of a map is that of its cells
    if (this.is_lent() && OF_CELLS.some((name) => name in values)) elsewhere.radius = null;
    this.setup = { ...this.setup, ...elsewhere, ...values };
    this.show_fields();
    this.strike();
  }

  undo(from, to) {
    if (!from.length) return;
    to.push(this.setup);
    this.setup = from.pop();
    this.chosen = null;
    this.followed = false;
    this.inputs = [];
    forget();
    this.show_fields();
    this.strike();
  }

  // A set-up that is refused stays, that one field of it can be mended; what is shown is of the last
  // one that has an answer. The field that mends it is marked, or those that asked for it; Undo leads back.
  refused(text, field) {
    this.caution = "";
    this.wrong(text, true);
    this.outdated(true);
    const mends = document.querySelector(`#site-fields [type=number][name="${field}"]`);
    const marked = this.moving || document.querySelector("[aria-invalid=true]"); // a field changed before
    const fields = mends ? [mends] : marked ? [] : this.inputs;
    fields.forEach((input) => mark(input, text));
    this.refusing.push(...fields.map((input) => [input, text]));
  }

  // A set-up has its answer: no field refuses it any more; what was typed wrong since stays marked.
  accepted() {
    for (const [input, text] of this.refusing.splice(0)) if (marked_with(input) === text) mark(input, "");
  }

  // -- the answer: at once, settled, and with motion and stress

  async strike() {
    const turn = ++this.turn;
    this.cost = null;
    clearTimeout(this.later);
    if (!this.moving) this.keep();
    this.outdated(true);
    delete document.documentElement.dataset.failed;
    this.warned = [];
    this.warn("");
    this.wrote("");
    if (this.page) this.last = this.page.hit;
    if (this.page && this.page.sites) {
      this.page = null;
      this.tell([]); // what it advises is not on the page any more
    }
    this.chosen = null;
    const known = !this.moving && this.answers.get(JSON.stringify(this.setup));
    if (known) return this.recall(known);
    this.draw_awaited();
    const found = await this.step("blow");
    if (!found) return;
    if (found.fall) return this.fall(found);
    if (this.shown_blow !== turn) this.before = this.shown_hit();
    this.shown_blow = turn;
    this.show(found, null);
    this.later = setTimeout(() => this.settle(found), found.settled ? 0 : PAUSE);
  }

  // The impact that is shown, or was, be it that of a site of a map.
  shown_hit() { return (this.page ? this.page.hit : this.last) || null; }

  // The new arrow and the held faces at once; the arrow is grey until the answer.
  draw_awaited() {
    const { page, setup, view } = this;
    const site = JSON.stringify([setup.point, setup.direction, setup.held]);
    if (!view || this.falls() || !page || !page.data.place || site === this.drawn_site) return;
    this.drawn_site = site;
    page.stop();
    const held = this.held(), { point, direction } = setup;
    Object.assign(page.data, { part: { ...this.skin, held }, place: { ...page.data.place, point, direction } });
    page.part = new Part(page.data.part, page.blow, view, page.data.place, true);
    page.kind = "";
    page.make_views();
    page.picture();
  }

  // A fall, then with its largest stress.
  async fall(found) {
    this.show_fall(found);
    const settled = await this.step("settle");
    if (!settled) return;
    this.show_fall(settled);
    this.completed();
    this.remember({ fall: settled });
  }

  // An answer that is whole is shown again at once when its set-up comes back.
  remember(answer) {
    const { answers, warned } = this;
    answers.set(JSON.stringify(this.setup), { ...answer, warned });
    if (answers.size > MOST_ANSWERS) answers.delete(answers.keys().next().value);
  }

  recall({ fall, settled, part, judged, warned }) {
    this.call("stop", { tab: this.tab, turn: this.turn, setup: this.setup }); // of what is computed
    this.outdated(false);
    this.warned = warned;
    if (fall) this.show_fall(fall);
    else {
      this.before = this.shown_hit();
      this.shown_blow = this.turn;
      this.show(settled, part);
      this.judge(judged);
      this.foresee();
    }
    this.completed();
  }

  completed() { for (const name of ["settled", "drawn", "complete"]) document.documentElement.dataset[name] = this.turn; }

  show_fall({ fall, about, caution, verdict }) {
    this.warn(caution);
    if (this.page) this.page.stop();
    this.page = globalThis.page = new FallPage(fall, this.view);
    if (this.view) this.view.picked = (x, y, e) => this.click(x, y, e.shiftKey);
    find("about").textContent = about;
    find("python").value = "";
    this.fitted = false;
    this.tell(verdict);
  }

  async settle(found) {
    const settled = found.settled ? found : await this.step("settle");
    if (!settled) return;
    if (settled !== found) this.show(settled, null);
    document.documentElement.dataset.settled = this.turn;
    const fields = await this.step("fields");
    if (!fields) return;
    this.show(settled, fields.part);
    document.documentElement.dataset.drawn = this.turn;
    const judged = await this.step("verdict");
    if (judged) this.judge(judged);
    const whole = judged && !judged.narrows ? await this.step("speeds") : judged;
    if (whole) {
      this.judge(whole);
      this.remember({ settled, part: fields.part, judged: whole });
      this.foresee();
    }
    document.documentElement.dataset.complete = this.turn;
    if (judged && judged.narrows) this.narrow();
  }

  // Smaller cells at the largest stress, once for a set-up: Undo leads back to it, and stays there.
  narrow() {
    const asked = JSON.stringify(this.setup), { stress_place, cells } = this.page.data;
    if (this.narrowed.has(asked)) return;
    this.narrowed.add(asked);
    this.change({ finer: true, stressed: [stress_place], ...(cells ? { near: cells } : {}) });
    find("case").textContent = "smaller cells at the largest stress follow, whose error is large …";
  }

  judge({ verdict, caution, judged }) {
    this.warn(caution);
    this.tell(verdict);
    Object.assign(this.page.data, judged, { awaited: false });
    delete this.page.drawn;
    this.page.rest();
    this.show_fields();
  }

  show({ blow, place, about, caution, verdict, settled, refining, python, site, taken }, part) {
    [this.site, this.lasts, this.by_server] = [site, blow.duration, taken];
    find("strikes").textContent = striker_text(blow, place);
    this.drawn_site = JSON.stringify([this.setup.point, this.setup.direction, this.setup.held]);
    this.show_fields();
    const kind = part && this.page ? this.page.kind : "";
    if (this.page) this.page.stop();
    const held = this.held();
    const data = { blow, place, part: part || { ...this.skin, held }, fixed: true, before: this.before, awaited: true };
    this.page = new Page(data, this.engine, this.view, true);
    if (kind && part) find("kind").value = this.page.kind = kind;
    if (this.view) this.page.picture();
    if (!this.fitted && this.view) { this.view.fit(); this.view.draw(); this.fitted = true; }
    find("about").textContent = about;
    find("held").textContent = place ? place.told : "";
    find("python").value = python;
    find("case").textContent = settled ? "" : refining || "bars follow …";
    this.heads("before");
    this.warn(caution);
    this.tell(verdict);
    globalThis.page = this.page;
  }

  // The sentence on a striker whose mass may be a slip; "" of others.
  heavy() {
    const { kind, mass, radius, material } = this.setup.striker, { mass: part, constants } = this.facts;
    const found = { mass, ball: 4 / 3 * Math.PI * radius ** 3 * (constants[material] || {}).rho }[kind];
    if (!(part && found > HEAVY * part)) return "";
    return `The striker of ${engineering(found, "kg")} has ${Number((found / part).toPrecision(2))} times the mass of the part, ${engineering(part, "kg")}: if that is not meant, change its field.`;
  }

  // What must be read before the numbers.
  warn(caution) {
    this.caution = [this.heavy(), caution].filter(Boolean).join(" ");
    this.wrong("", false);
  }

  tell(sentences) { find("verdict").replaceChildren(...sentences.map((text) => Object.assign(document.createElement("p"), { textContent: text }))); }

  // At most so many sites of a map; nothing typed: all.
  limit_sites() {
    const values = typed([find("most-sites")], 1, RULES.n, true);
    if (!values) return;
    this.most = values[0];
    this.tell_sites();
  }

  // What a map costs, kept until the set-up changes; null if it has none, or the page has gone on.
  async map_cost(where) {
    const turn = this.turn, { setup, tab, most } = this;
    const found = await this.call("map_forecast", { tab, turn, setup, opening: this.facts.opening, ...on_face(where, most) }).catch(() => null);
    return found && !found.stale && turn === this.turn ? found : null;
  }

  // How many sites the map of the button has, and how long it takes, beside it.
  async foresee() {
    if (this.falls()) return;
    this.cost = await this.map_cost(this.face || "");
    this.tell_sites();
  }

  tell_sites() {
    const { cost, most } = this, mapped = Boolean(this.page && this.page.sites);
    find("map-takes").textContent = cost && !mapped ? sites_text(cost, most) : "";
  }

  // A map that takes long is asked for, with fewer sites as the other way. What is left of the answer to the
  // blow is given up for the question, and goes on after a No; a map that is shown, or work that was stopped, stays.
  async ask_map(where) {
    const going = this.pending && STOPPED.includes(this.called) && !(this.page && this.page.sites), no = () => going && this.strike();
    if (going) this.turn += 1;
    const { most } = this, cost = await this.map_cost(where), map = (count) => this.map(0, where, count);
    if (!cost || cost.known.includes(most)) return map(most);
    const [least, longest] = map_seconds(cost, most);
    if (longest <= LONG) return map(most);
    const fewer = Math.max(FEWEST, Math.floor((SOON - cost.fixed[1]) / cost.each[1] / 10) * 10), count = Math.min(most ?? cost.sites, cost.sites);
    const saves = fewer < count && map_seconds(cost, fewer)[1] < SAVES * longest;
    const other = saves ? [sites_text(cost, fewer), () => map(fewer)] : undefined;
    this.ask(`The map of ${where || "the part"} strikes ${count} sites, which takes ${lasting(least, longest)}. The field beside the button limits their number.`,
      `Strike ${count} sites`, () => map(most), no, other);
  }

  // The map, at no more than so many sites; from a map the blow at the site that is chosen on it.
  async map(stress = 0, where = this.face || "", most = this.most) {
    if (this.page && this.page.sites && !stress) return this.strike_chosen();
    clearTimeout(this.later);
    this.turn += 1; // motion and stress of the blow would replace the map
    find("case").textContent = ""; // nor does its refining go on
    const setup = this.is_lent() ? { ...this.setup, radius: null } : this.setup;
    const found = await this.step("map", { ...on_face(where, most), stress, setup });
    if (!found) return;
    [this.mapped, this.mapped_sites] = [where, most];
    if (this.page) this.page.stop();
    this.page = globalThis.page = new Page({ ...found.map, fixed: true, chosen: (i) => this.follow(i) }, this.engine, this.view, true);
    if (stress) this.page.show_kind(["exposure", "peak_stress"]);
    this.page.choose(found.worst); // and its fields follow
    find("about").textContent = found.about;
    this.warn(found.caution);
    this.tell(found.verdict);
    this.heads("on the map");
    this.offer = found.offer;
    Object.assign(find("stresses"), { hidden: !this.offer, textContent: this.offer ? `Stress of each blow (${lasting(...this.offer.seconds)})` : "" });
  }

  // The stress of the blow at each site; what takes long is asked for, with fewer sites as the other way.
  stresses() {
    const { sites, seconds, fewer } = this.offer;
    const map = (count) => this.map(count, this.mapped, this.mapped_sites);
    if (fewer >= sites) return map(sites);
    const all = `all ${sites}, ${lasting(...seconds)}`, part = seconds.map((end) => end * fewer / sites);
    const some = `the ${fewer} with the largest forces and deflections, ${lasting(...part)}`;
    this.ask(`The stress of the blow at each of ${sites} sites takes ${lasting(...seconds)}.`, some, () => map(fewer), () => {}, [all, () => map(sites)]);
  }

  // The fields of the site show the site that is chosen on the map.
  follow(i) {
    const { sites } = this.page;
    this.lasts = sites.data.durations[i];
    if (sites.data.radii.length) this.site = { ...this.site, radius: sites.data.radii[i] };
    this.chosen = { point: this.placed(sites.at(i)), direction: aimed(sites.along(i)) };
    this.show_fields();
  }

  strike_chosen() {
    const { chosen, page: { sites: { data: { radii } }, site } } = this, radius = radii.length ? exact(radii[site]) : null;
    const lends = radius !== null && (this.setup.radius === null || this.is_lent());
    if (lends) this.lent.push(radius); // before its field is shown
    this.change(lends ? { ...chosen, radius } : chosen);
  }

  wrote(text) { Object.assign(find("written"), { textContent: text, hidden: !text }); }

  heads(compared) {
    find("stresses").hidden = true;
    find("compared").textContent = compared;
    this.name_map();
  }

  // What the buttons of the map do: strike its site, or map the face that was clicked, or the part.
  name_map() {
    const mapped = Boolean(this.page && this.page.sites);
    find("map").textContent = mapped ? "Strike this site" : `Map ${this.face || "the part"}`;
    find("map-all").hidden = mapped || !this.face || this.falls();
    find("sites-row").hidden = mapped || this.falls();
    this.tell_sites();
  }

  async save() {
    const { folder, names, takes } = await this.call("save", { setup: this.setup });
    const lasts = takes ? ` The report takes about ${takes}.` : "";
    this.ask(`Write ${names.join(" and ")} into ${folder}?${lasts}`, "Write them", async () => {
      this.wrote(`${WRITING} …`);
      const found = await this.step("write", { agreed: names });
      if (!found) return;
      this.wrote(`Written into ${found.folder}: ${found.written.join(" and ")}. The same numbers again: ${found.again} `);
      made("a", find("written"), "Open the report", { href: found.report, target: "_blank", rel: "noopener" });
      find("written").scrollIntoView({ block: "nearest" }); // beside the button, which may be far from the top
    });
  }

  // A question that is agreed to or not.
  ask(question, yes, agreed, refused = () => {}, [other, chosen] = ["", () => {}]) {
    find("question").textContent = question;
    const answered = (then) => () => { find("ask").close(); then(); };
    Object.assign(find("yes"), { textContent: yes, onclick: answered(agreed) });
    Object.assign(find("other"), { textContent: other, hidden: !other, onclick: answered(chosen) });
    find("no").onclick = answered(refused);
    find("ask").oncancel = refused;
    find("ask").showModal();
  }
}

// A notice of texts by weight: all that question the numbers (weight 0), or the first one; the others on demand.
function notice(element, told) {
  const shown = told.filter(([weight]) => !weight).length || 1;
  element.hidden = !told.length;
  element.className = told.some(([weight]) => weight < NOTE) ? "warning" : "choice";
  element.replaceChildren();
  for (const [, text] of told.slice(0, shown)) made("p", element, text);
  if (told.length <= shown) return;
  const more = made("details", element);
  made("summary", more, `${told.length - shown} more`);
  for (const [, text] of told.slice(shown)) made("p", more, text);
}

// The text that is chosen in a list, as its title and, where the list is too narrow for it, below. A
// list that is hidden has no width.
function full_text(select) {
  const text = select.selectedOptions.length ? select.selectedOptions[0].textContent : "", row = select.closest("label");
  const note = row.querySelector(".full") || made("small", row, "", { className: "full" }), style = getComputedStyle(select);
  const pen = document.createElement("canvas").getContext("2d");
  pen.font = style.font;
  select.title = text;
  note.textContent = text;
  note.hidden = pen.measureText(text).width < select.clientWidth - MARGINS;
}

// What was typed into number fields, times the size of their unit; null where an empty one leaves the
// choice open. Where a text breaks the rule it stays, marked, and nothing is returned.
function typed(inputs, size, [rule, keeps], open = false) {
  const numbers = inputs.map(({ value, validity }) => (value !== "" ? Number(value) : open && !validity.badInput ? null : NaN));
  const wrong = numbers.map((x) => x !== null && !(Number.isFinite(x) && keeps(x)));
  inputs.forEach((input, i) => mark(input, wrong[i] ? rule + (open ? ", or nothing" : "") : ""));
  return wrong.includes(true) ? null : numbers.map((x) => (x === null ? null : exact(x * size)));
}

// Mark a field, with the rule that it breaks beside it; "" ends it.
function mark(input, rule) {
  const row = input.closest("label"), note = row.querySelector(".rule") || made("small", row, "", { className: "rule", role: "alert" });
  input.setAttribute("aria-invalid", Boolean(rule));
  note.hidden = !row.querySelector("[aria-invalid=true]");
  if (rule) note.textContent = rule;
}

// The text beside a field; "" without any.
const marked_with = (input) => (input.closest("label").querySelector(".rule") || { textContent: "" }).textContent;

// End the marks of the fields in some rows.
function forget(rows = "") {
  for (const input of document.querySelectorAll(`${rows} [aria-invalid=true]`)) mark(input, "");
}

// Whether a field has the focus and a text that is not yet confirmed: one that differs from the last one shown.
const unconfirmed = (input) => input === document.activeElement && (input.validity.badInput || input.value !== input.dataset.shown);

// The value of a field, unless what was typed is marked, or not yet confirmed.
function fill(input, value) {
  if (input.getAttribute("aria-invalid") === "true" || unconfirmed(input)) return;
  input.value = value;
  input.dataset.shown = input.value;
}

// Mass, energy and tip of a striker, as far as they are known.
function striker_text({ mass, speed }, place) {
  const energy = mass && speed ? [`${engineering(speed, "m/s")}`, `energy ${engineering(mass * speed ** 2 / 2, "J")}`] : [];
  const tip = place && place.tip ? [`tip radius ${engineering(place.tip, "m")}`] : [];
  return [...(mass ? [`mass ${engineering(mass, "kg")}`] : []), ...energy, ...tip].join(", ");
}

// A time that is expected between two ends, in words.
function lasting(least, most) {
  const long = most >= 100, ends = [Math.floor(least / (long ? 60 : 1)), Math.ceil(most / (long ? 60 : 1))].map((end) => Math.max(1, end));
  return `${[...new Set(ends)].join(" to ")} ${long ? "min" : "s"}`;
}
// The least and the largest number of seconds of a map with at most so many sites, and both in words.
const map_seconds = ({ sites, fixed, each }, most) => fixed.map((time, i) => time + each[i] * Math.min(most ?? sites, sites));
const sites_text = (cost, most) => `${Math.min(most ?? cost.sites, cost.sites)} sites, ${lasting(...map_seconds(cost, most))}`;
// What a call says of a map.
const on_face = (where, most) => ({ ...(where ? { where } : {}), ...(most ? { most_sites: most } : {}) });
// A time that has passed, in words: 12 s, 3 min 5 s.
const clock = (seconds) => (seconds < 100 ? `${seconds} s` : `${Math.floor(seconds / 60)} min ${seconds % 60} s`);
const rounded = (x) => Number(Number(x).toPrecision(4)); // of numbers that the page takes by itself
const fitting = (x) => (String(x).length > MOST_DIGITS ? rounded(x) : x); // into a field, whose title has all digits
// The range of a yield strength, which grows with it.
const grown = ({ yield_strength: before, yield_range: range }, strength) =>
  (strength && before && range ? range.map((end) => rounded(end * strength / before)) : null);
const exact = (x) => Number(Number(x).toPrecision(9)); // without the last digits of a change of unit
const aimed = (direction) => direction.map((x) => Math.round(1e3 * x) / 1e3 + 0); // as far as the skin knows it; no -0

globalThis.bench = new Bench();
