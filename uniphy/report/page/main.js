// Fills the page, then does what the address asks for: #scene=1&frame=10&colour=speed opens a motion
// at a frame, coloured so; check, time and play are for tests (check.js).

async function showMotions(options) {
  const section = document.getElementById("player");
  const playbacks = dataOf("motions-data").filter(playback => playback.motions.length > 0);
  if (!section || !playbacks.length) return null;
  let player;
  try {
    player = new Player(section, playbacks);
  } catch (error) {
    section.replaceChildren(element("h2", {}, "Motions"), element("p", {class: "failure"},
      "Motions need WebGL, which this browser does not have or does not allow."));
    root.dataset.webgl = "missing";
    return null;
  }
  await player.open(Number(options.get("scene") || 0));
  if (!player.playback) return null;
  if (options.has("colour")) player.recolour(options.get("colour"));
  if (options.has("frame")) {
    player.scrubber.value = options.get("frame");
    player.scrubber.dispatchEvent(new Event("input"));
  }
  return player;
}

/// The charts of the page.
function showCharts() {
  const section = document.getElementById("charts");
  if (!section) return [];
  const grid = element("div", {class: "charts"});
  section.append(element("p", {class: "note"}, "Move the mouse over a chart, or focus it and use " +
    "the arrow keys, to read it off. A click on a name hides its line."), grid);
  const views = dataOf("charts-data").map(chart => new ChartView(chart));
  grid.append(...views.map(view => view.node));
  views.forEach(view => view.draw());  // now that each has its width
  return views;
}

async function main() {
  const options = hashOptions();
  const charts = showCharts();
  const player = await showMotions(options);
  if (player) player.draw();
  if (player && options.has("time")) timePage(player, Number(options.get("time")));
  if (player && options.has("play")) playPage(player, Number(options.get("play")));
  if (options.has("check")) checkPage(player, charts);
  root.dataset.state = "ready";
}

main().catch(fail);
