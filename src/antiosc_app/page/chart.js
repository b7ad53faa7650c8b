// The chart of the force over time on a canvas: the computed case, the present one and its bar.

class Chart {
  // The chart of a canvas, which is made once.
  static on(canvas) { return canvas.chart ??= new Chart(canvas); }

  constructor(canvas) {
    this.canvas = canvas;
    this.content = null;
    new ResizeObserver(() => this.draw()).observe(canvas);
    DARK_MODE.addEventListener("change", () => this.draw());
  }

  // content: until (end of the axis [s]); now, computed: {time [s], force [N]}; bar: relative error of the
  // computed force; at: marked time [s] or null.
  show(content) {
    this.content = content;
    this.draw();
  }

  draw() {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1, c = this.content;
    const width = canvas.clientWidth, height = canvas.clientHeight, pen = canvas.getContext("2d");
    if (!c || !width) return;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    pen.scale(ratio, ratio);
    pen.font = "12px system-ui, sans-serif";
    const now = highest(c.now) * (1 + (c.bar || 0)), beside = highest(c.computed);
    const most = 1.08 * Math.max(now, Math.min(beside, MOST_BESIDE * now || beside)) || 1;
    const [left, right, top, bottom] = [58, width - 24, 10, height - 36];
    const x = (t) => left + (right - left) * t / c.until, y = (f) => bottom - (bottom - top) * f / most;
    const ink = (name) => getComputedStyle(canvas).getPropertyValue(name);
    pen.strokeStyle = ink("--line");
    pen.fillStyle = ink("--faint");
    pen.textAlign = "right";
    for (const f of ticks(most, 4)) {
      line(pen, [[left, y(f)], [right, y(f)]]);
      pen.fillText(shown(f, most, "N"), left - 6, y(f) + 4);
    }
    pen.textAlign = "center";
    for (const t of ticks(c.until, width > 500 ? 7 : 4)) {
      line(pen, [[x(t), top], [x(t), bottom]]);
      pen.fillText(shown(t, c.until, "s"), x(t), bottom + 16);
    }
    pen.fillText("time", (left + right) / 2, height - 4);
    pen.save();
    pen.beginPath();
    pen.rect(left, top, right - left, bottom - top + 1);
    pen.clip();
    if (c.bar) {
      const up = points(c.now, x, y, 1 + c.bar), down = points(c.now, x, y, 1 - Math.min(c.bar, 1)).reverse();
      pen.fillStyle = "#1f77b433";
      pen.beginPath();
      [...up, ...down].forEach(([a, b]) => pen.lineTo(a, b));
      pen.fill();
    }
    pen.lineWidth = 1;
    pen.strokeStyle = ink("--faint");
    pen.setLineDash([5, 4]);
    if (c.computed && c.computed.time) line(pen, points(c.computed, x, y, 1));
    pen.setLineDash([]);
    pen.lineWidth = 1.5;
    pen.strokeStyle = "#1f77b4";
    line(pen, points(c.now, x, y, 1));
    if (c.at !== null) {
      pen.lineWidth = 1;
      pen.strokeStyle = "#d62728";
      line(pen, [[x(c.at), top], [x(c.at), bottom]]);
    }
    pen.restore();
  }
}

const MOST_BESIDE = 3; // the computed curve sets the scale up to this multiple of the present one
const highest = (curve) => (curve && curve.force ? curve.force.reduce((a, b) => Math.max(a, b), 0) : 0);
const points = (curve, x, y, factor) => Array.from(curve.time, (t, i) => [x(t), y(factor * curve.force[i])]);

function line(pen, through) {
  pen.beginPath();
  through.forEach(([a, b]) => pen.lineTo(a, b));
  pen.stroke();
}

// About `count` round numbers from 0 to `most`.
function ticks(most, count) {
  const raw = most / count, ten = 10 ** Math.floor(Math.log10(raw));
  const step = ten * [1, 2, 5, 10].find((each) => each * ten >= 0.999 * raw);
  return [...Array(Math.floor(most / step) + 1).keys()].map((k) => k * step);
}

// Text of a tick, with the prefix that suits the largest value `most`.
function shown(value, most, unit) {
  const power = Math.min(Math.max(Math.floor(Math.log10(most) / 3 - 0.1), -5), 4);
  return `${Number((value / 10 ** (3 * power)).toPrecision(4))} ${PREFIXES[power + 5]}${unit}`;
}
