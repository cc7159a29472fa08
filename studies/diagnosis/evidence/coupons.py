"""Coupon tests as evidence: the nominal stress of strips and sheets of a film.

The stretch of a test is known, so only the width is solved, of a strip that is free to narrow
under voltage. Its film has the law and the branches of a specimen, from the virgin state on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import AnyArray, Array, Mask, Numbers
from tympan.base.errors import InputError
from tympan.fem.film.density import maxwell
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Grips, Rig
from tympan.geometry.specimen import ConstantFlow, Film, Specimen
from tympan.studies.data.coupon import MODES, Coupons
from tympan.studies.diagnosis.evidence.kind import Predicts, Shown, Split, StripEvidence
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    Cause,
    Hypothesis,
    parameters_of,
    uses_of,
    with_factors,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects import Setup, Use, extended
from tympan.studies.effects.effect import Observable
from tympan.studies.material.branches import held_out_groups
from tympan.studies.material.relaxation import BranchStress

#: 0 °C [K].
ICE = 273.15
#: Temperature at which material constants are stated [K], 20 °C.
USUAL_KELVIN = 293.15

#: Most steps of Newton's method for a strip's width.
_STEPS = 40
#: Largest step in the logarithm of the width, so that it stays where laws are nearly straight.
_LARGEST = 0.2
#: Change of the logarithm at which the iteration has converged: near the rounding of numbers.
_THERE = 1e-11
#: Largest width over that without voltage. Beyond it a strip is taken to have no equilibrium.
_WIDEST = 3.0

#: Step for derivatives, as a share of the prior scale.
_STEP = 1e-5

#: Usual difference between strips and the actuators' film, as a share of the stiffness and of the
#: stress taken off by voltage: makers of cast films and tapes state their thickness to 5 to 10 %.
#: Stiffening by an actuator's grease and wrong labels of loads are in the factors alone.
BATCH = 0.1
#: Permittivity over the stated one that acts as none.
_NONE = 1e-9

#: Degree of the polynomials in the stretch that misfits are tested against.
_DEGREE = 4

#: Share of the largest logarithm of the stretch above which readings are held out.
_FAR = 0.7


@dataclass(frozen=True, eq=False)
class CouponTests(StripEvidence):
    """Coupon tests of the films of a setup's specimens, as a kind of evidence.

    ``film``: number of the specimen whose film was tested in each of the ``coupons``, shape
    (readings,); ``references``: shares of the readings that each reading is counted from, shape
    (readings, readings), if it is a drop of the stress; None where readings are stresses. ``rows``:
    numbers of the readings that are judged, ``leg``: numbers of the legs of runs they belong to.
    """

    setup: Setup
    coupons: Coupons
    film: Numbers
    rows: Numbers
    leg: Numbers
    references: Array | None = None

    files = ("coupon.csv",)
    kinds = ("stress",)

    def predict(self, model: Predicts, hypothesis: Hypothesis, unknowns: Array,
                table: ReadingTable) -> Shown:
        return CouponPrediction(self, hypothesis, unknowns, table.coupon, model.bounds(hypothesis))

    def extended(self, setup: Setup, unknowns: Array, uses: Iterable[Use]) -> Setup:
        """Apply effects to a setup, and the factor on stiffness to branches too.

        Readings of stress cannot separate thickness and modulus, so one factor acts on both.
        """
        stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()

        def change(film: Film) -> Film:
            return replace(with_factors(film, stiffness, permittivity), branches=tuple(
                replace(branch, modulus=stiffness * branch.modulus) for branch in film.branches))

        return extended(setup.with_films(change), uses)

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        coupons, reading = self.coupons, self.rows
        size = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
        stretch = _legendre(coupons.stretch[reading])
        few = stretch[:, :3]
        columns = {"level": stretch[:, :1], "stretch": stretch[:, 1:]}
        modes = coupons.mode[reading]
        present = [mode for mode in MODES if mode in modes]
        for mode in present if len(present) > 1 else ():
            columns[f"mode {mode.replace('_', '-')}"] = _times(modes == mode, few)
        columns["voltage"] = _times(coupons.volts[reading] ** 2, few)
        columns["temperature"] = _times(coupons.degrees[reading], few)
        time = np.nan_to_num(coupons.time[reading])
        if np.ptp(time) > 0:
            columns["time"] = _legendre(np.log(time + np.ptp(time) / 1e3))[:, 1:]
        columns["rate"] = _times(_log_rate(coupons)[reading], few)
        columns["way"] = _times(_way(self.leg, coupons.stretch[reading]), few)
        columns["runs"] = _runs_apart(self.leg, coupons.stretch[reading])
        return {f"coupon_{name}": size * values for name, values in columns.items()
                if np.abs(values).max(initial=0.0) > 0}

    def splits(self, setup: Setup, table: ReadingTable
               ) -> tuple[list[Split], dict[str, AnyArray]]:
        coupons, reading = self.coupons, self.rows[table.point]
        mode, warmth = coupons.mode[reading], coupons.degrees[reading]
        voltage = coupons.volts[reading]
        splits: list[Split] = [("mode", str(name).replace("_", " "), mode == name)
                               for name in np.unique(mode)]
        splits += [("temperature", f"{value:.4g} °C", warmth == value)
                   for value in np.unique(warmth)]
        splits += [("field", f"{value / 1e3:.4g} kV", voltage == value)
                   for value in np.unique(voltage)]
        groups = held_out_groups(coupons) if coupons.in_time else {}
        splits += [("run", name, rows[reading]) for name, rows in groups.items()]
        extent = np.abs(np.log(coupons.stretch[reading]))
        edge = _FAR * float(extent.max(initial=0.0))
        splits.append(("stretch", f"beyond a stretch of {np.exp(edge):.3g}", extent > edge))
        levels = {"mode": mode, "temperature": warmth, "field": voltage,
                  "run": table.states.run[table.state], "stretch": extent.round(3)}
        return splits, levels

    def observables(self, table: ReadingTable) -> set[Observable]:
        warm, timed = np.ptp(self.coupons.degrees) > 0, self.coupons.in_time
        return {Observable.STRESS, *([Observable.TEMPERATURE] if warm else []),
                *([Observable.TIME] if timed else [])}

    def feels(self, cause: Cause, setup: Setup, table: ReadingTable) -> bool:
        return self.feel(cause)

    def written(self, table: ReadingTable, names: Sequence[str], models: Mapping[str, Array]
                ) -> Mapping[str, AnyArray]:
        """Build the columns of strips.csv with their values."""
        coupons, row = self.coupons, self.rows
        return {"line": table.line, "specimen": np.array(names, str)[self.film[row]],
                "run": table.run, "leg": table.states.run[table.state], "mode": coupons.mode[row],
                "t": coupons.time[row], "stretch": coupons.stretch[row],
                "voltage": coupons.volts[row], "temperature_C": coupons.degrees[row],
                "sigma": table.noise.total, "read": table.value, **models}

    def specimens(self, setup: Setup) -> tuple[Specimen, ...]:
        """List the specimens with the tested films, at the temperatures of the tests."""
        warm = [at_temperature(specimen, celsius) for specimen in setup.specimens
                if specimen.membrane.temperature_power
                for celsius in np.unique(self.coupons.degrees).tolist()]
        return (*setup.specimens, *warm)

    def of_one_film(self, setup: Setup) -> bool:
        """Check whether every strip is of a film that an actuator of a setup has."""
        films = [specimen.membrane for specimen in setup.specimens]
        return all(specimen.membrane in films for specimen in self.setup.specimens)

    def batch(self, best: Setup) -> Array:
        """Compute stresses of rows whose films differ from the actuators' [Pa], shape (rows, 2).

        The best model of the coupons predicts them. Measured stresses would align the difference
        between films with the readings' own noise.
        """
        uncharged = best.with_films(lambda film: replace(
            film, relative_permittivity=_NONE * film.relative_permittivity))
        whole, law = (self.shown(setup)[0] for setup in (best, uncharged))
        return np.asarray(BATCH * np.stack([law, law - whole], axis=1)[self.rows])

    def shown(self, setup: Setup) -> tuple[Array, Mask]:
        """Compute the stress of each reading [Pa], and whether the strip has an equilibrium."""
        stress, possible = np.zeros(len(self.coupons)), np.ones(len(self.coupons), bool)
        for number, specimen in enumerate(setup.specimens):
            part = np.flatnonzero(self.film == number)
            stress[part], possible[part] = self._stress(specimen, setup.rig, part)
        if self.references is not None:
            possible = possible & ~((self.references > 0) & ~possible).any(1)
        return self.counted(stress), possible

    def counted(self, readings: Array) -> Array:
        """Convert stresses to what is read: the stress or its drop, shape (readings,)."""
        shares = self.references
        return readings if shares is None else np.asarray(shares @ readings - readings)

    def _stress(self, specimen: Specimen, rig: Rig, rows: Numbers) -> tuple[Array, Any]:
        coupons, film = self.coupons, specimen.membrane
        along, mode = coupons.stretch[rows], coupons.mode[rows]
        warmth = ((coupons.degrees[rows] + ICE) / USUAL_KELVIN) ** film.temperature_power
        pull = self._branch_pull(film, rig, rows)
        voltage = np.asarray(rig.film_voltage(coupons.volts[rows]))
        field = maxwell(specimen, voltage**2)
        free = along**-0.5
        possible = np.ones(len(rows), bool)
        widening = np.flatnonzero((mode == "uniaxial") & (voltage != 0))
        if len(widening):
            at_rest = film.material.derivatives(along[widening], free[widening])[1]
            stiffer = warmth[widening] * _stiffer(at_rest, pull[widening])
            free[widening], possible[widening] = _width(
                film, replace(field, coefficient=field.coefficient[widening]), stiffer,
                along[widening])
        across = rig.stretch_across(mode, along, free)
        law = np.asarray(film.material.derivatives(along, across)[1])
        return warmth * (law + pull) + field.derivatives(along, across)[1], possible

    def _branch_pull(self, film: Film, grips: Grips, rows: Numbers) -> Array:
        """Compute the nominal stress of a film's branches at 20 °C [Pa], shape (rows,)."""
        if not film.branches or not self.coupons.in_time:
            return np.zeros(len(rows))
        if any(branch.flow != ConstantFlow() for branch in film.branches):
            raise InputError("must be constant in the branches of films whose coupons are judged",
                             key="flow", given=film.branches[0].flow.flow)
        moduli = np.array([branch.modulus for branch in film.branches])
        logs = np.log([branch.time for branch in film.branches])
        pull = _looked_up(self.branches, logs)[rows] @ moduli
        moved = grips.width_shift(self.coupons.mode[rows])
        if moved.any():
            other = _looked_up(self.other_width, logs)[rows] @ moduli
            pull = (1 - moved) * pull + moved * other
        return np.asarray(pull)

    @cached_property
    def branches(self) -> BranchStress:
        """Stress of branches of unit modulus in the tests, in their stated modes."""
        return BranchStress.of(self.coupons)

    @cached_property
    def other_width(self) -> BranchStress:
        """Stress with free widths held and held widths free."""
        mode = self.coupons.mode
        other = np.select([mode == "uniaxial", mode == "pure_shear"], ["pure_shear", "uniaxial"],
                          mode)
        return BranchStress.of(replace(self.coupons, mode=other))

    def feel(self, cause: Cause) -> bool:
        """Check whether an effect changes anything that the readings depend on."""
        if cause not in self._felt:
            usual = [item.deviation for item in cause.effect.parameters]
            try:
                changed = self.seen_of(cause.effect.at(self.setup, usual, cause.which))
                self._felt[cause] = changed != self.seen_of(self.setup)
            except InputError:  # the specimen lacks what the effect acts on
                self._felt[cause] = False
        return self._felt[cause]

    @cached_property
    def _felt(self) -> dict[Cause, bool]:
        return {}

    def seen_of(self, setup: Setup) -> tuple[Any, ...]:
        """Collect all parts of a setup that these tests may depend on."""
        rig, timed = setup.rig, self.coupons.in_time
        films = [(film.material, maxwell(specimen, 1.0), film.temperature_power,
                  film.branches if timed else ())
                 for specimen in setup.specimens for film in (specimen.membrane,)]
        return (tuple(films), *np.asarray(rig.film_voltage(self.coupons.volts)).tolist(),
                *rig.width_shift(self.coupons.mode).tolist())


