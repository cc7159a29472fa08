"""What a reduced film's steps are found with: first guesses by voltages, Broyden's corrections."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.studies.reduced_film.corrections import Corrections, factorised
from tympan.studies.reduced_film.film import NoBalance
from tympan.studies.reduced_film.sampling import by_voltages


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


def _stretched(x: np.ndarray) -> np.ndarray:
    """Springs between neighbours that stiffen, over two stages and three shapes."""
    flat = x.reshape(*x.shape[:-2], 6)
    ends = np.diff(flat, prepend=0.0)
    pull = ends + 0.3 * ends**3
    return (pull - np.append(pull[..., 1:], 0 * pull[..., :1], -1)).reshape(x.shape)


@pytest.mark.parametrize("runs", [(), (2,)])
def test_corrections_learn_what_the_tangent_has_become(runs: tuple[int, ...]) -> None:
    """They need fewer than half of those by the same tangent alone, each run as if by itself."""
    load = np.tile(0.05 * np.arange(1.0, 7.0).reshape(2, 3), (*runs, 1, 1))
    if runs:
        load[1] *= 0.5
    matrix = 2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1)
    matrix[-1, -1] = 1.0
    stiffness = np.broadcast_to(matrix, (*runs, 6, 6)).reshape(*runs, 2, 3, 2, 3)
    counts = []
    for learns in (True, False):
        x, corrections, count = np.zeros_like(load), Corrections(factorised(stiffness)), 0
        while np.abs(pull := _stretched(x) - load).max() > 1e-9 and count < 200:
            x = x - (corrections.correction(pull) if learns else corrections.solve(pull))
            count += 1
        counts.append(count)
    assert counts[0] < counts[1] / 2 < 100


def test_a_singular_tangent_is_no_balance() -> None:
    for runs in ((), (2,)):
        with pytest.raises(NoBalance):
            factorised(np.zeros((*runs, 2, 1, 2, 1)))(np.ones((*runs, 2, 1)))
