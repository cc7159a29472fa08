"""Results on disk: every file is written under a temporary name and renamed, so none is ever half there."""

from __future__ import annotations

import csv
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from tympan.fem.discretisation.isoparametric import tabulated
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Fields, cell_fields
from tympan.geometry.errors import InputError

#: Fields of a VTU, in SI; ParaView shows the names. ``tension`` is 0 taut, 1 wrinkled, 2 slack;
#: ``breakdown_share`` is field over strength, 0 where the strength is unknown.
STORED = ("displacement", "stretch_1", "stretch_2", "thickness", "electric_field", "maxwell_stress",
          "stress_1",
          "stress_2", "stress_radial", "stress_circumferential", "stress_shear", "tension",
          "breakdown_share")


def write_atomically(file: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``file`` and rename it; a failure leaves the old file.

    Raises
    ------
    InputError
        When the folder cannot be made or written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        # The suffix stays last: libraries choose the format by it.
        handle, name = tempfile.mkstemp(suffix=file.suffix, prefix=f".{file.stem}-",
                                        dir=file.parent)
        os.close(handle)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=file) from None
    temporary = Path(name)
    try:
        write(temporary)
        temporary.chmod(0o644)
        temporary.replace(file)
    except OSError as error:  # libraries may raise it without a number
        raise InputError(f"cannot be written: {error.strerror or error}", file=file) from None
    finally:
        temporary.unlink(missing_ok=True)


def remove(folder: Path, *names: str) -> None:
    """Remove files of an earlier run, so that none stands beside results it does not belong to."""
    try:
        for name in names:
            folder.joinpath(name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror}", file=folder) from None


def write_text(file: Path, text: str) -> None:
    """Write a text file atomically."""
    write_atomically(file, lambda path: path.write_text(text, encoding="utf-8"))


def write_json(file: Path, value: Any) -> None:
    """Write a JSON file atomically."""
    write_text(file, json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def write_csv(file: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file atomically; floats with the digits needed to read them back to 12 places."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([f"{cell:.12g}" if isinstance(cell, float) else cell for cell in row]
                     for row in rows)
    write_text(file, text.getvalue())


def write_fields(file: Path, model: Model, state: State, parts: int = 6,
                 **nodal: np.ndarray) -> None:
    """The fields of a whole film as VTU: deformed positions as points, each curved element as ``parts``² triangles.

    Elements share no points, so jumps between them stay visible; the mounted position is the
    displacement away. Further ``nodal`` vectors, shape (nodes, 3), are interpolated.
    """
    points, triangles = lattice(parts)
    fields = cell_fields(model, state, points)
    offsets = len(points.T) * np.arange(model.discretisation.mesh.nelements)[:, None, None]
    cells = (offsets + triangles).reshape(-1, 3)
    mesh = meshio.Mesh(
        fields.position + fields.displacement, [("triangle", cells)],
        point_data={name: _array(fields, name) for name in STORED}
        | {name: interpolated(model, values, points) for name, values in nodal.items()})
    write_atomically(file, lambda path: meshio.write(path, mesh, file_format="vtu"))


def interpolated(model: Model, nodal: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A nodal vector field, shape (nodes, 3), at the same reference points of every element; element-major."""
    shapes = tabulated(model.discretisation.mesh.order, points)[0]
    return np.asarray(np.matmul(shapes.T, nodal[model.discretisation.connectivity]).reshape(-1, 3))


def lattice(parts: int) -> tuple[np.ndarray, np.ndarray]:
    """Reference points of a triangle cut into ``parts``² equal ones, shape (2, n), and these, shape (parts², 3).

    Examples
    --------
    >>> points, triangles = lattice(2)
    >>> points.shape, triangles.shape
    ((2, 6), (4, 3))
    """
    number: dict[tuple[int, int], int] = {}
    points: list[tuple[float, float]] = []
    for j in range(parts + 1):
        for i in range(parts + 1 - j):
            number[i, j] = len(points)
            points.append((i / parts, j / parts))
    up = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in number if i + j < parts]
    down = [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in number
            if i + j < parts - 1]
    return np.array(points).T, np.array(up + down)


def _array(fields: Fields, name: str) -> np.ndarray:
    return np.ascontiguousarray(getattr(fields, name))
