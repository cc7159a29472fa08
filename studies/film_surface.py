"""A film cut into flat triangles, with values at its points, for pictures and VTU files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from html import escape
from pathlib import Path

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.discretisation.isoparametric import tabulated
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Unfolding, cell_fields, whole
from tympan.studies.files import remove, write_atomically, write_text

#: Fields of a VTU, in SI; ParaView shows the names. ``tension`` is 0 taut, 1 wrinkled, 2 slack;
#: ``breakdown_share`` is field over strength, 0 where the strength is unknown.
STORED = (
    "displacement", "stretch_1", "stretch_2", "thickness", "electric_field", "maxwell_stress",
    "stress_1", "stress_2", "stress_radial", "stress_circumferential", "stress_shear", "tension",
    "breakdown_share")


#: Units of the fields that have one.
FIELD_UNITS = {
    "displacement": "m", "thickness": "m", "electric_field": "V/m", **dict.fromkeys(
        (name for name in STORED if "stress" in name), "Pa")}

#: Field of a film whose electrode is in segments: the number of the segment, from 0 in the order of
#: its file, -1 in bare film.
SEGMENT = "segment"
#: Distance of points of neighbouring elements that are one place, over the frame's half extent. No
#: multiple of a round length.
_SAME_PLACE = 0.9137e-6

#: Factors of x, y and z between program and VTU. A VTU has z upwards, so that a picture of it is
#: the right way up; in the program z is along the load.
_TURNED_OVER = np.array([1.0, 1.0, -1.0])
#: Field that only a VTU has [m], positive along the load. A file without it is from an older
#: version, which wrote z along the load.
_DEFLECTION = "deflection"

#: Warning of a result whose surface was asked for.
NO_SURFACE = "the film is a formula: it has no surface, and no fields on it to show"

#: Number of triangles tried for a place: those with the nearest middles.
_NEAREST = 12
#: Distance outside a triangle, relative to it, of a place that is at the film's curved edge.
_AT_EDGE = 0.1


@dataclass(frozen=True, eq=False)
class FilmSurface:
    """The deformed film: ``points`` [m], shape (n, 3), ``triangles``, shape (m, 3), values by name.

    Values have shape (n,) or (n, 3), in SI; z is along the load. Elements share no points, so jumps
    between them stay visible.
    """

    points: Array
    triangles: Numbers
    values: Mapping[str, Array]

    @property
    def mounted(self) -> Array:
        """Places of the points in the flat film [m], shape (n, 3)."""
        return self.points - self.values["displacement"]

    def at(self, places: Array) -> dict[str, Array]:
        """Interpolate all fields at places of the flat film [m], (n, 2); nan where no film is.

        The interpolation is linear within the triangles.
        """
        from scipy.spatial import cKDTree  # slow to load, and `solve` needs no places

        known = np.asarray(np.isfinite(places).all(axis=1))
        places = np.where(known[:, None], places, 0.0)
        corners = self.mounted[self.triangles][:, :, :2]
        count = min(_NEAREST, len(corners))
        near = cKDTree(corners.mean(axis=1)).query(places, count)[1].reshape(len(places), count)
        first, others = corners[near][:, :, 0], corners[near][:, :, 1:]
        edges = (others - first[:, :, None]).swapaxes(-1, -2)
        away = places[:, None] - first
        along = np.linalg.solve(edges, away[..., None])[..., 0]
        shares = np.concatenate([1 - along.sum(-1, keepdims=True), along], axis=-1)
        best = shares.min(axis=-1).argmax(axis=1)
        rows = np.arange(len(places))
        shares, points = shares[rows, best], self.triangles[near[rows, best]]
        shares[~known | (shares.min(axis=1) < -_AT_EDGE)] = np.nan
        return {name: np.einsum("nc,nc...->n...", shares, values[points])
                for name, values in self.values.items()}

    @property
    def flat(self) -> FilmSurface:
        """The mounted film before it moves, with the same values."""
        still = {"displacement": np.zeros_like(self.points)}
        return FilmSurface(self.mounted, self.triangles, {**self.values, **still})

    @property
    def segments(self) -> int:
        """Number of the electrode's segments, 0 of an electrode in one piece."""
        return int(self.values[SEGMENT].max()) + 1 if SEGMENT in self.values else 0

    def segment_sides(self, number: int) -> Numbers:
        """Find the sides of triangles around a segment: points at both ends and opposite, (n, 3).

        A film without segments has none.
        """
        if SEGMENT not in self.values:
            return np.zeros((0, 3), dtype=np.int64)
        within = self.triangles[self.values[SEGMENT][self.triangles[:, 0]] == number]
        sides = within[:, [[0, 1, 2], [1, 2, 0], [2, 0, 1]]].reshape(-1, 3)
        ends = np.sort(self._joined[sides[:, :2]], axis=1)
        # A pair as one number: comparing rows is far slower.
        _, first, count = np.unique(ends @ [len(self.points), 1], return_index=True,
                                    return_counts=True)
        return np.asarray(sides[first[count == 1]])

    def segment_edges(self, number: int, inset: float = 0.0) -> Array:
        """Find the lines around a segment of the electrode on the deformed film, (lines, 2, 3) [m].

        They are moved ``inset`` into the segment, so that those of neighbours do not coincide.
        """
        sides = self.segment_sides(number)
        ends, lines = self._joined[sides[:, :2]], self.points[sides[:, :2]]
        inwards = self.points[sides[:, 2]] - lines.mean(axis=1)
        towards = np.zeros((len(self.points), 3))
        for end in range(2):
            np.add.at(towards, ends[:, end], inwards)
        length = np.linalg.norm(towards, axis=1, keepdims=True)
        unit = towards / np.where(length > 0, length, 1.0)
        return np.asarray(lines + inset * unit[ends])

    @cached_property
    def _joined(self) -> Numbers:
        """Number of the place of each point: elements that meet there have the same, (n,)."""
        mounted = self.mounted[:, :2]
        places = np.round(mounted / (_SAME_PLACE * np.abs(mounted).max()))
        return np.asarray(np.unique(places @ [1, 1j], return_inverse=True)[1].reshape(-1))

    @property
    def turned_over(self) -> FilmSurface:
        """The film with z reversed."""
        def turned(values: Array) -> Array:
            return values * _TURNED_OVER + 0.0 if values.ndim == 2 else values  # no -0.0

        return FilmSurface(turned(self.points), self.triangles,
                           {name: turned(values) for name, values in self.values.items()})

    def save(self, file: Path) -> None:
        """Write a VTU file: z upwards, and ``deflection``, positive downwards, among the fields."""
        import meshio

        film, deflection = self.turned_over, self.values["displacement"][:, 2]
        mesh = meshio.Mesh(film.points, [("triangle", film.triangles)],
                           point_data={_DEFLECTION: deflection, **film.values})
        write_atomically(file, partial(meshio.write, mesh=mesh, file_format="vtu"))

    @classmethod
    def load(cls, file: Path) -> FilmSurface:
        """Read a file that :meth:`save` wrote, in this version or an older one."""
        from meshio import vtu

        if not file.is_file():
            raise InputError("is missing: run the command that wrote the folder again", file=file)
        try:
            # The reader is called directly: meshio.read ends the process on an unreadable file.
            mesh = vtu.read(file)
            points = np.asarray(mesh.points, float)
            triangles = np.asarray(mesh.cells_dict["triangle"])
            values = {name: np.asarray(value, float) for name, value in mesh.point_data.items()}
            if "displacement" not in values:
                raise ValueError("no displacement")
            if any(len(value) != len(points) for value in values.values()):
                raise ValueError("arrays do not belong together")
            if not len(triangles) or triangles.max() >= len(points):
                raise ValueError("triangles without points")
        except Exception:  # the reader raises any errors of XML, base64, zlib and NumPy
            raise InputError("is not a film as this version writes it: run the command that wrote "
                             "the folder again", file=file) from None
        if not all(np.isfinite(value).all() for value in (points, *values.values())):
            raise InputError("holds values that are not finite", file=file)
        upwards = values.pop(_DEFLECTION, None) is not None
        film = cls(points, triangles, values)
        return film.turned_over if upwards else film


