"""One look for all figures, and how they reach the disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tympan.geometry.errors import InputError
from tympan.studies.files import write_atomically

MM = 1 / 25.4  #: inches
WIDTH = 180.0  #: of a journal's two columns [mm]
DPI = 400  #: of pictures in print
#: Colours of the two axes, told apart by all eyes, on the film and on paper.
SHORT, LONG = "#f0642d", "#3aa3e3"
SHORT_TEXT, LONG_TEXT = "#b5400f", "#1b6fa8"  #: those of words about them, dark enough to read
COLOURS = "viridis"  #: of the stress, perceptually uniform
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000")
_MARKERS = "os^Dv*"  #: as many as colours
_FORMATS = ("png", "pdf", "svg")


@contextmanager
def figure_style() -> Iterator[None]:
    """The figures' fonts and lines, whatever the user's matplotlib is set to.

    The fixed salt of the SVG's names makes files repeat byte by byte.
    """
    with style.context(["default", {
        "font.family": "DejaVu Sans", "font.size": 7.5, "axes.titlesize": 8, "axes.labelsize": 7.5,
        "xtick.labelsize": 7, "ytick.labelsize": 7, "legend.fontsize": 7, "legend.frameon": False,
        "axes.linewidth": 0.6, "xtick.major.width": 0.6, "ytick.major.width": 0.6,
        "lines.linewidth": 1.3,
        "xtick.major.size": 2.5, "ytick.major.size": 2.5, "axes.spines.top": False,
        "axes.spines.right": False,
        "pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "tympan",
    }]):
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure [mm]."""
    figure = Figure(figsize=(width * MM, height * MM), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def place_axes(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Axes at a place measured from the page's top left corner [mm]."""
    across, down = figure.get_size_inches() / MM
    return figure.add_axes((left / across, 1 - (top + height) / down, width / across,
                            height / down))


def colour_of(number: int) -> str:
    """Colour of the curve of this number, in turns."""
    return PALETTE[number % len(PALETTE)]


def marker_of(number: int) -> str:
    """Marker of the curve of this number, in turns."""
    return _MARKERS[number % len(_MARKERS)]


def faint_grid(axes: Axes) -> None:
    """Faint lines behind the curves."""
    axes.grid(color="#e4e6ea", linewidth=0.5)
    axes.set_axisbelow(True)


def check_formats(formats: Sequence[str]) -> None:
    """Refuse formats that cannot be written."""
    for kind in formats:
        if kind not in _FORMATS:
            raise InputError(f"must be one of {', '.join(_FORMATS)}", key="format", given=kind)


def save_figure(folder: Path, name: str, compose: Callable[[], Figure],
                formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Compose a figure in the one style and write folder/name in each format; answers the files.

    Raises
    ------
    InputError
        When a format cannot be written, before anything is drawn.
    """
    check_formats(formats)
    with figure_style():
        figure = compose()
        files = [folder / f"{name}.{kind}" for kind in formats]
        for file in files:
            date = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(file.suffix, {})
            write_atomically(file, partial(figure.savefig, dpi=DPI, metadata=date))
    return files
