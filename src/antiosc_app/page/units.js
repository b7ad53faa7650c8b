// Texts of numbers with units and prefixes, as by antiosc.base.texts.

const PREFIXED = ["m", "s", "J", "Pa", "Hz", "g"]; // units with prefixes, as well as those that begin with N
const PREFIXES = ["f", "p", "n", "µ", "m", "", "k", "M", "G", "T"];

function engineering(value, unit = "", digits = 3) {
  if (!Number.isFinite(value)) return "–";
  if (unit === "kg" && value && Math.abs(value) < 1) return engineering(1e3 * value, "g", digits);
  if (unit === "m/s" && value && Math.abs(value) < 0.1) return engineering(1e3 * value, "mm/s", digits);
  if (value === 0) return `0 ${unit}`.trim();
  const rounded = Number(value.toPrecision(digits));
  let power = PREFIXED.includes(unit) || unit[0] === "N" ? Math.floor(Math.log10(Math.abs(rounded)) / 3 + 1e-12) : 0;
  power = Math.min(Math.max(power, -5), 4);
  const scaled = rounded / 10 ** (3 * power), size = Math.abs(scaled);
  const plain = size >= 1e-4 && size < 10 ** digits, whole = !plain && size >= 10 && size < 1e6;
  const shown = whole ? scaled.toFixed() : plain ? scaled.toPrecision(digits) : scaled.toExponential(digits - 1).replace(/e([+-])(.)$/, "e$10$2");
  return `${shown} ${PREFIXES[power + 5]}${unit}`.trim();
}

function percent(share) {
  if (Math.abs(share) < 1e-5) return "0 %";
  return Number.isFinite(share) ? `${Number((100 * share).toPrecision(2))} %` : "unknown";
}
