"""The parts of jobs/paraview/state.py that need no ParaView."""

import importlib.util

import numpy as np
import pytest
from conftest import EXAMPLES, ROOT

from solver_results import open_run


@pytest.fixture(scope="module")
def state():
    spec = importlib.util.spec_from_file_location("state", ROOT / "jobs" / "paraview" / "state.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_units_are_those_of_the_files(runs, state, name):
    with open_run(runs[name]) as run:
        for series in run.series.values():
            for array, unit in series[-1].units.items():
                assert unit == (state.unit_of(array, run.dimension) or "-"), array


def test_planes_are_cut_at_the_domain(state):
    corners = state.plane_in_box([0.5, 0, 2.1], [0.5, 0, 0.8660254], [0, 0, 0], [4, 2, 3])
    assert len(corners) == 4
    for corner in corners:
        assert abs((corner[0] - 0.5) * 0.5 + (corner[2] - 2.1) * 0.8660254) < 1e-12
    # In order round the polygon: no side is a diagonal.
    sides = np.linalg.norm(np.subtract(corners, corners[1:] + corners[:1]), axis=1)
    assert sorted(sides)[:2] == pytest.approx([2.0, 2.0])
    assert len(state.plane_in_box([0, 0, 0.5], [1, 1, 1], [0, 0, 0], [1, 1, 1])) == 3
    assert len(state.plane_in_box([0.5, 0.5, 0.5], [1, 1, 1], [0, 0, 0], [1, 1, 1])) == 6
    assert state.plane_in_box([0, 0, 5], [0, 0, 1], [0, 0, 0], [1, 1, 1]) == []


def test_walls_become_faces(state, tmp_path):
    low, high = [0, 0, 0], [2, 1, 3]
    flat = state.wall_faces({"shape": {"plane": {"point": [0, 0.5], "normal": [0, 1]}}}, [0, 0, 0], [2, 1, 0])
    assert sorted(flat[0]) == [[0, 0.5, 0], [2, 0.5, 0]]
    box = state.wall_faces({"shape": {"box": {"from": [0, 0, 0], "to": [1, 1, 1]}}}, low, high)
    assert len(box) == 6 and all(np.ptp(face, axis=0).tolist().count(0) == 1 for face in box)
    for face in box:
        # Four sides of length 1.
        assert np.linalg.norm(np.subtract(face, face[1:] + face[:1]), axis=1) == pytest.approx(1.0)
    polygon = state.wall_faces({"shape": {"polygon": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]}}, low, high)
    state.write_faces(tmp_path / "walls.vtk", [*box, *polygon, *flat])
    from vtkmodules.vtkIOLegacy import vtkPolyDataReader

    reader = vtkPolyDataReader()
    reader.SetFileName(str(tmp_path / "walls.vtk"))
    reader.Update()
    held = reader.GetOutput()
    assert (held.GetNumberOfPolys(), held.GetNumberOfLines(), held.GetNumberOfPoints()) == (7, 1, 6 * 4 + 3 + 2)


def test_values_are_freed_from_their_sources(state):
    assert state.plain({"size": {"value": [1, {"value": 2, "note": "n"}], "source": "assumed"}, "a": {"b": 1}}) == {
        "size": [1, 2],
        "a": {"b": 1},
    }
