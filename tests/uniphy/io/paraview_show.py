"""Stores what a ParaView reader shows of a file: pvpython paraview_show.py READER FILE SHOWN.npz

times, and for each time step K: K.cells (their number), K.x and K.NAME of every point array, by
vtk's own getters, for its numpy_support needs more packages.
"""
import sys

import numpy
from paraview import servermanager, simple


def main(name, file, to):
    key = "FileNames" if name == "XDMFReader" else "FileName"
    reader = getattr(simple, name)(**{key: [file]})
    reader.UpdatePipelineInformation()
    shown = {"times": numpy.array(reader.TimestepValues)}
    for k, time in enumerate(shown["times"]):
        reader.UpdatePipeline(time)
        data = servermanager.Fetch(reader)
        points = range(data.GetNumberOfPoints())
        shown["%d.cells" % k] = numpy.array(data.GetNumberOfCells())
        shown["%d.x" % k] = numpy.array([data.GetPoint(p) for p in points])
        arrays = data.GetPointData()
        for i in range(arrays.GetNumberOfArrays()):
            array = arrays.GetArray(i)
            shown["%d.%s" % (k, array.GetName())] = numpy.array([array.GetTuple(p) for p in points])
    numpy.savez(to, **shown)


main(*sys.argv[1:])
