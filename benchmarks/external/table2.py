"""The paper's Table 2 through the diagnosis, also by the ends that other seeds' levels reach."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from benchmarks.external.case import Case, draw, table, words
from benchmarks.external.table2_ranges import (
    Ends,
    expected,
    held_out,
    judged_again,
    marginal,
    median,
)
from tympan import paper
from tympan.base.arrays import Array
from tympan.paper.figures import Choices
from tympan.reports import look
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.conclusions import Conclusions
from tympan.studies.diagnosis.diagnose import conclude
from tympan.studies.diagnosis.inference.predictive import Predictive

FOLDER = Path(paper.__file__).parent / "table-2"

#: The levels of so many seeds stand for the lost ones, and these factors for other noises.
SEEDS = 20
_NOISES = (0.5, 2.0)


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


def judged(ends: Ends) -> Conclusions:
    """The verdict on the ranges between these ends."""
    with tempfile.TemporaryDirectory() as scratch:
        return conclude(read_dataset(with_ends(ends, Path(scratch) / "data")))


def section(folder: Path) -> str:
    """Verdict, evidence, misfit, ranges expected, other ends and noises, what would decide."""
    stated = Ends("as stated", 0.0, 7.0)
    diagnosis = judged(stated)
    in_time = judged(replace(stated, name="held", dwell=30.0)).diagnosis().json()
    read, record = diagnosis.judgement.table, diagnosis.diagnosis().json()
    seeds = [judged_again(diagnosis, ends.moved(read)) for ends in ends_of_seeds()]
    noises = [judged_again(diagnosis, read.with_sigma(factor * read.sigma)) for factor in _NOISES]
    creep = next(entry for entry in in_time["attempts"] if entry["effect"] == "creep")
    misfit, after, by_others = record["misfit"], record["after"] or {}, held_out(diagnosis)
    return words("table2").format(
        verdict=record["verdict"], headline=record["headline"],
        before=misfit["baseline_rmse_um"], noise=misfit["noise_um"], p=misfit["p_value"],
        where=misfit["where"], ratios=_ratios(misfit["ratios"]),
        after=after.get("rmse_um", float("nan")), after_p=after.get("p_value", float("nan")),
        creep=creep["headline"], creep_share=creep["explains"],
        attempts=_attempts(record["attempts"]), unknown=record["probability"]["unknown"],
        **_expectations(diagnosis, seeds, by_others), seeds=SEEDS,
        ends=_by_ends({"as stated": record, "as stated, held for 30 s": in_time}),
        by_seeds=_spread([other.diagnosis().json() for other in seeds]),
        noises=_by_noise([noises[0], diagnosis, noises[1]]),
        next=record["next_experiment"]["what"], menu=_menu(record["next_experiment"]["menu"]),
        warnings="; ".join(record["warnings"]) or "none",
        picture=draw(folder, "table-2", lambda: compose(misfit["ratios"])))


def _expectations(diagnosis: Conclusions, seeds: Sequence[Conclusions],
                  by_others: tuple[Array, Predictive]) -> dict[str, Any]:
    """The table of the six ranges, and what is missed of those held out."""
    read, (nominal, others) = diagnosis.judgement.table, by_others
    names = [specimen.name for specimen in diagnosis.simulation.setup.specimens]
    parts = (expected(diagnosis), others, marginal([expected(other) for other in seeds]))
    bands = [(median(part, read.sigma), *part.band(read.sigma)) for part in parts]
    rows = []
    for row in range(len(read)):
        cells = [f"{band[0][row] * 1e3:.2f} ({band[1][row] * 1e3:.2f} to {band[2][row] * 1e3:.2f})"
                 for band in bands]
        rows.append([f"{names[read.specimen[row]]} at {read.mass[row] * 1e3:.4g} g",
                     f"{read.value[row] * 1e3:.2f}", *cells[:2],
                     f"{nominal[row] * 1e3:.2f}", cells[2]])
    inside = [int(((band[1] < read.value) & (read.value < band[2])).sum()) for band in bands]
    bare, weighed = (1e6 * float(np.sqrt(np.mean((values - read.value) ** 2)))
                     for values in (nominal, bands[1][0]))
    return {"expected": table(
        ["range [mm]", "read", "by all six: median, 95 %", "by the other five", "the same, nominal",
         f"by all, levels of {len(seeds)} seeds"], rows),
            "inside": inside[0], "inside_others": inside[1],
            "bare": bare, "weighed": weighed, "gain": bare / weighed}


def _spread(records: Sequence[Mapping[str, Any]]) -> str:
    """In words, from least to most over the seeds: misfit, what is left, the first cause."""
    verdicts = " or ".join(sorted({record["verdict"] for record in records}))
    first = {record["causes"][0]["effect"] for record in records if record["causes"]}
    shares = [record["causes"][0]["probability"] for record in records if record["causes"]]
    spans = [_span([record["misfit"]["baseline_rmse_um"] for record in records]),
             _span([record["after"]["rmse_um"] for record in records if record["after"]])]
    return (f"a misfit of {spans[0]} µm, *{verdicts}* in all, {spans[1]} µm left, most probable "
            f"{' or '.join(sorted(first))} with {min(shares):.1%} to {max(shares):.1%}")


def _span(values: Sequence[float]) -> str:
    return f"{min(values):.1f} to {max(values):.1f}"


def _by_noise(diagnoses: Sequence[Conclusions]) -> str:
    """What the verdict would be if a noise of the ranges were stated."""
    rows = []
    for diagnosis in diagnoses:
        record = diagnosis.diagnosis().json()
        share = record["probability"]
        rows.append([f"{record['misfit']['noise_um']:.0f}", f"{record['misfit']['p_value']:.1g}",
                     diagnosis.judgement.verdict, f"{share['nothing']:.0%}",
                     f"{share['unknown']:.0%}", _causes(record["causes"][:3])])
    return table(["noise [µm], stated", "p of the nominal model", "verdict", "nothing is wrong",
                  "none of those known", "causes, if something is"], rows)


def _menu(menu: Sequence[Mapping[str, Any]]) -> str:
    rows = [[entry["what"], f"{entry['expected_chi_squared']:.3g}",
             "yes" if entry["enough"] else "no", f"{entry['minutes']:.0f}"] for entry in menu]
    return table(["measurement", "expected Δχ² between the first two explanations", "enough",
                  "minutes"], rows)


def _ratios(ratios: list[dict[str, Any]]) -> str:
    rows = [[ratio["what"], f"{ratio['read']:.3f}", f"{ratio['simulated']:.3f}",
             f"{ratio['off_by_noise']:+.1f}"] for ratio in ratios]
    return table(["ratio", "read", "nominal model", "off, in its noise"], rows)


def _attempts(attempts: list[dict[str, Any]]) -> str:
    rows = [[attempt["headline"], f"{attempt['explains']:.0%}", f"{attempt['prior_widths']:.1f}"]
            for attempt in attempts if attempt["explains"] > 0.05]
    return table(["one effect alone", "of the squared misfit", "size over its prior scale"], rows)


def _by_ends(records: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [[name, f"{record['misfit']['baseline_rmse_um']:.0f}", record["verdict"],
             f"{(record['after'] or {}).get('rmse_um', float('nan')):.0f}",
             _causes(record["causes"])] for name, record in records.items()]
    return table(["levels of 0 and 7 kV", "misfit at rest [µm]", "verdict", "left [µm]", "causes"],
                 rows)


def _causes(causes: Sequence[Mapping[str, Any]]) -> str:
    return ", ".join(f"{cause['effect']} {cause['probability']:.0%}" for cause in causes) or "none"


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
