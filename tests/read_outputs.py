#!/usr/bin/env python3
"""Open output files with VTK's own readers, as a viewer would, and say what is in them.

    read_outputs.py FILE [FILE ...]        FILE is a series index (.xmf) or a single output (.vtkhdf)

Prints one JSON object a line: per file, then per step, the number of points and cells and, per array, where it
lies, its components, type and range. The exit status is 1 as soon as one file cannot be read, an index has no
time step or a step without cells, or an array holds a value that is not finite. Needs the packages vtk and numpy.
"""
import json
import sys
from pathlib import Path

import numpy
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader


class Unreadable(Exception):
    """What is wrong with a file, in one sentence."""


def open_reader(path):
    if not path.is_file():
        raise Unreadable("there is no such file")
    reader = {".xmf": vtkXdmfReader, ".vtkhdf": vtkHDFReader}.get(path.suffix, lambda: None)()
    if reader is None:
        raise Unreadable("the name ends neither in .xmf nor in .vtkhdf")
    if not reader.CanReadFile(str(path)):
        raise Unreadable("the reader does not accept it")
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    return reader, errors


def parts_of(data):
    """The plain data sets in a reader's output."""
    if not isinstance(data, vtkCompositeDataSet):
        return [data]
    found = []
    walk = data.NewIterator()
    walk.InitTraversal()
    while not walk.IsDoneWithTraversal():
        found.append(walk.GetCurrentDataObject())
        walk.GoToNextItem()
    return found


def arrays_of(part):
    listing = {}
    for place, group in (("points", part.GetPointData()), ("cells", part.GetCellData())):
        for number in range(group.GetNumberOfArrays()):
            array = group.GetArray(number)
            if array is None:
                raise Unreadable(f"array {number} on the {place} is not numeric")
            values = vtk_to_numpy(array)
            if not numpy.isfinite(values).all():
                raise Unreadable(f"{array.GetName()} holds values that are not finite")
            listing[array.GetName()] = {
                "on": place,
                "components": array.GetNumberOfComponents(),
                "type": str(values.dtype),
                "range": [float(values.min()), float(values.max())] if values.size else None,
            }
    return listing


def describe(part):
    points, cells = part.GetNumberOfPoints(), part.GetNumberOfCells()
    bounds = list(part.GetBounds())
    if points and not numpy.isfinite(bounds).all():
        raise Unreadable("its points are not finite")
    return {
        "class": part.GetClassName(),
        "points": points,
        "cells": cells,
        "bounds": bounds if points else None,
        "arrays": arrays_of(part),
    }


def check(path):
    """Print what the file holds; raise Unreadable where something is wrong."""
    reader, errors = open_reader(path)
    pipeline = vtkStreamingDemandDrivenPipeline
    information = reader.GetOutputInformation(0)
    times = []
    if information.Has(pipeline.TIME_STEPS()):
        times = list(information.Get(pipeline.TIME_STEPS()))
    is_index = path.suffix == ".xmf"
    if is_index and not times:
        raise Unreadable("it has no time step")
    if times != sorted(set(times)):
        raise Unreadable("its times do not grow")
    print(json.dumps({"file": str(path), "times": times}))
    for time in times or [None]:
        reader.Update() if time is None else reader.UpdateTimeStep(time)
        output = reader.GetOutputDataObject(0)
        if output is None or errors:
            raise Unreadable(f"the reader failed at time {time}")
        for part in parts_of(output):
            held = describe(part)
            if is_index and not held["cells"]:
                raise Unreadable(f"it has no cells at time {time}")
            print(json.dumps({"file": str(path), "time": time, **held}))


def main():
    names = sys.argv[1:]
    if not names or names[0] in ("-h", "--help"):
        sys.exit(__doc__)
    failed = False
    for name in names:
        try:
            check(Path(name))
        except Unreadable as wrong:
            failed = True
            print(json.dumps({"file": name, "error": str(wrong)}))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
