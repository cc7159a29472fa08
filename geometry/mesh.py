"""Tagged triangle meshes with curved elements, from gmsh to scikit-fem; mirror images."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from itertools import combinations, permutations

import numpy as np
import skfem
from skfem.assembly import Dofs

from tympan.base.arrays import Array, Mask, Numbers
from tympan.geometry.specimen import Specimen

ELEMENTS: dict[int, type[skfem.Element]] = {
    1: skfem.ElementTriP1, 2: skfem.ElementTriP2, 3: skfem.ElementTriP3, 4: skfem.ElementTriP4}


#: Beginning of the names of subdomains that are an electrode's segments; see :func:`segment_name`.
SEGMENT = "segment "


def segment_name(number: int, planes: Iterable[str] = ()) -> str:
    """Name the subdomain of an electrode's segment.

    A part that is mirrored in ``planes`` names a segment for each of its images, too: there a
    triangle may lie in another segment than in the part.

    Examples
    --------
    >>> segment_name(0), segment_name(3, "yx")
    ('segment 0', 'segment 3 xy')
    """
    return f"{SEGMENT}{number} {''.join(sorted(planes))}".rstrip()


def named_segment(name: str) -> tuple[int, frozenset[str]] | None:
    """Read the number and the planes of :func:`segment_name`; None for other subdomains."""
    if not name.startswith(SEGMENT):
        return None
    number, _, planes = name.removeprefix(SEGMENT).partition(" ")
    return int(number), frozenset(planes)


def image_planes(planes: Iterable[str]) -> list[frozenset[str]]:
    """List the planes in which each image of a part is mirrored, the part itself first.

    Examples
    --------
    >>> ["".join(sorted(image)) for image in image_planes("yx")]
    ['', 'x', 'y', 'xy']
    """
    every = sorted(planes)
    return [frozenset(image) for count in range(len(every) + 1)
            for image in combinations(every, count)]


@dataclass(frozen=True, eq=False)
class FlatMesh:
    """Flat mesh with gmsh's order of nodes in each element.

    ``points`` [m] have shape (points, 2), ``triangles`` (elements, nodes), in point numbers.
    ``boundaries`` are the edges of each named boundary, shape (edges, order + 1), in point numbers,
    ``subdomains`` the numbers of each named subdomain's triangles.
    """

    points: Array
    triangles: Numbers
    order: int
    boundaries: Mapping[str, Numbers]
    subdomains: Mapping[str, Numbers]


@dataclass(repr=False)
class CurvedTriangles(skfem.MeshTri2):  # type: ignore[misc]  # scikit-fem has no types
    """Isoparametric triangles of any order; vertices ascend in every triangle."""

    @property
    def order(self) -> int:
        """Polynomial order of the geometry."""
        return int(self.elem.maxdeg)


def curved_mesh(vertices: Array, triangles: Numbers, order: int,
                nodes: Array) -> CurvedTriangles:
    """Make a scikit-fem mesh from the node positions of each element.

    ``vertices`` have shape (2, n), ``triangles``, of vertex numbers that ascend in each column, (3,
    elements), ``nodes``, at scikit-fem's local degrees of freedom, (2, local, elements).
    """
    element = ELEMENTS[order]
    triangles = np.ascontiguousarray(triangles)
    dofs = Dofs(skfem.MeshTri1(np.ascontiguousarray(vertices), triangles, validate=False),
                element()).element_dofs
    doflocs = np.empty((2, int(dofs.max()) + 1))
    doflocs[:, dofs] = nodes
    return CurvedTriangles(doflocs, triangles, elem=element, validate=False)


def from_flat(source: FlatMesh) -> CurvedTriangles:
    """Convert a mesh of gmsh, with its boundaries and subdomains."""
    order, cells = source.order, source.triangles
    used, corners = np.unique(cells[:, :3], return_inverse=True)
    corners = corners.reshape(-1, 3)
    rank = np.argsort(corners, axis=1)
    triangles = np.take_along_axis(corners, rank, axis=1).T
    local = _local_numbers(_gmsh_barycentric(order), order)[tuple(rank.T)]
    nodes = np.take_along_axis(cells, local, axis=1)
    mesh = curved_mesh(source.points[used].T, triangles, order,
                       source.points[nodes].transpose(2, 1, 0))
    new = np.full(len(source.points), -1)
    new[used] = np.arange(len(used))
    boundaries = {name: facets_of(mesh, new[edges[:, :2]])
                  for name, edges in source.boundaries.items() if len(edges)}
    subdomains = {name: members for name, members in source.subdomains.items() if len(members)}
    tagged: CurvedTriangles = mesh.with_boundaries(boundaries).with_subdomains(subdomains)
    return tagged


def to_bytes(mesh: CurvedTriangles) -> bytes:
    """Store a mesh with its boundaries and subdomains, for :func:`from_bytes`."""
    content = BytesIO()
    tagged = {f"boundary {name}": facets for name, facets in (mesh.boundaries or {}).items()}
    tagged |= {f"subdomain {name}": cells for name, cells in (mesh.subdomains or {}).items()}
    np.savez(content, doflocs=mesh.doflocs, t=mesh.t, order=mesh.order, **tagged)
    return content.getvalue()


def from_bytes(content: bytes) -> CurvedTriangles:
    """Load the mesh of :func:`to_bytes`, equal to the last bit."""
    with np.load(BytesIO(content)) as arrays:
        mesh = CurvedTriangles(arrays["doflocs"], arrays["t"],
                               elem=ELEMENTS[int(arrays["order"])], validate=False)
        tags = {kind: {name.removeprefix(f"{kind} "): arrays[name] for name in arrays.files
                       if name.startswith(f"{kind} ")} for kind in ("boundary", "subdomain")}
    tagged: CurvedTriangles = mesh.with_boundaries(tags["boundary"]).with_subdomains(
        tags["subdomain"])
    return tagged


def facets_of(mesh: CurvedTriangles, edges: Numbers) -> Numbers:
    """Numbers of the facets with the given end vertices, shape (edges, 2)."""
    key = mesh.facets[0].astype(np.int64) * mesh.nvertices + mesh.facets[1]
    order = np.argsort(key)
    low, high = np.sort(edges, axis=1).T
    return np.asarray(order[np.searchsorted(key, low * mesh.nvertices + high, sorter=order)])


def unfold(mesh: CurvedTriangles,
           planes: frozenset[str]) -> tuple[CurvedTriangles, Numbers, Array]:
    """Complete a part that was meshed for symmetry by its mirror images.

    Answers the whole mesh, the part's node behind each of its nodes, and signs of shape (2, nodes).
    A nodal vector field of the whole takes its x and y components from the part's nodes, times the
    signs.
    """
    nodes = mesh.doflocs.shape[1]
    origin, signs = np.arange(nodes), np.ones((2, nodes))
    for plane in sorted(planes):
        axis = "xy".index(plane)
        mesh, source, mirrored = _mirror(mesh, axis)
        origin, signs = origin[source], signs[:, source]
        signs[axis, mirrored] *= -1
    return mesh, origin, signs


def segmented(mesh: CurvedTriangles, specimen: Specimen, planes: Iterable[str] = ()
              ) -> CurvedTriangles:
    """Tag the elements of each of an electrode's segments; those in none of them are bare.

    A part that is mirrored in ``planes`` is tagged for each of its images, too.
    """
    if not specimen.electrode.segments:
        return mesh
    tags = mesh.subdomains or {}
    covered = tags.get("covered", np.zeros(0, dtype=np.int64))
    places = mesh.doflocs[:, mesh.dofs.element_dofs[:, covered]].mean(axis=1)
    parts: dict[str, Numbers] = {}
    for image in image_planes(planes):
        x, y = (-along if plane in image else along
                for plane, along in zip("xy", places, strict=True))
        number = specimen.electrode.segment_at(x, y, specimen.frame)
        if not image:
            parts |= {"covered": covered[number >= 0], "bare": np.concatenate(
                [tags.get("bare", covered[:0]), covered[number < 0]])}
        parts |= {segment_name(found, image): covered[number == found]
                  for found in range(len(specimen.electrode.segments))}
    tagged: CurvedTriangles = mesh.with_subdomains(
        {name: cells for name, cells in parts.items() if len(cells)})
    return tagged


def _mirror(mesh: CurvedTriangles, axis: int) -> tuple[CurvedTriangles, Numbers, Mask]:
    """Add the mirror image; also each node's origin, and whether it is in the image alone."""
    count, half = mesh.nvertices, mesh.t.shape[1]
    corner_points = mesh.doflocs[:, :count]
    on_plane = np.abs(corner_points[axis]) < 1e-12 * np.abs(corner_points).max()
    image = np.arange(count)
    image[~on_plane] = count + np.arange(np.count_nonzero(~on_plane))
    flip = np.ones((2, 1))
    flip[axis] = -1
    vertices = np.hstack([corner_points, (flip * corner_points)[:, ~on_plane]])
    # Vertices on the plane keep their numbers, so those of an image triangle need not ascend.
    corners = image[mesh.t]
    rank = np.argsort(corners, axis=0)
    local = _local_numbers(_barycentric(mesh.order), mesh.order)[tuple(rank)]
    old = mesh.dofs.element_dofs
    image_old = np.take_along_axis(old, local.T, axis=0)
    triangles = np.hstack([mesh.t, np.take_along_axis(corners, rank, axis=0)])
    nodes = np.concatenate([mesh.doflocs[:, old], flip[:, :, None] * mesh.doflocs[:, image_old]],
                           axis=2)
    whole = curved_mesh(vertices, triangles, mesh.order, nodes)
    dofs = whole.dofs.element_dofs
    source = np.empty(whole.doflocs.shape[1], dtype=np.int64)
    source[dofs] = np.hstack([old, image_old])
    mirrored = np.ones(len(source), dtype=bool)
    mirrored[dofs[:, :half]] = False
    subdomains: dict[str, Numbers] = {}
    for name, cells in (mesh.subdomains or {}).items():
        for copy, moved in _both(name, "xy"[axis], cells, half):
            known = subdomains.get(copy, moved[:0])
            subdomains[copy] = np.concatenate([known, moved])
    boundaries = {}
    for name, facets in (mesh.boundaries or {}).items():
        ends = mesh.facets[:, facets]
        boundaries[name] = np.unique(facets_of(whole, np.hstack([ends, image[ends]]).T))
    return whole.with_boundaries(boundaries).with_subdomains(subdomains), source, mirrored


