"""The only module that touches gmsh: a specimen's film as a tagged, curved, graded triangle mesh.

gmsh keeps one global state per process, and its options survive ``clear()``; so every mesh gets its
own ``initialize``/``finalize``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tympan.base.arrays import Numbers
from tympan.base.errors import InputError
from tympan.base.extras import needs
from tympan.base.fields import checks_types
from tympan.base.process.folder import temporary_folder
from tympan.base.process.interruption import handlers_kept
from tympan.base.system import missing_library, out_of_memory
from tympan.base.units import METRE, millimetres
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.sectors import Loop, sectors
from tympan.geometry.specimen import Plate, Specimen

if TYPE_CHECKING:
    from tympan.geometry.mesh import FlatMesh

#: Dimension and tag of gmsh's entities, by name.
Groups = dict[str, list[tuple[int, int]]]

#: Points along a curve at which elements are given a size by its curvature.
_SIZES = 65

#: How many times smaller than those around it the elements of an edge may be. Beyond that, larger
#: elements beside small ones fold.
_STEEP = 6

#: Ratio of the largest to the smallest curvature of a curve, up to which the curve counts as an
#: arc.
_ALIKE = 1.5

#: Points of the frame's outline where the width of the film is measured: every 4 degrees of a
#: circle. Set by trial.
_PLACES = 90
#: Corners of the frame's polygon from one measured width to the next. Widths are measured to the
#: polygon, so it must be near the curve.
_BETWEEN = 8

#: A size at a point counts if it is smaller than this share of what the other fields give there.
_SMALLER = 0.8

#: Step in which the factor of :meth:`MeshSettings.suited` changes, so that nearly equal
#: prestretches share a mesh.
_LEVEL = 0.25
#: Largest factor of :meth:`MeshSettings.suited`: elements half as long, four times as many. It
#: bounds the cost.
_FINEST = 2.0

#: Orders of the elements' curved edges.
_ORDERS = (1, 2, 3, 4)



@checks_types
@dataclass(frozen=True)
class MeshSettings:
    """Fineness of the film's mesh.

    ``order`` of the curved elements, ``around_plate`` elements around the whole plate; away from
    the plate the element size grows by ``growth`` metres per metre and never exceeds ``across`` of
    the local gap between plate and frame, nor what puts ``around_plate`` elements around a circle
    of the edge's own curvature.
    """

    order: int = 4
    around_plate: int = 12
    growth: float = 0.6
    across: float = 0.7

    def __post_init__(self) -> None:
        if self.order not in _ORDERS:
            raise InputError(f"must be one of {', '.join(map(str, _ORDERS))}", key="order",
                             given=self.order)
        if self.around_plate < 4 or not 0 < self.growth <= 2 or not 0 < self.across <= 2:
            raise InputError("must be: around_plate ≥ 4, growth and across in (0, 2]",
                             given=str(self))

    def refined(self, factor: float) -> MeshSettings:
        """Elements smaller by ``factor`` everywhere."""
        return MeshSettings(self.order, round(self.around_plate * factor), self.growth / factor,
                            self.across / factor)

    def suited(self, prestretch: tuple[float, float]) -> MeshSettings:
        """Refine for a prestretch, so that the accuracy is that of equal stretches.

        Under unequal tension a round plate acts like an ellipse, whose ends are sharper. Elements
        are smaller by the root of the ratio of the stretches.

        Examples
        --------
        >>> MeshSettings().suited((2.0, 2.1)) == MeshSettings()
        True
        >>> MeshSettings().suited((3.0, 1.35)).around_plate
        18
        """
        ratio = max(prestretch) / min(prestretch)
        factor = min(1 + _LEVEL * round((np.sqrt(ratio) - 1) / _LEVEL), _FINEST)
        return self if factor == 1 else self.refined(factor)


def mesh_film(specimen: Specimen, settings: MeshSettings, planes: frozenset[str]) -> FlatMesh:
    """Mesh the flat mounted film: points [m], shape (n, 2), and triangles of ``settings.order``.

    Its named parts are the edges ``frame``, ``plate``, ``axis_x``, ``axis_y`` (through the plate's
    centre, or the frame's where there is no plate), the triangles ``covered`` and ``bare``.
    ``planes`` names the coordinates in which the film will be mirrored: only the part where they
    are positive is meshed.
    """
    loops = sectors(specimen, planes)
    faces = _cut_faces(specimen, planes) if loops is None else {}
    with _session() as gmsh:
        edges = specimen.electrode.edges(specimen.frame)
        surfaces = (_imported(gmsh, faces, edges) if loops is None
                    else _built(gmsh, loops, edges))
        groups = _curve_groups(gmsh, specimen) | surfaces
        _size_field(gmsh, specimen, settings, groups, 2 ** len(planes))
        try:
            gmsh.model.mesh.generate(2)
            gmsh.model.mesh.setOrder(settings.order)
        except Exception as error:  # gmsh raises nothing more specific
            if short := out_of_memory(error):
                raise short from None
            raise InputError(f"cannot be meshed: {error}", key="frame, plate, electrode",
                             given=specimen.name) from None
        return _flat_mesh(gmsh, groups, settings.order)


def _cut_faces(specimen: Specimen, planes: frozenset[str]) -> dict[str, list[Any]]:
    """Cut the flat film with cadquery: its ``covered`` and ``bare`` faces, for OpenCASCADE."""
    needs("cadquery", "a mesh cut along an electrode's outline, or at curves that meet an axis "
                      "repeatedly,")
    from tympan.geometry.cad.membrane import membrane_faces  # not loaded where nothing is cut

    return {name: [face.wrapped for face in faces]
            for name, faces in membrane_faces(specimen, planes).items()}


@contextmanager
def _session() -> Iterator[Any]:
    try:
        import gmsh
    except OSError as error:
        raise missing_library(error) from None
    if gmsh.isInitialized():
        raise RuntimeError("gmsh is already in use in this process; finalize it before meshing "
                           "with tympan")
    with handlers_kept():
        gmsh.initialize(interruptible=False, readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        # Precision to which sizes are integrated along curves; gmsh's 1e-9 takes most of the time.
        gmsh.option.setNumber("Mesh.LcIntegrationPrecision", 1e-5)
        gmsh.model.add("film")
        yield gmsh
    finally:
        gmsh.finalize()


def _curve_groups(gmsh: Any, specimen: Specimen) -> Groups:
    """Find the curves on the frame, on the plate, and on the axes through the plate's centre."""
    tolerance = 1e-6 * max(specimen.frame.semi_axes)
    curves = gmsh.model.getEntities(1)
    x, y = np.moveaxis(np.array([_along(gmsh, curve, 7) for curve in curves]), -1, 0) / METRE
    places = {
        "frame": specimen.frame.level(x, y),
        "plate": np.inf + x if specimen.plate is None else specimen.plate.level(x, y),
        "axis_x": y - specimen.centre[1],
        "axis_y": x - specimen.centre[0],
    }
    groups: Groups = {name: [] for name in places}
    for number, curve in enumerate(curves):
        for name, distance in places.items():
            if np.all(np.abs(distance[number]) < tolerance):
                groups[name].append(curve)
                break
    return groups


def _along(gmsh: Any, curve: tuple[int, int], count: int) -> np.ndarray:
    """Points from one end of a curve to the other, shape (count, 2) [mm]."""
    return np.reshape(gmsh.model.getValue(*curve, _parameters(gmsh, curve, count)), (-1, 3))[:, :2]


def _parameters(gmsh: Any, curve: tuple[int, int], count: int) -> np.ndarray:
    start, end = gmsh.model.getParametrizationBounds(*curve)
    return np.linspace(start[0], end[0], count)


def _built(gmsh: Any, loops: dict[str, list[Loop]], edges: Sequence[Piece]) -> Groups:
    """Build surfaces within loops in gmsh's own OpenCASCADE, cut along ``edges``."""
    occ = gmsh.model.occ
    plane = occ.addDisk(0, 0, 0, 1, 1)
    surfaces = {name: [(2, occ.addTrimmedSurface(plane, [_curve_loop(occ, loop)], True))
                       for loop in members] for name, members in loops.items()}
    occ.remove([(2, plane)])
    # The surfaces have copies of the curves. The curves themselves, and the poles of splines, would
    # be meshed too.
    for dimension in (1, 0):
        occ.remove(occ.getEntities(dimension))
    groups = _glued(gmsh, surfaces, edges)
    if sum(map(len, groups.values())) == 1:
        _number_from_both_ends(gmsh)
    return groups


def _curve_loop(occ: Any, loop: Loop) -> int:
    return int(occ.addCurveLoop([_curve(occ, piece) for piece in loop]))


def _number_from_both_ends(gmsh: Any) -> None:
    """Assign numbers to curves and points in the order of OpenCASCADE's wires.

    The triangulation depends on these numbers and on the origin of the plane.
    """
    curves = gmsh.model.getEntities(1)
    ends = [curve for pair in zip(curves, reversed(curves), strict=True) for curve in pair]
    ends = ends[:len(curves)]
    met = dict.fromkeys(point for curve in ends
                        for point in gmsh.model.getBoundary([curve], oriented=False))
    for entities in (ends, [*met]):
        for number, entity in enumerate(entities, start=1 + max(_tags(entities))):
            gmsh.model.setTag(*entity, number)


def _curve(occ: Any, piece: Piece) -> int:
    """Add a piece as a curve [mm]; answers its tag."""
    if isinstance(piece, Line):
        return int(occ.addLine(*(occ.addPoint(*millimetres(*place), 0)
                                 for place in (piece.start, piece.end))))
    return _arc(occ, piece) if isinstance(piece, Arc) else _spline(occ, piece)


def _arc(occ: Any, arc: Arc) -> int:
    arc = arc.counterclockwise()
    x, y, a, b = millimetres(*arc.centre, *arc.radii)
    start = arc.start % (2 * np.pi)
    # The last digit of a sum of angles is rounding; left in, it would decide on the triangulation.
    angles = (float(f"{angle:.15g}") for angle in (start, start + arc.sweep))
    axes = (0, 0, 1), (np.cos(arc.turn), np.sin(arc.turn), 0)
    if a == b:
        return int(occ.addCircle(x, y, 0, a, -1, *angles, *axes))
    return int(occ.addEllipse(x, y, 0, a, b, -1, *angles, *axes))


def _spline(occ: Any, spline: Spline) -> int:
    from scipy.interpolate import make_interp_spline  # few films need it

    ends = [[(1, METRE * np.array(slope))] for slope in spline.slopes]
    curve = make_interp_spline(spline.knots, METRE * np.array(spline.points), bc_type=ends)
    knots, multiplicities = np.unique(curve.t, return_counts=True)
    return int(occ.addBSpline([occ.addPoint(x, y, 0) for x, y in curve.c], degree=3, knots=knots,
                              multiplicities=multiplicities))


def _imported(gmsh: Any, faces: dict[str, list[Any]], edges: Sequence[Piece]) -> Groups:
    """Bring cadquery's faces into gmsh as surfaces, cut along ``edges``."""
    with temporary_folder() as folder:
        surfaces = {name: gmsh.model.occ.importShapes(_brep_file(folder, name, members))
                    if members else [] for name, members in faces.items()}
    return _glued(gmsh, surfaces, edges)


def _glued(gmsh: Any, surfaces: Groups, edges: Sequence[Piece]) -> Groups:
    """Fuse surfaces, so that neighbours share the curves where they meet, and cut them."""
    occ = gmsh.model.occ
    whole = [surface for members in surfaces.values() for surface in members]
    lines = [(1, _curve(occ, piece)) for piece in edges]
    parts = [[surface] for surface in whole]
    if len(whole) + len(lines) > 1:
        _, parts = occ.fragment(whole[:1], whole[1:] + lines)
    occ.synchronize()
    of = dict(zip(whole, parts, strict=False))
    glued = {name: [part for surface in members for part in of[surface]]
             for name, members in surfaces.items()}
    if lines:
        # What of the edges lies beyond the film would be meshed too.
        kept = gmsh.model.getBoundary([part for members in glued.values() for part in members],
                                      combined=False, oriented=False)
        occ.remove(sorted({*gmsh.model.getEntities(1)} - {*kept}), recursive=True)
        occ.synchronize()
    return glued


def _brep_file(folder: Path, name: str, faces: list[Any]) -> str:
    """Write faces to a new file; answers its path."""
    from tympan.geometry.cad.wires import brep

    file = folder / f"{name}.brep"
    try:
        file.write_bytes(brep(faces))
    except OSError as error:
        raise InputError("cannot be meshed: there is no room for temporary files in "
                         f"{folder.parent} (TMPDIR names another place): {error.strerror}",
                         key="frame, plate, electrode") from None
    return str(file)


def _size_field(gmsh: Any, specimen: Specimen, settings: MeshSettings, groups: Groups,
                repeats: int) -> None:
    """Set the size of elements; the whole film consists of ``repeats`` copies of the mesh."""
    if specimen.plate is None:
        fields = _fields_without_plate(gmsh, specimen, settings, groups, repeats)
    else:
        fields = _fields_around_plate(gmsh, specimen, specimen.plate, settings, groups)
    fields.append(_curvature_field(gmsh, settings.around_plate))
    gmsh.model.mesh.field.setAsBackgroundMesh(_field(gmsh, "Min", FieldsList=fields))


def _fields_without_plate(gmsh: Any, specimen: Specimen, settings: MeshSettings, groups: Groups,
                          repeats: int) -> list[int]:
    """Limit element sizes h of a film without plate: h ≤ across·gap/2.

    The edge of an electrode takes the place of the plate's: h ≤ h_edge + growth·d_edge, with
    ``around_plate`` elements around the edge, and h ≤ across·(d_edge + d_frame), but never below a
    quarter of h_edge.
    """
    whole = settings.across * specimen.gap * METRE / 2
    fields = [_field(gmsh, "MathEval", F=repr(whole))]
    edge = _electrode_edge(gmsh, groups)
    if edge:
        points = [_along(gmsh, (1, tag), _SIZES) for tag in edge]
        length = repeats * sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in points)
        around = length / settings.around_plate
        rim, frame = _distance(gmsh, edge), _distance(gmsh, _tags(groups["frame"]))
        fields += [
            _field(gmsh, "MathEval", F=f"{around!r} + {settings.growth!r}*F{rim}"),
            _field(gmsh, "MathEval",
                   F=f"max({around / 4!r}, {settings.across!r}*(F{rim} + F{frame}))")]
    return fields


