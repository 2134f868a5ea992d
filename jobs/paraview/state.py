#!/usr/bin/env pvpython
"""Makes a ParaView state of a run: fluid, grains, contacts, blocks and time averages with colours, units, walls and bodies.

    pvpython jobs/paraview/state.py RUN [--output STATE.pvsm] [--picture PICTURE.png] [--fluid pressure] [--case-folder FOLDER]
    paraview --state RUN/paraview.pvsm

RUN is the output folder of a run. The state is RUN/paraview.pvsm unless --output names another file; the walls of the case lie beside it in
a file of VTK. A state holds the full paths of its files. --picture draws the last time. Rendering needs a display: on a machine without
one, run it under `xvfb-run -a -s "-screen 0 1600x1000x24 -noreset"`. Walls given as STL are looked for in the folder of the run,
or in --case-folder.

| series | shown as | coloured by |
|---|---|---|
| fluid | the plane in 2-D; in 3-D a section through the middle, across y | velocity, or what --fluid names |
| fluid, field solid | covered cells in grey, where neither grains nor blocks show them | |
| grains | spheres of true size | displacement where it was written, otherwise velocity |
| contacts | lines from centre to centre | normal force |
| blocks | surfaces with edges | displacement once something moved, otherwise velocity |
| averages | as the fluid, in a layout of its own | mean velocity |
| walls | half transparent; planes are cut at the domain | |

Ranges of colours are those of the first, the middle and the last time, of the whole field.
"""

import argparse
import json
import math
import sys
from pathlib import Path

# Units of the arrays, where they do not depend on the dimension; a test compares them with those in the files.
UNITS = {
    "angular_velocity": "rad/s",
    "density": "kg/m3",
    "diameter": "m",
    "displacement": "m",
    "eddy_viscosity": "m2/s",
    "head": "m",
    "mean_pressure": "Pa",
    "mean_velocity": "m/s",
    "overlap": "m",
    "fill": "-",
    "porosity": "-",
    "pressure": "Pa",
    "radius": "m",
    "reynolds_stress": "m2/s2",
    "rotation": "rad",
    "velocity": "m/s",
    "vorticity": "1/s",
}
# Forces are for each metre of depth in 2-D.
FORCES = ("contact_force", "fluid_force", "normal_force")

FLOW, LOADS = "Viridis (matplotlib)", "Inferno (matplotlib)"
MAPS = {"head": "Cool to Warm", "pressure": "Cool to Warm", "mean_pressure": "Cool to Warm", "normal_force": LOADS, "displacement": "Plasma (matplotlib)"}
# Grains and blocks differ in colour from the water around them.
SERIES = {"grains": "Plasma (matplotlib)", "blocks": "Plasma (matplotlib)"}


def unit_of(name, dimension):
    """The unit of an array, or an empty text where it is not known."""
    if name in FORCES:
        return "N/m" if dimension == 2 else "N"
    return UNITS.get(name, "")


def plain(value):
    """A value of a case without its source and note."""
    if isinstance(value, dict):
        return (
            plain(value["value"])
            if "value" in value and set(value) <= {"value", "source", "note"}
            else {k: plain(v) for k, v in value.items()}
        )
    return [plain(v) for v in value] if isinstance(value, list) else value


# ---------------------------------------------------------------------------------------------------------------- walls


