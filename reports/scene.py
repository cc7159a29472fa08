"""Pictures of deformed films: pyvista, off screen, in parallel projection, all to one scale."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import product
from math import ceil, cos, floor, radians, sin, sqrt

import numpy as np
import pyvista as pv
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  makes vtkRenderWindow() one of OpenGL
from numpy.typing import NDArray
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkRenderingCore import vtkRenderWindow

from tympan.base.arrays import Array
from tympan.base.system import MissingLibrary
from tympan.reports import look
from tympan.reports.look import Picture
from tympan.reports.scales import AxisScale
from tympan.studies.film_surface import FilmSurface

_MOUNTED = ("across", "back")
_LOOSE = ("wrinkled", "slack")

#: Margin about a film in its picture, over its larger side: no line of its edge is cut.
_ROOM = 0.01


#: Width of the line around a segment, over that of other lines.
_SEGMENT_LINE = 2.4


@dataclass(frozen=True)
class View:
    """View of all films of a figure.

    ``elevation`` is in degrees above the frame's plane, ``resolution`` in pixels per mm of film,
    ``line`` is the width of outlines [pixels]. ``colours`` and ``scale`` [kPa] are those of the
    film, ``net`` is the mesh width of the net on the flat film [mm], the rest colours of the axes.
    """

    resolution: float
    line: float
    scale: AxisScale
    net: float
    colours: str = look.COLOURS
    short: str = look.SHORT
    long: str = look.LONG
    elevation: float = 66.0
    ink: str = "white"  #: colour of the net
    samples: int = 1  #: samples across a pixel, which is their average

    @property
    def towards(self) -> Array:
        """Unit vector from the film to the eye."""
        tilt = radians(self.elevation)
        return np.array([0.0, -cos(tilt), sin(tilt)])

    @property
    def up(self) -> Array:
        """Unit vector that points upwards in the picture."""
        tilt = radians(self.elevation)
        return np.array([0.0, sin(tilt), cos(tilt)])

    def place(self, points: Array, turned: bool) -> Array:
        """Turn points [mm] so that their long axis is across the picture and the load downwards."""
        x, y, z = points.T
        across, back = (y, -x) if turned else (x, y)
        return np.column_stack([across, back, -z])

    def project(self, placed: Array) -> Array:
        """Project onto the picture: across and up [mm], shape (n, 2)."""
        _, back, depth = self.up
        x, y, z = placed.T
        return np.column_stack([x, y * back + z * depth])


def film_picture(film: FilmSurface, values: Array, view: View, turned: bool) -> Picture:
    """Draw the deformed film in colours of ``values`` at its points, the plate, and lines.

    ``values`` are on the view's scale, shape (points,); ``turned`` puts y across the picture. A
    :class:`~tympan.base.system.MissingLibrary` says that there is no OpenGL to draw with. The
    frame's centre is 0 in the picture's plane. Segments of the electrode are
    framed in their colours.
    """
    surface = placed_surface(film, values, view, turned)
    extent, size = picture_frame(view.project(np.asarray(surface.points)), view.resolution)
    fine = view.samples
    view = replace(view, resolution=fine * view.resolution, line=fine * view.line)
    with _plotter((fine * size[0], fine * size[1])) as plotter:
        plotter.add_mesh(surface, scalars="value", cmap=view.colours,
                         clim=(view.scale.low, view.scale.high),
                         lighting=False, show_scalar_bar=False, n_colors=1024)
        _add_hatches(plotter, surface, view)
        _add_lines(plotter, surface, view)
        for number, colour in enumerate(look.segment_colours(film.segments)):
            inset = 0.5e-3 * _SEGMENT_LINE * view.line / view.resolution
            lines = 1e3 * film.segment_edges(number, inset)
            if len(lines):
                around = pv.line_segments_from_points(view.place(lines.reshape(-1, 3), turned))
                _add_line(plotter, around, "white", (_SEGMENT_LINE + 0.8) * view.line,
                          2 * view.towards)
                _add_line(plotter, around, colour, _SEGMENT_LINE * view.line, 3 * view.towards)
        for rim in film_rims(surface)[1:]:
            corners = rim[:-1] if np.allclose(rim[0], rim[-1]) else rim
            face = pv.PolyData(corners, np.array([len(corners), *range(len(corners))]))
            plotter.add_mesh(face.triangulate(), color="#d5d7da", lighting=False)
        _aim(plotter, extent, view)
        pixels = plotter.screenshot(return_img=True)
    return downsampled(pixels[..., :3], fine), extent


def downsampled(pixels: NDArray[np.uint8], across: int) -> NDArray[np.uint8]:
    """Average blocks of ``across`` by ``across`` pixels, shape (rows, columns, 3)."""
    total = sum(pixels[row::across, column::across].astype(np.uint16)
                for row, column in product(range(across), repeat=2))
    return np.asarray((total + across**2 // 2) // across**2, np.uint8)


def placed_surface(film: FilmSurface, values: Array, view: View, turned: bool) -> pv.PolyData:
    """Place the film in the picture [mm], with elements joined where they meet."""
    points, mounted = 1e3 * film.points, 1e3 * film.mounted
    faces = np.column_stack([np.full(len(film.triangles), 3), film.triangles]).ravel()
    surface = pv.PolyData(points, faces)
    surface["value"] = values
    if "tension" in film.values:
        # Values are positive where the film has lost tension, 0 at the zone's edge: the state says
        # on which side of it a point lies, the stress how far from it.
        stresses = film.values["stress_2"], film.values["stress_1"]
        for state, (name, stress) in enumerate(zip(_LOOSE, stresses, strict=True), start=1):
            inside = np.where(film.values["tension"] >= state, 1, -1)
            surface[name] = inside * np.abs(stress / 1e3)
    for name, coordinate in zip(_MOUNTED, view.place(mounted, turned).T[:2], strict=True):
        surface[name] = coordinate
    # Points of shared edges are computed from both sides and differ only by rounding.
    joined = surface.clean(tolerance=1e-7 * float(np.ptp(points, axis=0).max()), absolute=True)
    joined.points = view.place(np.asarray(joined.points), turned)
    return joined


def film_rims(surface: pv.PolyData) -> list[Array]:
    """Find the film's closed boundaries as ordered points, (n, 3): the frame, then the plate."""
    edges = surface.extract_feature_edges(boundary_edges=True, feature_edges=False,
                                          manifold_edges=False, non_manifold_edges=False,
                                          clear_data=True)
    strips = edges.strip(join=True, max_length=100_000)
    loops = [np.asarray(strips.points)[cell.point_ids] for cell in strips.cell]
    lengths = [float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum()) for loop in loops]
    return [loops[number] for number in np.argsort(lengths)[::-1]]