def _electrode_edge(gmsh: Any, groups: Groups) -> list[int]:
    """Find the curves between covered and bare surfaces."""
    inner, outer = (gmsh.model.getBoundary(groups[name], combined=False, oriented=False)
                    for name in ("covered", "bare"))
    return sorted({*_tags(inner)} & {*_tags(outer)})


def _fields_around_plate(gmsh: Any, specimen: Specimen, plate: Plate, settings: MeshSettings,
                         groups: Groups) -> list[int]:
    """Limit element sizes h by the distances d to plate and frame.

    h ≤ h_plate + growth·d_plate and h ≤ across·(d_plate + d_frame). In an uncovered band, and under
    the electrode between two bands, h is at most 3 widths, because a curved edge of a larger
    element would reach across. If the electrode has an outline, the rule near plate and frame is h
    ≤ across·(distance to the outline + distance to plate or frame), but never below a quarter of
    h_plate or 3 widths of a band. Around tight fillets elements grow as they do around the plate.
    """
    edge = plate.outline.points(720)
    perimeter = float(np.hypot(*(np.roll(edge, 1, axis=1) - edge)).sum()) * METRE
    plain = perimeter / settings.around_plate
    rim, frame = (_distance(gmsh, _tags(groups[name])) for name in ("plate", "frame"))
    fields = [_field(gmsh, "MathEval", F=f"{plain!r} + {settings.growth!r}*F{rim}"),
              _field(gmsh, "MathEval", F=f"{settings.across!r}*(F{rim} + F{frame})")]
    margins = [width for width in (specimen.electrode.margin_frame, specimen.electrode.margin_plate)
               if width > 0]
    if specimen.electrode.outline is not None:
        # What is bare is no longer a band alone; this field is as fine in the bands.
        least = min([plain / 4, *(3 * METRE * width for width in margins)])
        edge_distance = _distance(gmsh, _electrode_edge(gmsh, groups))
        nearest = f"F{edge_distance} + min(F{rim}, F{frame})"
        fields.append(_field(gmsh, "MathEval",
                             F=f"max({least!r}, {settings.across!r}*({nearest}))"))
    elif margins:
        least, bands = (METRE * width for width in (specimen.gap - sum(margins), sum(margins)))
        covered = _field(gmsh, "MathEval",
                         F=f"3*max({least!r}, F{rim} + F{frame} - {bands!r})")
        fields += [_field(gmsh, "Constant", VIn=3 * min(margins) * METRE,
                          SurfacesList=_tags(groups["bare"])),
                   _field(gmsh, "Restrict", InField=covered, SurfacesList=_tags(groups["covered"]))]
    return [*fields, *_fillet_fields(gmsh, plate, settings, plain, groups),
            *_narrow_fields(gmsh, specimen, plate, settings, plain)]


