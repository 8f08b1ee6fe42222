// What tests ask for in the address and read from the attributes of the root element.

/// Milliseconds that a frame takes until its pixels can be read.
function timeFrames(player, count) {
  player.draw();
  const begin = performance.now();
  for (let i = 0; i < count; ++i) {
    player.seek(i % player.playback.leader.frames);
    player.draw();
    player.stage.renderer.getContext().readPixels(0, 0, 1, 1, 0x1908, 0x1401, new Uint8Array(4));
  }
  return (performance.now() - begin) / count;
}

/// #check: whether particles and charts are drawn, can be turned and read off, and fit the window.
function checkPage(player, charts) {
  root.dataset.overflow = root.scrollWidth - root.clientWidth;
  root.dataset.marks = document.querySelectorAll(".chart svg path, .chart svg circle").length;
  if (charts.length) {
    const {svg, readOut} = charts[0], box = svg.getBoundingClientRect();
    svg.dispatchEvent(new PointerEvent("pointermove", {
      clientX: box.left + box.width / 2, clientY: box.top + box.height / 2}));
    root.dataset.pointed = readOut.textContent;
    svg.dispatchEvent(new KeyboardEvent("keydown", {key: "ArrowRight"}));
    root.dataset.stepped = readOut.textContent;
  }
  if (!player) return;
  player.draw();
  root.dataset.pixels = player.stage.drawnPixels();
  root.dataset.kinds = [...player.colour.options].map(option => option.value).join(" ");
}

/// #time=60: how long so many frames take.
function timePage(player, count) {
  root.dataset.frameMs = timeFrames(player, count).toFixed(2);
}

/// #play=5: how many pictures a second are drawn in so many seconds, after as many to get going.
function playPage(player, seconds) {
  player.start();
  let before = 0;
  setTimeout(() => before = Number(root.dataset.drawn), 1000 * seconds);
  setTimeout(() => {
    root.dataset.picturesASecond = ((root.dataset.drawn - before) / seconds).toFixed(1);
  }, 2000 * seconds);
}
