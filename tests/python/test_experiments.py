"""The rows of jobs/experiments: each command of the page resolves, and only complete runs are kept."""

import importlib
import json
import re
import subprocess
import sys

import pytest
from conftest import ROOT

FOLDER = ROOT / "jobs" / "experiments"
sys.path.insert(0, str(FOLDER))


def call(*arguments):
    return subprocess.run([sys.executable, str(FOLDER / "run.py"), *arguments], capture_output=True, text=True)


def page_rows():
    """The cells of each row of the first table of the page."""
    lines = (FOLDER / "README.md").read_text().split("|---|---|---|---|---|---|\n")[1].split("\n\n")[0].splitlines()
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


def test_help_lists_the_rows_and_an_unknown_name_is_named():
    rows = importlib.import_module("run").ROWS
    told = call("--help")
    assert told.returncode == 0 and all(name in told.stdout for name in rows)
    wrong = call("colums")
    assert wrong.returncode == 1 and "colums" in wrong.stderr and "columns" in wrong.stderr
    assert call().returncode == 1


def test_each_row_of_the_page_is_complete_and_its_command_resolves():
    rows = importlib.import_module("run").ROWS
    named = set()
    for cells in page_rows():
        assert len(cells) == 6 and all(cells), cells
        named |= set(re.findall(r"run\.py ([a-z0-9-]+)", cells[-1]))
    assert named <= set(rows) and set(rows) - named <= {"backward-erosion"}
    for module in rows.values():
        assert callable(importlib.import_module(module).main)


@pytest.mark.parametrize(
    "outcome, may_fail, kept",
    [("done", False, True), ("done", True, True), ("failed", True, True), ("failed", False, False), ("stopped", True, False), (None, True, False)],
)
def test_only_runs_that_have_ended_are_kept(tmp_path, outcome, may_fail, kept):
    if outcome:
        (tmp_path / "summary.json").write_text(json.dumps({"outcome": outcome}))
    assert importlib.import_module("runs").complete(tmp_path, may_fail) == kept


def test_tables_name_the_version_that_made_a_run(tmp_path, monkeypatch):
    module = importlib.import_module("runs")
    monkeypatch.setattr(module, "VERSIONS", set())
    (tmp_path / "summary.json").write_text(json.dumps({"versions": {"solver": "0.1.0", "commit": "0123456789ab"}}))
    module.note_version(tmp_path)
    monkeypatch.setattr(module, "HERE", tmp_path)
    monkeypatch.setattr(module, "SOLVER", sys.executable)
    module.table("one", ["a"], [(1,)])
    assert (tmp_path / "results" / "one.csv").read_text().startswith("# solver 0.1.0 (0123456789ab); ")
