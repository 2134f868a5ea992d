"""Meshes for pyvista, which is imported only when one is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def _pyvista() -> Any:
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("a mesh needs pyvista, which is not installed; install it with: pip install pyvista") from error
    return pyvista


def image(shape: Sequence[int], spacing: np.ndarray, origin: np.ndarray, arrays: dict[str, np.ndarray]) -> Any:
    """A regular lattice of (nz, ny, nx) cells with cell data."""
    nz, ny, nx = shape
    mesh = _pyvista().ImageData(dimensions=(nx + 1, ny + 1, nz + 1), spacing=tuple(spacing), origin=tuple(origin))
    for name, array in arrays.items():
        # In both orders x is fastest.
        mesh.cell_data[name] = array.reshape(nx * ny * nz, *array.shape[3:])
    return mesh


def rectilinear(faces: Sequence[np.ndarray], arrays: dict[str, np.ndarray]) -> Any:
    """Cells between faces x, y, z with cell data."""
    mesh = _pyvista().RectilinearGrid(*faces)
    for name, array in arrays.items():
        mesh.cell_data[name] = array.reshape(mesh.n_cells, *array.shape[3:])
    return mesh


def points(positions: np.ndarray, arrays: dict[str, np.ndarray]) -> Any:
    """Points with point data."""
    mesh = _pyvista().PolyData(positions) if len(positions) else _pyvista().PolyData()
    for name, array in arrays.items():
        mesh.point_data[name] = array
    return mesh


def lines(ends: np.ndarray, arrays: dict[str, np.ndarray]) -> Any:
    """Lines from (n, 2, 3) ends with cell data."""
    pyvista = _pyvista()
    mesh = pyvista.PolyData()
    if len(ends):
        count = len(ends)
        cells = np.column_stack([np.full(count, 2), np.arange(2 * count).reshape(count, 2)])
        mesh = pyvista.PolyData(ends.reshape(-1, 3), lines=cells.ravel())
    for name, array in arrays.items():
        mesh.cell_data[name] = array
    return mesh


def faces(corners: np.ndarray, polygons: list[np.ndarray], arrays: dict[str, np.ndarray]) -> Any:
    """Polygons with cell data."""
    pyvista = _pyvista()
    mesh = pyvista.PolyData()
    if polygons:
        cells = np.concatenate([np.concatenate([[len(face)], face]) for face in polygons])
        mesh = pyvista.PolyData(corners, faces=cells)
    for name, array in arrays.items():
        mesh.cell_data[name] = array
    return mesh
