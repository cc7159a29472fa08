"""What a case is: a name, and the section it writes; tables and pictures that sections share."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from tympan.reports import look

HERE = Path(__file__).parent
DATA = HERE / "data"

#: Resolution of the page's pictures.
_DPI = 160

#: Characters of the longest cell of a column of numbers.
_NUMBER = 24


@dataclass(frozen=True)
class Case:
    """A case by ``name``; ``section`` writes its Markdown and draws its pictures into a folder."""

    name: str
    section: Callable[[Path], str]


def words(name: str) -> str:
    """The text of a section, with places for what is computed."""
    return (HERE / "text" / f"{name}.md").read_text(encoding="utf-8")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; columns of words stand on the left, of anything shorter on the right."""
    rows = list(rows)
    longest = [max((len(row[column]) for row in rows), default=0) for column in range(len(head))]
    rules = ["---", *("---" if length > _NUMBER else "---:" for length in longest[1:])]
    return "\n".join([f"| {' | '.join(head)} |", f"|{'|'.join(rules)}|",
                      *(f"| {' | '.join(row)} |" for row in rows)])


def draw(folder: Path, name: str, compose: Callable[[], Figure]) -> str:
    """Draw ``external-NAME.png``; answers its name."""
    with tempfile.TemporaryDirectory() as scratch:
        picture, *_ = look.save_figure(Path(scratch), f"external-{name}", compose, dpi=_DPI)
        shutil.copy(picture, folder)
    return picture.name
