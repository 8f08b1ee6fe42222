"""report.html opens in headless Chromium: nothing goes wrong, particles are drawn and the scrubber
moves them, charts can be read off, and the page fits a wide and a narrow window.

Usage: browser_test.py UNIPHY_SIMULATE UNIPHY_OBSERVE UNIPHY_EVALUATE. Skipped (77) where there is
no Chromium or no three.js (packages chromium and libjs-three).
"""
import html
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

SKIP = 77
SCENE = """
scene: {grid: 20, dt: 4e-4, steps: 400, frame_stride: 10}
output: {observation: %s, picture_frames: 0}
bodies:
  - {name: "</script><b>lump", shape: {type: sphere}, size: 0.3, center: [0.5, 0.4, 0.5],
     velocity: [1, -3, 0], filling: {type: random, particles: 600, seed: 1},
     law: {type: plasticine, mu: 1e5, lambda: 1e5, tau_y: %s}}
"""
SECOND_BODY = """
  - {name: box, shape: {type: box}, size: 0.2, center: [0.5, 0.7, 0.5], velocity: [0, -3, 0],
     filling: {type: random, particles: 300, seed: 2}, law: {type: elastic, mu: 1e5, lambda: 1e5}}
"""
SIZES = [(1280, 900), (400, 900)]


def skip(reason):
    print("skipped: " + reason)
    sys.exit(SKIP)


class Browser:
    def __init__(self, program, profile):
        # No sandbox, because root may not use it; SwiftShader, because there may be no GPU.
        self.command = [program, "--headless", "--no-sandbox", "--use-angle=swiftshader",
                        "--enable-unsafe-swiftshader", "--hide-scrollbars", "--disable-dev-shm-usage",
                        "--enable-logging=stderr", "--virtual-time-budget=6000",
                        "--user-data-dir=%s" % profile]

    def run(self, page, size, address, *options):
        done = subprocess.run(
            self.command + ["--window-size=%d,%d" % size, *options,
                            page.resolve().as_uri() + "#" + address],
            capture_output=True, text=True, timeout=180)
        assert done.returncode == 0, done.stderr
        console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
        assert not console, "%s %s %s: %s" % (page, size, address, console)
        return done.stdout

    def attributes(self, page, size, address):
        """Of the root element, which the page writes its state to."""
        dom = self.run(page, size, address, "--dump-dom")
        found = re.search(r"<html[^>]*>", dom).group(0)
        state = {k: html.unescape(v) for k, v in re.findall(r'data-([a-z-]+)="([^"]*)"', found)}
        assert state["state"] == "ready" and state["errors"] == "", (page, size, address, state)
        return state

    def picture(self, page, size, address, png):
        self.run(page, size, address, "--screenshot=%s" % png)
        return pixels_of(png)


def pixels_of(png):
    """The bytes of an 8-bit RGB or RGBA picture without interlacing."""
    data = png.read_bytes()
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    assert depth == 8 and kind in (2, 6), (depth, kind)
    step = 3 if kind == 2 else 4
    packed, at = b"", 8
    while at < len(data):
        length, name = struct.unpack(">I4s", data[at:at + 8])
        if name == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    raw, rows, above = zlib.decompress(packed), [], bytearray(width * step)
    for y in range(height):
        begin = y * (width * step + 1)
        row = bytearray(raw[begin + 1:begin + 1 + width * step])
        unfilter(raw[begin], row, above, step)
        rows.append(bytes(row))
        above = row
    return step, b"".join(rows)


def unfilter(kind, row, above, step):
    for i in range(len(row)):
        a, b = row[i - step] if i >= step else 0, above[i]
        c = above[i - step] if i >= step else 0
        if kind == 1:
            row[i] = row[i] + a & 255
        elif kind == 2:
            row[i] = row[i] + b & 255
        elif kind == 3:
            row[i] = row[i] + (a + b) // 2 & 255
        elif kind == 4:
            p = a + b - c
            nearest = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            row[i] = row[i] + nearest & 255


def differing(one, other):
    step, a = one
    return sum(a[i:i + 3] != other[1][i:i + 3] for i in range(0, len(a), step))


def run(folder, *command):
    done = subprocess.run([str(c) for c in command], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0 and "libjs-three" in done.stderr:
        skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr


def make_reports(folder, simulate, observe, evaluate):
    (folder / "two.yaml").write_text(SCENE % ("false", "5e3") + SECOND_BODY)
    (folder / "one.yaml").write_text(SCENE % ("true", "5e3"))
    (folder / "other.yaml").write_text(SCENE % ("false", "4e3"))
    (folder / "seen.yaml").write_text(
        "observation: one/observation.h5\npoints: {share: 0.5, hidden: 0.3}\n"
        "noise: {over_size: 0.002}\n")
    (folder / "judge.yaml").write_text(
        "trajectory: other/trajectory.h5\nreference: one/trajectory.h5\n")
    run(folder, simulate, "two.yaml", "--out", "two", "--report")
    run(folder, simulate, "one.yaml", "--out", "one")
    run(folder, simulate, "other.yaml", "--out", "other")
    run(folder, observe, "seen.yaml", "--out", "seen", "--report")
    run(folder, evaluate, "judge.yaml", "--out", "judge", "--report")
    return [folder / name / "report.html" for name in ("two", "seen", "judge")]


def check_page(browser, page, size):
    state = browser.attributes(page, size, "frame=20&check=1")
    assert int(state["pixels"]) > 2000, state
    assert int(state["overflow"]) <= 0, state
    assert state["frame"] == "20", state
    return state


def check_charts(state):
    assert int(state["marks"]) > 5, state
    assert "time, s" in state["pointed"] and re.search(r"\d", state["pointed"]), state
    assert state["stepped"] != state["pointed"], state


def main():
    names = ("chromium", "chromium-browser", "google-chrome")
    program = next(filter(None, map(shutil.which, names)), None)
    if program is None:
        skip("no chromium here (apt install chromium)")
    simulate, observe, evaluate = (pathlib.Path(name).resolve() for name in sys.argv[1:4])
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        folder = pathlib.Path(folder)
        two, seen, judge = make_reports(folder, simulate, observe, evaluate)
        browser = Browser(program, folder / "profile")
        for size in SIZES:
            assert check_page(browser, two, size)["kinds"] == "body speed strain"
            assert check_page(browser, seen, size)["kinds"] == "speed"
            state = check_page(browser, judge, size)
            assert state["kinds"] == "speed error", state
            check_charts(state)
            first, later = (
                browser.picture(two, size, "frame=%d&colour=strain" % frame, folder / "shot.png")
                for frame in (2, 20))
            assert differing(first, later) > 500, "the scrubber moves nothing at %s" % (size,)
    print("3 reports at %s: passed" % " and ".join("%d x %d" % size for size in SIZES))


if __name__ == "__main__":
    main()