def _field(gmsh: Any, kind: str, **options: float | str | list[int]) -> int:
    """Add a size field to gmsh; answers its number."""
    field = gmsh.model.mesh.field
    number = int(field.add(kind))
    for name, value in options.items():
        if isinstance(value, str):
            field.setString(number, name, value)
        elif isinstance(value, list):
            field.setNumbers(number, name, value)
        else:
            field.setNumber(number, name, value)
    return number


def _tags(entities: Iterable[tuple[int, int]]) -> list[int]:
    return [tag for _, tag in entities]


def _distance(gmsh: Any, curves: list[int]) -> int:
    return _field(gmsh, "Distance", CurvesList=curves, Sampling=100)


def _curvature_field(gmsh: Any, around: int) -> int:
    """Add a field with ``around`` elements around a circle of each curve's own curvature.

    gmsh has an option for that, which takes most of the time of meshing: it asks a spline for its
    curvature again and again. Here the sizes at points along every curve are stored in a view.
    Curves alone read it, each place from the nearest point.
    """
    curves = gmsh.model.getEntities(1)
    sizes = [2 * np.pi / (around * np.maximum(_curvature(gmsh, curve, _SIZES), 1e-12))
             for curve in curves]
    points = np.vstack([np.column_stack([_along(gmsh, curve, _SIZES), np.zeros(_SIZES), size])
                        for curve, size in zip(curves, sizes, strict=True)])
    view = gmsh.view.add("sizes")
    gmsh.view.addListData(view, "SP", len(points), points.ravel())
    sizes_of_points = _field(gmsh, "PostView", ViewTag=view)
    return _field(gmsh, "Restrict", InField=sizes_of_points, CurvesList=_tags(curves))


