"""Series of outputs over time: fields of a lattice, grains, contacts and blocks.

A series is a sequence of outputs: ``run.fluid[0]`` is the first one and ``run.fluid[-1]`` the last; ``for output in run.fluid`` goes
through all of them and holds few files open at a time. Each output knows its ``step`` and ``time`` [s] and reads its arrays when they
are asked for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar, overload

import h5py
import numpy as np
import pandas as pd

from . import meshes
from .errors import ReadError
from .files import Files, attributes, text

_AXES = "xyz"
_ENDINGS = {
    1: ("",),
    2: ("_x", "_y"),
    3: ("_x", "_y", "_z"),
    6: ("_xx", "_yy", "_zz", "_xy", "_yz", "_xz"),
    9: ("_xx", "_xy", "_xz", "_yx", "_yy", "_yz", "_zx", "_zy", "_zz"),
}


class Output:
    """One output: what a series holds at one time."""

    #: Type of its data files.
    layout = ""
    #: Groups of the file that hold its arrays.
    groups: tuple[str, ...] = ()

    def __init__(self, path: Path, step: int, files: Files, time: float | None = None):
        self.path = path
        self.step = step
        self._files = files
        self._time = time

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of step {self.step} in {str(self.path)!r}>"

    @property
    def file(self) -> h5py.File:
        """The open HDF5 file, for whatever this class does not offer. It is closed with the run, or when many others were read."""
        return self._files.get(self.path, self.layout)

    @property
    def time(self) -> float:
        """Time since the start of the run [s]."""
        if self._time is None:
            here = self._group("output").attrs
            if "time" not in here:
                raise ReadError(f"{self.path} does not name its time")
            self._time = float(here["time"])
        return self._time

    @property
    def provenance(self) -> dict[str, Any]:
        """Where the output comes from: the text of the case, its hash, the version and commit of the program, its ranks and threads."""
        group = self._group("provenance")
        found = {name: text(value[()]) for name, value in group.items() if isinstance(value, h5py.Dataset)}
        return {**found, **attributes(group)}

    @property
    def names(self) -> list[str]:
        """The names of its arrays."""
        return [name for group in self.groups for name in self._group(f"VTKHDF/{group}")]

    @property
    def units(self) -> dict[str, str]:
        """The units of its arrays: ``{"velocity": "m/s", "solid": "-"}``."""
        return {name: str(attributes(self._dataset(name)).get("units", "")) for name in self.names}

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def read(self, name: str, part: Any = ()) -> np.ndarray:
        """An array, or a part of it, of which only that part is read.

        :param name: one of :attr:`names`
        :param part: an index as of numpy: ``np.s_[0, :, :, 0]`` is the first component in the lowest layer of a field
        :return: a new array
        """
        return np.asarray(self._dataset(name)[part])

    def __getitem__(self, name: str) -> np.ndarray:
        """The whole array of a name."""
        return self.read(name)

    def mesh(self) -> Any:
        """The output as a mesh of pyvista with all arrays, under the same names as in ParaView.

        :raises ImportError: pyvista is not installed
        """
        raise NotImplementedError

    def _group(self, name: str) -> h5py.Group:
        file = self.file
        if name not in file:
            raise ReadError(f"{self.path} holds no group {name}")
        return file[name]

    def _dataset(self, name: str) -> h5py.Dataset:
        file = self.file
        for group in self.groups:
            path = f"VTKHDF/{group}/{name}"
            if path in file:
                return file[path]
        raise KeyError(f"{self.path} holds no array {name}; it holds {', '.join(self.names) or 'none'}")

    def _all(self, group: str) -> dict[str, np.ndarray]:
        return {name: np.asarray(value[()]) for name, value in self._group(f"VTKHDF/{group}").items()}


class Fields(Output):
    """Fields of a fluid at one time: one value for each cell of a lattice, whose cells may differ in width along each axis.

    Arrays have the order **(z, y, x)**: ``velocity[k, j, i]`` is the velocity in the cell with the centre
    ``(x[i], y[j], z[k])``. A scalar has the shape (nz, ny, nx), a vector (nz, ny, nx, 3) with its components x, y, z; a tensor
    (nz, ny, nx, 9) with the components xx, xy, xz, yx, … row by row. In 2-D nz is 1 and the vorticity is a scalar.
    """

    layout = "ImageData"
    groups = ("CellData",)

    @property
    def spacing(self) -> np.ndarray:
        """Edges of a cell x, y, z [m], of the narrowest cells if their widths differ, shape (3,)."""
        return np.array([np.diff(faces).min() for faces in self.faces]) if self.is_graded else self._floats("Spacing")

    @property
    def origin(self) -> np.ndarray:
        """Lower corner of the first cell x, y, z [m], shape (3,)."""
        return np.array([faces[0] for faces in self.faces]) if self.is_graded else self._floats("Origin")

    @property
    def is_graded(self) -> bool:
        """``True`` if the widths of the cells differ."""
        return "XCoordinates" in self._group("VTKHDF")

    @property
    def faces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions of the faces between the cells along x, y, z [m], shapes (nx + 1,), (ny + 1,), (nz + 1,)."""
        if self.is_graded:
            x, y, z = (np.asarray(self._group("VTKHDF")[f"{axis}Coordinates"][()]) for axis in "XYZ")
            return x, y, z
        origin, spacing = self.origin, self.spacing
        x, y, z = (origin[axis] + np.arange(self.shape[2 - axis] + 1) * spacing[axis] for axis in range(3))
        return x, y, z

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells (nz, ny, nx)."""
        extent = [int(n) for n in self._group("VTKHDF").attrs["WholeExtent"]]
        nx, ny, nz = (extent[2 * axis + 1] - extent[2 * axis] for axis in range(3))
        return nz, ny, nx

    @property
    def x(self) -> np.ndarray:
        """x of the cell centres [m], shape (nx,)."""
        return self._centres(0)

    @property
    def y(self) -> np.ndarray:
        """y of the cell centres [m], shape (ny,)."""
        return self._centres(1)

    @property
    def z(self) -> np.ndarray:
        """z of the cell centres [m], shape (nz,)."""
        return self._centres(2)

    def xyz(self, name: str) -> np.ndarray:
        """A field in the order **(x, y, z)**: shape (nx, ny, nz), or (nx, ny, nz, components)."""
        return np.swapaxes(self[name], 0, 2)

    def table(self) -> pd.DataFrame:
        """All cells as a data frame, x fastest: columns x, y, z [m] of the centre, then ``pressure``, ``velocity_x``, …"""
        z, y, x = np.meshgrid(self.z, self.y, self.x, indexing="ij")
        columns: dict[str, np.ndarray] = {"x": x.ravel(), "y": y.ravel(), "z": z.ravel()}
        units = dict.fromkeys(columns, "m")
        for name, unit in self.units.items():
            array = self[name]
            _spread(columns, units, name, array.reshape(x.size, -1), unit)
        return _frame(columns, units)

    def mesh(self) -> Any:
        """A ``pyvista.ImageData`` with cell data; a ``pyvista.RectilinearGrid`` if the widths of the cells differ.

        :raises ImportError: pyvista is not installed
        """
        if self.is_graded:
            return meshes.rectilinear(self.faces, self._all("CellData"))
        return meshes.image(self.shape, self.spacing, self.origin, self._all("CellData"))

    def _floats(self, name: str) -> np.ndarray:
        return np.array(self._group("VTKHDF").attrs[name], dtype=float)

    def _centres(self, axis: int) -> np.ndarray:
        if self.is_graded:
            faces = self.faces[axis]
            return 0.5 * (faces[:-1] + faces[1:])
        count = self.shape[2 - axis]
        return self.origin[axis] + (np.arange(count) + 0.5) * self.spacing[axis]


class Grains(Output):
    """Grains and round bodies at one time, by rising id. Arrays have the shape (n,) or (n, 3)."""

    layout = "PolyData"
    groups = ("PointData",)

    def __len__(self) -> int:
        return int(self._group("VTKHDF")["Points"].shape[0])

    @property
    def positions(self) -> np.ndarray:
        """Centres x, y, z [m], shape (n, 3); inside the domain where it is periodic."""
        return np.asarray(self._group("VTKHDF")["Points"][()])

    def table(self) -> pd.DataFrame:
        """One row for each grain: id, x, y, z [m], then every array, vectors as ``velocity_x``, ``velocity_y``, ``velocity_z``."""
        columns: dict[str, np.ndarray] = {}
        units: dict[str, str] = {}
        given = self.units
        if "id" in given:
            _spread(columns, units, "id", self["id"], given["id"])
        for axis, values in zip(_AXES, self.positions.T):
            columns[axis], units[axis] = values, "m"
        for name in given:
            if name != "id":
                _spread(columns, units, name, self[name], given[name])
        return _frame(columns, units)

    def mesh(self) -> Any:
        """A ``pyvista.PolyData`` of points with point data.

        :raises ImportError: pyvista is not installed
        """
        return meshes.points(self.positions, self._all("PointData"))


class Contacts(Output):
    """Contacts and bonds at one time. Arrays have the shape (n,) or (n, 3).

    ``grain`` and ``other`` are ids of grains and ``wall`` is the number of a wall; -1 where the contact has none.
    """

    layout = "PolyData"
    groups = ("CellData",)

    def __len__(self) -> int:
        return int(self._group("VTKHDF")["Lines/NumberOfCells"][0])

    @property
    def lines(self) -> np.ndarray:
        """Both ends of each contact [m], shape (n, 2, 3): the centre of the grain, then that of the other grain, or the point of
        contact on a wall or a block."""
        group = self._group("VTKHDF")
        points, ends = group["Points"][()], group["Lines/Connectivity"][()]
        return np.asarray(points[ends.reshape(-1, 2)] if len(ends) else np.empty((0, 2, 3)))

    def table(self) -> pd.DataFrame:
        """One row for each contact: grain, other, wall, forces …, then both ends ``from_x`` … ``to_z`` [m]."""
        columns: dict[str, np.ndarray] = {}
        units: dict[str, str] = {}
        for name, unit in self.units.items():
            _spread(columns, units, name, self[name], unit)
        lines = self.lines
        for end, place in enumerate(("from", "to")):
            _spread(columns, units, place, lines[:, end], "m")
        return _frame(columns, units, first=("grain", "other", "wall"))

    def mesh(self) -> Any:
        """A ``pyvista.PolyData`` of lines with cell data.

        :raises ImportError: pyvista is not installed
        """
        return meshes.lines(self.lines, self._all("CellData"))


class Blocks(Output):
    """Polyhedral blocks and bodies at one time. Arrays hold one row for each **face**; every face has the values of its block.
    :meth:`table` has one row for each block."""

    layout = "PolyData"
    groups = ("CellData",)

    def __len__(self) -> int:
        return len(np.unique(self["id"]))

    @property
    def points(self) -> np.ndarray:
        """Corners of all blocks x, y, z [m], shape (p, 3)."""
        return np.asarray(self._group("VTKHDF")["Points"][()])

    @property
    def faces(self) -> list[np.ndarray]:
        """Numbers of the corners in :attr:`points` for each face, in order round the face and outwards by the right hand."""
        group = self._group("VTKHDF")["Polygons"]
        ends = np.asarray(group["Offsets"][()])
        return np.split(np.asarray(group["Connectivity"][()]), ends[1:-1]) if len(ends) > 1 else []

    def table(self) -> pd.DataFrame:
        """One row for each block, by rising id: id, its centroid x, y, z [m], its volume [m3], then every array. Centroid and volume
        are those of the polyhedron that the faces enclose."""
        given = self.units
        id = self["id"]
        _, first = np.unique(id, return_index=True)
        volume, centroid = self._enclosed(id)
        columns: dict[str, np.ndarray] = {}
        units: dict[str, str] = {}
        _spread(columns, units, "id", id[first], given["id"])
        for axis, values in zip(_AXES, centroid.T):
            columns[axis], units[axis] = values, "m"
        columns["volume"], units["volume"] = volume, "m3"
        for name, unit in given.items():
            if name != "id":
                # An array of the same name as a column above replaces it.
                _spread(columns, units, name, self[name][first], unit)
        return _frame(columns, units)

    def mesh(self) -> Any:
        """A ``pyvista.PolyData`` of the faces with cell data.

        :raises ImportError: pyvista is not installed
        """
        return meshes.faces(self.points, self.faces, self._all("CellData"))

    def _enclosed(self, id: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Volume [m3] and centroid [m] of each block by rising id, by the divergence theorem over a fan of triangles in each face,
        relative to a corner of the block."""
        blocks, which = np.unique(id, return_inverse=True)
        points, faces = self.points, self.faces
        corner = np.zeros((len(blocks), 3))
        for face, block in zip(faces, which):
            corner[block] = points[face[0]]
        triangles = [(block, face[0], face[k - 1], face[k]) for face, block in zip(faces, which) for k in range(2, len(face))]
        if not triangles:
            return np.zeros(0), np.zeros((0, 3))
        table = np.array(triangles)
        block = table[:, 0]
        a, b, c = (points[table[:, k]] - corner[block] for k in (1, 2, 3))
        signed = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
        volume = np.bincount(block, signed, len(blocks))
        moment = np.stack([np.bincount(block, signed * s, len(blocks)) for s in ((a + b + c) / 4.0).T], axis=1)
        return volume, corner + moment / volume[:, None]


