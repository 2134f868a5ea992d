"""The examples in the pages about reading results run as they are written, on the shortened runs."""

import re

import pytest
from conftest import ROOT

# The folders of the pages, and the examples whose runs stand for them.
FOLDERS = {"flow": "first-flow", "seepage": "seepage", "piping": "piping", "avalanche": "avalanche"}


def examples():
    for page in ("jobs/python/README.md", "README.md"):
        for number, text in enumerate(re.findall(r"(?s)```python\n(.*?)```", (ROOT / page).read_text())):
            yield pytest.param(text, id=f"{page}-{number}")


def test_there_are_five_examples():
    assert sum("jobs/python" in example.id for example in examples()) == 5


@pytest.mark.parametrize("text", examples())
def test_example_runs(runs, monkeypatch, capsys, text):
    drawn = []
    if ".plot(" in text:
        pyvista = pytest.importorskip("pyvista")
        monkeypatch.setattr(pyvista.PolyData, "plot", lambda mesh, scalars: drawn.append(mesh.cell_data[scalars]))
    named = re.findall(r'"results/(\w+)"', text)
    assert named
    for name in named:
        text = text.replace(f"results/{name}", str(runs[FOLDERS[name]]))
    exec("from solver_results import open_run, units\n" + text, {})
    printed = capsys.readouterr().out
    assert ("print" not in text or len(printed) > 10) and (".plot(" not in text or len(drawn[0]))
