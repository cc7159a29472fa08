"""The paper's Table 2 through the diagnosis, also by the ends that other seeds' levels reach."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.external.case import Case, draw, table, words
from tympan.reports import look
from tympan.studies import paper
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.replica.figures import Choices

FOLDER = Path(paper.__file__).parent / "table-2"

#: Of so many seeds those whose levels reach least and middling far stand for the lost ones.
SEEDS = 20


@dataclass(frozen=True)
class Ends:
    """The lowest and the highest level [kV], whose they are, and how long each is held [s]."""

    name: str
    low: float
    high: float
    dwell: float | None = None


def ends_of_seeds(count: int = SEEDS) -> list[Ends]:
    """Of the random levels of figure 14 by seeds, the least spread first."""
    every = []
    for seed in range(count):
        volts = Choices(seed=seed).steps()[0].voltage / 1e3
        every.append(Ends(f"seed {seed}", float(volts.min()), float(volts.max())))
    return sorted(every, key=lambda ends: ends.high - ends.low)


def with_ends(ends: Ends, folder: Path) -> Path:
    """A copy of the dataset whose ranges are between other voltages, or of levels that are held."""
    shutil.copytree(FOLDER, folder)
    file = folder / "range.csv"
    head, *rows = file.read_text(encoding="utf-8").splitlines()
    dwell = [] if ends.dwell is None else [f"{ends.dwell:g}"]
    moved = [",".join([*cells[:2], f"{ends.low:.4f}", f"{ends.high:.4f}", cells[4], *dwell])
             for cells in (row.split(",") for row in rows)]
    head = ",".join([head, "dwell_s"] if dwell else [head])
    file.write_text("\n".join([head, *moved]) + "\n", encoding="utf-8")
    return folder


def judged(ends: Ends) -> dict[str, Any]:
    """The record of the verdict on the ranges between these ends."""
    with tempfile.TemporaryDirectory() as scratch:
        return diagnose(read_dataset(with_ends(ends, Path(scratch) / "data"))).json()


def section(folder: Path) -> str:
    """Verdict, evidence, misfit before and after, other ends, what would decide, a picture."""
    stated, others = Ends("as stated", 0.0, 7.0), ends_of_seeds()
    paused = replace(stated, name="as stated, held for 30 s", dwell=30.0)
    records = {ends.name: (ends, judged(ends))
               for ends in (stated, paused, others[0], others[len(others) // 2])}
    record, in_time = records[stated.name][1], records[paused.name][1]
    creep = next(entry for entry in in_time["attempts"] if entry["effect"] == "creep")
    misfit, after = record["misfit"], record["after"] or {}
    return words("table2").format(
        verdict=record["verdict"], headline=record["headline"],
        before=misfit["baseline_rmse_um"], noise=misfit["noise_um"], p=misfit["p_value"],
        where=misfit["where"], ratios=_ratios(misfit["ratios"]),
        after=after.get("rmse_um", float("nan")), after_p=after.get("p_value", float("nan")),
        creep=creep["headline"], creep_share=creep["explains"],
        attempts=_attempts(record["attempts"]), unknown=record["probability"]["unknown"],
        ends=table(["levels", "lowest, highest [kV]", "misfit at rest [µm]", "verdict", "left [µm]",
                    "causes"], _by_ends(records.values())),
        next=record["next_experiment"]["what"] if record["next_experiment"] else "none",
        warnings="; ".join(record["warnings"]) or "none",
        picture=draw(folder, "table-2", lambda: compose(misfit["ratios"])))


def _ratios(ratios: list[dict[str, Any]]) -> str:
    rows = [[ratio["what"], f"{ratio['read']:.3f}", f"{ratio['simulated']:.3f}",
             f"{ratio['off_by_noise']:+.1f}"] for ratio in ratios]
    return table(["ratio", "read", "nominal model", "off, in its noise"], rows)


def _attempts(attempts: list[dict[str, Any]]) -> str:
    rows = [[attempt["headline"], f"{attempt['explains']:.0%}", f"{attempt['prior_widths']:.1f}"]
            for attempt in attempts if attempt["explains"] > 0.05]
    return table(["one effect alone", "of the squared misfit", "usual widths"], rows)


def _by_ends(records: Any) -> Iterator[list[str]]:
    for ends, record in records:
        after = record["after"] or {}
        yield [ends.name, f"{ends.low:.2f}, {ends.high:.2f}",
               f"{record['misfit']['baseline_rmse_um']:.0f}", record["verdict"],
               f"{after.get('rmse_um', float('nan')):.0f}",
               ", ".join(f"{cause['effect']} {cause['probability']:.0%}"
                         for cause in record["causes"]) or "none"]


def compose(ratios: list[dict[str, Any]]) -> Figure:
    """Ratios read and simulated, with their noise."""
    figure = look.new_figure(60.0, 150.0)
    axes = look.place_axes(figure, 62, 9, 82, 40)
    places = np.arange(len(ratios))[::-1]
    axes.errorbar([ratio["read"] for ratio in ratios], places,
                  xerr=[ratio["noise"] for ratio in ratios], fmt="o", markersize=4, capsize=2,
                  color=look.colour_of(1), label="Table 2, assumed noise")
    axes.plot([ratio["simulated"] for ratio in ratios], places, "|", markersize=12,
              color=look.colour_of(0), label="nominal model at rest")
    axes.set_yticks(places, [ratio["what"] for ratio in ratios])
    look.describe(axes, "ratio of two ranges of motion")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    return figure


CASE = Case("table2", section)
