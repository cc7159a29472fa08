"""Pictures in space of the documentation, of films that are solved for them.

    python -m benchmarks.doc_pictures [-o docs]

The hero, a film that turns while its voltage rises and falls, a picture for each tutorial, and the
explorer as Chromium shows it. Deflections are true to scale. Colours are the larger principal true
stress unless said otherwise.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from PIL import Image

import tympan
from benchmarks.explore.__main__ import OVAL
from benchmarks.explore.browser import browsing, chromium, exploring
from tympan.base.arrays import Array
from tympan.reports import look
from tympan.reports.scales import round_scale
from tympan.reports.scene import View, downsampled, film_rims, placed_surface
from tympan.studies.files import write_atomically
from tympan.studies.film_surface import FilmSurface

#: Width and height of the hero [pixels]: as wide as a page shows it.
HERO = (640, 396)
#: Pictures of one turn.
FRAMES = 60
#: How long one turn takes [s]: slow enough to read the voltage.
TURN = 7.5
#: Size of its words [points], on a page half as large.
WORDS = 15
#: Quality of the hero's frames, of 100: no blocks to be seen, and far below 1 MB.
QUALITY = 68
#: Highest voltage of the hero [V], below its loss of tension at 5.77 kV.
HIGHEST = 5000.0

#: Width and height of a thumbnail [pixels], twice those on the page.
THUMBNAIL = (800, 560)
#: Width and height of the picture of the explorer [pixels].
EXPLORER = (1440, 900)
#: How long the explorer's curve and limits take at most [ms].
SETTLED = 20_000
#: Samples across a pixel.
SAMPLES = 2
#: Height of the camera above the frame's plane [degrees].
ELEVATION = 30.0

#: Room around what is shown, over its size.
MARGIN = 0.06
#: Height of the place that the hero turns about [mm]: half way down its film.
MIDDLE = -6.0
#: Distance of the lines of the net on a film [mm].
NET = 5.0

#: Radius of the rod that stands for the frame [mm].
ROD = 2.0
#: Thickness of a plate [mm].
THICK = 2.5
#: Colour of frames and of words.
FRAME = "#2b3440"
#: Colour of plates.
PLATE = "#c3c8cf"
#: Colour of what pulls.
PULL = look.PALETTE[1]
#: Colour of a film that is expected.
GHOST = look.PALETTE[0]


@dataclass(frozen=True)
class Scene:
    """Films, frames and plates in one picture, all in millimetres with z upwards."""

    plotter: pv.Plotter

    def film(self, film: FilmSurface, at: tuple[float, float] = (0.0, 0.0), *,
             colour: str | None = None, limits: tuple[float, float] | None = None,
             values: Array | None = None, opacity: float = 1.0, half: bool = False) -> None:
        """A film with its frame and its plate about a place [mm].

        ``half``: without the film and frame in front of the middle.
        """
        values = 1e-3 * film.values["stress_1"] if values is None else values
        scale = round_scale(float(values.min()), float(values.max()))
        whole = placed_surface(film, values, View(1.0, 1.0, scale, 10.0), False)
        frame, *rims = film_rims(whole)
        self._add(self._cut(pv.lines_from_points(frame), half).tube(radius=ROD), at, FRAME, opacity)
        for rim in rims:
            corners = rim[:-1] if np.allclose(rim[0], rim[-1]) else rim
            face = pv.PolyData(corners, np.array([len(corners), *range(len(corners))]))
            plate = face.triangulate().extrude((0, 0, THICK), capping=True)
            self._add(plate, at, PLATE, opacity)
        surface = self._cut(whole, half).translate((*at, 0))
        if colour is None:
            self.plotter.add_mesh(surface, scalars="value", cmap=look.COLOURS, clim=limits or (
                float(values.min()), float(values.max())), smooth_shading=True, opacity=opacity,
                show_scalar_bar=False, ambient=0.35, diffuse=0.75)
            for name in ("across", "back"):
                low, high = surface.get_data_range(name)
                net = surface.contour(np.arange(np.ceil(low / NET), high / NET) * NET, scalars=name)
                self.plotter.add_mesh(net.translate((0, 0, 0.15)), color="white", opacity=0.3,
                                      line_width=SAMPLES, lighting=False)
        else:
            self._add(surface, (0, 0), colour, opacity)

    @staticmethod
    def _cut(mesh: pv.PolyData, half: bool) -> pv.PolyData:
        return mesh.clip("-y", origin=(0, 0, 0)) if half else mesh

    def _add(self, mesh: pv.DataSet, at: tuple[float, float], colour: str,
             opacity: float = 1.0) -> None:
        self.plotter.add_mesh(mesh.translate((*at, 0)), color=colour, smooth_shading=True,
                              split_sharp_edges=True, opacity=opacity, specular=0.15)

    def rod(self, points: Array, radius: float, colour: str) -> None:
        """A rod along a line of points [mm], shape (n, 3)."""
        self._add(pv.lines_from_points(points).tube(radius=radius), (0, 0), colour)

    def block(self, centre: tuple[float, float, float], size: tuple[float, float, float],
              colour: str) -> None:
        """A box [mm]."""
        x, y, z = size
        self._add(pv.Cube(center=centre, x_length=x, y_length=y, z_length=z), (0, 0), colour)

    def weight(self, radius: float, top: float, height: float, colour: str = PULL) -> None:
        """A weight below the middle [mm]."""
        self._add(pv.Cylinder((0, 0, top - height / 2), (0, 0, 1), radius, height), (0, 0), colour)

    def look(self, azimuth: float = 20.0, elevation: float = ELEVATION,
             half: float | None = None) -> None:
        """Look from a direction [degrees] at all there is, as large as it may be.

        ``half`` [mm]: at the middle of a film instead, with this half height of the picture.
        """
        tilt, turn = np.radians([elevation, azimuth])
        towards = np.array([np.cos(tilt) * np.sin(turn), -np.cos(tilt) * np.cos(turn),
                            np.sin(tilt)])
        across = np.array([np.cos(turn), np.sin(turn), 0.0])
        up = np.cross(towards, across)
        width, height = self.plotter.window_size
        if half is None:
            points = np.concatenate([np.asarray(actor.mapper.dataset.points)
                                     for actor in self.plotter.actors.values()])
            seen = points @ np.column_stack([across, up])
            low, high = seen.min(0), seen.max(0)
            wide, tall = high - low
            half = (1 + MARGIN) / 2 * float(max(tall, wide * height / width))
            focus = np.array([across, up]).T @ (low + high) / 2
        else:
            focus = np.array([0.0, 0.0, MIDDLE])
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.position = tuple(focus), tuple(focus + 1000 * towards)
        camera.up, camera.parallel_scale = (0, 0, 1), half
        self.plotter.reset_camera_clipping_range()

    def pixels(self) -> NDArray[np.uint8]:
        """The picture, shape (height, width, 3)."""
        return downsampled(self.plotter.screenshot(return_img=True)[..., :3], SAMPLES)


@contextmanager
def drawn(size: tuple[int, int]) -> Iterator[Scene]:
    """An empty scene on white of a size in pixels."""
    with closing(pv.Plotter(off_screen=True, window_size=[SAMPLES * side for side in size],
                            theme=pv.themes.DocumentTheme())) as plotter:
        plotter.set_background("white")
        yield Scene(plotter)


def acrylic(prestretch: float = 2.236) -> tympan.Film:
    """A film of the tutorials: VHB 4910, 1 mm thick before it is stretched."""
    return tympan.Film("1 mm", prestretch, tympan.material("vhb-4910"))


def disc(radius: str = "4.5 cm", plate: str = "1 cm", film: tympan.Film | None = None
         ) -> tympan.Specimen:
    """A circular actuator."""
    return tympan.Specimen("disc", tympan.Circle(radius), tympan.Plate(tympan.Circle(plate)),
                           acrylic() if film is None else film)


def oval() -> tympan.Specimen:
    """The first tutorial's actuator, with its plate further from the middle."""
    plate = tympan.Plate(tympan.Circle("1 cm"), offset=("8 mm", "0 mm"))
    return tympan.Specimen("oval", tympan.Ellipse(("6 cm", "4 cm")), plate, acrylic())


