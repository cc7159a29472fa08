"""What a reduced film's steps are found with: first guesses, Broyden's corrections."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.transient.collocation import radau
from tympan.geometry.specimen import ViscousBranch
from tympan.studies.case import Settings, build_model
from tympan.studies.films.corrections import Corrections, factorised
from tympan.studies.films.film import FilmLoads, NoBalance, ReducedFilm
from tympan.studies.films.heave_path import HeavePath, HeaveSamples
from tympan.studies.films.reduction import film_of_runs
from tympan.studies.films.sampling import by_voltages

FORCES = 0.17554, 0.22016
PLAIN = circular(NeoHooke(20e3))


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


@cache
def film() -> ReducedFilm:
    branch = ViscousBranch(200e3, 10.0)
    specimen = replace(PLAIN, membrane=replace(PLAIN.membrane, branches=(branch,)))
    return film_of_runs(build_model(specimen, Settings()), FORCES, 7e3).tabulated


def solved(force: float, spring: float = 0.0) -> np.ndarray:
    """By Newton's method from the flat film, without the path."""
    loads = FilmLoads(force, 0.0, spring)
    return film().carried(film().flat, FilmLoads(0.0, 0.0), loads, last=1e-9)


@pytest.mark.parametrize("spring", [0.0, 20.0])
def test_a_film_at_rest_is_on_its_path(spring: float) -> None:
    path, forces = film().path, np.array([0.01, 0.1, *FORCES, 0.4])
    assert path is not None
    together = path.at_rest(forces, spring)
    assert together is not None
    for q, force in zip(together, forces.tolist(), strict=True):
        assert q == pytest.approx(solved(force, spring), abs=1e-9 * film().specimen.gap)
        assert path.at_rest(force, spring) == pytest.approx(q, abs=1e-15)


def test_a_film_beyond_its_path_is_solved_for() -> None:
    """Forces below none and above its end, alone or among others."""
    path = film().path
    assert path is not None
    for force in (-0.1, 1.2):
        assert path.at_rest(np.array([force, 0.1]), 0.0) is None
        q = film().at_rest(FilmLoads(force, 0.0), 1e-9)
        assert q == pytest.approx(solved(force), abs=1e-9 * film().specimen.gap)


def flowing(begin: np.ndarray, duration: float) -> StagedFlow:
    """From rest there, over a step that begins with a jump."""
    return StagedFlow.of(film().relaxed(begin), film().strain(begin), duration,
                         radau(5).from_start)


@pytest.mark.parametrize(("high", "near"), [(1e3, 1e-3), (3e3, 1e-2), (6e3, 0.08)])
@pytest.mark.parametrize("spring", [0.0, 20.0])
def test_a_jump_leads_nearly_where_the_film_goes_at_once(high: float, near: float, spring: float
                                                         ) -> None:
    """Beside a spring less so: that holds back what a film that softens would go on by."""
    begin = solved(FORCES[0], spring)
    loads = FilmLoads(FORCES[0], 0.0, spring), FilmLoads(FORCES[0], high**2, spring)
    flow = film().relaxed(begin).step(film().strain(begin), 0.0)
    moved = film().carried(begin, *loads, flow, last=1e-9) - begin
    led = film().led(begin, *loads, flowing(begin, 1.0))[0] - begin
    assert np.abs(led - moved).max() < (near + 0.1 * (spring > 0)) * np.abs(moved).max()


def test_a_jump_leads_nearly_where_the_film_creeps() -> None:
    """At the last stage of a long step, where its branch is relaxed."""
    begin, loads = solved(FORCES[0]), (FilmLoads(FORCES[0], 0.0), FilmLoads(FORCES[0], 9e6))
    led = film().led(begin, *loads, flowing(begin, 300.0))
    moved = film().at_rest(loads[1], 1e-9)[0] - begin[0]
    assert led[-1, 0] - begin[0] == pytest.approx(moved, rel=0.03)
    assert led[0, 0] - begin[0] < 0.97 * moved


def test_a_jump_off_the_path_leads_nowhere() -> None:
    q = np.stack([solved(FORCES[0]), solved(FORCES[1])])
    high = np.array([3e3, 40e3]) ** 2
    led = film().led(q, FilmLoads(0.0, np.zeros(2)), FilmLoads(0.0, high), flowing(q, 1.0))
    assert led.shape == (2, 6, film().count)
    assert (led[0, :, 0] > q[0, 0]).all()
    assert (led[1] == q[1]).all()


def test_a_film_that_no_polynomial_gives_has_no_path() -> None:
    """As one that has a kink; here of what is smooth, and of the same with one."""
    path = film().path
    assert path is not None
    heaves = path.samples.heaves
    between = (heaves[1:] + heaves[:-1]) / 2

    def bent(places: np.ndarray, power: int) -> HeaveSamples:
        column = np.abs(places - heaves.mean()) ** power
        return HeaveSamples(places, places, column, column, *3 * [column[:, None]])

    smooth = bent(heaves, 2), bent(between, 2)
    assert HeavePath.of(*smooth) is not None
    assert HeavePath.of(bent(heaves, 1), bent(between, 1)) is None
    softening = replace(smooth[0], force=smooth[0].q[:, 0])
    assert HeavePath.of(softening, smooth[1]) is None, "its force has two heaves"
