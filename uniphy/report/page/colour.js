// What particles are coloured by. Each kind gives every particle of a frame a place in [0, 1] on
// the colour scale, or -1 where it is not known; of bodies their number.

const colourKinds = {
  body: {
    label: "body",
    isThere: playback => playback.bodyCount > 1,
    scale: () => null,
    places(playback, motion, frame, out) {
      for (let p = 0; p < motion.particles; ++p) out[p] = motion.body[p] % palette.length;
    },
  },
  speed: {
    label: "speed",
    isThere: () => true,
    scale: playback => ({low: 0, high: playback.fastest, unit: "m/s"}),
    places(playback, motion, frame, out) {
      const [before, after] = speedFrames(motion, frame);
      const factor = speedFactor(playback, motion, before, after) / playback.fastest;
      for (let p = 0; p < motion.particles; ++p) {
        out[p] = motion.cloud ? -1 : factor * speedAt(motion, p, before, after);
      }
    },
  },
  strain: {
    label: "plastic strain",
    isThere: playback => playback.motions.some(motion => motion.strain),
    scale: playback => ({...playback.strainScale, unit: ""}),
    places: (playback, motion, frame, out) => storedPlaces(playback, motion, "strain", frame, out),
  },
  error: {
    label: "error",
    isThere: playback => playback.motions.some(motion => motion.error),
    scale: playback => ({...playback.errorScale, unit: "m"}),
    places: (playback, motion, frame, out) => storedPlaces(playback, motion, "error", frame, out),
  },
};

function storedPlaces(playback, motion, name, frame, out) {
  const codes = motion[name], from = frame * motion.particles;
  const top = 2 ** playback.valueBits - 2;
  for (let p = 0; p < motion.particles; ++p) {
    const code = codes ? codes[from + p] : 0;
    out[p] = code === 0 ? -1 : (code - 1) / top;
  }
}

/// The kind that shows most at first sight.
function defaultKind(playback) {
  return colourKinds.body.isThere(playback) ? "body" : "speed";
}

/// The colour bar, or the bodies by their colours.
function scaleElements(playback, name) {
  const kind = colourKinds[name], scale = kind.scale(playback);
  if (!scale) {
    const items = [];
    for (let b = 0; b < Math.min(playback.bodyCount, palette.length); ++b) {
      const swatch = element("span", {class: "swatch", style: `background:${palette[b]}`});
      items.push(element("span", {}, swatch, playback.bodies[b] || "body " + b));
    }
    return items;
  }
  const bar = element("span", {class: "bar", style: `background:${viridisGradient()}`});
  const unit = scale.unit ? " " + scale.unit : "";
  const items = [element("span", {}, kind.label + (scale.log ? ", logarithmic" : "")),
                 element("span", {}, (scale.log ? "≤ " : "") + numberText(scale.low, 2)), bar,
                 element("span", {}, "≥ " + numberText(scale.high, 2) + unit)];
  const blank = name === "strain" ? playback.motions.filter(m => !m.strain)
    : name === "error" ? playback.motions.filter(m => !m.error) : [];
  if (blank.length) {
    items.push(element("span", {}, "grey: not known of " + blank.map(m => m.name).join(", ")));
  }
  if (name === "error") {
    const to = playback.motions.filter(m => m.error).map(m => `${m.name} from ${m.reference}`);
    items.push(element("span", {}, "distance of " + to.join(", ")));
  }
  return items;
}
