"""The versions that this reader knows."""

from __future__ import annotations

from typing import Any

from .errors import ReadError

#: First two numbers of the versions of solver whose files this reader knows.
PROGRAM: tuple[tuple[int, int], ...] = ((0, 1),)

#: Type of a data file and the first number of the VTKHDF versions that this reader knows.
LAYOUTS = {"ImageData": (1,), "RectilinearGrid": (2,), "PolyData": (2,)}

#: Type of a data file that stands for another one: cells of different widths for equal ones.
_ALSO = {"ImageData": "RectilinearGrid"}


def check_program(version: Any, where: object) -> None:
    """Refuse what a version of solver wrote that is not known; a run that names no version is accepted.

    :param version: the version as the file gives it, such as ``"0.1.0"``, or ``None``
    :param where: the file that gives it
    :raises ReadError: the version is not known
    """
    if version is None or _numbers(version) in PROGRAM:
        return
    known = ", ".join(f"{a}.{b}.x" for a, b in PROGRAM)
    raise ReadError(
        f"{where} was written by solver {version}, and this reader knows {known} only; install jobs/python of the version that wrote it"
    )


def check_layout(kind: str | None, version: Any, expected: str, where: object) -> None:
    """Refuse a data file of another type or of an unknown version of VTKHDF.

    :raises ReadError: the type or the version is not the expected one
    """
    if kind is not None and kind == _ALSO.get(expected):
        expected = kind
    if kind != expected:
        raise ReadError(f"{where} holds {kind or 'no VTKHDF data'}, and {expected} was expected")
    try:
        major = int(version[0])
    except (IndexError, TypeError, ValueError):
        raise ReadError(f"{where} does not name its version of VTKHDF") from None
    if major not in LAYOUTS[expected]:
        known = ", ".join(f"{n}.x" for n in LAYOUTS[expected])
        named = ".".join(str(int(n)) for n in version)
        raise ReadError(f"{where} has version {named} of VTKHDF's {expected}, and this reader knows {known} only")


def _numbers(version: Any) -> tuple[int, int] | None:
    try:
        major, minor = str(version).split(".")[:2]
        return int(major), int(minor)
    except ValueError:
        return None
