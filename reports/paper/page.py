"""The page of ``tympan lumped paper``: each figure, the paper's numbers beside ours, its faults."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tympan.reports.paper.figures import FIGURES, draw_paper, read_paper
from tympan.reports.template import embedded_picture, sentence, template
from tympan.studies.files import write_text
from tympan.studies.paper.published import MASSES, NAMES, SETTLING

Content = Mapping[str, Any]

def build_paper_page(folder: Path) -> Path:
    """Draw the figures of the folder and write folder/paper.html; answers that file."""
    content = read_paper(folder)
    draw_paper(folder)
    file = folder / "paper.html"
    pictures = {name: embedded_picture(folder / f"{name}.svg") for name in FIGURES}
    write_text(file, render_paper(content, pictures))
    return file


def render_paper(content: Content, pictures: Mapping[str, str]) -> str:
    """The page as text; the figures as data URIs."""
    columns = [f"{name}_{1e3 * mass:g}g_s" for mass in MASSES for name in NAMES]
    return template("reports/paper/paper.html", number_text=number_text).render(
        paper=content, pictures=pictures, columns=columns,
        paper_settling=SETTLING.ravel().tolist(), masses=[1e3 * mass for mass in MASSES],
        names=NAMES)


def caption(name: str) -> str:
    """What stands under a figure.

    Examples
    --------
    >>> caption("fig10")
    'Figure 10: the same, its beginning.'
    """
    return sentence(template("reports/paper/words.txt"), "caption", name)


def number_text(number: Mapping[str, Any]) -> str:
    """A number of a finding in its usual unit.

    Examples
    --------
    >>> number_text({"value": 231610.0, "unit": "Pa"}), number_text({"value": 1.25, "unit": ""})
    ('231.6 kPa', '1.25')
    """
    units = {"Pa": ("kPa", 1e-3), "m": ("mm", 1e3), "kg": ("g", 1e3), "m²": ("cm²", 1e4)}
    unit, factor = units.get(number["unit"], (number["unit"], 1.0))
    return f"{factor * number['value']:.4g} {unit}".strip()
