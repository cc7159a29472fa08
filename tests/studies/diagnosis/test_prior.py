"""The heavy tail of what is known beforehand, against quadrature and SciPy's distributions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import cauchy, halfnorm, norm, t

from tympan.studies.effects.prior import HeavyTail, as_residuals

SCALE = norm.ppf(0.75)
LIMITS = st.tuples(st.floats(-50.0, -0.1), st.floats(0.1, 50.0))


@given(LIMITS, st.floats(0.01, 0.99), st.floats(0.01, 10.0))
def test_it_is_cauchys_distribution_between_its_limits(limits, share, usual) -> None:
    prior = HeavyTail(usual, *limits)
    whole = cauchy(scale=SCALE * usual)
    below, above = whole.cdf(limits)
    size = prior.ppf(share)
    assert limits[0] <= size <= limits[1]
    assert prior.cdf(size) == pytest.approx(share, abs=1e-9)
    assert share == pytest.approx((whole.cdf(size) - below) / (above - below), abs=1e-9)
    assert prior.logpdf(size) == pytest.approx(whole.logpdf(size) - np.log(above - below))
    assert prior.logpdf(limits[1] + 1.0) == -np.inf


def test_what_the_tail_costs_and_what_it_saves() -> None:
    """Mean logarithms of density over that of a half-normal prior, by quadrature."""
    tail = HeavyTail(1.0, 0.0, np.inf)
    if_usual = quad(lambda x: halfnorm.pdf(x) * (halfnorm.logpdf(x) - tail.logpdf(x)), 0, 12)[0]
    ends = np.log([0.3, 20.0])

    def saved(logpdf) -> float:
        return quad(lambda s: logpdf(np.exp(s)) - halfnorm.logpdf(np.exp(s)), *ends)[0] / np.ptp(
            ends)

    assert if_usual == pytest.approx(0.19, abs=0.01)
    assert saved(tail.logpdf) == pytest.approx(21.1, abs=0.1)
    for freedom in (2, 4, 8):
        student = t(freedom, scale=SCALE / t.ppf(0.75, freedom))
        assert saved(lambda x, student=student: student.logpdf(x) + np.log(2)) < saved(tail.logpdf)


@given(st.floats(-30.0, 30.0))
def test_as_residuals_it_is_the_same_density(share: float) -> None:
    scale = np.array([0.3])
    rows, slopes = as_residuals(share * scale, scale)
    tail = HeavyTail(0.3 / SCALE, -np.inf, np.inf)
    assert 0.5 * rows[0] ** 2 == pytest.approx(float(tail.logpdf(0.0) - tail.logpdf(share * 0.3)),
                                               abs=1e-9)
    step = 1e-4 * scale
    difference = (as_residuals(share * scale + step, scale)[0]
                  - as_residuals(share * scale - step, scale)[0]) / (2 * step)
    assert slopes == pytest.approx(difference, rel=1e-4, abs=1e-6)
