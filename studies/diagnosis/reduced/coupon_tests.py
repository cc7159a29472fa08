"""What coupon tests show under a hypothesis: the nominal stress of strips and sheets of a film.

A test's stretch is known, so nothing is solved but the width of a strip that is free to narrow
under voltage. Its film is the law and the branches of a specimen, from the virgin state.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.density import maxwell
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import ConstantFlow, Film, Specimen
from tympan.studies.data.coupon import Coupons
from tympan.studies.diagnosis.hypothesis import (
    FACTORS,
    Cause,
    Hypothesis,
    parameters_of,
    uses_of,
    with_factors,
)
from tympan.studies.effects import Setup, Use, extended
from tympan.studies.material.relaxation import BranchStress

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

#: 0 °C [K].
ICE = 273.15
#: Temperature at which constants of films hold [K], 20 °C.
USUAL_KELVIN = 293.15

#: Most steps of Newton's method for a strip's width.
_STEPS = 40
#: Its largest step in the logarithm, so that it does not leave where laws are nearly straight.
_LARGEST = 0.2
#: Change below which it is there: near to the rounding of numbers.
_THERE = 1e-11
#: How much wider than without voltage no strip is, as a factor. Further out it has no width.
_WIDEST = 3.0

#: Share of the usual size by which derivatives are taken.
_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class CouponTests:
    """Coupon tests of the films of a setup's specimens.

    ``film``: number of the specimen whose film each of the ``coupons`` is, shape (readings,);
    ``references``: of each reading the shares, shape (readings, readings), of those it is counted
    from, as a drop of the stress; None where readings are stresses. ``rows`` are numbers of the
    readings that are judged, ``leg`` of the legs of runs they are of.
    """

    setup: Setup
    coupons: Coupons
    film: Numbers
    rows: Numbers
    leg: Numbers
    references: Array | None = None

    def shown(self, setup: Setup) -> tuple[Array, NDArray[np.bool_]]:
        """What each reading shows [Pa] and whether such a strip has an equilibrium, (readings,)."""
        stress, possible = np.zeros(len(self.coupons)), np.ones(len(self.coupons), bool)
        for number, specimen in enumerate(setup.specimens):
            part = np.flatnonzero(self.film == number)
            stress[part], possible[part] = self._stress(specimen, setup.rig, part)
        if self.references is not None:
            possible = possible & ~((self.references > 0) & ~possible).any(1)
        return self.counted(stress), possible

    def counted(self, readings: Array) -> Array:
        """Stresses as what is read: themselves, or by how much they drop, shape (readings,)."""
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
        across = np.select([mode == "uniaxial", mode == "pure_shear"],
                           [free ** (1 - rig.width_held), along ** (-0.5 * rig.width_let)], along)
        law = np.asarray(film.material.derivatives(along, across)[1])
        return warmth * (law + pull) + field.derivatives(along, across)[1], possible

    def _branch_pull(self, film: Film, rig: Rig, rows: Numbers) -> Array:
        """Nominal stress of a film's branches at the usual temperature [Pa], shape (rows,)."""
        if not film.branches or not self.coupons.in_time:
            return np.zeros(len(rows))
        if any(branch.flow != ConstantFlow() for branch in film.branches):
            raise InputError("must be constant in the branches of films whose coupons are judged",
                             key="flow", given=film.branches[0].flow.flow)
        moduli = np.array([branch.modulus for branch in film.branches])
        logs = np.log([branch.time for branch in film.branches])
        pull = _looked_up(self.branches, logs)[rows] @ moduli
        moved = np.select([self.coupons.mode[rows] == "uniaxial",
                           self.coupons.mode[rows] == "pure_shear"],
                          [rig.width_held, rig.width_let], 0.0)
        if moved.any():
            other = _looked_up(self.other_width, logs)[rows] @ moduli
            pull = (1 - moved) * pull + moved * other
        return np.asarray(pull)

    @cached_property
    def branches(self) -> BranchStress:
        """Stress of branches of unit modulus in the tests as their modes are stated."""
        return BranchStress.of(self.coupons)

    @cached_property
    def other_width(self) -> BranchStress:
        """The same with free widths held and held ones free."""
        mode = self.coupons.mode
        other = np.select([mode == "uniaxial", mode == "pure_shear"], ["pure_shear", "uniaxial"],
                          mode)
        return BranchStress.of(replace(self.coupons, mode=other))

    def feel(self, cause: Cause) -> bool:
        """Whether an effect changes anything that the readings depend on."""
        if cause not in self._felt:
            usual = [item.deviation for item in cause.effect.parameters]
            try:
                changed = self.seen_of(cause.effect.at(self.setup, usual, cause.which))
                self._felt[cause] = changed != self.seen_of(self.setup)
            except InputError:  # of what such a specimen does not have
                self._felt[cause] = False
        return self._felt[cause]

    @cached_property
    def _felt(self) -> dict[Cause, bool]:
        return {}

    def seen_of(self, setup: Setup) -> tuple[Any, ...]:
        """All of a setup that these tests may depend on."""
        rig, timed = setup.rig, self.coupons.in_time
        films = [(film.material, maxwell(specimen, 1.0), film.temperature_power,
                  film.branches if timed else ())
                 for specimen in setup.specimens for film in (specimen.membrane,)]
        modes = self.coupons.modes
        return (tuple(films), *np.asarray(rig.film_voltage(self.coupons.volts)).tolist(),
                rig.width_held if "uniaxial" in modes else 0.0,
                rig.width_let if "pure_shear" in modes else 0.0)


