"""A folder that a run wrote."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from .errors import ReadError
from .files import Files
from .outputs import BlocksSeries, ContactsSeries, FieldsSeries, GrainsSeries, Series
from .tables import read_table
from .versions import check_program

_PROBE = "probe_"


def open_run(path: str | os.PathLike[str]) -> Run:
    """Open the folder of a run. Only what is asked for is read, so that opening takes milliseconds however long the run is.

    :param path: the output folder, which holds ``case.json``
    :return: the run; a context manager that closes its files
    :raises ReadError: it is no folder of a run, or a version of the program wrote it that this reader does not know
    """
    return Run(path)


class Run:
    """The results of one run. Made by :func:`open_run`.

    A run that is still going on can be opened; :meth:`refresh` shows what it has written since. Checkpoints are not read.
    """

    def __init__(self, path: str | os.PathLike[str]):
        self.folder = Path(path)
        if not self.folder.is_dir():
            raise ReadError(f"there is no folder {self.folder}")
        if not (self.folder / "case.json").is_file():
            raise ReadError(f"{self.folder} is no folder of a run: it holds no case.json")
        self._files = Files()
        self._case: dict[str, Any] | None = None
        self._summary: dict[str, Any] | None = None
        self._series: dict[str, Series] = {}
        self.refresh()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        state = self.summary.get("outcome", "no outcome") if self.finished else "no summary yet"
        return f"<Run {str(self.folder)!r}: {state}>"

    def close(self) -> None:
        """Close all files. What was read stays valid; reading more raises :class:`ReadError`."""
        self._files.close()

    def refresh(self) -> None:
        """Look at the folder again: a run that goes on has written more."""
        self._case = self._summary = None
        self._files.forget()
        series: list[Series] = [
            FieldsSeries(self.folder, "fluid", self._files),
            FieldsSeries(self.folder, "averages", self._files),
            GrainsSeries(self.folder, "grains", self._files),
            ContactsSeries(self.folder, "contacts", self._files),
            BlocksSeries(self.folder, "blocks", self._files),
        ]
        self._series = {one.name: one for one in series}
        self.tables: Mapping[str, pd.DataFrame] = Tables(self, "", skip=_PROBE)
        """Every CSV table except the probes by the name of its file without ``.csv``: ``run.tables["erosion"]``."""
        self.probes: Mapping[str, pd.DataFrame] = Tables(self, _PROBE)
        """The probes by their names in the case: ``run.probes["force"]``. A line has one row for each point and time."""
        if self.finished:
            check_program(self.summary.get("versions", {}).get("solver"), self.folder / "summary.json")

    @property
    def case(self) -> dict[str, Any]:
        """The case as it runs (``case.json``): a dict in SI units, as ``solver reference`` describes it."""
        if self._case is None:
            self._case = _json(self.folder / "case.json")
        return self._case

    @property
    def finished(self) -> bool:
        """Whether the run has written its summary."""
        return (self.folder / "summary.json").is_file()

    @property
    def summary(self) -> dict[str, Any]:
        """The summary (``summary.json``): outcome, steps, time [s], errors of balances, versions and more; an empty dict before the
        end of the run. ``None`` stands for what was not measured."""
        if self._summary is None:
            self._summary = _json(self.folder / "summary.json") if self.finished else {}
        return self._summary

    @property
    def fluid(self) -> FieldsSeries:
        """Fields of the fluid: of the lattice, or of the seepage grid where the fluid is a seepage."""
        return self._series["fluid"]  # type: ignore[return-value]

    @property
    def averages(self) -> FieldsSeries:
        """Time averages of the fluid since their start: mean velocity, mean pressure, Reynolds stress (nz, ny, nx, 9)."""
        return self._series["averages"]  # type: ignore[return-value]

    @property
    def grains(self) -> GrainsSeries:
        """Grains and round bodies."""
        return self._series["grains"]  # type: ignore[return-value]

    @property
    def contacts(self) -> ContactsSeries:
        """Contacts and bonds."""
        return self._series["contacts"]  # type: ignore[return-value]

    @property
    def blocks(self) -> BlocksSeries:
        """Polyhedral blocks and bodies."""
        return self._series["blocks"]  # type: ignore[return-value]

    @property
    def series(self) -> dict[str, Series]:
        """The series that hold outputs, by name: ``fluid``, ``averages``, ``grains``, ``contacts``, ``blocks``."""
        return {name: one for name, one in self._series.items() if len(one)}

    @property
    def dimension(self) -> int:
        """2 or 3: the number of edges of the domain."""
        size = self.case.get("domain", {}).get("size")
        if isinstance(size, dict):
            size = size.get("value")
        return len(size or [])


class Tables(Mapping):
    """CSV tables of a folder by name. A table is read when it is asked for, each time anew, so that the table of a run that goes on
    grows."""

    def __init__(self, run: Run, prefix: str, skip: str | None = None):
        self._run, self._folder, self._prefix, self._skip = run, run.folder, prefix, skip

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._names():
            there = ", ".join(self) or "none"
            raise KeyError(f"{self._folder} holds no table {self._prefix}{name}.csv; it holds {there}")
        return read_table(self._folder / f"{self._prefix}{name}.csv", dimension=self._run.dimension)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __contains__(self, name: object) -> bool:
        return name in self._names()

    def __repr__(self) -> str:
        return f"<tables {', '.join(self) or 'none'}>"

    def _names(self) -> list[str]:
        names = [
            entry.name[len(self._prefix) : -len(".csv")]
            for entry in os.scandir(self._folder)
            if entry.name.startswith(self._prefix) and entry.name.endswith(".csv")
        ]
        return sorted(name for name in names if self._skip is None or not name.startswith(self._skip))


def _json(path: Path) -> dict[str, Any]:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ReadError(f"{path} cannot be read: {error}") from None
    if not isinstance(value, dict):
        raise ReadError(f"{path} holds no JSON object")
    return value
