// A chart as SVG: lines and points, a legend that hides them, and a read-out by mouse or keys.

const chartMargin = {top: 10, right: 16, bottom: 44, left: 56};

class ChartView {
  constructor(chart) {
    this.chart = chart;
    this.hidden = new Set();
    this.xLabel = withPowers(chart.xLabel);
    this.yLabel = withPowers(chart.yLabel);
    this.readOut = element("div", {class: "read-out", "aria-live": "polite"});
    this.box = element("div", {});
    this.node = element("div", {class: "chart"}, element("h3", {}, chart.title), this.legend(),
      element("div", {class: "y-label"}, "↑ " + this.yLabel), this.box, this.readOut);
    watchWidth(this.box, () => this.draw());
  }

  styleOf(index) {
    const plain = this.chart.series.filter(s => !s.colour);
    const k = Math.max(0, plain.indexOf(this.chart.series[index]));
    return {colour: palette[k % palette.length], again: k >= palette.length};
  }

  legend() {
    const legend = element("div", {class: "legend"});
    this.chart.series.forEach((series, i) => {
      if (!series.label) return;
      const {colour, again} = this.styleOf(i);
      const mark = series.points
        ? svgElement("circle", {cx: 11, cy: 5, r: 4, ...markStyle(colour, again)})
        : svgElement("path", {d: "M0 5H22", ...lineStyle(colour, again)});
      const button = element("button", {type: "button", "aria-pressed": "true"},
        svgElement("svg", {viewBox: "0 0 22 10", "aria-hidden": "true"}, mark), series.label);
      button.addEventListener("click", () => {
        if (!this.hidden.delete(i)) this.hidden.add(i);
        button.setAttribute("aria-pressed", String(!this.hidden.has(i)));
        this.draw();
      });
      legend.append(button);
    });
    const {colourLabel} = this.chart, values = this.chart.series.flatMap(s => s.colour || []);
    if (values.length) legend.append(...this.colourBar(colourLabel, values));
    return legend;
  }

  colourBar(label, values) {
    const good = values.filter(Number.isFinite);
    this.colourRange = [good.reduce((a, b) => Math.min(a, b), Infinity),
                        good.reduce((a, b) => Math.max(a, b), -Infinity)];
    const bar = element("span", {class: "bar", style: `background:${viridisGradient()}`});
    return [element("span", {class: "scale"}, label, " ", numberText(this.colourRange[0], 3), bar,
                    numberText(this.colourRange[1], 3))];
  }

  draw() {
    const width = Math.max(this.box.clientWidth, 240);
    const height = Math.round(Math.min(380, 0.62 * width + 40));
    if (width === this.width && this.hidden.size === this.drawnHidden) return;
    [this.width, this.height, this.drawnHidden] = [width, height, this.hidden.size];
    const shown = this.chart.series.filter((s, i) => !this.hidden.has(i));
    const {top, right, bottom, left} = chartMargin;
    this.x = new Axis(shown.flatMap(s => s.x), this.chart.logX, left, width - right);
    this.y = new Axis(shown.flatMap(s => s.y), this.chart.logY, height - bottom, top);
    this.svg = svgElement("svg", {viewBox: `0 0 ${width} ${height}`, height, tabindex: 0, role: "img",
      "aria-label": `${this.chart.title}: ${this.yLabel} over ${this.xLabel}`});
    this.drawAxes();
    this.points = [];
    this.taken = [];
    shown.forEach(series => this.drawSeries(series));
    shown.forEach(series => this.drawNames(series));
    this.cross = svgElement("g", {"pointer-events": "none"});
    this.svg.append(this.cross);
    this.svg.addEventListener("pointermove", event => this.pointed(event));
    this.svg.addEventListener("pointerleave", () => this.select(null));
    this.svg.addEventListener("keydown", event => this.key(event));
    this.box.replaceChildren(this.svg);
    const last = this.selected;
    this.select(last ? this.points.find(p => p.series === last.series && p.k === last.k) : null);
  }

  drawAxes() {
    const {width, height} = this, {top, right, bottom, left} = chartMargin;
    const line = (d, name) => this.svg.append(svgElement("path", {d, class: name}));
    const text = (x, y, anchor, content, more) =>
      this.svg.append(svgElement("text", {x, y, "text-anchor": anchor, ...more}, content));
    for (const [value, label] of this.x.ticks(Math.max(3, width / 110))) {
      line(`M${this.x.at(value)} ${top}V${height - bottom}`, "grid");
      text(this.x.at(value), height - bottom + 16, "middle", label);
    }
    for (const [value, label] of this.y.ticks(Math.max(3, height / 50))) {
      line(`M${left} ${this.y.at(value)}H${width - right}`, "grid");
      text(left - 6, this.y.at(value) + 4, "end", label);
    }
    line(`M${left} ${top}V${height - bottom}H${width - right}`, "axis");
    text((left + width - right) / 2, height - 6, "middle", this.xLabel + " →");
  }