def _looked_up(stress: BranchStress, logs: Array) -> Array:
    """Look up stresses of branches at logarithms of times; beyond the tests, their end values."""
    return stress.columns(np.clip(logs, *stress.bounds))


def _stiffer(at_rest: Any, pull: Array) -> Array:
    """Compute the ratio of a strip's stiffness with branches to that without, on both axes."""
    tiny = 1e-6 * np.abs(at_rest).max(initial=1e-300)
    ratio = np.divide(pull, at_rest, out=np.zeros_like(pull), where=np.abs(at_rest) > tiny)
    return np.asarray(1 + np.maximum(ratio, 0.0), float)


def _width(film: Film, field: Any, stiffer: Array, along: Array) -> tuple[Array, Any]:
    """Solve the stretch across a strip with no stress across, and whether it exists."""
    start = along**-0.5
    across, done = start.copy(), np.zeros(len(along), bool)
    for _ in range(_STEPS):
        elastic, electric = (part.derivatives(along, across) for part in (film.material, field))
        force = stiffer * elastic[2] + electric[2]
        rate = stiffer * elastic[5] + electric[5]
        # Newton's method in the logarithm, where laws are nearly straight; outwards if unstable.
        slope = rate * across + force
        step = np.where(slope > 0, -force / np.where(slope > 0, slope, 1.0), _LARGEST)
        across = across * np.exp(np.clip(step, -_LARGEST, _LARGEST))
        across = np.clip(across, start / _WIDEST, _WIDEST * start)
        done = np.abs(step) < _THERE
        if done.all():
            break
    return across, done


