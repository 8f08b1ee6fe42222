// The motions of a playback, read from the streams that report_codec.hpp describes.

/// The bytes of the element blob-N.
async function blobBytes(number) {
  const text = atob(document.getElementById("blob-" + number).textContent);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/// Whole numbers [frames][3][particles].
function decodePositions(bytes, frames, particles) {
  const size = 3 * particles, all = frames * size;
  const numbers = new Uint16Array(all);
  for (let i = 0; i < all; ++i) {
    const code = bytes[i] | bytes[all + i] << 8;
    const difference = code & 1 ? -(code >> 1) - 1 : code >> 1;
    let expected = 0;
    if (i >= 2 * size) expected = 2 * numbers[i - size] - numbers[i - 2 * size];
    else if (i >= size) expected = numbers[i - size];
    else if (i > 0) expected = numbers[i - 1];
    numbers[i] = expected + difference;  // modulo 2^16
  }
  return numbers;
}

/// Bytes [frames][particles], of differences from the frame before.
function decodeBytes(bytes, particles) {
  for (let i = particles; i < bytes.length; ++i) bytes[i] += bytes[i - particles];
  return bytes;
}

/// The same order as the GPU takes: [frames][particles][3].
function interleaved(numbers, frames, particles) {
  const out = new Uint16Array(numbers.length);
  for (let f = 0; f < frames; ++f) {
    for (let k = 0; k < 3; ++k) {
      let from = (3 * f + k) * particles, to = 3 * f * particles + k;
      for (let p = 0; p < particles; ++p, ++from, to += 3) out[to] = numbers[from];
    }
  }
  return out;
}

async function loadMotion(description) {
  const {frames, particles} = description;
  const motion = {...description};
  const optional = async number => number === null ? null
    : decodeBytes(await blobBytes(number), particles);
  motion.x = interleaved(decodePositions(await blobBytes(description.positions), frames, particles),
                         frames, particles);
  motion.body = await blobBytes(description.body);
  motion.hidden = await optional(description.hidden);
  motion.strain = await optional(description.strain);
  motion.error = await optional(description.error);
  motion.start = description.time[0] || 0;
  motion.duration = frames ? description.time[frames - 1] - motion.start : 0;
  return motion;
}

async function loadPlayback(description) {
  const motions = [];
  for (const motion of description.motions) motions.push(await loadMotion(motion));
  const playback = {...description, motions};
  playback.step = description.side / (2 ** description.positionBits - 1);  // m
  // The scrubber moves over the frames of the longest motion.
  playback.leader = motions.reduce((a, b) => a.frames >= b.frames ? a : b);
  playback.duration = Math.max(...motions.map(m => m.duration));
  playback.fastest = fastestOf(playback);
  playback.bodyCount = 1 + motions.reduce((n, m) => m.body.reduce((a, b) => Math.max(a, b), n), 0);
  return playback;
}

/// The last frame of a motion that is not later than `time` after its start.
function frameAt(motion, time) {
  let low = 0, high = motion.frames - 1;
  const wanted = motion.start + time + 1e-9 + 1e-6 * motion.duration;
  while (low < high) {
    const middle = low + high + 1 >> 1;
    if (motion.time[middle] <= wanted) low = middle; else high = middle - 1;
  }
  return low;
}

/// The frames around one from which speeds are taken.
function speedFrames(motion, frame) {
  return [Math.max(frame - 1, 0), Math.min(frame + 1, motion.frames - 1)];
}

/// m/s of a particle, by the positions of the frames around.
function speedFactor(playback, motion, before, after) {
  const seconds = motion.time[after] - motion.time[before];
  return seconds > 0 ? playback.step / seconds : 0;
}

function speedAt(motion, particle, before, after) {
  const x = motion.x, a = 3 * (before * motion.particles + particle),
        b = 3 * (after * motion.particles + particle);
  const dx = x[b] - x[a], dy = x[b + 1] - x[a + 1], dz = x[b + 2] - x[a + 2];
  return Math.sqrt(dx * dx + dy * dy + dz * dz);  // hypot takes ten times as long
}

/// The speed that 98 of 100 particles stay below, of some frames.
function fastestOf(playback) {
  const speeds = [];
  for (const motion of playback.motions) {
    if (motion.cloud) continue;
    const frameStep = Math.max(1, Math.floor(motion.frames / 25));
    const particleStep = Math.max(1, Math.floor(motion.particles / 1000));
    for (let f = 0; f < motion.frames; f += frameStep) {
      const [before, after] = speedFrames(motion, f);
      const factor = speedFactor(playback, motion, before, after);
      for (let p = 0; p < motion.particles; p += particleStep) {
        speeds.push(factor * speedAt(motion, p, before, after));
      }
    }
  }
  speeds.sort((a, b) => a - b);
  return speeds.length ? speeds[Math.floor(0.98 * (speeds.length - 1))] || 1 : 1;
}