def _looked_up(stress: BranchStress, logs: Array) -> Array:
    """Of branches with these logarithms of times, those beyond what tests tell at its end."""
    return stress.columns(np.clip(logs, *stress.bounds))


def _stiffer(at_rest: Any, pull: Array) -> Array:
    """How many times as stiff as at rest branches make a strip: across as much as along."""
    tiny = 1e-6 * np.abs(at_rest).max(initial=1e-300)
    ratio = np.divide(pull, at_rest, out=np.zeros_like(pull), where=np.abs(at_rest) > tiny)
    return np.asarray(1 + np.maximum(ratio, 0.0), float)


def _width(film: Film, field: Any, stiffer: Array, along: Array) -> tuple[Array, Any]:
    """Stretch across a strip on which nothing pulls there, and whether there is one."""
    start = along**-0.5
    across, done = start.copy(), np.zeros(len(along), bool)
    for _ in range(_STEPS):
        elastic, electric = (part.derivatives(along, across) for part in (film.material, field))
        force = stiffer * elastic[2] + electric[2]
        rate = stiffer * elastic[5] + electric[5]
        # By the logarithm, in which laws are nearly straight; outwards where it is not stable.
        slope = rate * across + force
        step = np.where(slope > 0, -force / np.where(slope > 0, slope, 1.0), _LARGEST)
        across = across * np.exp(np.clip(step, -_LARGEST, _LARGEST))
        across = np.clip(across, start / _WIDEST, _WIDEST * start)
        done = np.abs(step) < _THERE
        if done.all():
            break
    return across, done


def coupon_setup(setup: Setup, unknowns: Array, uses: Iterable[Use]) -> Setup:
    """The setup with the factors on stiffness, branches' too, and permittivity; then with effects.

    Readings of stress do not tell a thickness from a modulus, so one factor is on both.
    """
    stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()

    def change(film: Film) -> Film:
        return replace(
            with_factors(film, stiffness, permittivity), branches=tuple(
                replace(branch, modulus=stiffness * branch.modulus) for branch in film.branches))

    return extended(setup.with_films(change), uses)


class CouponPrediction:
    """What rows of coupons show at some unknowns; with the readings' names of a film's prediction.

    ``rows`` are numbers of those judged; between ``bounds``, shape (2, unknowns), derivatives are
    taken.
    """

    def __init__(self, tests: CouponTests, hypothesis: Hypothesis, unknowns: Array, rows: Numbers,
                 bounds: Array) -> None:
        self.tests, self.hypothesis, self.unknowns, self.rows = tests, hypothesis, unknowns, rows
        self.bounds = bounds
        self.extended, possible = self._shown(unknowns)
        self.possible: NDArray[np.bool_] = possible[tests.rows[rows]]
        self.short = np.zeros(len(rows), bool)
        #: No plate moves.
        self.heave = np.zeros(len(rows))

    @property
    def complete(self) -> bool:
        """Whether all that was read is possible."""
        return bool(self.possible.all())

    def beyond(self, before: CouponPrediction) -> bool:
        """Whether a search must not go here, from where all is possible.

        What a strip without equilibrium shows leads nowhere.
        """
        return before.complete and not self.complete

    @property
    def values(self) -> Array:
        """What each row shows [Pa], nan where a strip has no equilibrium."""
        return np.where(self.possible, self.extended, np.nan)

    def _shown(self, unknowns: Array) -> tuple[Array, NDArray[np.bool_]]:
        """What each row shows, and which readings have an equilibrium."""
        tests, uses = self.tests, uses_of(self.hypothesis, unknowns)
        felt = [use for cause, use in zip(self.hypothesis, uses, strict=True) if tests.feel(cause)]
        shown, possible = tests.shown(coupon_setup(tests.setup, unknowns, felt))
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