class CouponPrediction:
    """Prediction of rows of coupons at some unknowns; its interface is that of a film's prediction.

    ``rows``: numbers of the judged readings; derivatives are taken within ``bounds``, shape
    (2, unknowns).
    """

    def __init__(self, tests: CouponTests, hypothesis: Hypothesis, unknowns: Array, rows: Numbers,
                 bounds: Array) -> None:
        self.tests, self.hypothesis, self.unknowns, self.rows = tests, hypothesis, unknowns, rows
        self.bounds = bounds
        self.extended, possible = self._shown(unknowns)
        self.possible: Mask = possible[tests.rows[rows]]
        self.short = np.zeros(len(rows), bool)
        #: Deflection of each row: no plate moves.
        self.deflection = np.zeros(len(rows))

    @property
    def complete(self) -> bool:
        """Whether every state that was read has an equilibrium."""
        return bool(self.possible.all())

    def beyond(self, before: CouponPrediction) -> bool:
        """Check whether a search must not go here, from a point where all states are possible.

        The values of a strip without equilibrium guide no search.
        """
        return before.complete and not self.complete

    @property
    def values(self) -> Array:
        """Stress of each row [Pa], nan where a strip has no equilibrium."""
        return np.where(self.possible, self.extended, np.nan)

    def _shown(self, unknowns: Array) -> tuple[Array, Mask]:
        """Compute the stress of each row, and which readings have an equilibrium."""
        tests, uses = self.tests, uses_of(self.hypothesis, unknowns)
        felt = [use for cause, use in zip(self.hypothesis, uses, strict=True) if tests.feel(cause)]
        shown, possible = tests.shown(tests.extended(tests.setup, unknowns, felt))
        return shown[tests.rows[self.rows]], possible

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the rows by the unknowns, shape (rows, unknowns)."""
        columns = []
        usual = [item.deviation for item in parameters_of(self.hypothesis)]
        for number, size in enumerate([1.0, 1.0, *usual]):
            sides = []
            for sign in (-1, 1):
                moved = self.unknowns.copy()
                moved[number] = np.clip(moved[number] + sign * _STEP * size,
                                        *self.bounds[:, number])
                sides.append((moved[number], self._shown(moved)[0]))
            (low, before), (high, after) = sides
            columns.append((after - before) / (high - low))
        return np.stack(columns, axis=1)


def at_temperature(specimen: Specimen, celsius: float) -> Specimen:
    """Change a specimen's film to a temperature [°C]; give the specimen a name of its own."""
    film = specimen.membrane
    factor = ((celsius + ICE) / USUAL_KELVIN) ** film.temperature_power
    warm = replace(film, material=scaled(film.material, factor), temperature_power=0.0,
                   branches=tuple(replace(branch, modulus=factor * branch.modulus)
                                  for branch in film.branches))
    return replace(specimen, name=f"{specimen.name} at {celsius:.4g} C", membrane=warm)


