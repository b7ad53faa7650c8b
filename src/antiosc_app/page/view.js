// The part in 3-D by WebGL 2: meshes of points that move and have values, turned by hand or keys.

const VERTEX = `#version 300 es
uniform mat4 camera; in vec3 at; in float value; out vec3 seen; out float shade;
void main() { vec4 p = camera * vec4(at, 1.0); seen = at; shade = value; gl_Position = p; }`;
const FRAGMENT = `#version 300 es
precision highp float; uniform vec3 light; uniform float plain; uniform float cover; in vec3 seen; in float shade; out vec4 colour;
vec3 viridis(float t) { // a polynomial of degree 6 through the colours of viridis
  const vec3 c0 = vec3(.2777, .0054, .3341), c1 = vec3(.1051, 1.4046, 1.3846),
    c2 = vec3(-.3309, .2148, .0951), c3 = vec3(-4.6342, -5.7991, -19.3324),
    c4 = vec3(6.2283, 14.1799, 56.6906), c5 = vec3(4.7764, -13.7451, -65.3530),
    c6 = vec3(-5.4355, 4.6459, 26.3124);
  return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6)))));
}
void main() {
  vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
  float lit = .62 + .38 * abs(dot(normal, light));
  // below 0 a plain colour: -1 the part, from -1.99 on held (-2 its faces, -2.4 its points and lines), -3 the striker, -4 arrow and marks, -5 the floor, -6 doubtful sites, hatched: grey ones were not seen on a grey part
  vec3 own = shade < -5.5 ? vec3(mod(gl_FragCoord.x + gl_FragCoord.y, 9.) < 4. ? .1 : 1.) : shade < -4.5 ? vec3(.93, .93, .94) * plain : shade < -3.5 ? vec3(.85, .15, .12) : shade < -2.5 ? vec3(.55, .57, .6)
    : shade < -1.99 ? vec3(.13, .2, .33) : shade < -.05 ? vec3(.66, .74, .82) * plain
    : viridis(clamp(shade, 0., 1.));
  colour = vec4(own * lit, cover);
}`;

class View {
  // null where the browser has no WebGL 2
  static on(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    return gl && new View(canvas, gl);
  }

  constructor(canvas, gl) {
    Object.assign(this, { canvas, gl, meshes: new Map(), turn: -0.9, lift: 0.42, zoom: 1 });
    Object.assign(this, { centre: [0, 0, 0], reach: [1, 1], framed: null }); // framed: names of meshes
    this.picked = () => {};
    const program = this.program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    gl.polygonOffset(1, 2);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    this.by_hand();
    this.by_keys();
    new ResizeObserver(() => this.draw()).observe(canvas);
    DARK_MODE.addEventListener("change", () => this.draw());
  }

  // Turn the view so that a face struck along d is seen from outside.
  face(d) {
    let best = -Infinity;
    for (const lift of [0.42, -0.42]) {
      for (const turn of [-0.9, 0.9, -0.9 + Math.PI, 0.9 + Math.PI]) {
        const tried = Object.assign(Object.create(View.prototype), { turn, lift });
        const seen = -dot(tried.axes()[2], unit(Array.from(d))) + (lift > 0 ? 0.4 : 0) + (turn === -0.9 ? 0.3 : 0);
        if (seen > best) [best, this.turn, this.lift] = [seen, turn, lift];
      }
    }
  }

