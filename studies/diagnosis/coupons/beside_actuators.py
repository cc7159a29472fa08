"""Coupons weighed together with actuators of the same film: their rows in one table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.specimen import Film
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable, States
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
    batch = _of_batch(tests, coupons.simulation.extended(best.hypothesis, best.unknowns))
    noise = coupons.table.noise.known(coupons.test.freedom).with_shared(
        np.arange(len(tests.rows)), batch)
    # All of one state: of a plate, under some mass, that is held where the film is flat.
    mass = float(table.states.mass.max(initial=0.0))
    flat = replace(States.of([0], [mass], [0.0]), heave=np.zeros(1))
    strips = replace(coupons.table, states=flat, state=0 * coupons.table.state, noise=noise)
    return replace(simulation, coupons=tests), table.joined(strips)


def _of_batch(tests: CouponTests, best: Setup) -> Array:
    """What rows show whose films differ from the actuators' [Pa], shape (rows, 2).

    By what the best model of the coupons says: by what was read, what films differ by would be
    along the readings' own noise.
    """
    def uncharged(film: Film) -> Film:
        return replace(film, relative_permittivity=_NONE * film.relative_permittivity)

    whole, law = (tests.shown(setup)[0] for setup in (best, best.with_films(uncharged)))
    return np.asarray(BATCH * np.stack([law, law - whole], axis=1)[tests.rows])
