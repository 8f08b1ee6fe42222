// The player: panels side by side, one camera, one time.

const framesASecond = 30;
const smoothParticles = 10000;
// Where a browser draws fewer than 30 pictures a second while it plays, fewer particles are drawn.
const slowMs = 36, leastShare = 0.25;

class Player {
  constructor(section, descriptions) {
    this.section = section;
    this.descriptions = descriptions;
    this.frame = 0;
    this.kind = "speed";
    this.playing = false;
    this.build();
    const particles = descriptions.map(d => d.motions.reduce((sum, m) => sum + m.particles, 0));
    this.stage = new ParticleStage(this.canvas, Math.max(...particles) <= smoothParticles);
    this.orbit = new Orbit(this.canvas, () => this.request());
    watchWidth(section, () => this.layOut());
  }

  build() {
    this.choice = element("select", {"aria-label": "motion"});
    this.descriptions.forEach((d, i) => this.choice.append(element("option", {value: i}, d.title)));
    this.choice.addEventListener("change", () => this.open(Number(this.choice.value)));
    this.colour = element("select", {"aria-label": "coloured by"});
    this.colour.addEventListener("change", () => this.recolour(this.colour.value));
    this.rate = element("select", {"aria-label": "frames a second"});
    for (const rate of [5, 10, 30, 60]) this.rate.append(element("option", {value: rate}, rate));
    this.rate.value = framesASecond;
    this.rate.addEventListener("change", () => this.begin());
    const button = (text, title, action) => {
      const made = element("button", {type: "button", title, "aria-label": title}, text);
      made.addEventListener("click", action);
      return made;
    };
    this.play = button("▶ Play", "play or pause", () => this.playing ? this.pause() : this.start());
    const group = element("span", {class: "group"},
      button("+", "nearer", () => this.orbit.magnify(1.25)),
      button("−", "farther", () => this.orbit.magnify(0.8)),
      button("⟲", "camera as at first", () => this.orbit.reset()));
    const several = this.descriptions.length > 1;
    this.controls = element("div", {class: "controls"},
      ...(several ? [element("label", {}, "motion ", this.choice)] : []),
      element("label", {}, "coloured by ", this.colour), group,
      element("label", {}, this.rate, " frames/s"));
    this.canvas = element("canvas", {tabindex: 0, role: "img"});
    this.panels = element("div", {class: "panels"});
    this.stageBox = element("div", {class: "stage"}, this.canvas, this.panels);
    this.scrubber = element("input", {type: "range", min: 0, step: 1, "aria-label": "frame"});
    this.scrubber.addEventListener("input", () => {
      this.pause();
      this.seek(Number(this.scrubber.value));
    });
    this.clock = element("output", {});
    this.scale = element("div", {class: "scale"});
    this.note = element("p", {class: "note"});
    this.section.append(this.controls, this.stageBox,
      element("div", {class: "scrub"}, this.play, this.scrubber, this.clock), this.scale, this.note);
  }

  /// Shows one of the playbacks.
  async open(index) {
    this.pause();
    this.choice.value = index;
    const opened = this.opened = (this.opened || 0) + 1;
    this.note.textContent = "Loading …";
    let playback;
    try {
      playback = await loadPlayback(this.descriptions[index]);
    } catch (error) {
      this.note.textContent = "This browser cannot unpack the motions: " + error.message;
      fail(error);
      return;
    }
    if (opened !== this.opened) return;  // another one was chosen meanwhile
    this.playback = playback;
    // Digits of the seconds in which frames differ.
    this.decimals = Math.max(3, Math.ceil(-Math.log10(playback.duration || 1)) + 2);
    this.stage.load(playback);
    this.share = 1;
    this.showPanels();
    this.colour.replaceChildren();
    for (const [name, kind] of Object.entries(colourKinds)) {
      if (kind.isThere(playback)) this.colour.append(element("option", {value: name}, kind.label));
    }
    this.scrubber.max = playback.leader.frames - 1;
    this.note.textContent = playback.note + " Drag to turn, drag with Shift or the right button " +
      "to move; the wheel zooms after a click, as + and − do.";
    this.lookAtAll();
    const kept = opened > 1 && colourKinds[this.kind].isThere(playback);
    this.recolour(kept ? this.kind : defaultKind(playback));
    this.seek(Math.min(this.frame, playback.leader.frames - 1));
  }