def save_series(folder: Path, name: str, films: Sequence[tuple[float, FilmSurface]]) -> None:
    """Write films, each with a time, as NAME-0000.vtu and so on, and NAME.pvd that lists them.

    ParaView and PyVista open the list as a series. Films of an earlier run are removed; without
    films nothing is written.
    """
    remove(folder, f"{name}.pvd", *(file.name for file in series_files(folder, name)))
    for number, (_, film) in enumerate(films):
        film.save(folder / f"{name}-{number:04d}.vtu")
    entries = [f'    <DataSet timestep="{moment:.10g}" file="{escape(name)}-{number:04d}.vtu"/>'
               for number, (moment, _) in enumerate(films)]
    if entries:
        write_text(folder / f"{name}.pvd", "\n".join([
            '<?xml version="1.0"?>', '<VTKFile type="Collection" version="0.1">',
            "  <Collection>", *entries, "  </Collection>", "</VTKFile>", ""]))


def series_files(folder: Path, name: str) -> list[Path]:
    """List the files of a series, in order."""
    numbered = re.compile(rf"{re.escape(name)}-\d{{4,}}\.vtu")
    return sorted(file for file in folder.glob("*.vtu") if numbered.fullmatch(file.name))


def film_surface(model: Model, state: State, parts: int = 6, unfolding: Unfolding | None = None,
                 **nodal: Array) -> FilmSurface | None:
    """Cut the whole film into triangles, ``parts``² an element, with all fields of :data:`STORED`.

    None for a film in closed form, which has no surface. ``unfolding`` is that of the model's mesh,
    if it is known. Further ``nodal`` vectors of the whole film, shape (nodes, 3), are interpolated.
    """
    if not model.meshed:
        return None
    model, state = whole(model, state, unfolding)
    points, triangles = cut_triangles(model, parts)
    [fields] = cell_fields(model, [state], points)
    values = {name: np.ascontiguousarray(getattr(fields, name)) for name in STORED}
    values |= {name: interpolated(model, vector, points) for name, vector in nodal.items()}
    if model.specimen.electrode.segments:
        mesh = model.discretisation
        number = np.where(mesh.covered[:, 0] > 0, mesh.segments, -1)
        values[SEGMENT] = np.repeat(number, points.shape[1]).astype(float)
    return FilmSurface(fields.position + fields.displacement, triangles, values)


