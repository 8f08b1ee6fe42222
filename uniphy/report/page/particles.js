// Draws the panels of a playback with three.js, all into one canvas.

// A particle is a disc that is lit like a ball and pales with its distance.
const particleVertex = `
attribute vec4 colour;
uniform vec3 low;
uniform float scale, radius, pixels, nearest, depth;
varying vec3 lit;
varying float away;
void main() {
  vec4 seen = modelViewMatrix * vec4(low + scale * position, 1.0);
  gl_Position = colour.a > 0.5 ? projectionMatrix * seen : vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = max(2.0, pixels * radius / -seen.z);
  lit = colour.rgb;
  away = clamp((-seen.z - nearest) / depth, 0.0, 1.0);
}`;
const particleFragment = `
varying vec3 lit;
varying float away;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  float square = dot(at, at);
  if (square > 1.0) discard;
  vec3 normal = vec3(at.x, -at.y, sqrt(1.0 - square));
  float light = 0.6 + 0.4 * max(0.0, dot(normal, vec3(-0.35, 0.62, 0.70)));
  gl_FragColor = vec4(mix(lit * light, vec3(0.93), 0.45 * away), 1.0);
}`;

const unknownColour = [176, 180, 186];
const lineColour = 0xb8c0c8;

/// Mean distance of neighbours in the first frame, from the box around the particles, m.
function spacingOf(playback, motion) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < 3 * motion.particles; ++i) {
    low[i % 3] = Math.min(low[i % 3], motion.x[i]);
    high[i % 3] = Math.max(high[i % 3], motion.x[i]);
  }
  const volume = low.reduce((v, l, k) => v * Math.max((high[k] - l) * playback.step, 1e-3), 1);
  return Math.cbrt(volume / Math.max(1, motion.particles));
}

/// The edges of the walls and a net on the floor.
function wallLines([low, high]) {
  const points = [];
  for (let a = 0; a < 8; ++a) {
    for (const axis of [1, 2, 4]) if (!(a & axis)) points.push(a, a | axis);
  }
  const corner = a => [1, 2, 4].map(axis => a & axis ? high : low);
  const vertices = points.flatMap(corner);
  for (let i = 1; i < 8; ++i) {
    const at = low + (high - low) * i / 8;
    vertices.push(at, low, low, at, low, high, low, low, at, high, low, at);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(vertices), 3));
  const material = new THREE.LineBasicMaterial({color: lineColour, transparent: true, opacity: 0.7});
  return new THREE.LineSegments(geometry, material);
}

/// All numbers below n, such that the first few of them are spread over all particles.
function spreadOrder(n) {
  const order = new Uint32Array(n);
  let step = Math.max(1, Math.round(0.618 * n));
  while (greatestDivisor(step, n) > 1) ++step;
  for (let i = 0, p = 0; i < n; ++i, p = (p + step) % n) order[i] = p;
  return order;
}

function greatestDivisor(a, b) {
  return b === 0 ? a : greatestDivisor(b, a % b);
}

class MotionView {
  /// `spacing`: m, of the particles.
  constructor(playback, motion, spacing) {
    this.playback = playback;
    this.motion = motion;
    this.places = new Float32Array(motion.particles);
    this.geometry = new THREE.BufferGeometry();
    this.positions = new THREE.BufferAttribute(new Uint16Array(3 * motion.particles), 3, true);
    this.words = new Uint32Array(motion.particles);  // a colour each; 0 where it is hidden
    this.colours = new THREE.BufferAttribute(new Uint8Array(this.words.buffer), 4, true);
    this.geometry.setAttribute("position", this.positions);
    this.geometry.setAttribute("colour", this.colours);
    this.geometry.setIndex(new THREE.BufferAttribute(spreadOrder(motion.particles), 1));
    this.radius = 0.62 * spacing;
    this.material = new THREE.ShaderMaterial({
      vertexShader: particleVertex, fragmentShader: particleFragment,
      uniforms: {
        low: {value: new THREE.Vector3(...playback.low)}, scale: {value: 65535 * playback.step},
        radius: {value: this.radius}, pixels: {value: 1}, nearest: {value: 0}, depth: {value: 1},
      },
    });
    const points = new THREE.Points(this.geometry, this.material);
    points.frustumCulled = false;
    this.scene = new THREE.Scene();
    this.scene.add(wallLines(playback.walls), points);
  }