def _legendre(values: Array) -> Array:
    """Evaluate Legendre polynomials over the range of values, no more than the values support."""
    span = float(np.ptp(values))
    degree = max(0, min(_DEGREE, len(np.unique(values.round(6))) - 2))
    share = 2 * (values - values.min()) / span - 1 if span > 0 else np.zeros_like(values)
    return np.asarray(legendre.legvander(share, degree if span > 0 else 0), float)


def _times(values: Array | Mask, columns: Array) -> Array:
    """Multiply columns by a contrast of mean 0 and spread 1; drop them if all values are equal."""
    contrast = np.asarray(values, float) - np.mean(values)
    spread = float(contrast.std())
    contrast = contrast / spread if spread > 1e-12 else 0 * contrast
    return np.asarray(contrast[:, None] * columns, float)


def _log_rate(coupons: Coupons) -> Array:
    """Compute the logarithm of the mean rate of each run; 0 without times or motion."""
    rate = np.zeros(len(coupons))
    for run in coupons.timed_runs.values():
        duration = float(np.ptp(coupons.time[run]))
        path = float(np.abs(np.diff(coupons.stretch[run])).sum())
        if duration > 0 and path > 1e-3:
            rate[run] = np.log(path / duration)
    return rate


def _way(run: Numbers, stretch: Array) -> Array:
    """Mark with 1 the legs that return to the virgin stretch, others with 0."""
    back = np.zeros(len(run))
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        away = np.abs(stretch[rows] - 1)
        back[rows] = away[-1] < away[0]
    return back


def _runs_apart(run: Numbers, stretch: Array) -> Array:
    """Build a polynomial for each leg of a run that has enough readings to leave some scatter."""
    columns = []
    for number in np.unique(run):
        rows = np.flatnonzero(run == number)
        along = stretch[rows]
        place = along if np.ptp(along) > 1e-3 else np.arange(len(rows), dtype=float)
        within = _legendre(place)
        within = within[:, : max(1, len(rows) // 3)]
        part = np.zeros((len(run), within.shape[1]))
        part[rows] = within
        columns.append(part)
    return np.hstack(columns)
