"""The reader of jobs/python: every array, table and unit of every example against what h5py and csv read, and against numbers that the
program writes elsewhere."""

import csv
import json
import os
import shutil
import sys
import xml.etree.ElementTree as ElementTree

import h5py
import numpy as np
import pytest
from conftest import EXAMPLES

import solver_results
from solver_results import ReadError, open_run, read_table, units

# Examples in two dimensions; the others are in three.
PLANE = ["backward-erosion", "biaxial", "broad-crested-weir", "cavity", "collision", "couette", "cut-off", "cylinder", "dam-break", "direct-shear", "drawdown", "earth-dam", "first-flow", "floating-log", "flume", "infiltration", "piping", "poiseuille", "settling-disc", "sheet-pile", "standing-wave", "taylor-green", "unconfined-compression", "weir"]

names = pytest.mark.parametrize("name", sorted(EXAMPLES))


def raw(path, place="VTKHDF"):
    """All datasets of a group and their units, read by h5py alone."""
    with h5py.File(path, "r") as file:
        found = {}
        file[place].visititems(
            lambda key, item: found.update({key: (item[()], item.attrs.get("units"))}) if isinstance(item, h5py.Dataset) else None
        )
        return found


def spread(array):
    """The columns of a table that come of an array."""
    return list(array.reshape(len(array), -1).T) if array.size else []


@names
def test_case_and_summary(runs, name):
    with open_run(runs[name]) as run:
        assert run.finished and run.case == json.loads((runs[name] / "case.json").read_text())
        summary = json.loads((runs[name] / "summary.json").read_text())
        assert run.summary == summary and summary["outcome"] == "done"
        assert run.dimension == (2 if name in PLANE else 3)
        wanted = {kind for kind in ("fluid", "averages", "grains", "contacts", "blocks") if kind in run.case["output"]}
        assert wanted and set(run.series) == wanted
        for series in run.series.values():
            assert series.steps[-1] == summary["steps"] and series.times[-1] == summary["time"]


@names
def test_series_are_those_of_the_index(runs, name):
    with open_run(runs[name]) as run:
        for kind, series in run.series.items():
            index = runs[name] / f"{kind}.xmf"
            grids = ElementTree.parse(index).findall(".//Grid[@GridType='Uniform']") if index.exists() else []
            named = {int(grid.get("Name").split("_")[-1]): float(grid.find("Time").get("Value")) for grid in grids}
            for output in series:
                place = dict(raw_attributes(output.path, "output"))
                assert (output.step, output.time) == (place["step"], place["time"])
                # A series in which no step has cells has no index.
                assert named.pop(output.step, place["time"]) == place["time"]
                assert series.at_step(output.step).path == output.path
                assert series.nearest(output.time).step == output.step
                assert output.provenance["case_hash"] == run.summary["case_hash"]
                # Made by h5py from a dataset, where the text is too long for an attribute.
                assert json.loads(output.provenance["case"]) == run.case
            assert not named


def raw_attributes(path, group):
    with h5py.File(path, "r") as file:
        return [(key, value.decode() if isinstance(value, bytes) else value) for key, value in file[group].attrs.items()]


@names
def test_fields_are_those_of_the_file(runs, name):
    with open_run(runs[name]) as run:
        for series in (run.fluid, run.averages):
            for output in series:
                stored = raw(output.path, "VTKHDF/CellData")
                assert output.names == sorted(stored) and stored
                root = dict(raw_attributes(output.path, "VTKHDF"))
                nx, ny, nz = root["WholeExtent"][1::2]
                assert output.shape == (nz, ny, nx)
                for key, (array, unit) in stored.items():
                    assert output[key].dtype == array.dtype and output.units[key] == unit.decode() != ""
                    assert np.array_equal(output[key], array, equal_nan=array.dtype.kind == "f")
                    assert output[key].shape[:3] == (nz, ny, nx)
                    assert output.xyz(key).shape[:3] == (nx, ny, nz)
                    assert np.array_equal(output.xyz(key)[-1, 0, 0], array[0, 0, -1], equal_nan=array.dtype.kind == "f")
                    assert np.array_equal(output.read(key, np.s_[0, :, 1]), array[0, :, 1], equal_nan=array.dtype.kind == "f")
                for axis, centres in enumerate((output.x, output.y, output.z)):
                    assert len(centres) == (nx, ny, nz)[axis]
                    expected = root["Origin"][axis] + root["Spacing"][axis] * (np.arange(len(centres)) + 0.5)
                    np.testing.assert_allclose(centres, expected, rtol=1e-15)
        if len(run.fluid) and run.fluid[0].shape[0] * run.fluid[0].shape[2] < 1000:
            table = run.fluid[-1].table()
            assert len(table) == np.prod(run.fluid[-1].shape)
            assert np.array_equal(table["pressure"], run.fluid[-1]["pressure"].ravel())
            assert units(table)["pressure"] == "Pa" and units(table)["x"] == "m"
            assert "velocity" not in run.fluid[-1] or units(table)["velocity_y"] == "m/s"