def minus(a, b):
    return [x - y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def box_edges(low, high):
    """The twelve edges of a box as pairs of points."""
    corners = [[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]
    return [(corners[k], corners[k | 1 << axis]) for k in range(8) for axis in range(3) if not k >> axis & 1]


def plane_in_box(point, normal, low, high):
    """Corners, in order, of the part of a plane inside a box; fewer than three where it misses the box."""
    found = []
    for a, b in box_edges(low, high):
        at, to = dot(minus(a, point), normal), dot(minus(b, point), normal)
        if at == to or at * to > 0.0:
            continue
        corner = [x + (y - x) * at / (at - to) for x, y in zip(a, b)]
        if not any(max(map(abs, minus(corner, other))) < 1e-9 * max(minus(high, low)) for other in found):
            found.append(corner)
    if len(found) < 3:
        return found
    middle = [sum(corner[axis] for corner in found) / len(found) for axis in range(3)]
    first = minus(found[0], middle)
    second = cross(normal, first)
    return sorted(found, key=lambda corner: math.atan2(dot(minus(corner, middle), second), dot(minus(corner, middle), first)))


def wall_faces(wall, low, high):
    """The polygons of a wall of a case; a mesh has a file of its own and gives none."""
    flat = low[2] == high[2]
    deep = [list(low[:2]) + [low[2]], list(high[:2]) + [high[2]]]
    shape = wall["shape"]

    def spatial(p):
        return list(p) + [0.0] * (3 - len(p))

    if "polygon" in shape:
        return [[spatial(p) for p in shape["polygon"]]]
    if "plane" in shape:
        point, normal = spatial(shape["plane"]["point"]), spatial(shape["plane"]["normal"])
        if flat:
            # A line of the plane: the thin sheet that the plane cuts from a box of some depth is reduced to its ends.
            ends = plane_in_box(point, normal, deep[0][:2] + [-1.0], deep[1][:2] + [1.0])
            line = []
            for end in ends:
                end = [end[0], end[1], low[2]]
                if end not in line:
                    line.append(end)
            return [line] if len(line) == 2 else []
        corners = plane_in_box(point, normal, low, high)
        return [corners] if len(corners) > 2 else []
    if "box" in shape:
        a, b = spatial(shape["box"]["from"]), spatial(shape["box"]["to"])
        corners = [[(a, b)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)]
        sides = [(0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5)]
        return [[corners[0], corners[1], corners[3], corners[2]]] if flat else [[corners[k] for k in side] for side in sides]
    return []


def write_faces(path, faces):
    """Polygons, and lines where they have two corners, as a text file of VTK."""
    points = [corner for face in faces for corner in face]
    numbered, first = [], 0
    for face in faces:
        numbered.append(list(range(first, first + len(face))))
        first += len(face)
    lines = ["# vtk DataFile Version 3.0", "walls", "ASCII", "DATASET POLYDATA", f"POINTS {len(points)} double"]
    lines += [" ".join(repr(float(x)) for x in point) for point in points]
    for name, chosen in (("LINES", [f for f in numbered if len(f) == 2]), ("POLYGONS", [f for f in numbered if len(f) > 2])):
        if chosen:
            lines.append(f"{name} {len(chosen)} {sum(len(face) + 1 for face in chosen)}")
            lines += [" ".join(map(str, [len(face), *face])) for face in chosen]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------- the state


class State:
    """The pipelines and views of one run."""

    def __init__(self, run, dimension, field):
        from paraview import simple

        self.simple = simple
        self.run, self.dimension, self.field = run, dimension, field
        self.bars = 0
        simple._DisableFirstRenderCameraReset()

    def view(self, name):
        simple = self.simple
        view = simple.CreateRenderView()
        view.ViewSize = [1280, 760]
        view.Background = [1.0, 1.0, 1.0]
        view.UseColorPaletteForBackground = 0
        view.OrientationAxesLabelColor = [0.1, 0.1, 0.1]
        simple.AssignViewToLayout(view=view, layout=simple.CreateLayout(name))
        self.bars = 0
        return view

    def series(self, name):
        """The reader of a series at its last time, or None."""
        path = self.run / f"{name}.xmf"
        if not path.is_file():
            return None
        reader = self.simple.XDMFReader(registrationName=name, FileNames=[str(path)])
        reader.UpdatePipelineInformation()
        reader.UpdatePipeline(times_of(reader)[-1])
        return reader

    def colour(self, display, view, source, place, name, title):
        """Colours by an array, with the range of three times and a bar that names the unit."""
        simple = self.simple
        times = times_of(source) or [0.0]
        low, high = float("inf"), float("-inf")
        components = 1
        preset = SERIES.get(title) or MAPS.get(name, FLOW)
        for time in sorted({times[0], times[len(times) // 2], times[-1]}):
            source.UpdatePipeline(time)
            data = source.GetDataInformation()
            data = data.GetCellDataInformation() if place == "CELLS" else data.GetPointDataInformation()
            array = data.GetArrayInformation(name)
            if array is not None:
                components = array.GetNumberOfComponents()
                ends = array.GetComponentRange(-1 if components > 1 else 0)
                low, high = min(low, ends[0]), max(high, ends[1])
        if not low <= high:
            low, high = 0.0, 1.0
        if components > 1:
            low = 0.0
        if low == high:
            # A single colour needs a range of some width.
            low, high = (0.0, 1.0) if high == 0.0 else sorted([0.0, high])
        if components == 1 and low < 0.0 < high and name == "normal_force":
            # Pull and pressure differ in colour.
            low, high = -max(-low, high), max(-low, high)
            preset = "Cool to Warm"
        # Each series has its own colours: a name such as velocity stands in several.
        simple.ColorBy(display, (place, name, "Magnitude") if components > 1 else (place, name), separate=True)
        table = simple.GetColorTransferFunction(name, display, separate=True)
        table.ApplyPreset(preset, True)
        table.RescaleTransferFunction(low, high)
        table.AutomaticRescaleRangeMode = "Never"
        bar = simple.GetScalarBar(table, view)
        unit = unit_of(name, self.dimension)
        bar.Title = f"{title}: {name.replace('_', ' ')}" + (f" [{unit}]" if unit not in ("", "-") else "")
        bar.ComponentTitle = ""
        bar.Orientation = "Horizontal"
        bar.WindowLocation = ["Lower Center", "Upper Center", "Upper Left Corner", "Lower Left Corner"][self.bars % 4]
        self.bars += 1
        bar.TitleColor = bar.LabelColor = [0.1, 0.1, 0.1]
        bar.TitleFontSize = bar.LabelFontSize = 13
        bar.ScalarBarLength = 0.24
        bar.AutomaticLabelFormat = 0
        bar.LabelFormat = bar.RangeLabelFormat = "%-.2g"
        bar.ScalarBarThickness = 12
        display.SetScalarBarVisibility(view, True)

    def fields(self, view, reader, name, title):
        """The plane, or in space a section across y and the field's outline."""
        simple = self.simple
        there = list(reader.CellArrayStatus)
        name = name if name in there else next((n for n in ("velocity", "mean_velocity", "pressure") if n in there), None)
        source = reader
        if self.dimension == 3:
            source = simple.Slice(registrationName=f"{title} section", Input=reader)
            bounds = reader.GetDataInformation().GetBounds()
            source.SliceType.Origin = [0.5 * (bounds[2 * axis] + bounds[2 * axis + 1]) for axis in range(3)]
            source.SliceType.Normal = [0.0, 1.0, 0.0]
        display = simple.Show(source, view)
        display.SetRepresentationType("Surface")
        if name:
            # Light must not change the colours of a section.
            display.Ambient, display.Diffuse = 1.0, 0.0
            self.colour(display, view, reader, "CELLS", name, title)
        return there

    def solid(self, view, reader):
        simple = self.simple
        covered = simple.Threshold(
            registrationName="bodies", Input=reader, Scalars=["CELLS", "solid"], LowerThreshold=0.5, UpperThreshold=1.5
        )
        display = simple.Show(covered, view)
        display.ColorArrayName = [None, ""]
        display.AmbientColor = display.DiffuseColor = [0.55, 0.55, 0.55]

    def grains(self, view, reader):
        simple = self.simple
        there = list(reader.PointArrayStatus)
        glyph = simple.Glyph(registrationName="grains as spheres", Input=reader, GlyphType="Sphere")
        glyph.GlyphType.Radius = 0.5
        glyph.GlyphType.ThetaResolution = glyph.GlyphType.PhiResolution = 12
        glyph.ScaleArray = ["POINTS", "diameter"]
        glyph.ScaleFactor = 1.0
        glyph.OrientationArray = ["POINTS", "No orientation array"]
        glyph.GlyphMode = "All Points"
        display = simple.Show(glyph, view)
        if self.dimension == 3 and (self.run / "contacts.xmf").is_file():
            # The contacts lie inside the grains.
            display.Opacity = 0.4
        self.colour(display, view, reader, "POINTS", "displacement" if "displacement" in there else "velocity", "grains")

    def contacts(self, view, reader):
        simple = self.simple
        display = simple.Show(reader, view)
        display.SetRepresentationType("Surface")
        display.LineWidth = 2.5
        if self.dimension == 2:
            # In front of the grains.
            bounds = reader.GetDataInformation().GetBounds()
            # The property was renamed after ParaView 5.11.
            name = "Translation" if "Translation" in display.ListProperties() else "Position"
            setattr(display, name, [0.0, 0.0, 0.1 * (bounds[1] - bounds[0])])
        self.colour(display, view, reader, "CELLS", "normal_force", "contacts")

    def blocks(self, view, reader):
        simple = self.simple
        display = simple.Show(reader, view)
        display.SetRepresentationType("Surface With Edges")
        display.EdgeColor = [0.2, 0.2, 0.2]
        moved = reader.GetDataInformation().GetCellDataInformation().GetArrayInformation("displacement")
        moved = moved is not None and moved.GetComponentRange(-1)[1] > 0.0
        self.colour(display, view, reader, "CELLS", "displacement" if moved else "velocity", "blocks")

    def walls(self, view, sources):
        simple = self.simple
        for source in sources:
            display = simple.Show(source, view)
            display.ColorArrayName = [None, ""]
            display.AmbientColor = display.DiffuseColor = [0.45, 0.36, 0.28]
            display.Opacity = 0.25 if self.dimension == 3 else 1.0
            display.LineWidth = 2.0

    def frame(self, view, domain, low, high, anything):
        """Edges of the domain, the time, and a camera that shows all of it."""
        simple = self.simple
        display = simple.Show(domain, view)
        display.ColorArrayName = [None, ""]
        display.SetRepresentationType("Outline")
        display.AmbientColor = display.DiffuseColor = [0.3, 0.3, 0.3]
        if anything is not None:
            stamp = simple.AnnotateTimeFilter(registrationName="time", Input=anything, Format="t = {time:.5g} s")
            text = simple.Show(stamp, view)
            text.Color = [0.1, 0.1, 0.1]
            text.FontSize = 14
            text.WindowLocation = "Upper Right Corner"
        middle = [0.5 * (a + b) for a, b in zip(low, high)]
        reach = max(minus(high, low))
        view.CameraFocalPoint = middle
        view.CameraParallelProjection = 1
        if self.dimension == 2:
            view.CameraPosition = [middle[0], middle[1], middle[2] + 4.0 * reach]
            view.CameraViewUp = [0.0, 1.0, 0.0]
            wide = (high[0] - low[0]) * view.ViewSize[1] / view.ViewSize[0]
            # Room above and below for the bars.
            view.CameraParallelScale = 0.5 * max(wide, high[1] - low[1]) * 1.45
        else:
            view.CameraPosition = [m + 4.0 * reach * d for m, d in zip(middle, (-0.45, -1.0, 0.55))]
            view.CameraViewUp = [0.0, 0.0, 1.0]
            view.CameraParallelScale = 0.53 * dot(minus(high, low), minus(high, low)) ** 0.5


def times_of(source):
    """Times of a reader or a filter, in order."""
    values = getattr(source, "TimestepValues", None)
    if values is None:
        return []
    return sorted(values) if hasattr(values, "__iter__") else [values]


def meshes(case, folder, simple):
    """The walls of a case that are meshes, as pipelines."""
    found = []
    for wall in case.get("walls") or []:
        mesh = wall["shape"].get("mesh")
        if not mesh or wall.get("during") == "preparation":
            continue
        path = next((p for p in (folder / mesh["path"], Path(mesh["path"])) if p.is_file()), None)
        if path is None:
            print(f"state: the mesh {mesh['path']} of the wall {wall['name']} is not there and is left out", file=sys.stderr)
            continue
        reader = simple.STLReader(registrationName=f"wall {wall['name']}", FileNames=[str(path)])
        scale = mesh.get("scale") or 1.0
        placed = simple.Transform(registrationName=f"wall {wall['name']} in place", Input=reader)
        placed.Transform.Scale = [scale] * 3
        placed.Transform.Translate = mesh.get("origin") or [0.0, 0.0, 0.0]
        found.append(placed)
    return found


def make(run, output, picture=None, field="velocity", case_folder=None):
    """Writes the state of a run; returns what it shows."""
    from paraview import simple

    case = plain(json.loads((run / "case.json").read_text(encoding="utf-8")))
    size = case["domain"]["size"]
    dimension = len(size)
    low, high = [0.0, 0.0, 0.0], [*map(float, size), *[0.0] * (3 - dimension)]
    state = State(run, dimension, field)
    there = {name: reader for name in ("fluid", "grains", "contacts", "blocks", "averages") if (reader := state.series(name))}
    if not there:
        raise SystemExit(f"state: {run} holds no series to show: no fluid, grains, contacts, blocks or averages .xmf")

    faces = [face for wall in case.get("walls") or [] if wall.get("during") != "preparation" for face in wall_faces(wall, low, high)]
    walls = meshes(case, case_folder or run, simple)
    if faces:
        path = output.with_name(f"{output.stem}_walls.vtk")
        write_faces(path, faces)
        walls.append(simple.LegacyVTKReader(registrationName="walls", FileNames=[str(path)]))
    domain = simple.Box(registrationName="domain", Center=[0.5 * (a + b) for a, b in zip(low, high)])
    domain.XLength, domain.YLength, domain.ZLength = minus(high, low)

    shown = []
    main = [name for name in there if name != "averages"]
    if main:
        view = state.view("run")
        if "fluid" in there:
            arrays = state.fields(view, there["fluid"], field, "fluid")
            shown.append("fluid")
            if "solid" in arrays and not {"grains", "blocks"} & set(there):
                state.solid(view, there["fluid"])
                shown.append("bodies")
        for name in ("grains", "contacts", "blocks"):
            if name in there:
                getattr(state, name)(view, there[name])
                shown.append(name)
        state.walls(view, walls)
        shown += ["walls"] if walls else []
        state.frame(view, domain, low, high, there[main[0]])
    if "averages" in there:
        averaged = state.view("averages")
        state.fields(averaged, there["averages"], "mean_velocity", "averages")
        state.frame(averaged, domain, low, high, None)
        shown.append("averages")
        view = view if main else averaged

    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.GoToLast()
    simple.SetActiveView(view)
    if picture:
        simple.Render(view)
        simple.SaveScreenshot(str(picture), view, ImageResolution=view.ViewSize)
    simple.SaveState(str(output))
    return shown


def main():
    parser = argparse.ArgumentParser(description="Makes a ParaView state of a run.", epilog="Run it by pvpython.")
    parser.add_argument("run", type=Path, help="output folder of a run")
    parser.add_argument("--output", type=Path, help="the state; by default RUN/paraview.pvsm")
    parser.add_argument("--picture", type=Path, help="a picture of the last time (.png)")
    parser.add_argument("--fluid", default="velocity", metavar="FIELD", help="the field that colours the fluid")
    parser.add_argument("--case-folder", type=Path, help="where the case named its STL files from")
    given = parser.parse_args()
    run = given.run.resolve()
    if not (run / "case.json").is_file():
        raise SystemExit(f"state: {given.run} is no folder of a run: it holds no case.json")
    output = (given.output or run / "paraview.pvsm").resolve()
    shown = make(run, output, given.picture, given.fluid, given.case_folder)
    print(f"{output}: {', '.join(shown)}")


if __name__ == "__main__":
    main()