def _curvature(gmsh: Any, curve: tuple[int, int], count: int) -> np.ndarray:
    return np.asarray(np.abs(gmsh.model.getCurvature(*curve, _parameters(gmsh, curve, count))))


def _fillet_fields(gmsh: Any, plate: Plate, settings: MeshSettings, plain: float,
                   groups: Groups) -> list[int]:
    """Add fields that grow elements away from edges much finer than their surroundings."""
    sizes: dict[int, list[int]] = {}
    points: list[int] = []
    for curve in (*groups["plate"], *groups["frame"]):
        curvatures = np.maximum(_curvature(gmsh, curve, _SIZES), 1e-12)
        around = 2 * np.pi / (settings.around_plate * curvatures)
        if curvatures.max() > _ALIKE * curvatures.min():
            # The curve is tight in places alone, such as the ends of an ellipse.
            places = _along(gmsh, curve, _SIZES)
            away = METRE * plate.level(*places.T / METRE)
            steep = np.maximum(plain / 2, (plain + settings.growth * away) / _STEEP)
            tight = around < steep
            points += _cones(gmsh, settings, places[tight], around[tight])
            continue
        size = float(around.min())
        nearest = METRE * float(plate.level(*_along(gmsh, curve, 3).T / METRE).min())
        if size < max(plain / 2, (plain + settings.growth * nearest) / _STEEP):
            # Edges of nearly the same curvature share a field.
            sizes.setdefault(int(np.floor(4 * np.log2(size))), []).append(curve[1])
    return [_field(gmsh, "MathEval", F=f"{2 ** ((level + 0.5) / 4)!r} + "
                   f"{settings.growth!r}*F{_distance(gmsh, tags)}")
            for level, tags in sizes.items()] + points