@names
def test_tables_of_grains_contacts_and_blocks(runs, name):
    with open_run(runs[name]) as run:
        for output in run.grains:
            check_table(output, raw(output.path, "VTKHDF/PointData"), None)
            points = raw(output.path)["Points"]
            assert points[1] == b"m" and np.array_equal(output.table()[["x", "y", "z"]], points[0])
            assert np.array_equal(output.positions, points[0])
        for output in run.contacts:
            check_table(output, raw(output.path, "VTKHDF/CellData"), None)
            points = raw(output.path)["Points"][0]
            ends = raw(output.path)["Lines/Connectivity"][0].reshape(-1, 2)
            table = output.table()
            assert np.array_equal(table[["from_x", "from_y", "from_z"]], points[ends[:, 0]])
            assert np.array_equal(table[["to_x", "to_y", "to_z"]], points[ends[:, 1]])
        for output in run.blocks:
            stored = raw(output.path, "VTKHDF/CellData")
            _, first = np.unique(stored["id"][0], return_index=True)
            check_table(output, stored, first)
            corners = raw(output.path)
            assert np.array_equal(output.points, corners["Points"][0])
            assert np.array_equal(np.concatenate(output.faces), corners["Polygons/Connectivity"][0])
            assert len(output.faces) == len(stored["id"][0])


def check_table(output, stored, rows):
    table = output.table()
    given = units(table)
    assert list(table.columns) == list(given) and all(given.values())
    assert len(table) == len(output) and output.names == sorted(stored)
    for key, (array, unit) in stored.items():
        assert output.units[key] == unit.decode() and np.array_equal(output[key], array)
        array = array if rows is None else array[rows]
        columns = [key] if array.ndim == 1 else [f"{key}_{axis}" for axis in "xyz"]
        for column, values in zip(columns, spread(array)):
            assert np.array_equal(table[column], values) and given[column] == unit.decode()


@names
def test_tables_are_those_of_the_files(runs, name):
    with open_run(runs[name]) as run:
        files = {path.stem for path in runs[name].glob("*.csv")}
        assert set(run.tables) | {f"probe_{probe}" for probe in run.probes} == files
        assert set(run.probes) == {probe["name"] for probe in run.case.get("probes", [])}
        for stem in files:
            table = run.probes[stem[6:]] if stem.startswith("probe_") else run.tables[stem]
            rows = list(csv.reader((runs[name] / f"{stem}.csv").read_text().splitlines()))
            head, below = rows.pop(0), []
            if rows and rows[0][0].startswith("#"):
                below = rows.pop(0)
            assert list(table.columns) == [cell.split(" [")[0] for cell in head] and len(table) == len(rows)
            for place, (column, unit) in enumerate(units(table).items()):
                written = head[place].partition(" [")[2].rstrip("]") or (below[place].lstrip("# ") if below else "")
                if written == "kg; 2-D kg/m":
                    written = "kg/m" if run.dimension == 2 else "kg"
                assert unit == ("-" if written == "1" else written) or (unit == "-" and not written)
                cells = [row[place] for row in rows]
                if table[column].dtype.kind in "fi" and cells:
                    # To the bit.
                    assert np.array_equal(table[column], np.array(cells, dtype=float), equal_nan=True)
                else:
                    assert list(table[column].astype(str)) == cells
            if stem.startswith("probe_"):
                assert units(table)["time"] == "s" and units(table)["step"] == "-"
                assert table["step"].dtype.kind == "i"
                # Forces on walls and structures are those of the middle of the last step.
                end, step = run.summary["time"], run.summary["time"] / run.summary["steps"]
                assert min(abs(table["time"].iloc[-1] - (end - part * step)) for part in (0, 0.5)) <= 1e-9 * end


