"""Parts for making an actuator and the mesh its film is computed on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import meshio
import numpy as np

from geometry import cad
from geometry.mesher import MeshSettings, mesh_film
from geometry.specimen import Specimen
from studies.store import write_atomically


def export(specimen: Specimen, settings: MeshSettings, folder: Path) -> Iterator[Path]:
    """Write frame, plate and film as STEP and DXF [mm] and a second-order mesh as VTU [m]; yields the files.

    Where the electrode leaves film bare, it is written too, for a mask.
    """
    parts = {"frame": cad.frame_part(specimen), "plate": cad.plate_part(specimen), "film": cad.membrane_part(specimen)}
    if not specimen.electrode.everywhere:
        parts["electrode"] = cad.electrode_part(specimen)
    for name, part in parts.items():
        for suffix, write in (("step", cad.write_step), ("dxf", cad.write_dxf)):
            file = folder / f"{specimen.name}-{name}.{suffix}"
            write_atomically(file, partial(write, [part]))
            yield file
    mesh = mesh_film(specimen, replace(settings, order=2), frozenset())
    flat = meshio.Mesh(np.column_stack([mesh.points, np.zeros(len(mesh.points))]),
                       [("triangle6", mesh.cells_dict["triangle6"])])
    file = folder / f"{specimen.name}-film.vtu"
    write_atomically(file, lambda path: flat.write(path, file_format="vtu"))
    yield file
