"""The one noise of readings, against the covariance that it stands for, written out."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.studies.estimation.noise import Noise, NoiseMemory, Off, Shared, root_of

RANDOM = np.random.default_rng(3)
COUNT = 12
#: Standard deviations that differ, and such as are alike.
SIGMAS = (np.exp(RANDOM.normal(size=COUNT)), np.full(COUNT, 0.3))
#: A run whose errors last, as those of first order do: half of one is left in the next.
RUN = np.arange(2, 9)
LASTING = 4.0 * 0.5 ** np.abs(RUN[:, None] - RUN)
#: Two readings that share a gain.
GAIN = np.array([0, 10])


#: Two runs whose errors remember, their readings in no order; one reading remembers nothing.
MEMORY = NoiseMemory(np.array([0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11]),
                np.array([0, 0, 1, 0, 1, 0, 1, 1, 0, 0, 1]),
                np.array([0.1, 3.0, 0.4, 0.2, 0.7, 2.9, 0.1, 1.9, 0.5, 0.9, 1.0]),
                np.array([1.0, 0.5, 1.0, 0.9, 0.3, 0.5, 0.7, 1.0, 0.2, 0.6, 1.0]))


def noise_of(sigma: np.ndarray, memory: NoiseMemory | None = None) -> Noise:
    """Independent errors, a run whose errors last, and two readings with a gain in common."""
    common = Shared.of(RUN, root_of(LASTING)), Shared.of(GAIN, np.array([[2.0], [3.0]]))
    return Noise(sigma).plus(*common, *([] if memory is None else [memory]))


def covariance(sigma: np.ndarray, memory: NoiseMemory | None = None) -> np.ndarray:
    """The same, written out."""
    matrix = np.diag(sigma**2)
    if memory is not None:
        same = memory.run[:, None] == memory.run
        correlation = np.exp(-np.abs(memory.clock[:, None] - memory.clock))
        correlation *= np.sqrt(np.outer(memory.share, memory.share))
        every = np.eye(COUNT)
        every[np.ix_(memory.rows, memory.rows)] = np.where(same, correlation, 0.0)
        np.fill_diagonal(every, 1.0)
        matrix = np.outer(sigma, sigma) * every
    matrix[np.ix_(RUN, RUN)] += LASTING
    matrix[np.ix_(GAIN, GAIN)] += np.outer([2.0, 3.0], [2.0, 3.0])
    return matrix


@pytest.mark.parametrize("memory", [None, MEMORY], ids=["forgets", "remembers"])
@pytest.mark.parametrize("sigma", SIGMAS, ids=["unlike", "alike"])
def test_whitened_errors_weigh_as_by_cholesky(sigma: np.ndarray, memory: NoiseMemory | None
                                              ) -> None:
    """χ² and volume, for residuals and for the columns of a Jacobian; and back again."""
    noise, matrix = noise_of(sigma, memory), covariance(sigma, memory)
    root = np.linalg.cholesky(matrix)
    errors = RANDOM.normal(size=(COUNT, 5))
    white, by_root = noise.whitened(errors), np.linalg.solve(root, errors)
    assert white.T @ white == pytest.approx(by_root.T @ by_root, rel=1e-12)
    assert noise.whitened(errors[:, 0]) == pytest.approx(white[:, 0])
    assert noise.coloured(white) == pytest.approx(errors, rel=1e-12)
    every = noise.whitened(np.eye(COUNT))
    assert every @ matrix @ every.T == pytest.approx(np.eye(COUNT), abs=1e-12)
    assert noise.log_volume + np.log(sigma).sum() == pytest.approx(
        np.log(np.diag(root)).sum(), rel=1e-12)
    assert noise.total == pytest.approx(np.sqrt(np.diag(matrix)))


@pytest.mark.parametrize("memory", [None, MEMORY], ids=["forgets", "remembers"])
@pytest.mark.parametrize("rows", [np.arange(COUNT) < 5, np.array([11, 4, 0, 10])])
def test_some_readings_have_the_covariance_of_these(rows: np.ndarray, memory: NoiseMemory | None
                                                    ) -> None:
    white = noise_of(SIGMAS[0], memory)[rows].whitened(np.eye(len(np.arange(COUNT)[rows])))
    some = np.arange(COUNT)[rows]
    assert white @ covariance(SIGMAS[0], memory)[np.ix_(some, some)] @ white.T == pytest.approx(
        np.eye(len(some)), abs=1e-12)


@pytest.mark.parametrize("memories", [(MEMORY, None), (None, MEMORY), (MEMORY, MEMORY)])
def test_joined_readings_remember_only_their_own(memories: tuple[NoiseMemory | None, ...]) -> None:
    first, second = (noise_of(SIGMAS[0], memory) for memory in memories)
    both = first.joined(second).whitened(np.eye(2 * COUNT))
    matrix = np.zeros((2 * COUNT, 2 * COUNT))
    matrix[:COUNT, :COUNT] = covariance(SIGMAS[0], memories[0])
    matrix[COUNT:, COUNT:] = covariance(SIGMAS[0], memories[1])
    assert both @ matrix @ both.T == pytest.approx(np.eye(2 * COUNT), abs=1e-11)


def test_a_reading_that_is_off_is_forgotten_by_those_after_it() -> None:
    """In effect it is left out: what is known of others is as without it."""
    off, others_of = Off(np.array([3]), np.array([1e9])), np.arange(COUNT) != 3
    errors = RANDOM.normal(size=COUNT)
    white = noise_of(SIGMAS[0], MEMORY).plus(off).whitened(errors)
    others = noise_of(SIGMAS[0], MEMORY)[others_of].whitened(errors[others_of])
    assert white @ white == pytest.approx(others @ others, rel=1e-6)


def test_errors_in_common_add_up_and_stay_as_large() -> None:
    """Of readings that others join, where more is in common, and with a louder noise of each."""
    first, second = map(noise_of, SIGMAS)
    column = RANDOM.normal(size=(2 * COUNT, 1))
    both = first.joined(second).plus(Shared.of(np.arange(2 * COUNT), column))
    louder = both.times(3.0)
    matrix = np.zeros((2 * COUNT, 2 * COUNT))
    for number, sigma in enumerate(SIGMAS):
        place = slice(number * COUNT, (number + 1) * COUNT)
        matrix[place, place] = covariance(3 * sigma)
    white = louder.whitened(np.eye(2 * COUNT))
    assert white @ (matrix + column @ column.T) @ white.T == pytest.approx(
        np.eye(2 * COUNT), abs=1e-11)
    half = Noise(np.ones(2 * COUNT)).plus(*(some.times(0.5) for some in both.common))
    assert half.total**2 - 1 == pytest.approx((both.total**2 - both.sigma**2) / 4)


def test_what_each_reading_is_off_by_alone_gets_louder_and_nothing_else_does() -> None:
    """Its own error and that of a reading that is off, each by its factor; and back again."""
    factor = np.exp(RANDOM.normal(size=COUNT))
    noise = noise_of(SIGMAS[0], MEMORY).plus(Off(np.array([2, 5]), np.array([3.0, 4.0])))
    louder = noise.times(factor)
    assert louder.sigma == pytest.approx(factor * np.hypot(SIGMAS[0], noise.off))
    assert louder.off[[2, 5]] == pytest.approx(factor[[2, 5]] * [3.0, 4.0])
    assert louder.total**2 - louder.sigma**2 == pytest.approx(noise.total**2 - noise.sigma**2)
    plain = louder.times(1 / factor).ordinary
    assert plain.total == pytest.approx(noise_of(SIGMAS[0]).total)
    assert plain.memories == ()


def test_a_zero_in_common_leaves_of_a_mean_what_its_size_says() -> None:
    """Of n readings 1/√(1 + n z²/σ²), and nothing of what they differ by."""
    noise = Noise(np.full(COUNT, 2.0)).plus(Shared.zero(COUNT, 30.0))
    values = RANDOM.normal(size=COUNT)
    left = noise.apart(values + 7.0)
    assert left - left.mean() == pytest.approx(values - values.mean())
    assert left.mean() == pytest.approx((values.mean() + 7.0) / (1 + COUNT * 15.0**2) ** 0.5)


def test_errors_are_drawn_as_they_are_weighed() -> None:
    random, noise = np.random.default_rng(1), noise_of(SIGMAS[0])
    sets = np.array([noise.drawn(random) for _ in range(40_000)])
    scale = np.sqrt(np.diag(covariance(SIGMAS[0])))
    assert np.cov(sets.T) / np.outer(scale, scale) == pytest.approx(
        covariance(SIGMAS[0]) / np.outer(scale, scale), abs=0.03)


def test_parts_stay_parts_only_where_their_noise_was_found() -> None:
    stated = Noise.of(np.ones(2), "stated")
    assert stated.joined(stated).freedom.tolist() == [8.0]
    assert Noise.of(np.ones(2), "from repeats").freedom.tolist() == [0.0]
    found = stated.known(5.0).joined(stated.known(30.0))
    assert found.freedom.tolist() == [5.0, 30.0]
    assert found.part.tolist() == [0, 0, 1, 1]
    assert found[np.array([False, True, True, False])].part.tolist() == [0, 1]


def test_many_readings_forget_as_few_do() -> None:
    """One after the other, where a matrix would be large."""
    count = 900
    memory = NoiseMemory(np.arange(count), np.arange(count) // 300, RANDOM.uniform(0, 30, count),
                    RANDOM.uniform(0.1, 1.0, count))
    values = RANDOM.normal(size=(count, 2))
    many = memory.forgotten(values)
    for run in range(3):
        rows = memory.run == run
        few = memory.among(np.flatnonzero(rows))
        assert few.forgotten(values[rows]) == pytest.approx(many[rows], abs=1e-9)
    assert memory.remembered(many) == pytest.approx(values, abs=1e-9)
