// Fills the page, then does what the address asks for: #scene=0&frame=10&colour=speed opens a
// motion at a frame, and tests add check=1 (count the pixels drawn) or time=60 (time so many frames).

async function showMotions(options) {
  const section = document.getElementById("player");
  if (!section) return null;
  let player;
  try {
    player = new Player(section, dataOf("motions-data"));
  } catch (error) {
    section.replaceChildren(element("h2", {}, "Motions"), element("p", {class: "failure"},
      "Motions need WebGL, which this browser does not have or does not allow."));
    root.dataset.webgl = "missing";
    return null;
  }
  await player.open(Number(options.get("scene") || 0));
  if (options.has("colour")) player.recolour(options.get("colour"));
  if (options.has("frame")) player.seek(Math.min(Number(options.get("frame")), player.scrubber.max));
  return player;
}

/// Milliseconds that a frame takes until its pixels can be read.
function timeFrames(player, count) {
  const begin = performance.now();
  for (let i = 0; i < count; ++i) {
    player.seek(i % player.playback.leader.frames);
    player.draw();
    player.stage.renderer.getContext().readPixels(0, 0, 1, 1, 0x1908, 0x1401, new Uint8Array(4));
  }
  return (performance.now() - begin) / count;
}

async function main() {
  const options = hashOptions();
  const charts = document.getElementById("charts");
  if (charts) {
    const grid = element("div", {class: "charts"});
    charts.append(grid);
    for (const chart of dataOf("charts-data")) {
      const view = new ChartView(chart);
      grid.append(view.node);
      view.draw();
    }
  }
  const player = await showMotions(options);
  if (player && options.has("time")) {
    root.dataset.frameMs = timeFrames(player, Number(options.get("time"))).toFixed(2);
  }
  if (player) {
    player.draw();
    if (options.has("check")) root.dataset.pixels = player.stage.drawnPixels();
  }
  root.dataset.marks = document.querySelectorAll(".chart svg path, .chart svg circle").length;
  root.dataset.state = "ready";
}

main().catch(fail);