def solved(specimen: tympan.Specimen, mass: float, voltage: float = 0.0) -> FilmSurface:
    """The film in equilibrium under a mass [kg] and a voltage [V]."""
    result = tympan.solve(specimen, mass=mass, voltage=voltage)
    assert result.status == "equilibrium", (specimen.name, mass, voltage)
    return result.film


def hero(file: Path) -> None:
    """A film that turns while its voltage rises and falls, as an animated WebP."""
    specimen = oval()
    phases = 2 * np.pi * np.arange(FRAMES) / FRAMES
    voltages = np.round(HIGHEST * (1 - np.cos(phases)) / 2, 3)
    results = {voltage: tympan.solve(specimen, mass="100 g", voltage=float(voltage))
               for voltage in np.unique(voltages)}
    stresses = np.concatenate([1e-3 * result.film.values["stress_1"]
                               for result in results.values()])
    limits = float(stresses.min()), float(stresses.max())
    frames = []
    for phase, voltage in zip(phases, voltages, strict=True):
        with drawn(HERO) as scene:
            scene.film(results[voltage].film, limits=limits)
            scene.look(float(np.degrees(phase)), half=41.0)
            words = f"{voltage / 1e3:.1f} kV   {1e3 * results[voltage].deflection_m:.1f} mm"
            scene.plotter.add_text(words, position=(0.04, 0.05), viewport=True, color=FRAME,
                                   font_size=WORDS, font="arial")
            frames.append(Image.fromarray(scene.pixels()))
    write_atomically(file, partial(
        frames[0].save, format="WEBP", save_all=True, append_images=frames[1:], loop=0,
        duration=round(1e3 * TURN / FRAMES), quality=QUALITY, method=6))


