"""Cases of more evidence than readings at rest: steps in time, lines over films, taps.

Circular films by the axisymmetric equations, at rest and in time; films that are not, by finite
elements on a finer mesh of another order, the spot with an edge as sharp as grease has.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.trials.strata import lines, steps
from benchmarks.trials.strata.evidence import ReadingPlan, evidence, sheets, write_dataset
from benchmarks.trials.strata.steps import StepPlan, step_evidence, step_sheets
from benchmarks.trials.synthetic_trials import (
    FINEST,
    NOBODY,
    Array,
    Means,
    Stranger,
    Truth,
    circles,
)
from tympan.fem.film.laws import Ogden
from tympan.geometry.specimen import Patch
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.effects import EFFECTS, Setup

#: Noise of heaves and lines, and of samples in time [m]; to which heaves are written down [m].
NOISE, DIGIT = 10e-6, 1e-7


class SharpPatch(Patch):
    """A spot with an edge."""

    def bare(self, x: Array, y: Array) -> Array:
        """1 within, 0 elsewhere."""
        away = np.hypot(x - self.centre[0], y - self.centre[1])
        return np.asarray(2 * away < self.diameter, float)


@dataclass(frozen=True)
class SharpSpot(Stranger):
    """The electrode of every specimen misses a spot."""

    patch: Patch

    def setup(self, setup: Setup) -> Setup:
        """With the spot in place of others."""
        return setup.with_specimens(lambda specimen: replace(
            specimen, electrode=replace(specimen.electrode, patches=(self.patch,))))


@dataclass(frozen=True)
class EvidenceCase:
    """What is hidden in readings of a plan: effects with their values in SI, on one specimen if so.

    Films are 5 % stiffer and 3 % less permittive than stated. ``made_by``: what makes readings.
    """

    name: str
    words: str
    verdict: tuple[str, ...]
    plan: Callable[[], ReadingPlan | StepPlan]
    effects: tuple[tuple[str, tuple[float, ...], str | None], ...] = ()
    made_by: Means = "equations"
    stranger: Stranger = NOBODY

    @property
    def truth(self) -> Truth:
        """With sizes instead of values; a spot of its own has no effect of it beside."""
        effects = self.effects if self.stranger is NOBODY else ()
        sizes = tuple(item.size(value) for name, values, _ in effects
                      for item, value in zip(EFFECTS[name].parameters, values, strict=True))
        causes = tuple(Cause(name, which) for name, _, which in effects)
        return Truth(1.05, 0.97, causes, sizes, self.made_by, FINEST, self.stranger)

    @property
    def expected(self) -> dict[str, object]:
        """What expected.json says."""
        parameters = {name: {item.name: {"value": item.shown(value), "unit": item.unit}
                             for item, value in zip(EFFECTS[name].parameters, values, strict=True)}
                      for name, values, _ in self.effects}
        return {"hidden": self.words, "verdict": list(self.verdict),
                "causes": [name for name, *_ in self.effects], "parameters": parameters}


def _slow() -> StepPlan:
    """A step of one film, each state before held for 30 s."""
    return replace(steps.slow(shapes=("middle",)), rate=10.0)


def _fast() -> StepPlan:
    """A step of one plate that swings."""
    return replace(steps.fast(shapes=("middle",)), rate=250.0, length=1.5)


def _line() -> ReadingPlan:
    """One film, lines at the lowest and highest voltage."""
    plan = lines.plan_of(["round"])
    setup = plan.design.setup.with_films(
        lambda film: replace(film, material=Ogden((20e3,), (2.0,))))
    return replace(plan, design=replace(plan.design, setup=setup))


def _taps() -> ReadingPlan:
    """Three films, each tapped at every fourth voltage."""
    design = circles()
    return ReadingPlan(design, tapped=np.arange(0, len(design.table), 4))


_NAMED, _EITHER = ("named",), ("named", "ambiguous")
EVIDENCE_CASES = (
    EvidenceCase("steps-nothing", "nothing but noise, in time too", ("nothing",), _slow),
    EvidenceCase("steps-creep", "300 kPa of the film's stiffness relax within 20 s", _NAMED, _slow,
                 (("creep", (300e3, 20.0), None),)),
    EvidenceCase("steps-damped", "the plate is damped by 0.2 N s/m more than stated", _NAMED, _fast,
                 (("plate_damping", (0.2,), None),)),
    EvidenceCase("steps-late-sensor", "the sensor follows 20 ms late", _EITHER, _fast,
                 (("sensor_lag", (20e-3,), None),)),
    EvidenceCase("taps-lead", "a lead of 3 g moves with every plate and hangs elsewhere", _NAMED,
                 _taps, (("added_mass", (3e-3,), None),)),
    EvidenceCase("line-nothing", "nothing but noise, and lines whose zeros are not the sensor's",
                 ("nothing",), _line),
    EvidenceCase("line-eccentric", "the plate sits 2 mm off the centre", _NAMED, _line,
                 (("plate_eccentricity", (2e-3, -1e-3), None),), "elements"),
    EvidenceCase("line-wedge", "the film is 15 % thicker where x ends than in the middle", _NAMED,
                 _line, (("thickness_gradient", (0.15, -0.03), None),), "elements"),
    EvidenceCase("line-stretched", "the film is stretched 3 % more along x", _NAMED, _line,
                 (("prestretch_anisotropy", (0.03,), None),), "elements"),
    EvidenceCase("line-spot", "the electrode misses a spot of 23 mm with a sharp edge", _NAMED,
                 _line, (("electrode_patch", (20e-3, -12e-3, 0.5), "round"),), "elements",
                 SharpSpot(SharpPatch((23.6e-3, -14.1e-3), 23.3e-3))),
)


def write_evidence(case: EvidenceCase, folder: Path) -> None:
    """A case's folder."""
    plan, random = case.plan(), np.random.default_rng(EVIDENCE_CASES.index(case))
    read: Any = (step_evidence(plan, case.truth) if isinstance(plan, StepPlan)
                 else evidence(plan, case.truth))
    if read is None:
        raise SystemExit(f"{case.name}: a state has no equilibrium")
    files = (step_sheets(plan, read, NOISE, random) if isinstance(plan, StepPlan)
             else sheets(plan, read, NOISE, random))
    for columns in files.values():
        if "displacement" in columns:
            columns["displacement"] = DIGIT * np.round(columns["displacement"] / DIGIT)
    damping = plan.design.setup.rig.plate_damping
    head = {"rig": {"plate_damping": f"{damping} N s/m"}} if damping else {}
    design = replace(plan.design, name=case.name)
    write_dataset(folder, design, files, NOISE, source="equations or finer elements", **head)
    (folder / "expected.json").write_text(json.dumps(case.expected, indent=1) + "\n",
                                          encoding="utf-8")
