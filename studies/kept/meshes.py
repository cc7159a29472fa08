"""Meshes of films, kept on disk.

Where a film is cut, loading cadquery alone takes longer than solving the film on a stored mesh.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import parent_process

from tympan.geometry.mesh import CurvedTriangles, from_bytes, from_flat, to_bytes
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.geometry.outlines import Outline
from tympan.geometry.specimen import Specimen
from tympan.studies.kept.store import MESHING, Store, digest

#: Store of meshes: about 10 MB at the default fineness.
MESHES = Store("meshes", 400)

#: Largest size of a mesh that is kept [bytes].
_LARGEST = 2_000_000


def film_part(specimen: Specimen, settings: MeshSettings,
              planes: frozenset[str]) -> CurvedTriangles:
    """Mesh the film, or its part where the coordinates ``planes`` are positive.

    The fineness follows the settings and the film's prestretch. Equal outlines and settings are
    meshed once and then read from the disk, identical to the last bit. A worker process among
    others stores no meshes, because it solves many films and few of them recur.
    """
    settings = settings.suited(specimen.membrane.prestretch)
    key = None if parent_process() else _key(specimen, settings, planes)
    kept = None if key is None else MESHES.read(key, from_bytes)
    if kept is not None:
        return kept
    part = from_flat(mesh_film(specimen, settings, planes))
    content = to_bytes(part)
    if key is not None and len(content) <= _LARGEST:
        MESHES.keep(key, content)
    return part


def _key(specimen: Specimen, settings: MeshSettings, planes: frozenset[str]) -> bytes | None:
    """Make a key from all that a mesh depends on; None if values do not determine outlines."""
    shape = specimen.frame, specimen.plate, specimen.electrode.even
    with suppress(TypeError):
        return digest("mesh", *shape, *(outline.curve.pieces for outline in _outlines(specimen)),
                      settings, planes, sources=MESHING)
    return None


def _outlines(specimen: Specimen) -> Iterator[Outline]:
    """Yield all outlines; their pieces change with the sources of outlines in other packages."""
    yield specimen.frame
    if specimen.plate is not None:
        yield specimen.plate.outline
    if specimen.electrode.outline is not None:
        yield specimen.electrode.outline.outline
    for segment in specimen.electrode.segments:
        if segment.outline is not None:
            yield segment.outline.outline
