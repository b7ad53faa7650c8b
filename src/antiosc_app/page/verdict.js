// What is said of the present impact, as antiosc.impact.histories.verdict says it of a computed one.

// Speed from which a striker of a mobility [1/kg] yields on a rigid wall; parts that give way yield at higher ones.
function yield_speed({ params }, mobility) {
  const [k, y] = params;
  return Math.sqrt(0.8 * k * y ** 2.5 * mobility);
}

// The radius of the rim of a dent; null where the law does not say it.
function rim_radius(yields, indentation, deepest) {
  if (!yields.rim) return null;
  const [at, squared] = yields.rim, x = Math.log(deepest / indentation);
  let i = 1;
  while (i < at.length - 1 && x > Math.log(at[i])) i++;
  const [low, high] = [Math.log(at[i - 1]), Math.log(at[i])];
  const share = Math.min(Math.max((x - low) / (high - low), 0), 1);
  return Math.sqrt((squared[i - 1] + share * (squared[i] - squared[i - 1])) * yields.radius * deepest);
}

// Whether the contact yields, and what remains; "" of a law that does not say it.
function contact_sentence(hit, law) {
  return [yielding_sentence(hit, law), ...cracks(hit, law)].filter(Boolean).join(" ");
}

const UNKNOWN_YIELD = "Whether the contact yields is not known: give the yield strength or a material.";

function yielding_sentence(hit, { yields, hertz }) {
  if (hit.contacts && hertz) return hertz_sentence(hit, hertz);
  if (!yields || !yields.rim || !hit.contacts) return "";
  const [k, y] = hit.posed.params, { strength, side } = yields, elastic = elastic_depth(hit);
  const pressure = elastic_pressure(hit, yields), told = engineering(pressure, "Pa");
  const from = engineering(k * y ** 1.5, "N"), of = engineering(strength, "Pa");
  if (!(hit.dent > 0)) {
    if ((yields.unknown || "").includes("yield strength")) return UNKNOWN_YIELD;
    const share = general(Math.sqrt(elastic / y));
    return `The contact stays elastic: its pressure is ${told}, ${share} times that of first yield (yield strength ${of}${side ? ` of ${side}` : ""}).`;
  }
  const across = engineering(2 * rim_radius(yields, y, hit.deepest), "m", 2);
  const rebound = Number.isFinite(hit.restitution) ? `; restitution ${hit.restitution.toFixed(2)}${approaching(hit.restitution)}` : "";
  return `The contact yields: a dent of ${engineering(hit.dent, "m")}, some ${across} across${side ? `, in ${side}` : ""}${rebound}.`
    + ` It yields from ${from} on; Hertz's pressure would be ${told}, ${general(pressure / strength)} times the yield strength ${of}${(side || "").startsWith("the ") ? ` of ${side}` : ""}.`;
}

function hertz_sentence(hit, { limit, unknown }) {
  if (limit && hit.peak_force > limit) return `The contact yields from ${engineering(limit, "N")} on, where Hertz's law ends: the contact "auto" goes on beyond.`;
  return unknown ? UNKNOWN_YIELD : "";
}

// The indentation [m] that an elastic contact would have had, and the largest pressure [Pa] there.
function elastic_depth(hit) { return (2.5 * hit.work / hit.posed.params[0]) ** 0.4; }
function elastic_pressure(hit, { radius }) {
  return 1.5 * hit.posed.params[0] / Math.PI * Math.sqrt(elastic_depth(hit)) / radius;
}

// The tension at the rim of the contact on each side that cracks: antiosc.engine.contact.cracking.
function cracks(hit, law) {
  const mean = hit.contacts ? mean_pressure(hit, law) : null;
  return mean === null ? [] : (law.brittle || []).map(({ name, nu, bounds, small }) => {
    const tension = (1 - 2 * nu) / 2 * mean, joined = (texts) => [...new Set(texts)].join(" to ");
    const shares = joined([...bounds].reverse().map((bound) => String(Number((tension / bound).toPrecision(2)))));
    return `In ${name} the tension at the rim of the contact is ${engineering(tension, "Pa")}, ${shares} times its strength in bending tests`
      + ` (${joined(bounds.map((bound) => engineering(bound, "Pa")))}): ${tension >= bounds[0] ? "it may crack there" : "no crack is expected there"}; ${small}.`;
  });
}

// Largest force over the area of the contact [Pa]; null of laws without an area.
function mean_pressure(hit, { yields, hertz }) {
  const [k, y] = hit.posed.params;
  if (hertz) {
    const radius = (0.75 * k / hertz.modulus) ** 2;
    return 2 / 3 * (6 * hit.peak_force * hertz.modulus ** 2 / (Math.PI ** 3 * radius ** 2)) ** (1 / 3);
  }
  if (!yields || !yields.rim) return null;
  return hit.dent > 0 ? hit.peak_force / (Math.PI * rim_radius(yields, y, hit.deepest) ** 2) : 2 / 3 * elastic_pressure(hit, yields);
}

