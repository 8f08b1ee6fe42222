// A camera that turns about a point: by mouse, touch, wheel and keys.

class Orbit {
  /// `changed` is called after every move.
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", event => this.down(event));
    canvas.addEventListener("pointermove", event => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, event => this.pointers.delete(event.pointerId));
    }
    canvas.addEventListener("wheel", event => this.wheel(event), {passive: false});
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener("keydown", event => this.key(event));
    this.home = {centre: [0.5, 0.5, 0.5], radius: 0.5};
    this.reset(false);
  }

  /// What is looked at: a ball.
  look(centre, radius) {
    this.home = {centre, radius};
    this.reset();
  }

  reset(tell = true) {
    this.azimuth = 35 * Math.PI / 180;
    this.elevation = 20 * Math.PI / 180;
    this.zoom = 1;
    this.centre = [...this.home.centre];
    if (tell) this.changed();
  }

  turn(right, up) {
    this.azimuth -= right;
    this.elevation = Math.min(Math.max(this.elevation + up, -1.5), 1.5);
    this.changed();
  }

  magnify(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.2), 30);
    this.changed();
  }

  /// Moves the centre by pixels on the screen.
  shift(right, up, height) {
    const metres = 2 * this.home.radius / this.zoom / height;
    const [a, e] = [this.azimuth, this.elevation];
    const x = [Math.cos(a), 0, -Math.sin(a)];
    const y = [-Math.sin(e) * Math.sin(a), Math.cos(e), -Math.sin(e) * Math.cos(a)];
    for (let k = 0; k < 3; ++k) this.centre[k] -= metres * (right * x[k] - up * y[k]);
    this.changed();
  }

  down(event) {
    this.canvas.focus({preventScroll: true});
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  move(event) {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - last[0], now[1] - last[1]];
    const before = this.spread();
    this.pointers.set(event.pointerId, now);
    if (this.pointers.size === 2) this.magnify(this.spread() / before);
    else if (event.buttons & 6 || event.shiftKey) this.shift(dx, dy, this.canvas.clientHeight);
    else this.turn(0.008 * dx, 0.008 * dy);
  }

  /// Distance of two fingers.
  spread() {
    const [a, b] = [...this.pointers.values()];
    return a && b ? Math.max(1, Math.hypot(a[0] - b[0], a[1] - b[1])) : 1;
  }

  /// Before a click into the picture the wheel goes on scrolling the page.
  wheel(event) {
    if (document.activeElement !== this.canvas && !event.ctrlKey) return;
    event.preventDefault();
    this.magnify(Math.exp(-0.0015 * event.deltaY * (event.deltaMode ? 30 : 1)));
  }

  key(event) {
    const moves = {
      ArrowLeft: () => this.turn(-0.1, 0), ArrowRight: () => this.turn(0.1, 0),
      ArrowUp: () => this.turn(0, 0.1), ArrowDown: () => this.turn(0, -0.1),
      "+": () => this.magnify(1.15), "=": () => this.magnify(1.15),
      "-": () => this.magnify(1 / 1.15), Home: () => this.reset(),
    };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
  }

  /// Sets a THREE.PerspectiveCamera for a panel of this shape.
  apply(camera, aspect) {
    const half = camera.fov * Math.PI / 360;
    const fit = 0.95 * this.home.radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * aspect)));
    const distance = fit / this.zoom;
    const flat = Math.cos(this.elevation) * distance;
    const [x, y, z] = this.centre;
    camera.position.set(x + Math.sin(this.azimuth) * flat, y + Math.sin(this.elevation) * distance,
                        z + Math.cos(this.azimuth) * flat);
    camera.lookAt(x, y, z);
    camera.near = distance / 100;
    camera.far = distance + 10 * this.home.radius;
    camera.aspect = aspect;
    camera.updateProjectionMatrix();
    return distance;
  }
}
