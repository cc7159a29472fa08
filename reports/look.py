"""The common style of all figures, and how figures are written to files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import accumulate
from pathlib import Path

import numpy as np
from matplotlib import colormaps, style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.reports.scales import AxisScale
from tympan.studies.case import Band
from tympan.studies.files import write_atomically

MM = 1 / 25.4  #: inches
WIDTH = 180.0  #: of a journal's two columns [mm]
DPI = 400  #: of pictures in print

#: Width on the left of an axis for its numbers and words [mm].
LEFT = 14.0
#: Width on the right, for half of the last number [mm].
RIGHT = 4.0
#: Height above an axis for its title [mm].
TITLE = 6.0
#: Height below an axis for its numbers and words [mm].
AXIS = 12.0
#: Height between two axes, one below the other [mm].
GAP = 5.0

#: Colour of the short axis on the film and on paper, distinct from the other for all eyes.
SHORT = "#f0642d"
#: Colour of the long axis.
LONG = "#3aa3e3"

#: Colour of words about the short axis, dark enough to read.
SHORT_TEXT = "#b5400f"
#: Colour of words about the long axis.
LONG_TEXT = "#1b6fa8"

#: Colour of lines other than measurements: zero, and models in a legend.
GREY = "#5a6475"
#: Colour of the noise band and of a grid, light behind the readings.
FAINT = "#e4e6ea"

COLOURS = "viridis"  #: of the stress, perceptually uniform
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#000000")
_MARKERS = "os^Dv*"  #: as many as colours
#: Colours of an electrode's segments, in turns, told apart by all eyes, that white words show on.
SEGMENTS = ("#0072b2", "#d55e00", "#009e73", "#b0578d", "#3a97c9", "#b8860b", "#5b4ba0", "#555555")

#: Opacity of the band of films that scatter: curves are visible through several bands.
_BAND = 0.15
#: Words for the band of films in a legend.
_BAND_WORDS = "90 % of the films"

#: Share by which axes are made higher in one try, to make room for their legend.
_RAISED = 0.08
#: Most tries to make room for a legend, so that curves keep half of the height.
_TRIES = 9
#: Distance that words may reach beyond the page before it is enlarged: less is rounding [mm].
_CUT = 0.2
#: Margin about words that reach further [mm].
_ROOM = 1.0

#: Pixels, shape (rows, columns, 3), and the (left, right, bottom, top) they cover [mm].
Picture = tuple[NDArray[np.uint8], tuple[float, float, float, float]]


@contextmanager
def figure_style() -> Iterator[None]:
    """Set the figures' fonts and lines, whatever the user's matplotlib is set to.

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
    """Make an empty figure [mm]."""
    figure = Figure(figsize=(width * MM, height * MM), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def place_axes(figure: Figure, left_edge: float, top: float, width: float, height: float) -> Axes:
    """Add axes at a place measured from the page's top left corner [mm]."""
    across, down = figure.get_size_inches() / MM
    return figure.add_axes((left_edge / across, 1 - (top + height) / down, width / across,
                            height / down))


def panels(count: int, columns: int, height: float, title: float = TITLE, axis: float = AXIS
           ) -> tuple[Figure, list[Axes]]:
    """Make a figure of axes in rows, with margins above and below each [mm]."""
    cell, tall = WIDTH / columns, title + height + axis
    figure = new_figure(max(1, -(-count // columns)) * tall)
    return figure, [place_axes(figure, LEFT + number % columns * cell,
                               title + number // columns * tall, cell - LEFT - RIGHT, height)
                    for number in range(count)]


def pairs(count: int, above: float, below: float, left_edge: float = LEFT
          ) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """Make a figure of columns, each a pair of axes with one abscissa, of these heights [mm]."""
    figure = new_figure(TITLE + above + GAP + below + AXIS)
    width = (WIDTH - RIGHT) / count - left_edge
    return figure, [place_pair(figure, left_edge + column * (width + left_edge), TITLE, width,
                               (above, GAP, below)) for column in range(count)]


def place_pair(figure: Figure, left_edge: float, top: float, width: float,
               heights: tuple[float, float, float]) -> tuple[Axes, Axes]:
    """Add two axes with the same abscissa [mm]; ``heights`` are upper, gap and lower."""
    above, gap, below = heights
    pair = (place_axes(figure, left_edge, top, width, above),
            place_axes(figure, left_edge, top + above + gap, width, below))
    pair[0].tick_params(labelbottom=False)
    return pair


def centred(widths: Sequence[float], gap: float, left_margin: float = 0.0,
            right_margin: float = 0.0) -> list[float]:
    """Compute left edges of columns in the middle of the page, between margins [mm]."""
    spare = WIDTH - left_margin - right_margin - sum(widths) - gap * (len(widths) - 1)
    starts = accumulate((width + gap for width in widths[:-1]), initial=left_margin + spare / 2)
    return list(starts)


def show_picture(axes: Axes, picture: Picture, *captions: tuple[str, float, str, float],
                 interpolation: str = "hanning") -> None:
    """Show a picture in axes of the millimetres it covers, with captions above it.

    ``captions`` are text, distance from the picture [mm], weight and size. ``interpolation`` is
    "none" for a picture whose pixels are those of the print, which is quicker and sharper.
    """
    pixels, extent = picture
    axes.set_axis_off()
    axes.imshow(pixels, extent=extent, interpolation=interpolation, aspect="auto")
    for text, above, weight, size in captions:
        axes.annotate(text, (0.5, 1.0), (0, above * MM * 72), xycoords="axes fraction",
                      textcoords="offset points", ha="center", va="bottom", weight=weight,
                      fontsize=size)


#: Width of a digit of a colour bar's numbers [mm].
_WIDE = 1.6


def colour_bar(figure: Figure, left_edge: float, top: float, size: tuple[float, float],
               scale: AxisScale, colours: str, words: str) -> None:
    """Draw a bar of a ``size`` [mm] that explains the colours of pictures."""
    bar = figure.colorbar(ScalarMappable(Normalize(scale.low, scale.high), colours),
                          cax=place_axes(figure, left_edge, top, *size), orientation="horizontal",
                          ticks=scale.ticks)
    # Numbers that would overlap are left out: every second one, or two of three.
    texts = [scale.text(tick) for tick in scale.ticks]
    room = (scale.ticks[1] - scale.ticks[0]) / (scale.high - scale.low) * size[0]
    step = max(1, int(np.ceil(_WIDE * (max(map(len, texts)) + 1) / room)))
    bar.set_ticklabels([text if number % step == 0 else "" for number, text in enumerate(texts)])
    bar.outline.set_linewidth(0.5)
    bar.set_label(words, labelpad=2)


def colour_of(number: int, count: int = 1) -> str:
    """Choose the colour of a curve by its number, in turns; many curves each have their own."""
    if count <= len(PALETTE):
        return PALETTE[number % len(PALETTE)]
    return to_hex(colormaps[COLOURS](0.92 * number / (count - 1)))  # its yellow is pale on white


def segment_colours(count: int) -> list[str]:
    """List the colours of an electrode's segments, in turns."""
    return [SEGMENTS[number % len(SEGMENTS)] for number in range(count)]


def edges(places: Array, bands: Sequence[Band | None], factor: float
          ) -> Array:
    """Join places with 5 and 95 % of films, (3, places), times a factor; NaN without a band."""
    values = [(np.nan, np.nan) if band is None else (factor * band.low, factor * band.high)
              for band in bands]
    return np.array([places, *np.array(values).reshape(-1, 2).T])


def band(axes: Axes, edge: Array, colour: str) -> None:
    """Draw the band of films that scatter: places with low and high edge, (3, places)."""
    if not np.isfinite(edge[1:]).any():
        return
    axes.fill_between(*edge, color=colour, alpha=_BAND, linewidth=0.0, zorder=0.5)
    if _BAND_WORDS not in axes.get_legend_handles_labels()[1]:
        axes.fill_between([], [], [], color=GREY, alpha=_BAND, linewidth=0.0, label=_BAND_WORDS)


def marker_of(number: int) -> str:
    """Choose the marker of a curve by its number, in turns."""
    return _MARKERS[number % len(_MARKERS)]


def describe(axes: Axes, across: str = "", up: str = "", title: str = "", bold: bool = False,
             ) -> None:
    """Name both axes, with a title on the left and faint lines behind the curves."""
    axes.set(xlabel=across, ylabel=up)
    axes.set_title(title, loc="left", weight="bold" if bold else "normal")
    axes.grid(color=FAINT, linewidth=0.5)
    axes.set_axisbelow(True)


def legend(axes: Axes, handles: Sequence[Artist] | None = None) -> Legend:
    """Add a legend that covers no line; if there is no such place, extend the axes upwards."""
    made = axes.legend(handles=handles, loc="best")
    for _ in range(_TRIES):
        bottom, _ = axes.get_ylim()
        covered = made.get_window_extent()
        if not any(_meets(line, covered) for line in axes.get_lines()):
            break
        higher = axes.transAxes.transform((0.0, 1.0 + _RAISED))
        axes.set_ylim(bottom, axes.transData.inverted().transform(higher)[1])
    return made


def _meets(line: Line2D, box: Bbox) -> bool:
    """Check whether a line crosses a box [pixels]; for marks alone, whether one is in it."""
    path = line.get_transform().transform_path(line.get_path())
    if line.get_linestyle() == "None":
        return bool(box.count_contains(path.vertices))
    return np.size(path.vertices) > 0 and bool(path.intersects_bbox(box, filled=False))


def _whole(figure: Figure) -> Bbox | None:
    """Extend the page by words that reach beyond it [inches]; None where none do."""
    page, drawn = figure.bbox_inches, figure.get_tightbbox()
    if np.array_equal(Bbox.union([page.padded(_CUT * MM), drawn]), page.padded(_CUT * MM)):
        return None
    return Bbox.union([page, drawn.padded(_ROOM * MM)])


def save_figure(folder: Path, name: str, compose: Callable[[], Figure],
                formats: Sequence[str] = ("png", "svg"), dpi: int = DPI) -> list[Path]:
    """Compose a figure in the common style and write folder/name in each format; return the files.

    A page is enlarged if its words reach beyond it.
    """
    with figure_style():
        figure = compose()
        page = _whole(figure)
        files = [folder / f"{name}.{kind}" for kind in formats]
        for file in files:
            date = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}.get(file.suffix, {})
            write_atomically(file, partial(figure.savefig, dpi=dpi, metadata=date,
                                           bbox_inches=page))
    return files
