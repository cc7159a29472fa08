"""What a reduced film's steps are found with: first guesses, tangents."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.studies.films.collocated_step import factorised
from tympan.studies.films.film import NoBalance
from tympan.studies.films.sampling import by_voltages


def test_what_follows_voltages_and_time_is_led_on() -> None:
    """Of two runs at once, one of which has a constant voltage and only creeps."""
    time, later = np.array([-1.0, -0.8, -0.4, -0.2, 0.0]), np.array([0.3, 0.7, 1.1])

    def squared(times: np.ndarray) -> np.ndarray:
        return np.stack([9e6 * (1.2 + np.sin(2 * times)), 4e6 + 0 * times])

    def values(times: np.ndarray) -> np.ndarray:
        share = squared(times)[..., None] / 1e7
        return times[:, None] * [1e-4, 2e-5] + share * [1e-3, 0.0] + share**2 * [0.0, 3e-4]

    led = by_voltages(time, squared(time), values(time), later, squared(later))
    assert led == pytest.approx(values(later), abs=1e-8)
    alone = by_voltages(time, squared(time)[0], values(time)[0], later, squared(later)[0])
    assert alone == pytest.approx(led[0], abs=1e-12)


def test_a_singular_tangent_is_no_balance() -> None:
    for runs in ((), (2,)):
        with pytest.raises(NoBalance):
            factorised(np.zeros((*runs, 2, 1, 2, 1)))(np.ones((*runs, 2, 1)))
