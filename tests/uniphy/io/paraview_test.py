"""Every reader that ParaView offers for trajectory.xdmf shows the numbers of trajectory.h5.

Usage: paraview_test.py UNIPHY_SIMULATE. Debian's python3 runs it; the readers run in pvpython, from
another folder. Skipped (77) where pvpython or h5py is missing.
"""
import pathlib
import shutil
import subprocess
import sys
import tempfile

SKIP = 77
SCENE = """
scene: {grid: 16, dt: 5e-4, steps: 40, frame_stride: 10}
output: {fields: [v, C, F], gzip: %d, picture_frames: 0}
bodies:
  - {name: a, shape: {type: sphere}, size: 0.25, center: [0.3, 0.5, 0.5], velocity: [1, 0, 0],
     filling: {type: lattice, particles: 80}, law: {type: elastic, mu: 1e4, lambda: 1e4}}
  - {name: b, shape: {type: box}, size: 0.2, center: [0.75, 0.5, 0.5],
     filling: {type: lattice, particles: 50},
     law: {type: plasticine, mu: 1e4, lambda: 1e4, tau_y: 100}}
"""
READERS = ["XDMFReader", "Xdmf3ReaderS", "Xdmf3ReaderT"]


def skip(reason):
    print("skipped: " + reason)
    sys.exit(SKIP)


def check(reader, shown, h5):
    steps = len(h5["time"])
    assert steps == 5, steps
    numpy.testing.assert_array_equal(shown["times"], h5["time"])
    particles = h5["x"].shape[1]
    for k in range(steps):
        def values(name):
            return shown["%d.%s" % (k, name)].reshape(particles, -1)

        assert shown["%d.cells" % k] == particles, (reader, k, shown["%d.cells" % k])
        for name in "xvCF":
            numpy.testing.assert_array_equal(
                values(name), h5[name][k].reshape(particles, -1),
                "%s, frame %d, %s" % (reader, k, name))
        for name in ("body", "mass"):
            numpy.testing.assert_array_equal(values(name)[:, 0], h5[name][...])


def main():
    simulate = str(pathlib.Path(sys.argv[1]).resolve())
    show = str(pathlib.Path(__file__).resolve().with_name("paraview_show.py"))
    for gzip in (0, 4):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            elsewhere = folder / "elsewhere"
            elsewhere.mkdir()
            (folder / "scene.yaml").write_text(SCENE % gzip)
            subprocess.run([simulate, "scene.yaml", "--out", "out"], cwd=folder, check=True)
            with h5py.File(folder / "out" / "trajectory.h5", "r") as h5:
                for reader in READERS:
                    result = subprocess.run(
                        [pvpython, "--force-offscreen-rendering", show, reader,
                         str(folder / "out" / "trajectory.xdmf"), "shown.npz"],
                        cwd=elsewhere, timeout=120, stdout=subprocess.PIPE,
                        stderr=subprocess.STDOUT, universal_newlines=True)
                    assert result.returncode == 0, result.stdout
                    check(reader, numpy.load(elsewhere / "shown.npz"), h5)
                    print("%s, gzip %d: every frame and field agrees" % (reader, gzip))


pvpython = shutil.which("pvpython")
if pvpython is None:
    skip("no pvpython here (Debian: paraview, python3-paraview)")
try:
    import h5py
    import numpy
except ImportError as error:
    skip(str(error))
main()