def picture_frame(projected: Array, resolution: float
                  ) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    """Compute extent [mm] and pixels of a picture that holds points, shape (n, 2) [mm].

    Its pixels are whole, of exactly 1/resolution mm.
    """
    low, high = projected.min(0), projected.max(0)
    room = _ROOM * float((high - low).max())
    width, height = (ceil((span + 2 * room) * resolution) for span in high - low)
    x, y = (low + high) / 2
    across, up = np.array([width, height]) / resolution / 2
    return (x - across, x + across, y - up, y + up), (width, height)


def _add_lines(plotter: pv.Plotter, surface: pv.PolyData, view: View) -> None:
    """Draw a square net, the axes through the plate, and the edges of frame and plate."""
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
    """Hatch every zone without tension, crosswise where no direction has any."""
    spacing = 6 * view.line / view.resolution
    for name, sign in zip(_LOOSE, (1, -1), strict=True):
        if name not in surface.point_data or surface[name].max() <= 0:
            return
        zone = surface.clip_scalar(scalars=name, invert=False, value=0.0)
        zone["hatch"] = (zone["across"] + sign * zone["back"]) / sqrt(2)
        lines = zone.contour(_net(zone, "hatch", spacing), scalars="hatch")
        for line in (lines, surface.contour([0.0], scalars=name)):
            # Black on white is visible on any colour of the film.
            _add_line(plotter, line, "white", 1.1 * view.line, view.towards)
            _add_line(plotter, line, "black", 0.55 * view.line, 2 * view.towards)


def _net(surface: pv.PolyData, coordinate: str, spacing: float) -> list[float]:
    """List the multiples of the spacing within the range of a coordinate."""
    low, high = surface.get_data_range(coordinate)
    return [spacing * number for number in range(ceil(low / spacing), floor(high / spacing) + 1)]


def _add_line(plotter: pv.Plotter, line: pv.PolyData, colour: str, width: float, towards: Array,
              opacity: float = 1.0) -> None:
    """Draw a line slightly in front of the film it lies on, so that the film does not cover it."""
    if line.n_points:
        shifted = line.translate(0.001 * line.length * towards)
        plotter.add_mesh(shifted, color=colour, line_width=width, opacity=opacity, lighting=False)


def _aim(plotter: pv.Plotter, extent: tuple[float, float, float, float], view: View) -> None:
    west, east, bottom, top = extent
    far = 10 * max(east - west, top - bottom)
    centre = np.array([(west + east) / 2, 0, 0]) + (bottom + top) / 2 * view.up
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = tuple(centre)
    camera.position = tuple(centre + far * view.towards)
    camera.up = tuple(view.up)
    camera.parallel_scale = (top - bottom) / 2
    camera.clipping_range = (far / 10, 2 * far)


@contextmanager
def _plotter(size: tuple[int, int]) -> Iterator[pv.Plotter]:
    """Open an off-screen plotter on white, closed at the end."""
    # VTK reports every kind of window it tries before one works; only the last one matters.
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        _check_opengl()
        with closing(pv.Plotter(off_screen=True, window_size=list(size),
                                theme=pv.themes.DocumentTheme())) as plotter:
            plotter.set_background("white")
            plotter.enable_anti_aliasing("msaa", multi_samples=8)
            # The pass for surfaces visible through one another takes one sample a pixel, and time.
            # Here only lines are transparent.
            with suppress(AttributeError):  # before VTK 9.5
                plotter.renderer.SetUseOIT(False)
            yield plotter
    finally:
        vtkLogger.SetStderrVerbosity(verbosity)


def _check_opengl() -> None:
    """Refuse to draw without OpenGL: VTK would end the whole process."""
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.Initialize()
    initialized = window.GetInitialized()
    window.Finalize()
    if not initialized:
        raise MissingLibrary("cannot draw the membranes: VTK finds no OpenGL; install the Debian "
                             "packages libegl1, libgl1 and libgl1-mesa-dri (or your system's "
                             "counterparts)")
