"""Tests of coupons by closed forms, at rest and in time, and the files a laboratory makes of them.

All by :mod:`benchmarks.trials.coupons.readings`. As "another law" the film is of another material
family, whose stresses differ by 0.02 %, and a branch evolves by logarithms of its strains.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks.trials.coupons.readings import PERMITTIVITY, THICKNESS, Film
from benchmarks.trials.strata.evidence import Columns
from benchmarks.trials.synthetic_trials import Array, Design, Truth
from tympan.fem.film.laws import Gent
from tympan.fem.rig import Rig
from tympan.geometry import specimen
from tympan.geometry.outlines import Circle
from tympan.studies.diagnosis.reading_table import States, rows
from tympan.studies.effects import Setup

#: Gent's limit of I₁ - 3 of the film as it is stated, and three terms of Yeoh's law with the same
#: stresses: 2 ∂W/∂I₁ by powers of I₁ - 3 over the modulus.
LIMIT = 110.0
YEOH = (1.0001841, 8.95033681e-3, 1.03876555e-4)
#: Of the mounted film, to which effects refer.
PRESTRETCH = 5**0.5

#: What the attributes of a film are called as effects.
EFFECTS_OF = {"strain_stiffening": "hardening", "second_invariant": "second",
              "permittivity_stretch": "falling", "temperature": "power", "width_not_free": "held",
              "width_not_held": "let"}

#: What a test in time shows of them, creep as often as two others.
SEEN_IN_TIME = ("creep", "strain_stiffening", "width_not_free", "second_invariant", "creep",
                "width_not_held")

#: By which strips differ, and the noise of a laboratory's reading over the largest stress, which it
#: does not state; readings of one of its runs.
STRIPS_DIFFER, UNSTATED, DENSE = 0.03, 0.002, 120


@dataclass(frozen=True)
class Run:
    """A test of a strip: its mode, voltage [V] and temperature [°C], and, of one in time, the rate
    at which it is stretched [1/s] and how long it is held then [s]."""

    mode: str
    voltage: float = 0.0
    celsius: float = 20.0
    rate: float = 0.0
    hold: float = 0.0
    stretch: float = 3.0

    def places(self, count: int) -> tuple[Array, Array]:
        """Times [s], nan of one at rest, and stretches of some readings."""
        if not self.rate:
            return np.full(count, np.nan), np.linspace(1.1, self.stretch, count)
        ramp = np.linspace(1.0, self.stretch, count - count // 2)
        ends = (self.stretch - 1) / self.rate
        time = np.r_[(ramp - 1) / self.rate, ends + np.geomspace(1.0, self.hold, count // 2)]
        return time, np.r_[ramp, np.full(count // 2, self.stretch)]


@dataclass(frozen=True, eq=False)
class StripPlan:
    """Tests of a film beside what a design reads of actuators of it, if anything.

    So many readings of each run; their noise is a share of the stress, or a laboratory's, and
    ``stated`` in a column or not. ``batch``: factors on stiffness and permittivity by which strips
    differ from actuators; ``differ``: share of the stress by which they do from each other.
    """

    design: Design
    runs: tuple[Run, ...]
    count: int = 12
    noise: float | None = None
    batch: tuple[float, float] = (1.0, 1.0)
    differ: float = 0.0
    stated: bool = True


#: Three modes, two voltages, two temperatures, a free strip under voltage too.
AT_REST = (Run("uniaxial"), Run("uniaxial", 6e3), Run("equibiaxial"), Run("equibiaxial", 6e3),
           Run("pure_shear"), Run("pure_shear", 4e3), Run("pure_shear", 6e3),
           Run("pure_shear", celsius=50.0))
#: Two rates, and two modes.
IN_TIME = (Run("uniaxial", rate=0.01, hold=300.0), Run("uniaxial", rate=0.1, hold=300.0),
           Run("pure_shear", rate=0.03, hold=300.0))


def film_alone() -> Design:
    """A film, of which no actuator is read."""
    film = specimen.Film(THICKNESS, (PRESTRETCH, PRESTRETCH), Gent(20e3, LIMIT), PERMITTIVITY)
    made = specimen.Specimen("film", Circle(45e-3), specimen.Plate(Circle(10e-3)), film)
    none = np.zeros(0)
    return Design("coupons", Setup((made,), Rig()),
                  rows(States.of(none, none, none), "displacement", 0.0), ())


def laboratory(design: Design, runs: tuple[Run, ...]) -> StripPlan:
    """Strips as a laboratory reads them."""
    return StripPlan(design, runs, DENSE, differ=STRIPS_DIFFER, stated=False)


def strip_evidence(plan: StripPlan, truth: Truth) -> list[Array] | None:
    """Stresses of each run without noise [Pa]; None where a strip does not bear its test."""
    limits = [item.limits for cause in truth.hypothesis for item in cause.effect.parameters]
    if any(not low <= size <= high
           for size, (low, high) in zip(truth.sizes, limits, strict=True)):
        return None
    film, stresses = film_of(plan, truth), []
    for run in plan.runs:
        time, stretch = run.places(plan.count)
        stress = film.stress(run.mode, stretch, run.voltage, run.celsius)
        if run.rate:
            stress = stress + film.branch_stress(run.mode, time, stretch)
        # A strip that pushes has buckled, and one that goes slack on the way is held by nothing.
        if not (stress > 0.0 if not run.rate else stress >= 0.0).all():
            return None
        stresses.append(stress)
    return stresses


def film_of(plan: StripPlan, truth: Truth) -> Film:
    """The film that is tested."""
    stated = plan.design.setup.specimens[0].membrane
    film = Film(stiffer=plan.batch[0] * truth.stiffness, less=plan.batch[1] * truth.permittivity,
                mounted=stated.prestretch[0], logarithmic=truth.means == "another law")
    if isinstance(stated.material, Gent):
        film = replace(film, slope=_yeoh if film.logarithmic else _gent)
    sizes = iter(truth.sizes)
    for cause in truth.hypothesis:
        values = tuple(item.value(next(sizes)) for item in cause.effect.parameters)
        if cause.name == "creep":
            film = replace(film, branch=(values[0], values[1]))
        elif cause.name in EFFECTS_OF:
            film = replace(film, **{EFFECTS_OF[cause.name]: values[0]})
    return film


def _gent(first: Array) -> Array:
    return np.asarray(LIMIT / (LIMIT - (first - 3)))


def _yeoh(first: Array) -> Array:
    return np.polynomial.polynomial.polyval(first - 3, YEOH)


def strip_sheet(plan: StripPlan, stresses: list[Array], random: np.random.Generator,
                exact: bool = False) -> Columns:
    """Columns of coupon.csv, with noise unless ``exact``."""
    every = np.concatenate(stresses)
    size = float(np.sqrt(np.mean(every**2)))
    sigma = UNSTATED * float(every.max()) if plan.noise is None else plan.noise * size
    if not exact:
        factors = 1 + plan.differ * random.standard_normal(len(stresses))
        every = np.concatenate([factor * stress for factor, stress in
                                zip(factors.tolist(), stresses, strict=True)])
        every = every + sigma * random.standard_normal(len(every))
    places = [run.places(plan.count) for run in plan.runs]
    times, stretches = (np.concatenate(parts) for parts in zip(*places, strict=True))

    def each(values: list[float] | list[str]) -> list[float] | list[str]:
        return np.repeat(values, plan.count).tolist()

    sheet: Columns = {
        "mode": each([run.mode for run in plan.runs]), "stretch": stretches,
        "nominal_stress": every, "run": each([f"{k}" for k in range(len(plan.runs))]),
        "voltage": np.array(each([run.voltage for run in plan.runs])),
        "temperature_C": np.array(each([run.celsius for run in plan.runs]))}
    if np.isfinite(times).any():
        sheet["t"] = times
    return {**sheet, "sigma": np.full(len(every), sigma)} if plan.stated else sheet
