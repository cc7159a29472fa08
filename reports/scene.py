"""Pictures of deformed films: pyvista, off screen.

In parallel projection, so that millimetres are the same in all.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import ceil, cos, floor, radians, sin, sqrt

import numpy as np
import pyvista as pv
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  makes vtkRenderWindow() one of OpenGL
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkRenderingCore import vtkRenderWindow

from tympan.geometry.system import MissingLibrary
from tympan.reports.scales import AxisScale
from tympan.studies.film_surface import FilmSurface

Array = NDArray[np.float64]

_MOUNTED = ("across", "back")
_LOOSE = ("wrinkled", "slack")


@dataclass(frozen=True)
class View:
    """How all films of a figure are looked at.

    ``elevation`` [degrees] above the frame's plane, ``resolution`` [pixels per mm of film],
    ``line`` width of the outlines [pixels], and the colours' name and scale [kPa].
    """

    resolution: float
    line: float
    colours: str
    scale: AxisScale
    net: float
    short: str
    long: str
    elevation: float = 66.0
    ink: str = "white"  #: of the net

    @property
    def towards(self) -> Array:
        """Unit vector from the film to the eye."""
        tilt = radians(self.elevation)
        return np.array([0.0, -cos(tilt), sin(tilt)])

    def place(self, points: Array, turned: bool) -> Array:
        """Points [mm] with their long axis across the picture and the load downwards."""
        x, y, z = points.T
        across, back = (y, -x) if turned else (x, y)
        return np.column_stack([across, back, -z])

    def project(self, placed: Array) -> Array:
        """Across and up in the picture [mm], shape (n, 2)."""
        tilt = radians(self.elevation)
        return np.column_stack([placed[:, 0], placed[:, 1] * sin(tilt) + placed[:, 2] * cos(tilt)])


@dataclass(frozen=True, eq=False)
class Picture:
    """Pixels, shape (rows, columns, 3), and the (left, right, bottom, top) they cover [mm].

    In the plane of the picture, the frame's centre 0.
    """

    pixels: NDArray[np.uint8]
    extent: tuple[float, float, float, float]


def film_picture(film: FilmSurface, values: Array, view: View, turned: bool) -> Picture:
    """The deformed film in colours of ``values`` at its points, the plate at its depth, and lines.

    Parameters
    ----------
    values
        On the view's scale, shape (points,).
    turned
        Whether y is across the picture.

    Raises
    ------
    MissingLibrary
        When there is no OpenGL to draw with.
    """
    surface = placed_surface(film, values, view, turned)
    extent, size = picture_frame(view.project(np.asarray(surface.points)), view.resolution)
    with _plotter(size) as plotter:
        plotter.add_mesh(surface, scalars="value", cmap=view.colours,
                         clim=(view.scale.low, view.scale.high),
                         lighting=False, show_scalar_bar=False, n_colors=1024)
        _add_hatches(plotter, surface, view)
        _add_lines(plotter, surface, view)
        for rim in film_rims(surface)[1:]:
            _add_plate(plotter, rim, view)
        _aim(plotter, extent, view)
        pixels = plotter.screenshot(return_img=True)
    return Picture(np.ascontiguousarray(pixels[..., :3]), extent)


def placed_surface(film: FilmSurface, values: Array, view: View, turned: bool) -> pv.PolyData:
    """The film as placed in the picture [mm], elements joined where they meet."""
    points, mounted = 1e3 * film.points, 1e3 * film.mounted
    faces = np.column_stack([np.full(len(film.triangles), 3), film.triangles]).ravel()
    surface = pv.PolyData(points, faces)
    surface["value"] = values
    for name, zone in _zones(film).items():
        surface[name] = zone
    for name, coordinate in zip(_MOUNTED, view.place(mounted, turned).T[:2], strict=True):
        surface[name] = coordinate
    # Shared edges are computed from both sides and differ by rounding only.
    joined = surface.clean(tolerance=1e-7 * float(np.ptp(points, axis=0).max()), absolute=True)
    joined.points = view.place(np.asarray(joined.points), turned)
    return joined


def _zones(film: FilmSurface) -> dict[str, Array]:
    """Where the film has lost tension: positive inside, 0 at a zone's edge; none without stress.

    The state says on which side of an edge a point lies, the stress how far from it.
    """
    if "tension" not in film.values:
        return {}
    stresses = film.values["stress_2"], film.values["stress_1"]
    return {name: np.where(film.values["tension"] >= state, 1, -1) * np.abs(stress / 1e3)
            for state, (name, stress) in enumerate(zip(_LOOSE, stresses, strict=True), start=1)}


def film_rims(surface: pv.PolyData) -> list[Array]:
    """Closed boundaries of the film as ordered points, shape (n, 3): the frame, then the plate."""
    edges = surface.extract_feature_edges(boundary_edges=True, feature_edges=False,
                                          manifold_edges=False, non_manifold_edges=False,
                                          clear_data=True)
    strips = edges.strip(join=True, max_length=100_000)
    loops = [np.asarray(strips.points)[cell.point_ids] for cell in strips.cell]
    return sorted(loops, key=_length, reverse=True)


def picture_frame(projected: Array, resolution: float, margin: float = 0.01,
                  ) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """Extent [mm] and pixels of a picture that holds points, shape (n, 2) [mm].

    Its pixels are whole, of exactly 1/resolution mm.
    """
    low, high = projected.min(0), projected.max(0)
    room = margin * float((high - low).max())
    width, height = (ceil((span + 2 * room) * resolution) for span in high - low)
    (x, y), half = (low + high) / 2, np.array([width, height]) / resolution / 2
    return (x - half[0], x + half[0], y - half[1], y + half[1]), (width, height)


def _add_lines(plotter: pv.Plotter, surface: pv.PolyData, view: View) -> None:
    """A square net on the film, the axes through the plate, the frame's and the plate's edge."""
    edges = film_rims(surface)
    centre = edges[-1].mean(0)
    for coordinate, colour in enumerate((view.short, view.long)):
        net = surface.contour(_net(surface, _MOUNTED[coordinate], view.net),
                              scalars=_MOUNTED[coordinate])
        _add_line(plotter, net, view.ink, 0.5 * view.line, view.towards, opacity=0.35)
        normal = "xy"[coordinate]
        _add_line(plotter, surface.slice(normal, origin=tuple(centre)), colour, 1.3 * view.line,
                  2 * view.towards)
    for loop in edges:
        _add_line(plotter, pv.lines_from_points(loop), "black", view.line, 3 * view.towards)


def _add_hatches(plotter: pv.Plotter, surface: pv.PolyData, view: View) -> None:
    """Every zone without tension, hatched; crosswise where there is none in any direction."""
    spacing = 6 * view.line / view.resolution
    for name, sign in zip(_LOOSE, (1, -1), strict=True):
        if name not in surface.point_data or surface[name].max() <= 0:
            return
        zone = surface.clip_scalar(scalars=name, invert=False, value=0.0)
        zone["hatch"] = (zone["across"] + sign * zone["back"]) / sqrt(2)
        lines = zone.contour(_net(zone, "hatch", spacing), scalars="hatch")
        for line in (lines, surface.contour([0.0], scalars=name)):
            # Black on white can be seen on any colour of the film.
            _add_line(plotter, line, "white", 1.1 * view.line, view.towards)
            _add_line(plotter, line, "black", 0.55 * view.line, 2 * view.towards)


def _net(surface: pv.PolyData, coordinate: str, spacing: float) -> list[float]:
    """Multiples of the spacing that a coordinate of the points takes."""
    low, high = surface.get_data_range(coordinate)
    return [spacing * number for number in range(ceil(low / spacing), floor(high / spacing) + 1)]


def _add_line(plotter: pv.Plotter, line: pv.PolyData, colour: str, width: float, towards: Array,
              opacity: float = 1.0) -> None:
    """A line slightly before the film it lies on, or the two would show through each other."""
    if line.n_points:
        shifted = line.translate(0.001 * line.length * towards)
        plotter.add_mesh(shifted, color=colour, line_width=width, opacity=opacity, lighting=False)


def _add_plate(plotter: pv.Plotter, rim: Array, view: View) -> None:
    """A flat grey face within the rim."""
    corners = rim[:-1] if np.allclose(rim[0], rim[-1]) else rim
    face = pv.PolyData(corners,
                       np.concatenate([[len(corners)], np.arange(len(corners))])).triangulate()
    plotter.add_mesh(face, color="#d5d7da", lighting=False)


def _aim(plotter: pv.Plotter, extent: tuple[float, float, float, float], view: View) -> None:
    west, east, bottom, top = extent
    tilt, far = radians(view.elevation), 10 * max(east - west, top - bottom)
    up = np.array([0.0, sin(tilt), cos(tilt)])
    centre = np.array([(west + east) / 2, 0, 0]) + (bottom + top) / 2 * up
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = tuple(centre)
    camera.position = tuple(centre + far * np.array([0.0, -cos(tilt), sin(tilt)]))
    camera.up = tuple(up)
    camera.parallel_scale = (top - bottom) / 2
    camera.clipping_range = (far / 10, 2 * far)


@contextmanager
def _plotter(size: tuple[int, int]) -> Iterator[pv.Plotter]:
    """An off-screen plotter on white, closed in the end."""
    with _quiet():
        _check_opengl()
        plotter = pv.Plotter(off_screen=True, window_size=list(size),
                             theme=pv.themes.DocumentTheme())
        try:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("msaa", multi_samples=8)
            yield plotter
        finally:
            plotter.close()


def _check_opengl() -> None:
    """VTK ends the whole process when it draws without OpenGL, so ask it first."""
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.Initialize()
    initialized = window.GetInitialized()
    window.Finalize()
    if not initialized:
        raise MissingLibrary("cannot draw the membranes: VTK finds no OpenGL; install the Debian "
                             "packages libegl1, libgl1 and libgl1-mesa-dri (or your system's "
                             "counterparts)")


@contextmanager
def _quiet() -> Iterator[None]:
    """VTK reports every kind of window it tries before one that works; only the last matters."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


def _length(loop: Array) -> float:
    return float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())
