// Axes of a chart: where a number stands, and which numbers are written beside it.

class Axis {
  /// From `low` to `high` at the pixels `from` to `to`.
  constructor(values, log, from, to) {
    this.log = log;
    this.from = from;
    this.to = to;
    const good = values.filter(v => Number.isFinite(v) && (!log || v > 0));
    let low = good.reduce((a, b) => Math.min(a, b), Infinity);
    let high = good.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!good.length) [low, high] = log ? [1, 10] : [0, 1];
    [this.low, this.high] = log ? Axis.decades(low, high) : Axis.margins(low, high);
  }

  static decades(low, high) {
    const [a, b] = [Math.log10(low), Math.log10(high)];
    const margin = Math.max(0.03 * (b - a), 0.05);
    return [10 ** (a - margin), 10 ** (b + margin)];
  }

  static margins(low, high) {
    const margin = high > low ? 0.03 * (high - low) : Math.abs(high) * 0.1 || 1;
    return [low - margin, high + margin];
  }

  /// The pixel of a value; NaN where it has none.
  at(value) {
    if (value === null || !Number.isFinite(value) || (this.log && value <= 0)) return NaN;
    const f = this.log ? Math.log(value / this.low) / Math.log(this.high / this.low)
      : (value - this.low) / (this.high - this.low);
    return this.from + f * (this.to - this.from);
  }

  /// [value, text] of at most about `count` marks.
  ticks(count) {
    const decades = this.log ? Math.log10(this.high / this.low) : 0;
    return this.log && decades > 1.2 ? this.logTicks(count) : this.linearTicks(count);
  }

  logTicks(count) {
    const first = Math.ceil(Math.log10(this.low) - 1e-9);
    const last = Math.floor(Math.log10(this.high) + 1e-9);
    const step = Math.max(1, Math.ceil((last - first + 1) / count));
    const ticks = [];
    for (let k = Math.ceil(first / step) * step; k <= last; k += step) {
      ticks.push([10 ** k, powerOfTen(k)]);
    }
    return ticks;
  }

  linearTicks(count) {
    const raw = (this.high - this.low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find(f => f * power >= raw * 0.999);
    const ticks = [];
    for (let k = Math.ceil(this.low / step); k * step <= this.high; ++k) {
      if (!this.log || k > 0) ticks.push([k * step, numberText(k * step)]);
    }
    return ticks;
  }
}