def first_actuator(scene: Scene) -> None:
    """The oval film under a weight and a voltage."""
    film = solved(oval(), 0.1, 3500.0)
    scene.film(film)
    scene.look(25)


def shape_from_drawing(scene: Scene) -> None:
    """An egg with a plate that tilts, of the second tutorial."""
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    long = np.where(np.cos(angle) > 0, 45.0, 30.0)
    shell = np.column_stack([long * np.cos(angle), 28 * np.sin(angle)]) * 1e-3
    plate = tympan.Plate(tympan.RoundedRectangle(("9 mm", "6 mm"), "3 mm"),
                         offset=("-4 mm", "0 mm"))
    egg = tympan.Specimen("egg", tympan.ClosedSpline(tuple(map(tuple, shell.tolist()))), plate,
                          acrylic(3.0))
    film = solved(egg, 0.04, 2500.0)
    scene.film(film)
    scene.look(-35, 26)


def sweep(scene: Scene) -> None:
    """Frames of one area and several ratios, with plates of three sizes, in one scale."""
    films = {}
    for column, (a, b) in enumerate(((40, 40), (50, 32), (64, 25))):
        for row, radius in enumerate((6, 10, 14)):
            plate = tympan.Plate(tympan.Circle(f"{radius} mm"))
            specimen = tympan.Specimen("oval", tympan.Ellipse((f"{a} mm", f"{b} mm")), plate,
                                       acrylic(3.0))
            films[(0, 100, 222)[column], -95 * row] = solved(specimen, 0.06, 3000.0)
    depths = np.concatenate([1e3 * film.values["displacement"][:, 2] for film in films.values()])
    for place, film in films.items():
        scene.film(film, place, values=1e3 * film.values["displacement"][:, 2],
                   limits=(0.0, float(depths.max())))
    scene.look(12, 40)


def alpha(scene: Scene) -> None:
    """A stadium between the two circles that stand for it."""
    stadium = tympan.Specimen("stadium", tympan.Stadium(("6 cm", "3 cm")),
                              tympan.Plate(tympan.Circle("1 cm")), acrylic())
    films = {(0.0, 0.0): stadium, (-115.0, 0.0): disc("3 cm"), (145.0, 0.0): disc("6 cm")}
    for place, specimen in films.items():
        scene.film(solved(specimen, 0.1), place)
    scene.look(0, 36)


def diagnosed(scene: Scene) -> None:
    """The film that is expected, cut open, above the one that a hidden weight pulls down."""
    expected, read = solved(disc(), 0.06), solved(disc(), 0.12)
    scene.film(read, half=True)
    scene.film(expected, colour=GHOST, opacity=0.3, half=True)
    depth = 1e3 * float(read.values["displacement"][:, 2].max())
    scene.weight(9.0, -depth, 9.0, "#7d8794")
    scene.weight(9.0, -depth - 9.0, 9.0)
    scene.look(15, 12)


def lumped(scene: Scene) -> None:
    """A film and what stands for it: a spring, a damper beside it, and a mass."""
    scene.film(solved(disc(), 0.1), (0.0, 0.0))
    x = 95.0
    turns = np.linspace(0, 2 * np.pi * 6, 400)
    spring = np.column_stack([x - 12 + 6 * np.cos(turns), 6 * np.sin(turns),
                              20 - 40 * turns / turns[-1]])
    scene.rod(spring, 1.1, look.PALETTE[0])
    scene.rod(np.array([[x + 12, 0, 20], [x + 12, 0, 2]]), 1.2, FRAME)
    scene.rod(np.array([[x + 12, 0, 3], [x + 12, 0, -12]]), 5.0, look.PALETTE[2])
    scene.rod(np.array([[x + 12, 0, -11], [x + 12, 0, -20]]), 1.2, FRAME)
    scene.block((x, 0, 22), (50, 16, 4), FRAME)
    scene.block((x, 0, -26), (46, 16, 12), PULL)
    scene.look(15, 24)


