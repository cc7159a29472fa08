"""Coupons weighed together with actuators of the same film: their rows in one table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Film
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.coupon_tests import CouponTests
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup

Array = NDArray[np.float64]

#: By what share the stiffness of strips, and what voltage takes from their stress, usually differ
#: from the actuators' film: makers of cast films and tapes state their thickness to 5 to 10 %, and
#: what an actuator's grease stiffens and a load's label is off is in its factors alone.
BATCH = 0.1

#: Of a permittivity that is as good as none, over the stated one.
_NONE = 1e-9


def of_one_film(setup: Setup, tests: CouponTests) -> bool:
    """Whether every strip is of a film that an actuator of a setup has."""
    films = [specimen.membrane for specimen in setup.specimens]
    return all(specimen.membrane in films for specimen in tests.setup.specimens)


def weighed_together(simulation: Simulation, table: ReadingTable, coupons: Judgement
                     ) -> tuple[Simulation, ReadingTable]:
    """A simulation of actuators with coupons beside them, and their table with the coupons' rows.

    ``coupons`` are judged by themselves before, and so is their noise. Their stiffness and
    permittivity are the actuators' but for a share, :data:`BATCH`, that is integrated over: as an
    error that all strips have in common.
    """
    tests, best = coupons.simulation.coupons, coupons.chosen or coupons.nominal
    assert tests is not None
    lasting = _of_batch(tests, coupons.simulation.extended(best.hypothesis, best.unknowns))
    sigma = coupons.table.sigma
    tests = replace(tests, lasting=lasting if tests.lasting is None else lasting + tests.lasting
                    ).with_noise(sigma)
    values = tests.judged(tests.counted(tests.coupons.stress))
    return replace(simulation, coupons=tests), table.joined(
        _rows(tests, sigma, values, float(table.states.mass.max(initial=0.0))))


def _of_batch(tests: CouponTests, best: Setup) -> Array:
    """Covariance of rows whose films differ from the actuators' [Pa²], shape (rows, rows).

    By what the best model of the coupons says: by what was read, what films differ by would be
    along the readings' own noise.
    """
    def uncharged(film: Film) -> Film:
        return replace(film, relative_permittivity=_NONE * film.relative_permittivity)

    whole, law = (tests.shown(setup)[0] for setup in (best, best.with_films(uncharged)))
    parts = BATCH * np.stack([law, law - whole])[:, tests.rows]
    return np.asarray(parts.T @ parts)


def _rows(tests: CouponTests, sigma: Array, values: Array, mass: float) -> ReadingTable:
    """Rows of one state: of a plate, of some mass [kg], that is held where the film is flat."""
    count = len(tests.rows)
    number, none = np.zeros(count, np.int64), np.zeros(count)
    states = States.of(number, np.full(count, mass), none)
    every = rows(replace(states, heave=none), "stress", sigma, values,
                 file=tests.coupons.file[tests.rows], line=tests.coupons.line[tests.rows])
    return replace(every, states=every.states[number[:1]], state=number,
                   point=np.arange(count))