Kind = TypeVar("Kind", bound=Output)


class _Entry(NamedTuple):
    """An entry of the list of outputs."""

    step: int
    path: Path


class Series(Sequence, Generic[Kind]):
    """The outputs of one kind over time, in order. What files there are is looked up once, when it is first asked for."""

    #: The class of its outputs.
    kind: type[Kind]

    def __init__(self, folder: Path, name: str, files: Files):
        self.name = name
        self._folder = folder
        self._files = files
        self._found: list[_Entry] | None = None
        self._times: dict[int, float] | None = None

    def __repr__(self) -> str:
        return f"<{self.name}: {len(self)} outputs>"

    def __len__(self) -> int:
        return len(self._list())

    @overload
    def __getitem__(self, index: int) -> Kind: ...

    @overload
    def __getitem__(self, index: slice) -> list[Kind]: ...

    def __getitem__(self, index: int | slice) -> Kind | list[Kind]:
        found = self._list()[index]
        return [self._make(one) for one in found] if isinstance(found, list) else self._make(found)

    def __iter__(self) -> Iterator[Kind]:
        for one in list(self._list()):
            yield self._make(one)

    @property
    def steps(self) -> np.ndarray:
        """Steps of the outputs, shape (number of outputs,)."""
        return np.array([one.step for one in self._list()], dtype=np.int64)

    @property
    def times(self) -> np.ndarray:
        """Times of the outputs [s], shape (number of outputs,)."""
        return np.array([output.time for output in self], dtype=float)

    def at_step(self, step: int) -> Kind:
        """The output of a step.

        :raises KeyError: there is none of this step
        """
        for one in self._list():
            if one.step == step:
                return self._make(one)
        raise KeyError(f"{self._folder} holds no output {self.name} of step {step}")

    def nearest(self, time: float) -> Kind:
        """The output whose time is nearest to ``time`` [s]; of two as near the earlier one.

        :raises IndexError: there is no output at all
        """
        times = self.times
        if not len(times):
            raise IndexError(f"{self._folder} holds no output {self.name}")
        return self[int(np.argmin(np.abs(times - time)))]

    def _make(self, one: _Entry) -> Kind:
        return self.kind(one.path, one.step, self._files, self._index().get(one.step))

    def _list(self) -> list[_Entry]:
        if self._found is None:
            wanted = re.compile(re.escape(self.name) + r"_(\d+)\.vtkhdf")
            matches = ((wanted.fullmatch(path.name), path) for path in self._folder.iterdir())
            self._found = sorted(_Entry(int(match.group(1)), path) for match, path in matches if match)
        return self._found

    def _index(self) -> dict[int, float]:
        """Times by step as the index of the series gives them. A series in which no output has cells has no index: its files know their times."""
        if self._times is None:
            try:
                index = (self._folder / f"{self.name}.xmf").read_text(encoding="utf-8")
            except OSError:
                index = ""
            grid = re.compile(rf'<Grid Name="{re.escape(self.name)}_(\d+)" GridType="Uniform"><Time Value="([^"]*)"/>')
            self._times = {int(step): float(time) for step, time in grid.findall(index)}
        return self._times


