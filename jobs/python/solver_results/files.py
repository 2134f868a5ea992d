"""HDF5 files, of which a few stay open."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any

import h5py

from .errors import ReadError
from .versions import check_layout, check_program

#: Files that stay open at a time.
_OPEN = 8


class Files:
    """Opens data files when they are asked for and closes the one that was not used for longest."""

    def __init__(self) -> None:
        self._open: OrderedDict[Path, h5py.File] = OrderedDict()
        self._closed = False

    def get(self, path: Path, layout: str) -> h5py.File:
        """The open file of a layout, ``ImageData`` or ``PolyData``."""
        if self._closed:
            raise ReadError(f"the run was closed before {path.name} was read")
        if path in self._open:
            self._open.move_to_end(path)
            return self._open[path]
        file = _opened(path)
        try:
            _check(file, path, layout)
        except ReadError:
            file.close()
            raise
        self._open[path] = file
        while len(self._open) > _OPEN:
            self._open.popitem(last=False)[1].close()
        return file

    def forget(self) -> None:
        """Close the files that are open; they may be opened again."""
        for file in self._open.values():
            file.close()
        self._open.clear()

    def close(self) -> None:
        """Close the files for good."""
        self.forget()
        self._closed = True


def _opened(path: Path) -> h5py.File:
    try:
        return h5py.File(path, "r")
    except OSError:
        # A data file is complete when it has its name, and no program changes it: it needs no lock, and some network file systems
        # have none.
        try:
            return h5py.File(path, "r", locking=False)
        except OSError as error:
            raise ReadError(f"{path} cannot be read: {error}") from None


def attributes(place: Any) -> dict[str, Any]:
    """The attributes of a group or dataset, texts as str."""
    return {name: text(value) for name, value in place.attrs.items()}


def text(value: Any) -> Any:
    """A text as str; anything else as it is."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _check(file: h5py.File, path: Path, layout: str) -> None:
    root = attributes(file["VTKHDF"]) if "VTKHDF" in file else {}
    check_layout(root.get("Type"), root.get("Version"), layout, path)
    written = attributes(file["provenance"]) if "provenance" in file else {}
    check_program(written.get("solver"), path)
