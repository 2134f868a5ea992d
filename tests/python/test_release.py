"""Version and notes: Cargo.toml, CITATION.cff, the reader, the notes and the recipes agree."""

import re
import shutil
import subprocess
import sys

import solver_results
from conftest import ROOT
from solver_results.versions import PROGRAM, check_program

CARGO = re.search(r'(?s)\[workspace\.package\].*?^version = "([^"]+)"', (ROOT / "Cargo.toml").read_text(), re.M).group(1)


def held(path, pattern):
    return re.findall(pattern, (ROOT / path).read_text(), re.M)


def test_one_version_everywhere():
    assert re.fullmatch(r"\d+\.\d+\.\d+", CARGO)
    assert held(".github/CITATION.cff", r"^version: (.+)$") == [CARGO]
    assert held("jobs/python/pyproject.toml", r'^version = "(.+)"$') == [CARGO]
    assert solver_results.__version__ == CARGO
    assert held("jobs/container/solver.def", r"^    Version (.+)$") == [CARGO]
    assert set(held("jobs/modulefiles/solver.lua", r"\b(\d+\.\d+\.\d+)\b")) == {CARGO}
    assert set(held("Cargo.lock", r'name = "solver(?:-library)?"\nversion = "(.+)"')) == {CARGO}


def test_the_reader_knows_the_version():
    check_program(CARGO, "Cargo.toml")
    assert tuple(int(n) for n in CARGO.split(".")[:2]) == PROGRAM[-1]


def test_the_notes_begin_with_the_version():
    """The newest section of the notes is that of the version, with the date of the citation."""
    date = held(".github/CITATION.cff", r"^date-released: (.+)$")
    sections = held("jobs/CHANGELOG.md", r"^## (\d+\.\d+\.\d+) \((\d{4}-\d{2}-\d{2})\)$")
    assert sections[0] == (CARGO, *date)
    assert sections == sorted(sections, key=lambda s: [int(n) for n in s[0].split(".")], reverse=True)
    text = (ROOT / "jobs" / "CHANGELOG.md").read_text()
    assert not re.search(r"\b[A-Z]-\d\d\b|\b[0-9a-f]{7,40}\b", text), "notes have no ids"


def test_recipes_name_files_that_are_there():
    for recipe in ("Dockerfile", "solver.def"):
        names = set(held(f"jobs/container/{recipe}", r"\b(jobs/container/[\w.]+)"))
        assert len(names) > 2
        for name in names:
            assert (ROOT / name).is_file(), name
    need = held("Cargo.toml", r'^rust-version = "(.+)"$')
    assert held("jobs/container/Dockerfile", r"^FROM rust:([\d.]+)-bookworm") == need
    assert held("jobs/container/solver.def", r"^From: rust:([\d.]+)-bookworm") == need
    assert held("jobs/spack/packages/solver/package.py", r'"rust@([\d.]+):"') == need


def test_the_package_installs(tmp_path):
    """pip installs the reader from a copy: a build leaves files in the sources."""

    source = shutil.copytree(
        ROOT / "jobs" / "python", tmp_path / "source", ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info")
    )
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
        "--disable-pip-version-check",
    ]
    done = subprocess.run(
        [*command, "--target", str(tmp_path / "there"), str(source)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert done.returncode == 0, done.stdout
    package = tmp_path / "there" / "solver_results"
    files = (ROOT / "jobs" / "python" / "solver_results").iterdir()
    modules = sorted(path.name for path in files if path.is_file())
    assert sorted(path.name for path in package.iterdir() if path.is_file()) == modules and "py.typed" in modules
