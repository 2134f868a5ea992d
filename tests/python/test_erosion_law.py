"""The figure of the erosion law in jobs/python, as a script and as a notebook."""

import json
import os
import runpy
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from conftest import ROOT

SCRIPT = ROOT / "jobs" / "python" / "erosion_law.py"


def draw(*arguments):
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, arguments)], stdout=subprocess.PIPE, text=True, env=environment)


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """What the script defines, after it drew the committed study."""
    pytest.importorskip("matplotlib")
    figure = tmp_path_factory.mktemp("figure") / "law.svg"
    argv, sys.argv = sys.argv, [str(SCRIPT), "--output", str(figure)]
    try:
        return {**runpy.run_path(str(SCRIPT), run_name="__main__"), "figure": figure.read_text()}
    finally:
        sys.argv = argv


def test_the_study_is_drawn(script):
    """Points, line and band are those of the committed tables."""
    folder = ROOT / "jobs" / "piping_erosion" / "results" / "small"
    points = pd.read_csv(folder / "erosion_points.csv")
    points = points[(points["points"] == "run") & (points["cohesion [N/m]"] == 0.506)]
    law = pd.read_csv(folder / "erosion_readings.csv")
    law = law[(law["points"] == "runs") & (law["cohesion [N/m]"] == 0.506) & (law["stress"] == "balance")].iloc[0]
    axes = script["FIGURE"].axes[0]
    drawn = np.concatenate([marks.get_offsets() for marks in axes.collections if marks.get_offset_transform() == axes.transData])
    expected = points[["shear_balance [Pa]", "rate [kg/(m^2 s)]"]].to_numpy()
    assert len(expected) == 10
    for point in expected:
        assert np.isclose(drawn, point, rtol=1e-12).all(axis=1).any()
    (curve,) = [found for found in axes.lines if len(found.get_xdata()) == 300]
    at, rate = curve.get_data()
    np.testing.assert_allclose(rate, law["coefficient [s/m]"] * np.maximum(at - law["critical_shear [Pa]"], 0.0))
    assert "[Pa]" in axes.get_xlabel() and "kg" in axes.get_ylabel()
    assert script["figure"].startswith("<?xml")


def test_windows_of_a_run_have_their_rate(script):
    """A hole of 6 mm from which one grain of 0.02 kg/m leaves every 10 ms: 0.02 / 0.01 / (2 * 0.006) kg/(m2 s)."""
    time = np.arange(0.0, 1.2001, 0.01)
    grains = np.arange(len(time))
    erosion = pd.DataFrame(
        {
            "time": time,
            "eroded_grains": grains,
            "eroded_mass": 0.02 * grains,
            "eroded_fraction": grains / 1000.0,
            "hole_length": 0.006,
            "shear_balance": 0.01 + time,
            "pressure_difference": 0.5,
        }
    )
    windows = script["windows"](erosion, "balance")
    rate = 0.02 / 0.01 / 0.012
    np.testing.assert_allclose(windows["rate"], rate, rtol=1e-9)
    # Poisson: one over the root of the number of grains.
    number = (len(time) - 2) / 4
    np.testing.assert_allclose(windows["rate_error"], rate / np.sqrt(number), rtol=0.05)
    assert len(windows) == 4 and windows["shear"].is_monotonic_increasing
    exact = pd.DataFrame({"shear": [1.0, 2.0, 4.0], "eroding": True, "rate_error": [0.1, 0.2, 0.1]})
    law = script["line"](exact.assign(rate=3.0 * (exact["shear"] - 0.5)))
    assert law["coefficient"] == pytest.approx(3.0) and law["critical_shear"] == pytest.approx(0.5)
    assert law["coefficient_low"] < 3.0 < law["coefficient_high"]


def test_a_run_without_erosion_is_drawn(script, runs, tmp_path):
    done = draw(runs["piping"], "--output", tmp_path / "run.png")
    assert done.returncode == 0 and "0 points, no law" in done.stdout
    assert (tmp_path / "run.png").stat().st_size > 1000


def test_the_notebook_is_the_script():
    notebook = json.loads(SCRIPT.with_suffix(".ipynb").read_text())
    cells = []
    for part in SCRIPT.read_text().split("# %%")[1:]:
        kind, _, text = part.partition("\n")
        markdown = kind.strip() == "[markdown]"
        lines = [line[2:] if markdown and line.startswith("# ") else line for line in text.strip().splitlines()]
        cells.append(("markdown" if markdown else "code", "\n".join("" if markdown and line == "#" else line for line in lines)))
    assert [(cell["cell_type"], "".join(cell["source"]).strip()) for cell in notebook["cells"]] == cells
    assert not any(cell.get("outputs") or cell.get("execution_count") for cell in notebook["cells"])
