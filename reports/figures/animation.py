"""A film in motion: pictures of the deformed film with its voltage and deflection in time.

Frames of any such film are written as a GIF and an MP4.
"""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from tympan.base.errors import InputError
from tympan.reports import look as style
from tympan.reports.scales import AxisScale, bar_length, round_scale
from tympan.reports.scene import View, film_picture
from tympan.studies.files import write_atomically
from tympan.studies.film_surface import FilmSurface
from tympan.studies.trace import Response

#: Width of the picture [mm].
_WIDTH = 120.0
#: Width of the film in it [mm].
_FILM = 112.0
#: Height below the film for the colour bar with its words [mm].
_BAR = 16.0
#: Height of the axis of the voltage [mm].
_VOLTAGE = 14.0
#: Height of the axis of the deflection [mm].
_RESPONSE = 26.0

#: Height above the film [mm].
_TOP = 4.0
#: Height below an axis for its numbers and words [mm].
_AXIS = 11.0
#: Height between two axes [mm].
_GAP = 4.0

#: Resolution of a picture [pixels per inch]: sharp on a screen, and a small file.
FRAME_DPI = 110
#: Duration of all pictures together [s].
_LENGTH = 5.0


def animate(response: Response, films: Mapping[float, FilmSurface], file: Path) -> None:
    """Write a GIF with a picture for each film, by time [s].

    An MP4 is written beside it where FFmpeg is installed.

    Raises
    ------
    InputError
        When FFmpeg fails.
    """
    times, surfaces = list(films), list(films.values())
    deflections = [1e3 * film.values["displacement"][:, 2] for film in surfaces]
    scale = round_scale(min(0.0, *(float(deflection.min()) for deflection in deflections)),
                        max(float(deflection.max()) for deflection in deflections))
    half = np.abs(surfaces[0].mounted[:, :2]).max(0)
    wide = 2e3 * float(half.max())
    view = View(1.5 * FRAME_DPI * style.MM * _FILM / wide, 1.0, scale,
                bar_length(wide) / 2, elevation=38.0)
    pictures = [film_picture(film, deflection, view, bool(half[1] > half[0]))
                for film, deflection in zip(surfaces, deflections, strict=True)]
    with style.figure_style():
        frames = [figure_pixels(_compose(picture, response, time, scale, common_extent(pictures)))
                  for time, picture in zip(times, pictures, strict=True)]
    write_frames(frames, file)


def write_frames(frames: Sequence[NDArray[np.uint8]], file: Path) -> None:
    """Write pictures, shape (height, width, 3) each, as a GIF, and as an MP4 if FFmpeg is there.

    An :class:`InputError` when FFmpeg fails.
    """
    write_atomically(file, partial(_save, frames))
    ffmpeg = shutil.which("ffmpeg")
    if ffmpeg is not None:
        write_atomically(file.with_suffix(".mp4"), partial(_encode, ffmpeg, np.array(frames)))


def _save(frames: Sequence[NDArray[np.uint8]], file: Path) -> None:
    # Rare colours must be kept, such as a curve's.
    first, *others = [Image.fromarray(frame).quantize(256, Image.Quantize.MAXCOVERAGE)
                      for frame in frames]
    first.save(file, format="GIF", save_all=True, append_images=others, loop=0,
               duration=max(20, round(1e3 * _LENGTH / len(frames))))


def _encode(ffmpeg: str, frames: NDArray[np.uint8], file: Path) -> None:
    """Encode pictures of shape (frames, height, width, 3) as MPEG-4."""
    # Colours at half the resolution, which all players can show, need even sizes.
    count, height, width = frames.shape[0], *(size // 2 * 2 for size in frames.shape[1:3])
    made = subprocess.run(
        [ffmpeg, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
         "-s", f"{width}x{height}", "-r", f"{count / _LENGTH:g}", "-i", "-", "-pix_fmt", "yuv420p",
         str(file)], input=frames[:, :height, :width].tobytes(), capture_output=True, check=False)
    if made.returncode:
        words = made.stderr.decode(errors="replace").strip().splitlines() or ["it does not say why"]
        raise InputError(f"ffmpeg makes no film of the pictures: {words[-1]}; mend it, or run "
                         "again without --animate", key="--animate")


def common_extent(pictures: Iterable[style.Picture]) -> tuple[float, float, float, float]:
    """Compute the extent that holds all pictures: west, east, bottom, top [mm]."""
    west, east, bottom, top = zip(*(extent for _, extent in pictures), strict=True)
    return min(west), max(east), min(bottom), max(top)


def _compose(picture: style.Picture, response: Response, time: float, scale: AxisScale,
             extent: tuple[float, float, float, float]) -> Figure:
    west, east, bottom, top = extent
    height = _FILM * (top - bottom) / (east - west)
    below = _TOP + height + _BAR
    figure = style.new_figure(below + _VOLTAGE + _GAP + _RESPONSE + _AXIS, _WIDTH)
    axes = style.place_axes(figure, (_WIDTH - _FILM) / 2, _TOP, _FILM, height)
    style.show_picture(axes, picture)
    axes.set(xlim=(west, east), ylim=(bottom, top))
    style.colour_bar(figure, (_WIDTH - 60) / 2, _TOP + height + 3, (60, 2.4), scale, style.COLOURS,
                     "deflection (mm)")
    _add_traces(figure, response, time, below)
    return figure


def _add_traces(figure: Figure, response: Response, time: float, top: float) -> None:
    """Draw voltage and displacement up to a time in colour, the rest in grey."""
    when, voltage, reading = response.samples[["t", "voltage", "displacement"]].to_numpy().T
    pair = style.place_pair(figure, style.LEFT, top, _WIDTH - style.LEFT - style.RIGHT,
                            (_VOLTAGE, _GAP, _RESPONSE))
    for axes, values, words in zip(pair, (1e-3 * voltage, 1e3 * reading),
                                   ("voltage (kV)", "displacement (mm)"), strict=True):
        axes.plot(when, values, color="#c9ccd1", linewidth=1.0)
        past = when <= time
        axes.plot(when[past], values[past], color=style.colour_of(0), linewidth=1.3)
        axes.plot(time, np.interp(time, when, values), "o", color=style.colour_of(1), markersize=4)
        style.describe(axes, "", words)
        axes.set_xlim(when[0], when[-1])
    pair[1].set_xlabel("time (s)")


def figure_pixels(figure: Figure) -> NDArray[np.uint8]:
    """Render a figure as a frame, shape (height, width, 3)."""
    figure.set_dpi(FRAME_DPI)
    figure.canvas.draw()
    return np.array(figure.canvas.buffer_rgba())[..., :3]  # type: ignore[attr-defined]
