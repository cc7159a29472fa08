"""Export of parts for making an actuator, and of the mesh of its film."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import meshio
import numpy as np

from tympan.base.extras import needs
from tympan.geometry.cad.sizes import PartOptions
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.specimen import Specimen
from tympan.studies.files import write_atomically


def export(specimen: Specimen, settings: MeshSettings, folder: Path,
           options: PartOptions = PartOptions()) -> Iterator[Path]:
    """Write frame, clamp, plate and film as STEP, DXF and SVG [mm], a second-order mesh as VTU [m].

    It yields the files. A film without plate has no plate file. Where the electrode leaves film
    bare, it is written too, for a mask; of an electrode in segments all together, each on a layer
    of its name, and each in files of its own.
    """
    needs("cadquery", "writing parts")
    from tympan.geometry.cad import membrane as cad
    from tympan.geometry.cad import parts

    segments = cad.segment_parts(specimen) if specimen.electrode.segments else {}
    made = {"frame": parts.ring_part(specimen.frame, options, options.frame_height),
            "clamp": parts.ring_part(specimen.frame, options, options.clamp_height),
            "film": cad.membrane_part(specimen)}
    if specimen.plate is not None:
        made["plate"] = parts.plate_part(specimen, options)
    if not segments and not specimen.electrode.everywhere:
        made["electrode"] = cad.electrode_part(specimen)
    made |= {f"electrode-{name}": part for name, part in segments.items()}
    flat = {"dxf": parts.write_dxf, "svg": parts.write_svg}
    for name, part in made.items():
        for suffix, write in {"step": cad.write_step, **flat}.items():
            file = folder / f"{specimen.name}-{name}.{suffix}"
            write_atomically(file, partial(write, [part]))
            yield file
    if segments:
        every, names = [*segments.values()], [*segments]
        together = {"step": partial(cad.write_step, every)} | {
            suffix: partial(draw, every, names=names) for suffix, draw in flat.items()}
        for suffix, write_all in together.items():
            file = folder / f"{specimen.name}-electrode.{suffix}"
            write_atomically(file, write_all)
            yield file
    mesh = mesh_film(specimen, replace(settings, order=2), frozenset())
    membrane = meshio.Mesh(np.column_stack([mesh.points, np.zeros(len(mesh.points))]),
                       [("triangle6", mesh.triangles)])
    file = folder / f"{specimen.name}-film.vtu"
    write_atomically(file, lambda path: membrane.write(path, file_format="vtu"))
    yield file
