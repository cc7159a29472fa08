"""The page of ``tympan lumped paper``: each figure with the paper's numbers beside ours, and what is wrong in it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tympan.reports.paper import figures as lumped_paper
from tympan.reports.template import embedded_picture, page_template
from tympan.studies.files import write_text
from tympan.studies.paper.published import MASSES, NAMES, SETTLING

Content = Mapping[str, Any]

#: What stands under each figure.
CAPTIONS = {
    "fig7": "Figure 7: distance at rest against voltage, 17.9 g.",
    "fig8": "Figure 8: distance at rest against voltage, 22.45 g.",
    "fig9": "Figure 9: response to a step from 0 to 3.5 kV, 17.9 g.",
    "fig10": "Figure 10: the same, its beginning.",
    "fig11": "Figure 11: response to a step from 0 to 3.5 kV, 22.45 g.",
    "fig12": "Figure 12: the same, its beginning.",
    "fig13": "Figure 13: hysteresis between voltage and distance, one period after two others.",
    "fig14": "Figure 14: response to pseudo-random steps every 30 s.",
    "misfit": "The lost parameters: worst misfit to Table 2's six ranges at rest; line: twice the least.",
}


def build_paper_page(folder: Path) -> Path:
    """Draw the figures of the folder and write folder/paper.html; answers that file.

    Raises
    ------
    InputError
        When something that ``tympan lumped paper`` stores is missing or damaged.
    """
    content = lumped_paper.read_paper(folder)
    lumped_paper.draw_paper(folder)
    file = folder / "paper.html"
    pictures = {name: embedded_picture(folder / f"{name}.svg") for name in CAPTIONS}
    write_text(file, render_paper(content, pictures))
    return file


def render_paper(content: Content, pictures: Mapping[str, str]) -> str:
    """The page as text; the figures as data URIs."""
    columns = [f"{name}_{1e3 * mass:g}g_s" for mass in MASSES for name in NAMES]
    return page_template("paper/paper.html", shown=shown).render(
        found=content, captions=CAPTIONS, pictures=pictures, columns=columns,
        paper_settling=SETTLING.ravel().tolist(), masses=[1e3 * mass for mass in MASSES],
        names=NAMES)


def shown(number: Mapping[str, Any]) -> str:
    """A number of a finding in its usual unit.

    Examples
    --------
    >>> shown({"value": 231610.0, "unit": "Pa"}), shown({"value": 1.25, "unit": ""})
    ('231.6 kPa', '1.25')
    """
    unit, factor = {"Pa": ("kPa", 1e-3), "m": ("mm", 1e3), "kg": ("g", 1e3),
                    "m²": ("cm²", 1e4)}.get(
        number["unit"], (number["unit"], 1.0))
    return f"{factor * number['value']:.4g} {unit}".strip()