def test_fields_lie_where_the_probes_say(runs):
    """The program samples lines through cell centres by itself: order of axes, coordinates and units are one."""
    with open_run(runs["taylor-green"]) as run:
        for probe, table in run.probes["line"].groupby("step"):
            fields = [output for output in run.fluid if output.step == probe]
            if not fields:
                continue
            (output,) = fields
            column = int(np.argmin(np.abs(output.x - 0.00255)))
            np.testing.assert_allclose(output.y, table["y"], rtol=1e-12)
            np.testing.assert_allclose(output.x[column], table["x"], rtol=1e-12)
            velocity = output["velocity"][0, :, column]
            np.testing.assert_allclose(velocity[:, 0], table["velocity_x"], rtol=1e-5, atol=1e-12)
            np.testing.assert_allclose(velocity[:, 1], table["velocity_y"], rtol=1e-5, atol=1e-12)
            np.testing.assert_allclose(output["pressure"][0, :, column], table["pressure"], rtol=1e-4, atol=1e-9)
            # Neither is the same along the other axis.
            assert np.ptp(velocity[:, 0]) > 0.1 * abs(velocity[:, 0]).max()
            assert not np.allclose(output["velocity"][0, column, :, 0], table["velocity_x"], rtol=1e-2, atol=0)
            break
        else:
            pytest.fail("no field at a step of the probe")


def test_vertical_axis_of_three_dimensions(runs):
    """The stream over the bed of blocks points along x and is fastest high above it."""
    with open_run(runs["scour"]) as run:
        mean = run.fluid[0]["velocity"][..., 0].mean(axis=(1, 2))
        assert len(mean) == len(run.fluid[0].z) and mean[-1] > mean[0] and mean.max() > 0


def test_grains_have_the_energy_of_the_summary(runs):
    with open_run(runs["seepage"]) as run:
        table = run.grains[-1].table()
        assert len(table) == run.summary["grains"]
        density = run.case["materials"][run.case["grains"]["material"]]["density"]
        mass = density * 4 / 3 * np.pi * table["radius"] ** 3
        speed = sum(table[f"velocity_{axis}"] ** 2 for axis in "xyz")
        spin = sum(table[f"angular_velocity_{axis}"] ** 2 for axis in "xyz")
        energy = (mass / 2 * (speed + 0.4 * table["radius"] ** 2 * spin)).sum()
        assert energy == pytest.approx(run.summary["kinetic_energy"], rel=1e-9)
        assert np.array_equal(table["diameter"], 2 * table["radius"]) and (np.diff(table["id"]) > 0).all()


def test_contacts_join_the_grains(runs):
    """A line of two grains is as long as their radii less the overlap."""
    with open_run(runs["piping"]) as run:
        grains = run.grains[-1].table().set_index("id")
        table = run.contacts[-1].table()
        pairs = table[table["other"] >= 0]
        assert len(pairs) > 100 and pairs["bonded"].max() == 1
        radii = grains["radius"].loc[pairs["grain"]].to_numpy() + grains["radius"].loc[pairs["other"]].to_numpy()
        lines = run.contacts[-1].lines[pairs.index]
        length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
        np.testing.assert_allclose(length, radii - pairs["overlap"], rtol=1e-9)
        assert np.array_equal(lines[:, 0], grains[["x", "y", "z"]].loc[pairs["grain"]])


def test_blocks_stand_where_their_probes_say(runs):
    with open_run(runs["dry-incline"]) as run:
        for body, name in enumerate(("sticks", "slides")):
            probe = run.probes[name].iloc[-1]
            table = run.blocks[-1].table()
            (block,) = table[table["body"] == body].to_dict("records")
            assert block["volume"] == pytest.approx(0.4 * 0.4 * 0.2, rel=1e-12)
            for axis in "xyz":
                assert block[axis] == pytest.approx(probe[axis], rel=1e-12)
                assert block[f"velocity_{axis}"] == probe[f"velocity_{axis}"]
        assert units(table)["volume"] == "m3" and units(table)["rotation_x"] == "rad"


def test_averages(runs):
    with open_run(runs["stagnation"]) as run:
        output = run.averages[-1]
        samples = output["samples"]
        covered = samples == 0
        assert covered.any() and samples.max() > 1
        stress = output["reynolds_stress"].reshape(*output.shape, 3, 3)
        assert np.array_equal(stress, np.swapaxes(stress, -1, -2), equal_nan=True)
        # Cells inside a body have no samples and no mean.
        assert np.isnan(output["mean_pressure"][covered]).all() and np.isfinite(output["mean_pressure"][~covered]).all()
        assert output.units["reynolds_stress"] == "m2/s2"