  /// Draws only a share of the particles, larger.
  thin(share) {
    this.geometry.setDrawRange(0, Math.ceil(share * this.motion.particles));
    this.material.uniforms.radius.value = this.radius / Math.cbrt(share);
  }

  show(frame, kind) {
    const {motion, playback} = this, n = motion.particles;
    this.positions.array.set(motion.x.subarray(3 * frame * n, 3 * (frame + 1) * n));
    this.positions.needsUpdate = true;
    colourKinds[kind].places(playback, motion, frame, this.places);
    const table = kind === "body" ? bodyColours : scaleColours, top = table.length - 2;
    const hidden = motion.hidden && motion.hidden.subarray(frame * n, (frame + 1) * n);
    for (let p = 0; p < n; ++p) {
      const place = kind === "body" ? this.places[p] : Math.round(top * Math.min(this.places[p], 1));
      this.words[p] = hidden && hidden[p] ? 0 : table[place < 0 ? top + 1 : place];
    }
    this.colours.needsUpdate = true;
  }

  dispose() {
    this.scene.traverse(node => {
      if (node.geometry) node.geometry.dispose();
      if (node.material) node.material.dispose();
    });
  }
}

/// Colours as the words of an array of bytes, and at the end that of what is not known.
function colourTable(colours) {
  const bytes = [...colours, unknownColour].flatMap(rgb => [...rgb, 255]);
  return new Uint32Array(new Uint8Array(bytes).buffer);
}
const bodyColours = colourTable(palette.map(rgbOf));
const scaleColours = colourTable(Array.from({length: 256}, (unused, i) => viridis(i / 255)));

class ParticleStage {
  /// Throws where the browser has no WebGL. `smooth`: lines without steps; of many particles, whose
  /// edges it does not smooth, it would cost more than it gives.
  constructor(canvas, smooth) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({canvas, antialias: smooth});
    this.renderer.setClearColor(0xffffff);
    this.renderer.autoClear = false;
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.01, 10);
    this.views = [];
  }

  load(playback) {
    this.views.forEach(view => view.dispose());
    const spacings = playback.motions.map(motion => spacingOf(playback, motion));
    // A few tracked points are not blown up to fill the body.
    const most = 1.5 * Math.min(...spacings);
    this.views = playback.motions.map((motion, i) =>
      new MotionView(playback, motion, Math.min(spacings[i], most)));
  }

  /// `panels`: the elements that the motions stand behind.
  draw(orbit, panels) {
    const {clientWidth: width, clientHeight: height} = this.canvas;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.renderer.setScissorTest(false);
    this.renderer.clear();
    this.renderer.setScissorTest(true);
    const from = this.canvas.getBoundingClientRect();
    this.views.forEach((view, i) => {
      const box = panels[i].getBoundingClientRect();
      const area = [box.left - from.left, height - (box.bottom - from.top), box.width, box.height];
      this.renderer.setViewport(...area);
      this.renderer.setScissor(...area);
      const distance = orbit.apply(this.camera, box.width / box.height);
      const {pixels, nearest, depth} = view.material.uniforms;
      pixels.value = ratio * box.height / Math.tan(this.camera.fov * Math.PI / 360);
      nearest.value = distance - orbit.home.radius;
      depth.value = 2 * orbit.home.radius;
      this.renderer.render(view.scene, this.camera);
    });
  }

  /// Pixels that are not background, read back: for tests.
  drawnPixels() {
    const gl = this.renderer.getContext(), {width, height} = this.canvas;
    const bytes = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    let count = 0;
    for (let i = 0; i < bytes.length; i += 4) {
      if (bytes[i] < 250 || bytes[i + 1] < 250 || bytes[i + 2] < 250) ++count;
    }
    return count;
  }
}
