"""The paper's figures and what is wrong in it: ``docs/paper.md``, two figures (``make paper``)."""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from tympan.paper.figures import Choices
from tympan.paper.missing_parameters import fit_levels
from tympan.paper.output import PaperResult
from tympan.paper.page import BASES, caption, number_text
from tympan.paper.published import HIGHEST, MASSES, NAMES, SETTLING
from tympan.reports.template import percent

_DOCS = Path(__file__).parent.parent / "docs"
_SEEDS = 6
_FIGURES = {"fig14": "paper-fig14.png", "misfit": "paper-misfit.png"}


def main() -> None:
    """Write the page from a folder that ``tympan lumped paper`` has written."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("folder", type=Path, metavar="DIR")
    folder = parser.parse_args().folder
    for figure, file in _FIGURES.items():
        shutil.copy(folder / f"{figure}.png", _DOCS / file)
    text = page(PaperResult.load(folder).numbers, other_seeds())
    (_DOCS / "paper.md").write_text(text, encoding="utf-8")


def other_seeds() -> list[str]:
    """ε_r, α₁ and what is left at the levels' ends, of the first seeds near to 0 and 7 kV."""
    rows: list[tuple[str, ...]] = []
    seed = 0
    while len(rows) < _SEEDS:
        choices = Choices(seed=seed)
        signal, _ = choices.steps()
        if signal.voltage.min() <= choices.near and signal.voltage.max() >= HIGHEST - choices.near:
            fit = fit_levels(signal)
            growth = fit.ranges[1] / fit.ranges[0]
            rows.append((f"{seed}", f"{fit.permittivity:.2f}", f"{fit.alpha[0]:.3f}",
                         f"{1e3 * fit.rms:.3f}",
                         f"{1e3 * np.abs(fit.misfit[:, 1:]).max():.3f}",
                         " / ".join(f"{1e3 * value:+.3f}" for value in fit.misfit[:, 0]),
                         " / ".join(f"{value:.3f}" for value in growth)))
        seed += 1
    return ["The same for the first seeds whose levels come near to both ends:", "",
            *_table(("seed", "ε_r", "α₁", "left (rms) [mm]", "worst ellipse [mm]",
                     "circle, 17.9 and 22.45 g [mm]",
                     "growth with the mass"), rows)]


def page(content: Any, seeds: list[str]) -> str:
    """The page as Markdown, with what other seeds give among the lost parameters."""
    ranges, settling = content["table_2"], content["settling"]
    columns = [(name, f"{1e3 * mass:g}") for mass in MASSES for name in NAMES]
    lines = [
        "# The source paper's lumped model, computed again", "",
        "Written by `make paper`; `tympan lumped paper -o DIR` computes it, with figures 7 to 14 "
        "and an HTML page. "
        "Pictures of the stress (its figure 4): `make study`. The same measurements by the field "
        "model in time: [here](paper-in-time.md).", "",
        "## What the paper does not say", "", *(f"* {words}" for words in content["chosen"]), "",
        "## Table 2: ranges of motion", "",
        *_table(("actuator", "mass [g]", "paper [mm]", "ends of figure 14's levels [mm]",
                 "at rest, 0 to 7 kV [mm]",
                 "all samples [mm]", "paper [%]", "ends of levels [%]", "at rest [%]"),
                ((row["specimen"], f"{row['mass_g']:g}", f"{row['paper_mm']:.2f}",
                  f"{row['at_levels_mm']:.3f}",
                  f"{row['at_rest_mm']:.3f}", f"{row['all_samples_mm']:.3f}",
                  f"{row['paper_percent']:.0f}",
                  f"{row['at_levels_percent']:.1f}", f"{row['at_rest_percent']:.1f}")
                 for row in ranges["rows"])), "",
        *(f"* {words}" for words in ranges["why"]), "",
        f"![{caption('fig14')}]({_FIGURES['fig14']})", "",
        "## Settling times of the oscillation [s]", "",
        *_table(("within", *(f"{name}, {mass} g" for name, mass in columns), "off by (rms)"),
                [("paper", *(f"{value:.2f}" for value in SETTLING.ravel()), ""),
                 *((row["criterion"].replace("um", "µm"),
                    *(f"{row[f'{name}_{mass}g_s']:.2f}" for name, mass in columns),
                    f"{row['rms_s']:.2f}")
                   for row in settling["rows"])]), "",
        "The last three rows are the best of their kind.", "",
        *(f"* {words}" for words in settling["why"]), "",
        "## Hysteresis", "",
        *_table(("actuator", "u₀ [kV]", "u₁ [kV]", "range [µm]", "widest gap over range [%]"),
                ((row["specimen"], f"{row['offset_kV']:g}", f"{row['amplitude_kV']:g}",
                  f"{row['range_um']:.1f}",
                  f"{row['gap_percent']:.1f}") for row in content["hysteresis"]["rows"])), "",
        *content["hysteresis"]["why"], "",
        "## Weights α, found in four ways", "",
        *_table(("actuator, α from", "α₁", "α₂", "fit error", "held-out error"),
                ((f"{row['specimen']}, {BASES[row['basis']]}",
                  *(f"{weight:.4f}" for weight in row["alpha"]), percent(row["fit_error"]),
                  percent(row["held_out_error"])) for row in content["alpha"])), "",
        "An α belongs to its kind of circle.", "",
        "## What is wrong or missing in the paper", ""]
    for number, finding in enumerate(content["findings"], 1):
        lines += [f"### {number}. {finding['title']}", ""]
        for words in finding["words"]:
            lines += [words, ""]
        if finding["key"] == "lost":
            lines += [f"![{caption('misfit')}]({_FIGURES['misfit']})", "", *seeds, ""]
        lines += [*_table(("number", "value"),
                          ((item["what"], number_text(item)) for item in finding["numbers"])), ""]
    return "\n".join(lines).rstrip() + "\n"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [" | ".join(("", *head, "")).strip(), "|---|" + "---:|" * (len(head) - 1),
            *(" | ".join(("", *row, "")).strip() for row in rows)]


if __name__ == "__main__":
    main()
