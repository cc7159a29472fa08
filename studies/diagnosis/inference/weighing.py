"""How explanations of readings are weighed: one formula, and what each kind of explanation costs.

Noise terms, corrected labels, mistaken quantities and other frames are weighed by
:func:`unlikely`, minus twice the logarithm of the readings' probability. Its unit is that of χ²:
where the noise is known, differences of both are the same. An explanation must lower it by its
price. The price pays for all the ways in which such an explanation could have fitted by chance.

Effects are weighed by :func:`~tympan.studies.diagnosis.fits.evidence.evidence` instead. Their
sizes have prior scales, so their probability is an integral. Corrections of data have no size.
Patterns of a misfit, with single runs and loads, say only where it is. They are compared by the
share of χ² that they explain (:mod:`~tympan.studies.diagnosis.inference.pattern_shares`).
"""

from __future__ import annotations

from math import inf, log

#: Largest difference between two explanations that the readings do not separate.
MORE = 4.0

#: χ² by which a rival must exceed the named cause, whatever the rival's size may be: a cause that
#: is expected to be ahead by t is behind by this with z = (EXCLUDED + t) / (2 √t) or more, 3 at
#: least.
EXCLUDED = 9.0

#: Price of noise terms: 20 to 1 in probability. A person who states the noise is rarely wrong.
NOISE = 6.0

#: Price of corrected labels: there are some hundred ways in which labels may be wrong.
LABELS = 30.0
#: Additional price of labels between two lines that have no name: a few rows whose labels hardly
#: matter gain as much by chance.
LINES = 12.0

#: Price of another frame of scans. It is high since no effect has been considered yet: by noise
#: alone it has a probability of exp(-30).
FRAME = 60.0

#: Standard deviations of χ² up to which it counts as noise.
_SCATTER = 2.0

#: Least sum of squares in a logarithm: readings that agree exactly have no other limit.
_LEAST = 1e-12


def unlikely(chi_squared: float, count: int, known: float = inf, unknowns: int = 0) -> float:
    """Compute minus twice the log probability of readings, marginal over a factor on their noise.

    It contains Schwarz's penalty for each unknown, and no constants of a normal distribution.

    Parameters
    ----------
    chi_squared
        Sum of squares that an explanation leaves, over the noise as stated.
    count
        Number of readings.
    known
        Degrees of freedom of the noise as stated. With none, the squares alone determine the noise;
        with infinitely many the result is χ² minus the number of readings.
    unknowns
        Number of unknowns that were fitted.
    """
    penalty = unknowns * log(max(count, 2))
    if known == inf:
        return chi_squared - count + penalty
    freedom = count + known
    return freedom * log(max(chi_squared + known, _LEAST) / freedom) + penalty


def most_of_noise(count: int) -> float:
    """Compute the largest χ² of ``count`` readings that counts as noise."""
    return count + _SCATTER * float((2 * count) ** 0.5)
