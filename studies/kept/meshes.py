"""Meshes of films, kept on disk.

Where a film is cut, to load cadquery alone takes longer than to solve it on a mesh that is there.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import parent_process

from tympan.geometry.mesh import CurvedTriangles, from_bytes, from_meshio, to_bytes
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import Outline
from tympan.geometry.specimen import Specimen
from tympan.studies.kept.store import Store, digest

#: Some 10 MB at the default fineness.
MESHES = Store("meshes", 400)

#: Meshes of more bytes are not kept.
_LARGEST = 2_000_000


def film_part(specimen: Specimen, settings: MeshSettings,
              planes: frozenset[str]) -> CurvedTriangles:
    """The mesh of the film, or of its part where the coordinates ``planes`` are positive.

    It is as fine as the settings and the film's prestretch say. That of the same outlines and
    settings is meshed once and read from then on, to the last bit.
    But a process among others at work on many films keeps none: few are met again.
    """
    settings = settings.suited(specimen.membrane.prestretch)
    key = None if parent_process() else _key(specimen, settings, planes)
    kept = None if key is None else MESHES.read(key, from_bytes)
    if kept is not None:
        return kept
    part = from_meshio(mesh_film(specimen, settings, planes))
    content = to_bytes(part)
    if key is not None and len(content) <= _LARGEST:
        MESHES.keep(key, content)
    return part


def _key(specimen: Specimen, settings: MeshSettings, planes: frozenset[str]) -> bytes | None:
    """Key by all that a mesh depends on; None of outlines whose value is not all they are."""
    shape = specimen.frame, specimen.plate, specimen.electrode
    with suppress(TypeError):
        return digest("mesh", *shape, *(outline.curve.pieces for outline in _outlines(specimen)),
                      settings, planes)
    return None


def _outlines(specimen: Specimen) -> Iterator[Outline]:
    """All outlines; their pieces tell of changes in the sources of outlines from elsewhere."""
    yield specimen.frame
    if specimen.plate is not None:
        yield specimen.plate.outline
    if specimen.electrode.outline is not None:
        yield specimen.electrode.outline.outline