def cut_triangles(model: Model, parts: int) -> tuple[Array, Numbers]:
    """Compute reference points of a cut element, (2, k), and all triangles, element-major."""
    points, triangles = lattice(parts)
    offsets = len(points.T) * np.arange(model.discretisation.mesh.nelements)[:, None, None]
    return points, (offsets + triangles).reshape(-1, 3)


def interpolated(model: Model, nodal: Array, points: Array) -> Array:
    """Interpolate a nodal field, (nodes, 3), at points, (2, k), to (elements · k, 3)."""
    shapes = tabulated(model.discretisation.mesh.order, points)[0]
    return np.asarray(np.matmul(shapes.T, nodal[model.discretisation.connectivity]).reshape(-1, 3))


def lattice(parts: int) -> tuple[Array, Numbers]:
    """Cut a triangle into ``parts``² equal ones: reference points, (2, n), triangles, (parts², 3).

    Examples
    --------
    >>> points, triangles = lattice(2)
    >>> points.shape, triangles.shape
    ((2, 6), (4, 3))
    """
    places = [(i, j) for j in range(parts + 1) for i in range(parts + 1 - j)]
    number = {place: index for index, place in enumerate(places)}
    up, down = [], []
    for i, j in places:
        if i + j < parts:
            up.append((number[i, j], number[i + 1, j], number[i, j + 1]))
        if i + j < parts - 1:
            down.append((number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]))
    return np.array(places).T / parts, np.array(up + down)
