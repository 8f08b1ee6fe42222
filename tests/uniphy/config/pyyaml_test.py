"""PyYAML, a reader of YAML 1.1, reads the config.yaml of a run to the numbers and texts of ours.

Usage: pyyaml_test.py UNIPHY_SIMULATE. Skipped (77) where PyYAML is missing.
"""
import json
import math
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

try:
    import yaml
except ImportError:
    print("skipped: no PyYAML here (Debian: python3-yaml)")
    sys.exit(77)

# What YAML 1.1 takes for something else than a text.
NAMES = ["yes", "no", "On", "off", "y", "null", "~", "true", "1:20", "1:20:30.5", "0x1F", "0b11",
         "017", "1_000", "5e-05", ".5", ".inf", "-.INF", ".nan", "2001-01-01",
         "2001-01-01 10:00:00", "=", "<<", "- a", "a: b", "# a", "%", "@a", "\u03bc\u00b2",
         "next\u0085line\u2028"]


def number(bits):
    """A number of the given bits between 1e-250 and 1e250 in size."""
    value = struct.unpack("<d", struct.pack("<Q", bits.getrandbits(64)))[0]
    return value if 1e-250 < abs(value) < 1e250 else number(bits)


def scene(values):
    bodies = []
    for i, name in enumerate(NAMES):
        place = [0.2 + 0.12 * (i % 6), 0.2 + 0.12 * (i // 6), 0.5]
        bodies.append(
            "  - {name: %s, size: 0.05, center: [%s], velocity: [-0.0, 0, 5e-5],\n"
            "     shape: {type: knurling, turns: %r}, filling: {type: random, particles: 5},\n"
            "     law: {type: elastic, mu: 1e4, lambda: 1e+04}}\n"
            % (json.dumps(name), ", ".join(map(repr, place)), values[i]))
    return ("scene: {grid: 16, dt: 5e-05, steps: 0, gravity: [1e-300, -2e-17, 0]}\n"
            "output: {picture_frames: 0}\nbodies:\n" + "".join(bodies))


def main():
    simulate = pathlib.Path(sys.argv[1]).resolve()
    bits = random.Random(1)
    values = [1e16, 1e22, 5e-324, 1.5e300, -1e-5, 0.1, 3.0] + [number(bits) for _ in NAMES]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "scene.yaml").write_text(scene(values), encoding="utf-8")
        done = subprocess.run([str(simulate), "scene.yaml", "--out", "out"], cwd=folder,
                              capture_output=True, encoding="utf-8")
        assert done.returncode == 0, done.stderr
        read = yaml.safe_load((folder / "out" / "config.yaml").read_text(encoding="utf-8"))
    assert read["scene"]["dt"] == 5e-5, read["scene"]
    assert read["scene"]["gravity"] == [1e-300, -2e-17, 0], read["scene"]
    for name, value, body in zip(NAMES, values, read["bodies"]):
        assert body["name"] == name, (name, body["name"])
        assert type(body["name"]) is str, (name, body["name"])
        turns = body["shape"]["turns"]
        assert type(turns) in (int, float) and turns == value, (turns, value)
        assert body["law"]["mu"] == 1e4, body["law"]
        assert math.copysign(1, body["velocity"][0]) == -1, body["velocity"]
        assert body["velocity"][2] == 5e-5, body["velocity"]
    print("%d texts and numbers: passed" % len(NAMES))


if __name__ == "__main__":
    main()