// The duration of the contact with the largest force, of those of the main impact.
function hardest_touch({ main: [from, to], touches, time, force }) {
  const most = ([start, end]) => force.reduce((best, one, i) => (start <= time[i] && time[i] <= end ? Math.max(best, one) : best), 0);
  const [start, end] = touches.filter(([start, end]) => from <= start && end <= to).reduce((best, one) => (most(one) > most(best) ? one : best));
  return `; the hardest touch takes ${engineering(end - start, "s")}`;
}

// What the contact time is of, where there are several contacts: antiosc.impact.histories.bars.
function contact_time_note(hit) {
  if (hit.contact_time_note !== undefined) return hit.contact_time_note; // of the computed case
  if (!(hit.contacts > 1 && hit.main)) return "";
  const [from, to] = hit.main;
  const at = (time) => engineering(time, "s"), hardest = hardest_touch(hit);
  if (from === hit.touches[0][0] && to === hit.touches.at(-1)[1]) return `of all contacts, flights included${hardest}`;
  const flights = hit.touches.some(([start, end]) => start === from && end < to);
  const peak = hit.time[hit.force.reduce((best, force, i) => (force > hit.force[best] ? i : best), 0)];
  const own = hit.force.reduce((most, force, i) => (from <= hit.time[i] && hit.time[i] <= to ? Math.max(most, force) : most), 0);
  const elsewhere = from <= peak && peak <= to ? "" : `, with at most ${engineering(own, "N")}; the peak force falls outside it, at ${at(peak)}`;
  return `of the main impact${flights ? `, flights included${hardest}` : ""}${elsewhere}; last release at ${at(hit.last)}`;
}

// Start, end and impulse of the contacts of a curve of the force.
function touches({ time, force }) {
  const found = [];
  for (let i = 1; i < time.length; i++) {
    if (!(force[i] > 0 || force[i - 1] > 0)) continue;
    const impulse = (time[i] - time[i - 1]) * (force[i] + force[i - 1]) / 2, last = found[found.length - 1];
    if (last && force[i - 1] > 0) [last[1], last[2]] = [time[i], last[2] + impulse];
    else found.push([time[i - 1], time[i], impulse]);
  }
  return found;
}

// The main impact of such contacts: aom_main_impact of csrc/impacts.c.
function main_impact({ touches }) {
  const impacts = [];
  for (const [start, end, impulse] of touches) {
    const last = impacts[impacts.length - 1];
    if (last && start - last[1] < last[1] - last[0]) [last[1], last[2]] = [end, last[2] + impulse];
    else impacts.push([start, end, impulse]);
  }
  return impacts.reduce((a, b) => (b[2] > a[2] ? b : a));
}

// The largest stress of the part, in the scope that is judged; "" until the picture has followed the sliders.
function stress_sentence(value, strength, scope) {
  if (!Number.isFinite(value)) return "";
  const about = `The largest von Mises stress${scope ? ` ${scope}` : ""} is about ${engineering(value, "Pa")}`;
  return strength ? `${about}, ${general(value / strength)} of the yield strength ${engineering(strength, "Pa")}.` : `${about}.`;
}

// A number with three digits, as Python's ".3g".
function general(value) { return String(Number(value.toPrecision(3))); }

// A number and its bar as ErrorBudget.shown has them: of one that may be 0, how large it may be.
function bar_texts(name, plain, bar, value, unit) {
  const [below, above = below] = [bar].flat(), relative = name !== "restitution";
  const whole = relative && name !== "stress" && percent(below) === percent(1);
  if (whole) return [`${plain},`, `at most ${engineering((1 + above) * value, unit, 2)}`];
  return [plain, plus_minus(bar, relative ? percent : (side) => engineering(side, "", 2))];
}

// The error below and above a number as far as physics allows, as ErrorBudget.sides, by the sum of
// its causes. The impulse is m v (1 + e), 0 <= e <= 1, where e, the restitution, is a number.
function sides_of(name, total, e) {
  const sides = [Math.min(total, 1), total], of_rebound = name === "impulse" || name === "restitution";
  if (!of_rebound || !Number.isFinite(e)) return name === "restitution" ? undefined : sides;
  const limits = [e < 0 ? 1 : e / (1 + e), Math.max(1 - e, 0) / (1 + e)];
  const within = sides.map((side, i) => Math.min(side, limits[i]));
  return name === "impulse" ? within : within.map((side) => (1 + e) * side);
}