def hysteresis(scene: Scene) -> None:
    """Halves of one film as its voltage rises and falls again, one behind the other in time."""
    film = tympan.Film("1 mm", 5**0.5, tympan.NeoHooke("20 kPa"), relative_permittivity=4.7,
                       branches=(tympan.ViscousBranch("1 MPa", "30 s"),))
    times = (0.0, 30.0, 60.0, 90.0, 119.0)
    result = tympan.transient(disc(film=film), signal="ramp", mass="60 g", high="6 kV",
                              duration=120.0, interval=0.5, at=times)
    films = list(result.films[0].values())
    depths = [1e3 * film.values["displacement"][:, 2] for film in films]
    limits = 0.0, float(max(depth.max() for depth in depths))
    for number, (surface, depth) in enumerate(zip(films, depths, strict=True)):
        scene.film(surface, (0.0, 62.0 * number), values=depth, limits=limits, half=True)
    scene.look(50, 26)


def force(scene: Scene) -> None:
    """A film, and below it three bowed beams that push its plate."""
    film = solved(disc("4.5 cm", "8 mm"), 0.1)
    scene.film(film, half=True)
    depth = 1e3 * float(film.values["displacement"][:, 2].max())
    along = np.linspace(0, 1, 80)
    for number in range(3):
        turn = np.pi * number / 3 + 0.3
        bow = 7 * (1 - np.cos(2 * np.pi * along)) / 2
        beam = np.column_stack([60 * (along - 0.5) * np.cos(turn),
                                60 * (along - 0.5) * np.sin(turn), bow - depth - 11])
        scene.rod(beam, 1.1, PULL)
        for end in (beam[0], beam[-1]):
            scene.block((end[0], end[1], end[2] - 3), (7, 7, 6), FRAME)
    scene.rod(np.array([[0, 0, -depth], [0, 0, -depth - 4]]), 2.0, FRAME)
    scene.look(15, 14)


def four_quarters(scene: Scene) -> None:
    """A film with one of four quarters driven: the plate leans towards it."""
    segments = tuple(tympan.Segment(name=name, sector=(f"{start} deg", f"{start + 90} deg"))
                     for name, start in zip("ABCD", (-75, 15, 105, 195), strict=True))
    film = tympan.Film("1 mm", 5**0.5, tympan.NeoHooke("20 kPa"), relative_permittivity=4.7)
    driven = tympan.Specimen("quarters", tympan.Circle("4.5 cm"),
                             tympan.Plate(tympan.Circle("1 cm")), film,
                             tympan.Electrode(segments=segments, gap="1.5 mm"))
    solved_film = tympan.solve(driven, mass="60 g", voltage="A = 5.2 kV").film
    scene.film(solved_film, values=1e-6 * solved_film.values["electric_field"])
    scene.look(25, 34)


#: What shows each tutorial, by the number in the name of its script.
TUTORIALS = (first_actuator, shape_from_drawing, sweep, alpha, diagnosed, lumped, hysteresis,
             force, four_quarters)


def thumbnails(folder: Path) -> None:
    """A picture for each tutorial, named by its number."""
    folder.mkdir(exist_ok=True)
    for number, show in enumerate(TUTORIALS, start=1):
        with drawn(THUMBNAIL) as scene:
            show(scene)
            picture = Image.fromarray(scene.pixels()).quantize(128, dither=Image.Dither.NONE)
        write_atomically(folder / f"plot_{number}.png", partial(picture.save, format="PNG",
                                                               optimize=True))


def explorer(file: Path) -> None:
    """The live page with the film of a benchmark at 5.5 kV."""
    executable = chromium()
    if executable is None:
        raise SystemExit("Chromium is not installed: the explorer is not drawn")
    with TemporaryDirectory() as folder:
        Path(folder, "oval.toml").write_text(OVAL, encoding="utf-8")
        with (exploring(Path(folder), "oval.toml", "--mass", "17.9 g", "--voltage", "5.5 kV") as
              server, browsing(executable) as browser):
            page = browser.new_page(viewport={"width": EXPLORER[0], "height": EXPLORER[1]})
            page.goto(server.address)
            page.wait_for_load_state("networkidle")
            page.wait_for_timeout(SETTLED)
            write_atomically(file, partial(_screenshot, page))


def _screenshot(page: Any, file: Path) -> None:
    file.write_bytes(page.screenshot(type="png"))


#: What is drawn, by name, in the order of its cost.
PICTURES = {"explore": lambda folder: explorer(folder / "explore.png"),
            "thumbnails": lambda folder: thumbnails(folder / "thumbnails"),
            "hero": lambda folder: hero(folder / "hero.webp")}


def main() -> None:
    """Write the pictures, all or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*PICTURES, []])
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    arguments = parser.parse_args()
    for name in arguments.names or PICTURES:
        PICTURES[name](arguments.output)


if __name__ == "__main__":
    main()