  showPanels() {
    const motions = this.playback.motions;
    this.labels = motions.map(() => element("span", {}));
    this.cells = motions.map((motion, i) =>
      element("div", {class: "panel"}, element("b", {}, motion.name), this.labels[i]));
    this.panels.replaceChildren(...this.cells);
    this.canvas.setAttribute("aria-label", "particles: " + motions.map(m => m.name).join(", ") +
      "; arrow keys turn, plus and minus zoom");
    this.layOut();
  }

  layOut() {
    if (!this.playback) return;
    const count = this.playback.motions.length, width = this.stageBox.clientWidth;
    const most = Math.max(1, Math.floor(width / (width < 600 ? 160 : 270)));
    const rows = Math.ceil(count / Math.min(count, most)), columns = Math.ceil(count / rows);
    const height = Math.min(Math.max(width / columns * 0.9, 190), 480);
    this.panels.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    this.panels.style.gridAutoRows = height + "px";
    this.request();
  }

  /// The camera looks at all places where particles come by.
  lookAtAll() {
    const {low, side, step, motions} = this.playback;
    const high = [0, 0, 0];
    for (const {x} of motions) {
      for (let i = 0; i < x.length; ++i) if (x[i] > high[i % 3]) high[i % 3] = x[i];
    }
    const half = high.map(top => top * step / 2);
    const centre = low.map((l, k) => l + half[k]);
    this.orbit.look(centre, Math.max(Math.hypot(...half), 0.02 * side));
  }

  recolour(kind) {
    this.kind = kind;
    this.colour.value = kind;
    this.scale.replaceChildren(...scaleElements(this.playback, kind));
    this.shown = null;
    this.request();
  }

  seek(frame) {
    this.frame = frame;
    this.scrubber.value = frame;
    const {leader} = this.playback;
    this.clock.textContent = `${frame + 1} / ${leader.frames}`;
    this.scrubber.setAttribute("aria-valuetext", `frame ${frame + 1} of ${leader.frames}`);
    this.request();
  }

  start() {
    this.playing = true;
    this.play.textContent = "❚❚ Pause";
    if (this.frame >= this.playback.leader.frames - 1) this.seek(0);
    this.begin();
    let last = 0, mean = 0, counted = 0;
    const next = now => {
      if (!this.playing) return;
      this.began = this.began || now;
      if (last) mean += (now - last - mean) / Math.min(++counted, 8);
      last = now;
      if (counted >= 8 && mean > slowMs && this.share > leastShare) {
        this.thin(Math.max(leastShare, 0.7 * this.share));
        [mean, counted] = [0, 0];
      }
      const rate = Number(this.rate.value);
      const frame = this.first + Math.floor((now - this.began) / 1000 * rate);
      const count = this.playback.leader.frames;
      if (frame % count !== this.frame) this.seek(frame % count);
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  /// From here on frames are counted anew.
  begin() {
    this.first = this.frame;
    this.began = 0;
  }

  /// Draws only a share of the particles.
  thin(share) {
    this.share = share;
    this.stage.views.forEach(view => view.thin(share));
    root.dataset.share = share.toFixed(2);
    this.request();
  }

  pause() {
    if (this.share < 1) this.thin(1);
    this.playing = false;
    this.play.textContent = "▶ Play";
  }

  /// Draws once before the next picture of the screen, however often it is asked for.
  request() {
    if (this.asked || !this.playback) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }

  draw() {
    if (!this.playback) return;
    const {leader, motions} = this.playback;
    const time = leader.time[this.frame] - leader.start;
    const key = this.frame + this.kind;
    motions.forEach((motion, i) => {
      const frame = frameAt(motion, time);
      if (key !== this.shown) this.stage.views[i].show(frame, this.kind);
      this.labels[i].textContent = `${motion.time[frame].toFixed(this.decimals)} s`;
    });
    this.shown = key;
    this.stage.draw(this.orbit, this.cells);
    root.dataset.frame = this.frame;
    root.dataset.drawn = Number(root.dataset.drawn || 0) + 1;
  }
}
