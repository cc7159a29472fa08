"""Steady lines in the spectrum of a run in time: mains hum, and other permanent vibrations.

Curves through each hold remove the slow course, and a window over each hold keeps the oscillations
after jumps out of other frequencies. A peak that exceeds its neighbours in the spectrum by more
than noise may is fitted: frequency, amplitude and phase, and how the last two change slowly. It is
a steady line if it is equally strong in every part of the run: a film that oscillates after a jump
does so neither before nor for ever. A line at no multiple of the mains' frequency, or where this
plate may oscillate itself, must be seen before the first jump, where nothing happens.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.ndimage import median_filter

from tympan.base.arrays import Array, Numbers
from tympan.base.constants import STANDARD_GRAVITY
from tympan.studies.data.sampled_run import SampledRun

Spans = Sequence[tuple[int, int]]

#: Frequencies of mains [Hz].
_MAINS = (50.0, 60.0)
#: Highest multiple of the mains that counts as hum: motors and rectifiers make the first few.
_MULTIPLES = 4
#: Largest error of mains and clocks together, for each multiple [Hz]: grids keep within 0.2 Hz.
_OFF = 0.25

#: Fewest samples of a hold that is used.
_FEWEST = 16
#: Most curves for a hold's slow course: enough to remove creep from a spectrum of noise.
_CURVES = 6
#: Samples for each curve, so that faster changes remain.
_EACH = 8
#: Fewest periods of a line in the run. Fewer are a bend of the slow course.
_PERIODS = 8

#: Probability that noise makes a line at any frequency of a run.
_CHANCE = 1e-3
#: Number of frequencies on either side whose median is the noise about a line.
_NEIGHBOURS = 32
#: Safety factor on the height of a line above noise: such a median has an error of a fifth.
_SAFE = 1.25
#: Number of frequencies on either side that belong to a line, by its window.
_WIDTH = 4
#: Most lines that are examined, steady or not. It limits the cost.
_MOST = 24
#: Highest power of time in a line's amplitude and phase.
_WANDERS = 6
#: χ² that two more powers, four numbers, must remove: noise does so once in a thousand.
_WANDERED = 18.5

#: Parts after the first jump, each of which must have a line; one more without jumps.
_PARTS = 3
#: Largest ratio of a part's amplitude to the whole line's. The phase of grids changes slowly. Other
#: lines must also keep their phase: its change may be worth half of the amplitude.
_ALIKE = 2.0
#: Standard deviations by which noise may change a part's amplitude in addition.
_CLEAR = 3.0
#: Standard deviations from which a line counts as seen in a part.
_SEEN = 4.0
#: Distance from half the sampling rate, in periods of the whole run, within which amplitude and
#: phase cannot be separated: only the visible part of the amplitude is known.
_FOLDED = 4.0

#: Factor on the frequency of a mass with such a static deflection below which its plate may
#: oscillate itself.
_SWINGS = 4.0
#: Deviation of the squared voltage from its slow course, over its peak, that drives the film.
_DRIVES = 0.01


@dataclass(frozen=True)
class SteadyLine:
    """A line of a run's spectrum.

    ``frequency``: of the mains, else as seen; ``seen``: where samples show it, folded at half their
    rate [Hz]; ``amplitude`` [m], with standard deviation ``sigma``, inf where only a part of it may
    be seen.
    """

    frequency: float
    seen: float
    amplitude: float
    sigma: float
    mains: bool


def steady_lines(record: SampledRun) -> tuple[tuple[SteadyLine, ...], Array]:
    """Find the steady lines of a run, strongest first, and what they add to its samples [m]."""
    nothing = np.zeros(len(record.time))
    course = _Course(record)
    if not record.even or not course.spans:
        return (), nothing
    kept, named = list[_Wave](), list[tuple[float, bool]]()
    rest = course.apart(record.displacement)
    for wave in course.waves(rest):
        known = _mains(wave.frequency, record)
        if course.steady(wave, rest, known is not None):
            kept.append(wave)
            named.append((known or wave.frequency, known is not None))
    if not kept:
        return (), nothing
    columns = np.hstack([wave.columns for wave in kept])
    parts = course.fitted(columns, rest)
    lines, every, first = [], nothing.copy(), 0
    for wave, (frequency, mains) in zip(kept, named, strict=True):
        behind = first + wave.columns.shape[1]
        alone = wave.columns @ parts[first:behind]
        lines.append(SteadyLine(frequency, wave.frequency, course.amplitude(alone),
                                inf if course.folded(wave.frequency) else wave.sigma, mains))
        every, first = every + alone, behind
    return tuple(sorted(lines, key=lambda line: -line.amplitude)), every


def _mains(seen: float, record: SampledRun) -> float | None:
    """Find the lowest multiple of the mains' frequency that samples show there [Hz], or None."""
    rate, length = 1 / record.step, record.time[-1] - record.time[0]
    for multiple in range(1, _MULTIPLES + 1):
        for base in _MAINS:
            frequency = multiple * base
            folded = abs(frequency - rate * round(frequency / rate))
            if abs(seen - folded) < multiple * _OFF + 1 / length:
                return frequency
    return None