def _narrow_fields(gmsh: Any, specimen: Specimen, plate: Plate, settings: MeshSettings, plain: float
                   ) -> list[int]:
    """Limit h to across·width where the film is narrow and no plate lies in between."""
    places, widths = _widths(specimen.frame.points(_PLACES * _BETWEEN))
    away = plate.level(*places.T)
    sizes = settings.across * widths
    others = np.minimum(plain / METRE + settings.growth * away, settings.across * away)
    narrow = sizes < _SMALLER * others
    return _cones(gmsh, settings, METRE * places[narrow], METRE * sizes[narrow])


def _widths(edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measure a closed polygon straight across: places on it, shape (n, 2), and widths there."""
    corners = np.asarray(edge).T
    ahead, behind = np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0)
    chosen = slice(None, None, _BETWEEN)
    along = (ahead - behind)[chosen]
    x, y = corners.T
    turn = np.sign(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    inwards = turn * np.column_stack([-along[:, 1], along[:, 0]])
    inwards /= np.hypot(*inwards.T)[:, None]
    start, side = corners[chosen][:, None], ahead - corners
    # The normal from p meets the side from q to r: p + t n = q + s (r − q).
    gap = corners[None] - start
    across = inwards[:, None, 0] * side[None, :, 1] - inwards[:, None, 1] * side[None, :, 0]
    with np.errstate(all="ignore"):
        far = (gap[..., 0] * side[None, :, 1] - gap[..., 1] * side[None, :, 0]) / across
        share = (gap[..., 0] * inwards[:, None, 1] - gap[..., 1] * inwards[:, None, 0]) / across
    scale = np.ptp(corners, axis=0).max()
    met = (share >= 0) & (share <= 1) & (far > 1e-6 * scale)
    return corners[chosen], np.where(met, far, np.inf).min(axis=1)


def _cones(gmsh: Any, settings: MeshSettings, places: np.ndarray, sizes: np.ndarray) -> list[int]:
    """Add fields that grow from sizes at places [mm]; a size that another implies is left out."""
    kept: list[int] = []
    for number in np.argsort(sizes, kind="stable"):
        away = np.hypot(*(places[kept] - places[number]).T)
        if (sizes[kept] + settings.growth * away > sizes[number] / _SMALLER).all():
            kept.append(int(number))
    return [_field(gmsh, "MathEval", F=f"{float(sizes[number])!r} + {settings.growth!r}*"
                   f"Sqrt((x - ({float(places[number, 0])!r}))^2"
                   f" + (y - ({float(places[number, 1])!r}))^2)") for number in kept]


def _flat_mesh(gmsh: Any, groups: Groups, order: int) -> FlatMesh:
    """Convert gmsh's mesh: tagged, points numbered from zero, in metres."""
    from tympan.geometry.mesh import FlatMesh  # settings are read without finite elements

    tags, xyz, _ = gmsh.model.mesh.getNodes()
    number = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    nodes_of = {1: order + 1, 2: (order + 1) * (order + 2) // 2}
    triangles: list[Numbers] = []
    edges: dict[str, list[Numbers]] = {}
    members: dict[str, list[Numbers]] = {}
    count = 0
    for name, entities in groups.items():
        for dim, tag in entities:
            _, _, nodes = gmsh.model.mesh.getElements(dim, tag)
            cells = number[nodes[0].astype(np.int64)].reshape(-1, nodes_of[dim])
            if dim == 1:
                edges.setdefault(name, []).append(cells)
                continue
            members.setdefault(name, []).append(count + np.arange(len(cells)))
            triangles.append(cells)
            count += len(cells)
    return FlatMesh(xyz.reshape(-1, 3)[:, :2] / METRE, np.concatenate(triangles), order,
                    {name: np.concatenate(parts) for name, parts in edges.items()},
                    {name: np.concatenate(parts) for name, parts in members.items()})