  drawSeries(series) {
    const index = this.chart.series.indexOf(series);
    const {colour, again} = this.styleOf(index);
    let path = "", drawing = false;
    series.x.forEach((x, k) => {
      const at = [this.x.at(x), this.y.at(series.y[k])];
      const good = Number.isFinite(at[0] + at[1]) && (!series.colour || series.colour[k] !== null);
      if (good) {
        this.points.push({at, series, k, index});
        if (series.points) this.drawMark(series, k, at, colour, again);
        else path += `${drawing ? "L" : "M"}${at[0].toFixed(1)} ${at[1].toFixed(1)}`;
      }
      drawing = good;
    });
    if (path) this.svg.append(svgElement("path", {d: path, ...lineStyle(colour, again)}));
  }

  drawMark(series, k, at, colour, again) {
    const [low, high] = this.colourRange || [0, 1];
    const fill = series.colour
      ? `rgb(${viridis((series.colour[k] - low) / (high - low || 1)).join(",")})` : colour;
    this.taken.push([at[0] - 4, at[1] - 4, at[0] + 4, at[1] + 4]);
    this.svg.append(svgElement("circle", {cx: at[0], cy: at[1], r: 4, ...markStyle(fill, again)}));
  }

  /// Names beside points, where they cover neither points nor each other; the read-out has all.
  drawNames(series) {
    if (!series.names) return;
    const edge = this.width - chartMargin.right;
    for (const {at, k} of this.points.filter(p => p.series === series)) {
      const wide = 6.4 * series.names[k].length;
      const places = [[7, -4], [7, 14], [-7 - wide, -4], [-7 - wide, 14], [-wide / 2, -9],
                      [-wide / 2, 20]];
      const free = places.map(([dx, dy]) => [at[0] + dx, at[1] + dy])
        .map(([x, y]) => [x, y - 10, x + wide, y + 2])
        .find(b => b[0] > chartMargin.left && b[2] < edge && b[1] > 0 &&
                   b[3] < this.height - chartMargin.bottom && !this.taken.some(t => overlap(t, b)));
      if (!free) continue;
      this.taken.push(free);
      const place = {x: free[0], y: free[3] - 2, "font-size": 11};
      this.svg.append(svgElement("text", place, series.names[k]));
    }
  }

  pointed(event) {
    const box = this.svg.getBoundingClientRect();
    const at = [(event.clientX - box.left) * this.width / box.width,
                (event.clientY - box.top) * this.height / box.height];
    const distance = p => Math.hypot(p.at[0] - at[0], 0.5 * (p.at[1] - at[1]));
    this.select(this.points.reduce((a, b) => a && distance(a) <= distance(b) ? a : b, null));
  }

  /// Left and right along a line, up and down from one to another.
  key(event) {
    const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
    const jump = {ArrowUp: -1, ArrowDown: 1}[event.key];
    if ((!step && !jump) || !this.points.length) return;
    event.preventDefault();
    const all = this.points, now = all.indexOf(this.selected);
    if (step || now < 0) {
      this.select(all[Math.min(Math.max(now + (step || 1), 0), all.length - 1)]);
      return;
    }
    const shown = [...new Set(all.map(p => p.index))];
    const next = shown[(shown.indexOf(all[now].index) + jump + shown.length) % shown.length];
    const near = p => Math.abs(p.at[0] - all[now].at[0]);
    this.select(all.filter(p => p.index === next).reduce((a, b) => near(a) <= near(b) ? a : b));
  }

  select(point) {
    this.selected = point;
    this.cross.replaceChildren();
    if (!point) {
      this.readOut.textContent = "";
      return;
    }
    const {at: [x, y], series, k} = point, {top, right, bottom, left} = chartMargin;
    const lines = `M${x} ${top}V${this.height - bottom}M${left} ${y}H${this.width - right}`;
    this.cross.append(
      svgElement("path", {class: "cross", d: lines}),
      svgElement("circle", {cx: x, cy: y, r: 5, fill: "none", stroke: "#1b1f24", "stroke-width": 2}));
    const name = [series.label, series.names && series.names[k]].filter(Boolean).join(", ");
    this.readOut.replaceChildren(element("b", {}, name), name ? ": " : "",
      `${this.xLabel} ${numberText(series.x[k])}, ${this.yLabel} ${numberText(series.y[k])}` +
      (series.colour ? `, ${this.chart.colourLabel} ${numberText(series.colour[k])}` : ""));
  }
}

function overlap(a, b) {
  return a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
}

function lineStyle(colour, again) {
  return {fill: "none", stroke: colour, "stroke-width": 2, "stroke-linejoin": "round",
          ...(again ? {"stroke-dasharray": "6 4"} : {})};
}

function markStyle(colour, again) {
  return {fill: again ? "#ffffff" : colour, stroke: again ? colour : "#ffffff",
          "stroke-width": again ? 2 : 0.7};
}