def _both(name: str, plane: str, cells: Numbers, count: int) -> Iterator[tuple[str, Numbers]]:
    """Name a subdomain in a part of ``count`` elements and in its mirror image in a plane."""
    segment = named_segment(name)
    if segment is None:
        yield name, np.concatenate([cells, cells + count])
        return
    number, planes = segment
    yield segment_name(number, planes - {plane}), cells + count * (plane in planes)


def _barycentric(order: int) -> Numbers:
    """Integer barycentric coordinates of scikit-fem's local nodes, shape (local, 3)."""
    xy = np.rint(ELEMENTS[order].doflocs * order).astype(np.int64)
    return np.column_stack([order - xy.sum(axis=1), xy])


def _gmsh_barycentric(order: int) -> Numbers:
    """Barycentric nodes in gmsh's order: vertices, edges 01, 12, 20, then the inner triangle."""
    if order == 0:
        return np.zeros((1, 3), dtype=np.int64)
    corners = order * np.eye(3, dtype=np.int64)
    edges = [corners[i] + step * (corners[j] - corners[i]) // order
             for i, j in ((0, 1), (1, 2), (2, 0)) for step in range(1, order)]
    inner = _gmsh_barycentric(order - 3) + 1 if order >= 3 else np.empty((0, 3), dtype=np.int64)
    return np.vstack([corners, *edges, inner])


def _local_numbers(source: Numbers, order: int) -> Numbers:
    """table[rank] for the six vertex orders: where scikit-fem's local nodes are in ``source``."""
    number = {tuple(point): position for position, point in enumerate(source)}
    target = _barycentric(order)
    table = np.zeros((3, 3, 3, len(target)), dtype=np.int64)
    for ranks in permutations(range(3)):
        moved = np.empty_like(target)
        moved[:, ranks] = target
        table[ranks] = [number[tuple(point)] for point in moved]
    return table
