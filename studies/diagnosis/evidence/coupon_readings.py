"""coupon.csv as a table to predict: the film and noise of each reading, and which are judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.data.checks import slips_of_unit
from tympan.studies.data.coupon import Coupons
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.evidence.coupons import CouponTests
from tympan.studies.diagnosis.evidence.kind import ASSUMED, FEWEST, PreparedReadings
from tympan.studies.diagnosis.reading_table import ReadingTable, States, evenly_chosen, rows
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import SCATTER, Noise, Shared, root_of
from tympan.studies.files import words_beside

#: Sentences on what is done to readings and what is wrong with them.
WORDS = words_beside(__file__)

#: Most readings of a run that are judged. Those between add little, and correlated noise would
#: count as many independent readings.
MOST = 30

#: Degree of the polynomial whose residuals over a leg are taken as noise. Set by trial.
_DEGREE = 5
#: Readings per coefficient; with fewer the degree is reduced. A higher degree would follow the
#: noise.
_PER_COEFFICIENT = 1.5
#: Least noise as a share of the readings, however small their scatter: no law is much closer.
_QUIETEST = 0.002

#: Degrees of freedom from which a scatter is taken as known.
_KNOWN = 6

#: Change of the stretch over a run's range from which a strip is no longer held.
_HELD = 1e-3

#: Correlation length of differences between strips, in the logarithm of the stretch.
_LASTS = 0.5

#: Factor beyond which stresses come from a wrong unit, not from a stiffer or softer film.
_SLIP = 100.0

#: Largest stretch beyond the run without voltage at which a drop is still counted.
_BEYOND = 1e-3


def coupon_readings(dataset: Dataset) -> PreparedReadings:
    """Prepare coupon.csv; raise an :class:`InputError` if nothing can be concluded from it."""
    coupons = dataset.coupons
    if coupons is None or len(coupons) < FEWEST:
        raise InputError(WORDS["few"].format(fewest=FEWEST), key="readings",
                         given=0 if coupons is None else len(coupons))
    for slip in slips_of_unit(dataset):
        raise InputError(slip, key=dataset.name)
    setup, film = _films(dataset, coupons)
    legs, keys, references = list(_legs(coupons, film)), _keys(coupons, film), None
    values, remarks = coupons.stress, []
    if dataset.coupon_reading == "drop":
        references, legs = _references(coupons, film, legs)
        values = references @ coupons.stress - coupons.stress
        if sum(map(len, legs)) < FEWEST:
            raise InputError(WORDS["no_drops"], key="coupon_reading", given="drop")
        remarks.append(WORDS["drops"].format(count=sum(map(len, legs))))
    noise = _noise(coupons, references, values, legs)
    judged = list(_thinned(legs, keys))
    chosen = np.concatenate(judged)
    if len(chosen) < sum(map(len, legs)):
        remarks.append(WORDS["thinned"].format(every=sum(map(len, legs)), kept=len(chosen),
                                               most=MOST))
    leg = np.concatenate([np.full(len(part), number) for number, part in enumerate(judged)])
    tests, noise = CouponTests(setup, coupons, film, chosen, leg, references), noise[chosen]
    _refuse_slip_of_stress(tests)
    if dataset.strip_scatter:
        remarks.append(WORDS["scatter"].format(share=dataset.strip_scatter))
        noise = _with_lasting(noise, tests, keys, dataset.strip_scatter)
    table = _table(coupons, tests).with_values(values[chosen]).with_noise(noise)
    return PreparedReadings(setup, table, (tests,), tuple(remarks))


def _refuse_slip_of_stress(tests: CouponTests) -> None:
    """Raise an :class:`InputError` for stresses that no film of the stated kind has."""
    if tests.references is not None:
        return
    shown = float(np.abs(tests.shown(tests.setup)[0]).sum())
    ratio = float(np.abs(tests.coupons.stress).sum()) / max(shown, 1e-300)
    if not 1 / _SLIP < ratio < _SLIP:
        raise InputError(WORDS["slip"].format(ratio=ratio), file="coupon.csv")


def _with_lasting(noise: Noise, tests: CouponTests, keys: Array, scatter: float) -> Noise:
    """Add noise for strips whose stresses differ by a share.

    The share varies smoothly with the logarithm of the stretch along a run, and is independent
    between runs.
    """
    coupons, rows = tests.coupons, tests.rows
    squared = coupons.stress[rows] ** 2
    if tests.references is not None:
        squared = squared + (tests.references[rows] @ coupons.stress) ** 2
    size = scatter * np.sqrt(squared)
    along = np.log(coupons.stretch[rows])
    runs = np.unique(keys[rows], axis=0, return_inverse=True)[1].ravel()
    for run in range(int(runs.max()) + 1):
        mine = np.flatnonzero(runs == run)
        near = np.exp(-0.5 * ((along[mine][:, None] - along[mine]) / _LASTS) ** 2)
        lasting = root_of(np.outer(size[mine], size[mine]) * near)
        noise = noise.plus(Shared.of(mine, lasting))
    return noise


def _films(dataset: Dataset, coupons: Coupons) -> tuple[Setup, Numbers]:
    """Find the specimens whose films were tested, and the number of the film of each reading."""
    names = [specimen.name for specimen in dataset.specimens]
    only = 0 if all(specimen.membrane == dataset.specimens[0].membrane
                    for specimen in dataset.specimens) else None
    film = np.empty(len(coupons), np.int64)
    for strip in np.unique(coupons.specimen).tolist():
        number = names.index(strip) if strip in names else only
        if number is None:
            raise InputError(WORDS["whose"].format(names=", ".join(names)), file="coupon.csv",
                             key="specimen", given=strip)
        film[coupons.specimen == strip] = number
    used, numbers = np.unique(film, return_inverse=True)
    specimens: list[Specimen] = [dataset.specimens[number] for number in used.tolist()]
    return Setup(tuple(specimens), dataset.rig), numbers.ravel().astype(np.int64)


def _keys(coupons: Coupons, film: Numbers) -> Array:
    """Build keys that readings of one run share, shape (readings, 6)."""
    labels = [np.unique(values, return_inverse=True)[1].ravel().astype(float)
              for values in (coupons.specimen, coupons.run, coupons.mode)]
    return np.stack([film.astype(float), labels[2], coupons.degrees, coupons.volts, *labels[:2]],
                    axis=1)


def _legs(coupons: Coupons, film: Numbers) -> Iterator[Numbers]:
    """Yield the legs of each run in time: up to its largest stretch, and from there back."""
    keys = _keys(coupons, film)
    numbers = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    for run in range(int(numbers.max()) + 1):
        part = np.flatnonzero(numbers == run)
        if np.isfinite(coupons.time[part]).all():
            part = part[np.argsort(coupons.time[part], kind="stable")]
        top = int(np.abs(coupons.stretch[part] - 1).argmax()) + 1
        # A run whose stretch is held, or does not come back, is one leg.
        back = float(np.ptp(coupons.stretch[part[top - 1:]]))
        if len(part) - top < FEWEST or back < 0.1 * float(np.ptp(coupons.stretch[part])):
            top = len(part)
        yield from filter(len, (part[:top], part[top:]))


def _references(coupons: Coupons, film: Numbers, legs: list[Numbers]
                ) -> tuple[Array, list[Numbers]]:
    """Build the shares of readings that each is counted from, and the legs that are judged."""
    keys, shares = _keys(coupons, film)[:, :3], np.zeros((len(coupons), len(coupons)))
    outward = [_outward(coupons, leg) for leg in legs]
    judged = []
    for leg, out in zip(legs, outward, strict=True):
        if not coupons.volts[leg[0]]:
            continue
        plain = [other for other, away in zip(legs, outward, strict=True)
                 if not coupons.volts[other[0]] and away == out
                 and np.array_equal(keys[other[0]], keys[leg[0]])]
        if not plain:
            continue
        order = plain[0][np.argsort(coupons.stretch[plain[0]], kind="stable")]
        stretch = coupons.stretch[order]
        inside = leg[(coupons.stretch[leg] >= stretch[0] - _BEYOND)
                     & (coupons.stretch[leg] <= stretch[-1] + _BEYOND)]
        place = np.clip(np.searchsorted(stretch, coupons.stretch[inside]), 1, len(order) - 1)
        width = np.maximum(stretch[place] - stretch[place - 1], 1e-12)
        upper = np.clip((coupons.stretch[inside] - stretch[place - 1]) / width, 0.0, 1.0)
        shares[inside, order[place]] += upper
        shares[inside, order[place - 1]] += 1 - upper
        if len(inside):
            judged.append(inside)
    return shares, judged


def _outward(coupons: Coupons, leg: Numbers) -> bool:
    """Check whether a leg moves away from the virgin stretch."""
    away = np.abs(coupons.stretch[leg] - 1)
    return bool(away[-1] >= away[0])


def _thinned(legs: list[Numbers], keys: Array) -> Iterator[Numbers]:
    """Thin the legs of long runs to fewer, evenly spaced readings."""
    runs = [tuple(keys[leg[0]].tolist()) for leg in legs]
    lengths = Counter[tuple[float, ...]]()
    for run, leg in zip(runs, legs, strict=True):
        lengths[run] += len(leg)
    for run, leg in zip(runs, legs, strict=True):
        yield evenly_chosen(leg, max(2, round(min(1.0, MOST / lengths[run]) * len(leg))))


def _noise(coupons: Coupons, references: Array | None, values: Array, legs: list[Numbers]
           ) -> Noise:
    """Estimate the noise of each reading [Pa]; with few readings the stated noise counts more."""
    every = np.concatenate(legs)
    size = float(np.sqrt(np.mean(values[every] ** 2))) or 1.0
    squares, freedom = 0.0, 0
    for leg in (part for whole in legs for part in _smooth(coupons, whole)):
        degree = min(_DEGREE, int(len(leg) / _PER_COEFFICIENT) - 2)
        if degree >= 1:
            basis = legendre.legvander(np.linspace(-1, 1, len(leg)), degree)
            rest = values[leg] - basis @ np.linalg.lstsq(basis, values[leg], rcond=None)[0]
            squares, freedom = squares + float(rest @ rest), freedom + len(leg) - degree - 1
    measured = freedom >= _KNOWN
    scatter = (squares / freedom) ** 0.5 if measured else ASSUMED * size
    estimated = np.full(len(coupons), max(scatter, _QUIETEST * size))
    if coupons.sigma is None:
        return Noise(estimated, source=SCATTER if measured else "assumed")
    sigma = coupons.sigma
    if references is not None:
        squared = np.nan_to_num(sigma, nan=scatter) ** 2
        sigma = np.sqrt(squared + references**2 @ squared)
    stated = np.isfinite(sigma[every]).all()
    return Noise(np.where(np.isfinite(sigma), sigma, estimated),
                 source="stated" if stated else SCATTER)


def _smooth(coupons: Coupons, leg: Numbers) -> list[Numbers]:
    """Split a leg into parts with smooth stress: while it is stretched, and while it is held."""
    stretch = coupons.stretch[leg]
    moves = np.abs(np.diff(stretch)) > _HELD * max(float(np.ptp(stretch)), _HELD)
    turns = 1 + np.flatnonzero(np.diff(moves.astype(int)))
    parts = np.split(leg, turns)
    # A part with so few readings cannot determine a noise of its own.
    return parts if min(map(len, parts)) >= FEWEST else [leg]


def _table(coupons: Coupons, tests: CouponTests) -> ReadingTable:
    """Build the rows of the readings that are judged, without values."""
    reading = tests.rows
    states = States.of(tests.film[reading], np.zeros(len(reading)), coupons.volts[reading],
                       np.nan_to_num(coupons.time[reading]), 0.0, tests.leg)
    # No plate moves: these are states at a given deflection.
    states = replace(states, deflection=np.zeros(len(reading)))
    labels = [" ".join(filter(None, pair)) for pair in
              zip(coupons.specimen[reading].tolist(), coupons.run[reading].tolist(), strict=True)]
    table = rows(states, "stress", 0.0, file=coupons.file[reading],
                 line=coupons.line[reading], run=np.array(labels))
    return replace(table, point=np.arange(len(reading)))
