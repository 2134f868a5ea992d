"""CSV tables as data frames with units.

The program writes units in one of two ways, and both are read:

* in the names of the columns: ``step,time [s],eroded_mass [kg/m]``
* in the line below the names: ``step,time,velocity_x``, then ``# -,s,m/s``

A data frame has plain names (``time``); the units are in ``frame.attrs["units"]``, a dict from name to unit. The unit of numbers
without a dimension, of counts and of texts is ``-``. All units are empty texts where the file gives none at all.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from .errors import ReadError

#: What makes pandas read numbers to the bit: its default from 3.1 on.
_EXACT: dict[str, Any] = {} if tuple(int(n) for n in pd.__version__.split(".")[:2]) >= (3, 1) else {"float_precision": "round_trip"}

#: What stands between the units in 3-D and in 2-D where a heading gives both.
_FLAT = "; 2-D "
_WITH_UNIT = re.compile(r"^(.*?)\s*\[([^\[\]]*)\]$")


def read_table(path: str | os.PathLike[str], units_in_names: bool = False, dimension: int | None = None) -> pd.DataFrame:
    """Read a CSV table of a run, a study or an analysis.

    :param path: the file
    :param units_in_names: name the columns ``time [s]`` in place of ``time``
    :param dimension: 2 or 3, which chooses between the units of a heading such as ``mass [kg; 2-D kg/m]``
    :return: a data frame with one row for each line; units in ``frame.attrs["units"]``. A last line that is still being written
        is left out. Empty cells are NaN. Numbers have the same bits as in the program.
    :raises ReadError: there is no such file, it has no line of names, or a line does not fit the names
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ReadError(f"there is no table {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ReadError(f"{path} cannot be read: {error}") from None
    names, units, rows = _parts(text[: text.rfind("\n") + 1], path)
    if dimension is not None:
        units = [unit.split(_FLAT)[-1 if dimension == 2 else 0] for unit in units]
    if units_in_names:
        labels = [f"{name} [{unit}]" if unit not in ("", "-") else name for name, unit in zip(names, units)]
    else:
        labels = names
    if rows:
        frame = pd.read_csv(io.StringIO("\n".join(rows)), header=None, names=labels, index_col=False, skipinitialspace=True, **_EXACT)
    else:
        frame = pd.DataFrame({label: pd.Series(dtype=float) for label in labels})
    frame.attrs["units"] = dict(zip(labels, units))
    return frame


def units(frame: pd.DataFrame) -> dict[str, str]:
    """The units of a data frame of this package: a dict from the name of a column to its unit, ``-`` for plain numbers."""
    return dict(frame.attrs.get("units", {}))


def _parts(text: str, path: Path) -> tuple[list[str], list[str], list[str]]:
    """Names, units and lines of values."""
    comment: list[str] | None = None
    names: list[str] | None = None
    rows: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(text.split("\n"), start=1):
        line = line.rstrip("\r")
        if line.startswith("#"):
            # The first such line counts: above the names it may hold them, below it the units.
            if comment is None:
                comment = _cells(line)
                comment[0] = comment[0].lstrip("#").strip()
        elif not line or line.isspace():
            continue
        elif names is None:
            cells = _cells(line)
            if comment is not None and all(_is_number(cell) for cell in cells):
                names, comment = comment, None
                rows.append(line)
                numbers.append(number)
            else:
                names, comment = cells, None
        else:
            rows.append(line)
            numbers.append(number)
    if names is None:
        raise ReadError(f"{path} has no line with the names of columns")
    for number, row in zip(numbers, rows):
        count = row.count(",") + 1 if '"' not in row else len(_cells(row))
        if count != len(names):
            raise ReadError(f"{path}, line {number}: {count} cells where {len(names)} columns are named")
    below = comment or []
    given = [below[k] if k < len(below) else "" for k in range(len(names))]
    return (*_split(names, given), rows)


def _split(names: Sequence[str], below: Sequence[str]) -> tuple[list[str], list[str]]:
    """Plain names, and units from the names or else from the line below them."""
    plain, units = [], []
    for name, unit in zip(names, below):
        found = _WITH_UNIT.match(name)
        if found:
            name, unit = found.groups()
        plain.append(name)
        units.append("-" if unit == "1" else unit)
    if any(units):
        units = [unit or "-" for unit in units]
    if len(set(plain)) < len(plain):
        # Two columns that differ by their unit only keep it in their names.
        plain = list(names)
    return plain, units


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], skipinitialspace=True), [""])]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
