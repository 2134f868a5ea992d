"""Opens a state of jobs/paraview/state.py in ParaView and checks what it shows: pvpython tests/read_state.py RUN STATE

Every series of the run is in it, the bars name units, the picture beside the state is not one colour, and the range of colours of each bar
holds the values of the last time.
"""

import sys
from pathlib import Path

from paraview import simple
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOImage import vtkPNGReader

run, state = Path(sys.argv[1]), Path(sys.argv[2])
simple.LoadState(str(state))
# ParaView names readers by their files.
sources = {name.removesuffix(".xmf"): source for (name, _), source in simple.GetSources().items()}
series = {path.stem for path in run.glob("*.xmf")}
assert series and series <= set(sources), f"{series} of the run, {set(sources)} of the state"
assert "domain" in sources

titles = []
for view in simple.GetViews():
    for representation in view.Representations:
        title = getattr(representation, "Title", None)
        if title and getattr(representation, "Visibility", 0):
            titles.append(str(title))
print(titles)
coloured = {title.split(":")[0] for title in titles}
assert series <= coloured, f"no bar of {series - coloured}"
assert all(title.endswith("]") for title in titles), titles

for name in series:
    source = sources[name]
    times = source.TimestepValues
    times = list(times) if hasattr(times, "__iter__") else [times]
    source.UpdatePipeline(times[-1])
    (title,) = [title for title in titles if title.startswith(f"{name}:")]
    array = title.split(": ")[1].split(" [")[0].replace(" ", "_")
    places = (source.GetDataInformation().GetCellDataInformation(), source.GetDataInformation().GetPointDataInformation())
    (found,) = [place.GetArrayInformation(array) for place in places if place.GetArrayInformation(array)]
    low, high = found.GetComponentRange(-1 if found.GetNumberOfComponents() > 1 else 0)
    tables = [
        table
        for view in simple.GetViews()
        for bar in view.Representations
        if getattr(bar, "Title", None) == title
        for table in [bar.LookupTable]
    ]
    points = tables[0].RGBPoints
    slack = 1e-6 * max(abs(low), abs(high))
    assert points[0] <= low + slack and points[-4] >= high - slack, f"{title}: {points[0]} to {points[-4]}, values {low} to {high}"

picture = vtkPNGReader()
picture.SetFileName(str(state.with_suffix(".png")))
picture.Update()
pixels = vtk_to_numpy(picture.GetOutput().GetPointData().GetScalars())
colours = len({tuple(pixel) for pixel in pixels[::97]})
assert colours > 20, f"{colours} colours in the picture"
print(f"{state.name}: {', '.join(sorted(series))}; {colours} colours")