  // Set the mesh `name`: points (3 n), values (n), which colour them, and corners of faces; null keeps
  // those. With a cover (opacity) below 1 the mesh is transparent.
  put(name, points, values, faces, cover = 1) {
    const gl = this.gl;
    let mesh = this.meshes.get(name);
    if (!mesh) {
      mesh = { array: gl.createVertexArray(), at: gl.createBuffer(), value: gl.createBuffer(), of: gl.createBuffer() };
      this.meshes.set(name, mesh);
    }
    Object.assign(mesh, { points, values, cover });
    gl.bindVertexArray(mesh.array);
    [["at", points, 3], ["value", values, 1]].forEach(([attribute, content, size]) => {
      const place = gl.getAttribLocation(this.program, attribute);
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh[attribute]);
      gl.bufferData(gl.ARRAY_BUFFER, content, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    });
    if (!faces) return;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.of);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    mesh.count = faces.length;
  }

  // Unit vectors to the right, up and out of the picture.
  axes() {
    const [s, c, sl, cl] = [Math.sin(this.turn), Math.cos(this.turn), Math.sin(this.lift), Math.cos(this.lift)];
    return [[-s, c, 0], [-sl * c, -sl * s, cl], [cl * c, cl * s, sl]];
  }

  // Half the width, height and depth of all meshes along these axes, and their middle.
  box() {
    const axes = this.axes(), low = [Infinity, Infinity, Infinity], high = low.map((x) => -x);
    for (const [name, { points }] of this.meshes) {
      if (this.framed && !this.framed.includes(name)) continue;
      for (let p = 0; p < points.length; p += 3) {
        for (let i = 0; i < 3; i++) {
          const x = axes[i][0] * points[p] + axes[i][1] * points[p + 1] + axes[i][2] * points[p + 2];
          if (x < low[i]) low[i] = x;
          if (x > high[i]) high[i] = x;
        }
      }
    }
    return { half: low.map((x, i) => (high[i] - x) / 2), middle: low.map((x, i) => (x + high[i]) / 2) };
  }

  // Scale and move the view so that all meshes fill it.
  fit() {
    const { half, middle } = this.box(), axes = this.axes();
    if (!Number.isFinite(half[0])) return;
    this.centre = [0, 1, 2].map((k) => axes.reduce((sum, axis, i) => sum + axis[k] * middle[i], 0));
    Object.assign(this, { reach: half.slice(0, 2), zoom: 1 });
  }

  // Scale [pixels/m]: the fitted one, or less while a turned mesh would not fit.
  scale() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const share = this.framed ? 0.43 : 0.47; // beside a part stand marks of impacts
    const fits = ([x, y]) => share * Math.min(width / (x || 1e-30), height / (y || 1e-30));
    if (this.zoom !== 1) return this.zoom * fits(this.reach);
    const { half, middle } = this.box(), off = this.axes().map((axis, i) => Math.abs(middle[i] - dot(axis, this.centre)));
    return Math.min(fits(this.reach), fits([half[0] + off[0], half[1] + off[1]]));
  }

  camera() {
    const { clientWidth: width, clientHeight: height } = this.canvas, axes = this.axes(), size = 2 * this.scale();
    const scale = [size / width, size / height, -0.2 * size / Math.min(width, height) / this.zoom];
    const m = new Float32Array(16);
    axes.forEach((axis, i) => {
      for (let k = 0; k < 3; k++) m[4 * k + i] = scale[i] * axis[k];
      m[12 + i] = -scale[i] * dot(axis, this.centre);
    });
    m[15] = 1;
    return m;
  }

  draw() {
    const { gl, canvas } = this, ratio = window.devicePixelRatio || 1;
    const wanted = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== wanted[0] || canvas.height !== wanted[1]) [canvas.width, canvas.height] = wanted;
    gl.viewport(0, 0, canvas.width, canvas.height);
    const dark = DARK_MODE.matches;
    gl.clearColor(...(dark ? [0.09, 0.1, 0.12, 1] : [1, 1, 1, 1]));
    gl.uniform1f(gl.getUniformLocation(this.program, "plain"), dark ? 0.75 : 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(gl.getUniformLocation(this.program, "camera"), false, this.camera());
    const [right, up, out] = this.axes(), light = right.map((x, i) => 0.3 * x + 0.45 * up[i] + 0.84 * out[i]);
    gl.uniform3fv(gl.getUniformLocation(this.program, "light"), light);
    const clear = ([, mesh]) => Number(mesh.cover < 1), cover = gl.getUniformLocation(this.program, "cover");
    for (const [name, mesh] of [...this.meshes].sort((a, b) => clear(a) - clear(b))) {
      if (mesh.cover < 1) gl.enable(gl.BLEND);
      else gl.disable(gl.BLEND);
      gl.depthMask(mesh.cover === 1);
      gl.uniform1f(cover, mesh.cover);
      gl.depthFunc(name === "face" ? gl.ALWAYS : gl.LESS); // it is seen through the part
      if (name === "skin") gl.enable(gl.POLYGON_OFFSET_FILL); // it lies behind the map
      else gl.disable(gl.POLYGON_OFFSET_FILL);
      gl.bindVertexArray(mesh.array);
      gl.drawElements(gl.TRIANGLES, mesh.count, gl.UNSIGNED_INT, 0);
    }
    gl.depthMask(true); // else nothing clears the depths
  }

  // [x, y, depth] of a point: pixels of the page, and depth towards the viewer.
  seen(point) {
    const m = this.camera(), box = this.canvas, p = [0, 1, 2].map((i) => m[i] * point[0] + m[4 + i] * point[1] + m[8 + i] * point[2] + m[12 + i]);
    return [(p[0] + 1) / 2 * box.clientWidth, (1 - p[1]) / 2 * box.clientHeight, -p[2]];
  }

  // Line of sight through the pixel (x, y): a point in front of all meshes, and its direction.
  sight(x, y) {
    const { canvas, centre } = this, scale = this.scale(), [right, up, out] = this.axes(), deep = this.box().half[2] * 4;
    const across = (x - canvas.clientWidth / 2) / scale, high = (canvas.clientHeight / 2 - y) / scale;
    return [centre.map((c, i) => c + across * right[i] + high * up[i] + deep * out[i]), out.map((c) => -c)];
  }

  // One finger or the mouse turns, a click picks, two fingers or ctrl and the wheel zoom.
  by_hand() {
    const canvas = this.canvas, held = new Map();
    let way = 0;
    const apart = () => { const [a, b] = [...held.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
    canvas.addEventListener("pointerdown", (e) => {
      canvas.setPointerCapture(e.pointerId);
      held.set(e.pointerId, [e.offsetX, e.offsetY]);
      way = 0;
    });
    canvas.addEventListener("pointermove", (e) => {
      const last = held.get(e.pointerId);
      if (!last) return;
      const before = held.size === 2 ? apart() : 0, x = e.offsetX - last[0], y = e.offsetY - last[1];
      held.set(e.pointerId, [e.offsetX, e.offsetY]);
      way += Math.hypot(x, y);
      if (held.size === 2) this.zoom *= apart() / (before || 1);
      else {
        this.turn -= 0.01 * x;
        this.lift = Math.min(Math.max(this.lift + 0.01 * y, -1.55), 1.55);
      }
      this.draw();
    });
    canvas.addEventListener("pointerup", (e) => {
      held.delete(e.pointerId);
      if (way < 4) this.picked(e.offsetX, e.offsetY, e);
    });
    canvas.addEventListener("pointercancel", (e) => held.delete(e.pointerId));
    canvas.addEventListener("wheel", (e) => {
      if (!e.ctrlKey) return;
      e.preventDefault();
      this.zoom *= Math.exp(-0.003 * e.deltaY);
      this.draw();
    }, { passive: false });
    canvas.addEventListener("dblclick", () => { this.fit(); this.draw(); });
  }

  // Arrows turn, + and - zoom, Home shows all.
  by_keys() {
    const turns = { ArrowLeft: ["turn", 0.1], ArrowRight: ["turn", -0.1], ArrowUp: ["lift", 0.1], ArrowDown: ["lift", -0.1] };
    this.canvas.addEventListener("keydown", (e) => {
      if (turns[e.key]) this[turns[e.key][0]] += turns[e.key][1];
      else if (e.key === "+" || e.key === "-") this.zoom *= e.key === "+" ? 1.2 : 1 / 1.2;
      else if (e.key === "Home") this.fit();
      else return;
      e.preventDefault();
      this.lift = Math.min(Math.max(this.lift, -1.55), 1.55);
      this.draw();
    });
  }
}

const DARK_MODE = matchMedia("(prefers-color-scheme: dark)");

const less = (a, b) => a.map((x, i) => x - b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Crossings of triangles with the line from a point along d, of length 1: [{at: distance, face, normal}].
function crossings(points, faces, from, d) {
  const found = [], corner = (k) => [points[3 * k], points[3 * k + 1], points[3 * k + 2]];
  for (let f = 0; f < faces.length; f += 3) {
    const a = corner(faces[f]), u = less(corner(faces[f + 1]), a), v = less(corner(faces[f + 2]), a);
    const p = cross(d, v), volume = dot(u, p);
    if (!volume) continue;
    const s = less(from, a), q = cross(s, u), x = dot(s, p) / volume, y = dot(d, q) / volume;
    if (x < -1e-6 || y < -1e-6 || x + y > 1 + 1e-6) continue;
    found.push({ at: dot(v, q) / volume, face: f / 3, normal: unit(cross(u, v)) });
  }
  return found;
}

// Two unit vectors normal to d and to each other.
function across(d) {
  const least = d.map(Math.abs).indexOf(Math.min(...d.map(Math.abs))), e = [0, 1, 2].map((i) => (i === least ? 1 : 0));
  const a = unit(cross(d, e));
  return [a, cross(d, a)];
}

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => a.map((x) => x / (Math.hypot(...a) || 1));

// {points, faces} of a body of revolution about d; rings: [distance along d from the point, radius].
function turned(point, d, rings, sides = 24) {
  const [a, b] = across(d), points = [], faces = [];
  rings.forEach(([along, radius], r) => {
    for (let k = 0; k < sides; k++) {
      const c = radius * Math.cos(2 * Math.PI * k / sides), s = radius * Math.sin(2 * Math.PI * k / sides);
      for (let i = 0; i < 3; i++) points.push(point[i] + along * d[i] + c * a[i] + s * b[i]);
      if (r) {
        const [p, q] = [r * sides + k, r * sides + (k + 1) % sides];
        faces.push(p, q, p - sides, q, q - sides, p - sides);
      }
    }
  });
  return { points: new Float32Array(points), faces: new Uint32Array(faces) };
}

// A sphere that touches the point, from which it lies in the direction -d.
function ball(point, d, radius) {
  const rings = [...Array(17).keys()].map((k) => [-radius * (1 + Math.cos(Math.PI * k / 16)), radius * Math.sin(Math.PI * k / 16)]);
  return turned(point, d, rings);
}

// An arrow along d whose tip is at the point.
function arrow(point, d, length) {
  const rings = [[-1, 0], [-1, 0.025], [-0.32, 0.025], [-0.32, 0.08], [0, 0]];
  return turned(point, d, rings.map((ring) => ring.map((x) => x * length)));
}