@pytest.mark.parametrize("name", ["piping", "seepage", "avalanche"])
def test_meshes(runs, name):
    pytest.importorskip("pyvista")
    with open_run(runs[name]) as run:
        for output in (series[-1] for series in run.series.values()):
            mesh = output.mesh()
            arrays = mesh.point_data if isinstance(output, solver_results.Grains) else mesh.cell_data
            assert set(output.names) <= set(arrays.keys())
            for key in output.names:
                array = output[key]
                assert np.array_equal(np.asarray(arrays[key]).ravel(), array.ravel())
            if isinstance(output, solver_results.Fields):
                centres = mesh.cell_centers().points.reshape(*output.shape, 3)
                np.testing.assert_allclose(centres[0, 0, :, 0], output.x, rtol=1e-6)
                np.testing.assert_allclose(centres[:, 0, 0, 2], output.z, rtol=1e-6)
            elif isinstance(output, solver_results.Contacts):
                np.testing.assert_allclose(mesh.points.reshape(-1, 2, 3), output.lines, rtol=1e-6)
            elif isinstance(output, solver_results.Blocks):
                assert mesh.n_cells == len(output["id"])


def test_meshes_need_pyvista(runs, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with open_run(runs["seepage"]) as run, pytest.raises(ImportError, match="pip install pyvista"):
        run.fluid[-1].mesh()


@pytest.fixture()
def copy(runs, tmp_path):
    return shutil.copytree(runs["seepage"], tmp_path / "copy")


def test_opening_reads_no_field(copy, monkeypatch):
    """Ten thousand outputs: none is opened before one is asked for, and the list of times takes none either."""
    first = copy / "grains_000000000.vtkhdf"
    grid = '  <Grid Name="grains_{0:09}" GridType="Uniform"><Time Value="{1}"/>\n  </Grid>\n'
    with open(copy / "grains.xmf", "w") as index:
        for step in range(1000, 11000):
            os.link(first, copy / f"grains_{step:09}.vtkhdf")
            index.write(grid.format(step, step / 1e3))
    opened = []
    there = h5py.File
    monkeypatch.setattr(h5py, "File", lambda *a, **k: opened.append(a) or there(*a, **k))
    with open_run(copy) as run:
        before = len(run.grains)
        assert before > 10000 and run.grains[-1].time == 10.999
        # Those few that the index does not name know their times themselves.
        times = run.grains.times
        assert len(opened) == before - 10000 and np.array_equal(times[-10000:], np.arange(1000, 11000) / 1e3)
        opened.clear()
        for output in run.grains[-300:]:
            assert output.positions.shape[1] == 3
        assert len(opened) == 300 and len(run._files._open) <= 8


def test_a_closed_run_reads_no_more(runs):
    with open_run(runs["collision"]) as run:
        output = run.grains[0]
        radius = output["radius"]
        file = output.file
    assert not file and (radius > 0).all()
    with pytest.raises(ReadError, match="closed"):
        output["radius"]


def test_cells_of_different_widths(copy):
    with open_run(copy) as run:
        shape = run.fluid[-1].shape
        assert not run.fluid[-1].is_graded
        assert [len(faces) - 1 for faces in run.fluid[-1].faces] == list(shape[::-1])
    faces = [np.cumsum(np.arange(n + 1.0)) for n in shape[::-1]]
    with h5py.File(sorted(copy.glob("fluid_*.vtkhdf"))[-1], "r+") as file:
        root = file["VTKHDF"]
        root.attrs["Type"], root.attrs["Version"] = np.bytes_("RectilinearGrid"), np.array([2, 7])
        for axis, values in zip("XYZ", faces):
            root[f"{axis}Coordinates"] = values
    with open_run(copy) as run:
        fields = run.fluid[-1]
        assert fields.is_graded and fields.shape == shape
        for found, values in zip((fields.x, fields.y, fields.z), faces):
            assert np.allclose(found, 0.5 * (values[1:] + values[:-1]))
        assert (fields.spacing == 1).all() and (fields.origin == 0).all()
        assert len(fields.table()) == np.prod(shape)


def test_unknown_versions_are_refused(copy):
    summary = json.loads((copy / "summary.json").read_text())
    for version in ("0.2.0", "1.0.0", "soon"):
        (copy / "summary.json").write_text(json.dumps({**summary, "versions": {"solver": version}}))
        with pytest.raises(ReadError, match=f"written by solver {version}, and this reader knows 0.1.x"):
            open_run(copy)
    (copy / "summary.json").unlink()
    fluid = sorted(copy.glob("fluid_*.vtkhdf"))[-1]
    with h5py.File(fluid, "r+") as file:
        kind = file["VTKHDF"].attrs["Version"]
        file["VTKHDF"].attrs["Version"] = np.array([7, 1])
    with open_run(copy) as run:
        assert not run.finished and run.summary == {}
        with pytest.raises(ReadError, match="version 7.1 of VTKHDF's ImageData"):
            run.fluid[-1]["pressure"]
        assert run.fluid[0]["pressure"].size
    with h5py.File(fluid, "r+") as file:
        file["VTKHDF"].attrs["Version"] = kind
        if "solver" in file["provenance"].attrs:
            file["provenance"].attrs["solver"] = "0.9.1"
    with open_run(copy) as run, pytest.raises(ReadError, match="written by solver 0.9.1"):
        run.fluid[-1]["pressure"]


def test_what_is_broken_is_named(copy):
    last = sorted(copy.glob("grains_*.vtkhdf"))[-1]
    last.write_bytes(last.read_bytes()[:5000])
    with open_run(copy) as run:
        with pytest.raises(ReadError, match=last.name):
            run.grains[-1]["radius"]
        with pytest.raises(KeyError, match="holds no array speed; it holds"):
            run.fluid[0]["speed"]
        with pytest.raises(KeyError, match="holds no table"):
            run.tables["speed"]
        with pytest.raises(KeyError, match="no output fluid of step 77777"):
            run.fluid.at_step(77777)
        with pytest.raises(IndexError):
            run.blocks.nearest(0.0)
    (copy / "case.json").write_text("{")
    with pytest.raises(ReadError, match="case.json cannot be read"):
        _ = open_run(copy).case
    (copy / "case.json").unlink()
    with pytest.raises(ReadError, match="no folder of a run"):
        open_run(copy)
    with pytest.raises(ReadError, match="there is no folder"):
        open_run(copy / "nowhere")


def test_a_run_that_goes_on(copy):
    later = sorted(copy.glob("fluid_*.vtkhdf"))[-1]
    aside = copy / "aside"
    later.rename(aside)
    with open_run(copy) as run:
        count = len(run.fluid)
        aside.rename(later)
        assert len(run.fluid) == count
        run.refresh()
        assert len(run.fluid) == count + 1


def test_styles_of_tables(tmp_path):
    def table(text, **more):
        (tmp_path / "a.csv").write_text(text)
        return read_table(tmp_path / "a.csv", **more)

    inline = table("step,time [s],share [1],kind\n1,0.5,1,loose\n2,1,,at wall\n")
    assert units(inline) == {"step": "-", "time": "s", "share": "-", "kind": "-"}
    assert inline["kind"].tolist() == ["loose", "at wall"] and np.isnan(inline["share"][1])
    below = table("step,time,u\n# -,s,m/s\n1,0.1,0.30000000000000004\n# a remark\n\n2,0.2,NaN\n3,0.")
    assert units(below) == {"step": "-", "time": "s", "u": "m/s"}
    assert below["u"][0] == 0.1 + 0.2 and len(below) == 2
    assert units(table("# x, radius\n0.1,0.2\n")) == {"x": "", "radius": ""}
    assert list(table("a [m],a [s]\n1,2\n").columns) == ["a [m]", "a [s]"]
    assert list(table("time [s],n [1]\n1,2\n", units_in_names=True).columns) == ["time [s]", "n"]
    assert units(table("mass [kg; 2-D kg/m]\n1\n", dimension=2)) == {"mass": "kg/m"}
    assert len(table("time [s]\n")) == 0
    for broken in ("", "a,b\n1,2,3\n", "a,b\n1\n"):
        with pytest.raises(ReadError, match="a.csv"):
            table(broken)
    with pytest.raises(ReadError, match="no table"):
        read_table(tmp_path / "b.csv")


def test_committed_tables_are_read():
    """The tables of the studies in this repository, which older versions wrote, too."""
    from conftest import ROOT

    tables = sorted((ROOT / "jobs").rglob("results/**/*.csv"))
    assert len(tables) > 20
    for path in tables:
        assert len(read_table(path)) > 0