class FieldsSeries(Series[Fields]):
    """Fields of a fluid over time."""

    kind = Fields


class GrainsSeries(Series[Grains]):
    """Grains over time."""

    kind = Grains


class ContactsSeries(Series[Contacts]):
    """Contacts over time."""

    kind = Contacts


class BlocksSeries(Series[Blocks]):
    """Blocks over time."""

    kind = Blocks


def _spread(columns: dict[str, np.ndarray], units: dict[str, str], name: str, array: np.ndarray, unit: str) -> None:
    """Add an array of shape (n,) or (n, components) as one column for each component."""
    rows = array.reshape(len(array), -1) if array.size else array.reshape(0, array.shape[-1] if array.ndim > 1 else 1)
    count = rows.shape[1]
    endings = _ENDINGS.get(count) or [f"_{k}" for k in range(count)]
    for ending, values in zip(endings, rows.T):
        columns[name + ending], units[name + ending] = values, unit


def _frame(columns: dict[str, np.ndarray], units: dict[str, str], first: tuple[str, ...] = ()) -> pd.DataFrame:
    order = [name for name in first if name in columns] + [name for name in columns if name not in first]
    frame = pd.DataFrame({name: columns[name] for name in order})
    frame.attrs["units"] = {name: units[name] for name in order}
    return frame