@dataclass(frozen=True, eq=False)
class _Wave:
    """A sinusoid with slowly changing amplitude and phase: its columns, (n, 2 (power + 1))."""

    frequency: float
    columns: Array
    sigma: float


def _noise(power: Array) -> Array:
    """Estimate the mean power of noise about each frequency, from the median of neighbours."""
    noise = median_filter(power, 2 * _NEIGHBOURS + 1, mode="reflect") / np.log(2)
    return np.asarray(np.maximum(noise, 1e-30 * max(float(power.max()), 1e-30)))


class _Course:
    """A run's slow course, and the spectrum without it."""

    def __init__(self, record: SampledRun) -> None:
        self.record = record
        time = record.time
        self.spans: Spans = [hold for hold in record.holds if hold[1] - hold[0] >= _FEWEST]
        self.weight = np.zeros(len(time))
        self._curves = list[tuple[slice, Array]]()
        for begin, end in self.spans:
            span = slice(begin, end)
            window = self.weight[span] = np.hanning(end - begin + 2)[1:-1]
            since = time[span] - time[begin]
            logs = np.log1p(since / record.step)
            powers = [np.ones_like(since), logs, since / since[-1], logs**2, logs**3, logs**4]
            curves = np.stack(powers[:min(_CURVES, len(since) // _EACH)], 1)
            root = np.sqrt(window)[:, None]
            turned, _ = np.linalg.qr(root * curves)
            self._curves.append((span, turned / root))

    def apart(self, values: Array) -> Array:
        """Subtract the slow course of each hold from values, (n, ...); 0 outside holds."""
        rest = np.zeros(values.shape)
        for span, curves in self._curves:
            some = values[span]
            rest[span] = some - curves @ (curves.T @ (self.weight[span] * some.T).T)
        return rest

    def fitted(self, columns: Array, rest: Array, part: slice = slice(None)) -> Array:
        """Fit columns to a part of the samples without the slow course; coefficients (columns,)."""
        root = np.sqrt(self._window(part))
        basis = self.apart(columns)[part] * root[:, None]
        return np.asarray(np.linalg.lstsq(basis, root * rest[part], rcond=1e-9)[0])

    def amplitude(self, wave: Array, part: slice = slice(None)) -> float:
        """Compute the amplitude of a wave from its mean square [m]."""
        window = self._window(part)
        return float(np.sqrt(2 * (window @ wave[part] ** 2) / window.sum()))

    def sigma(self, density: float, part: slice = slice(None)) -> float:
        """Compute the standard deviation of an amplitude from the noise power about it [m]."""
        window = self._window(part)
        variance = density / float(self.weight @ self.weight)
        return float(np.sqrt(2 * variance * (window @ window)) / window.sum())

    def _window(self, part: slice) -> Array:
        if part == slice(None):
            return self.weight
        count = len(self.weight[part])
        return np.asarray(np.hanning(count + 2)[1:-1] * (self.weight[part] > 0))

    @cached_property
    def _places(self) -> Numbers:
        """Indices of samples on an evenly spaced clock."""
        return np.asarray(np.round((self.record.time - self.record.time[0]) / self.record.step),
                          dtype=np.int64)

    @cached_property
    def frequencies(self) -> Array:
        """Frequencies of the spectrum [Hz]."""
        return np.asarray(np.fft.rfftfreq(int(self._places[-1]) + 1, self.record.step), float)

    def power(self, rest: Array) -> Array:
        """Compute the spectrum of samples without the slow course."""
        even = np.zeros(int(self._places[-1]) + 1)
        even[self._places] = self.weight * rest
        return np.asarray(np.abs(np.fft.rfft(even)) ** 2)

    def waves(self, rest: Array) -> Iterator[_Wave]:
        """Yield lines that exceed the noise, strongest first, each after removing those before."""
        at = self.frequencies
        least = _SAFE * np.log(len(at) / _CHANCE)
        open_ = at * 2 * self._half >= _PERIODS
        power = self.power(rest)
        for _ in range(_MOST):
            noise = _noise(power)
            peak = int(np.argmax(np.where(open_, power / noise, 0.0)))
            if not open_[peak] or power[peak] < least * noise[peak]:
                return
            own = slice(max(peak - _WIDTH, 0), peak + _WIDTH + 1)
            frequency = self._refined(peak, power, rest)
            columns = self._columns(frequency, 0)
            left = self._without(columns, rest)
            for wanders in range(2, _WANDERS + 1, 2):
                more = self._columns(frequency, wanders)
                less = self._without(more, rest)
                variance = float(_noise(self.power(less))[peak]) / float(self.weight @ self.weight)
                if self.weight @ (left**2 - less**2) < _WANDERED * variance:
                    break
                columns, left = more, less
            power = self.power(left)
            yield _Wave(frequency, columns, self.sigma(float(_noise(power)[peak])))
            rest, open_[own] = left, False

    def _without(self, columns: Array, rest: Array) -> Array:
        """Subtract the best fit of columns from the samples without the slow course."""
        return rest - self.apart(columns @ self.fitted(columns, rest))

    def _refined(self, peak: int, power: Array, rest: Array) -> float:
        """Refine the frequency of a spectral peak [Hz]: by its neighbours, then by its phase."""
        at = self.frequencies
        place, width = 0.0, float(at[1])
        if 0 < peak < len(at) - 1:
            low, here, high = np.log(np.maximum(power[peak - 1:peak + 2], 1e-300))
            place = 0.5 * (low - high) / min(low - 2 * here + high, -1e-9)
        frequency = float(at[peak]) + width * float(np.clip(place, -0.5, 0.5))
        for _ in range(2):
            columns = self._columns(frequency, 1)
            a, b, slope_a, slope_b = self.fitted(columns, rest)
            turned = (slope_a * b - slope_b * a) / max(a * a + b * b, 1e-300) / self._half
            frequency += float(np.clip(turned / (2 * np.pi), -0.5 * width, 0.5 * width))
            frequency = float(np.clip(frequency, width, at[-1]))
        return frequency

    @property
    def _half(self) -> float:
        """Half the run [s]."""
        return 0.5 * float(self.record.time[-1] - self.record.time[0])

    def _columns(self, frequency: float, wanders: int) -> Array:
        """Build cosine and sine times each power of time up to ``wanders``."""
        since = self.record.time - self.record.time[0] - self._half
        turn = 2 * np.pi * frequency * since
        powers = legvander(since / self._half, wanders)
        both = np.stack([np.cos(turn), np.sin(turn)], 1)
        return np.asarray((powers[:, :, None] * both[:, None, :]).reshape(len(since), -1))

    def steady(self, wave: _Wave, rest: Array, mains: bool) -> bool:
        """Check whether every part of the run has a wave equally strong; see this file's head."""
        whole = wave.columns @ self.fitted(wave.columns, rest)
        size = self.amplitude(whole)
        density = (wave.sigma / self.sigma(1.0)) ** 2
        first = self.record.jumps[:1].tolist()
        quiet = slice(0, first[0]) if first else slice(0, 0)
        seen = len(self.weight[quiet]) >= _FEWEST
        cuts = np.linspace(quiet.stop, len(whole), _PARTS + 1 + (not first)).round().astype(int)
        parts = [quiet] * seen + [slice(*cut) for cut in pairwise(cuts)]
        for number, part in enumerate(parts):
            sigma = self.sigma(density, part)
            alone = wave.columns[:, :2] @ self.fitted(wave.columns[:, :2], rest, part)
            here, off = self.amplitude(alone, part), self.amplitude(alone - whole, part)
            if not size / _ALIKE - _CLEAR * sigma < here < size * _ALIKE + _CLEAR * sigma:
                return False
            if not mains and (off > size / _ALIKE or here < _SEEN * sigma):
                return False
            if not number:
                seen &= here > _SEEN * sigma
        return seen or (mains and not self._films(wave.frequency))

    def folded(self, frequency: float) -> bool:
        """Check whether a frequency is so near half the sampling rate that its phase is unknown."""
        return frequency > 0.5 / self.record.step - _FOLDED / (2 * self._half)

    def _films(self, frequency: float) -> bool:
        """Check if a film may move so by itself: it is driven, or its plate oscillates there."""
        squared = self.record.voltage**2
        off = np.sqrt(np.average(self.apart(squared) ** 2, weights=self.weight))
        deep = max(float(np.abs(np.median(self.record.displacement))), 1e-9)
        return bool(off > _DRIVES * squared.max(initial=0.0)
                    or frequency < _SWINGS * np.sqrt(STANDARD_GRAVITY / deep) / (2 * np.pi))
