"""Rules of a verdict, one by one: what is doubted, what is left out, and what may be named.

Fits and what they leave are made up here, so that a rule alone decides. A cause stands out by far,
until one thing is changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.support.straight_bench import design
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis, unknown_count
from tympan.studies.diagnosis.inference import verdict
from tympan.studies.diagnosis.inference.posterior import DISCREPANCY, PAIR, SINGLE, Posterior
from tympan.studies.diagnosis.inference.verdict import Wandering, Weighed

DOCS = Path(__file__).parents[4] / "docs"
ZERO, DRIFT, SAG = map(Cause, ("sensor_zero", "drift", "voltage_sag"))
TABLE = design()
#: Probabilities of what fits leave, by noise alone: of noise, of more than noise, and of so much
#: more that a cause is out of the question where another one leaves noise.
NOISE, MORE, FAR_MORE = 0.5, 5e-3, 1e-9


def made(hypothesis: Hypothesis, evidence: float, chi_squared: float, size: float = 1.0) -> Fit:
    """A fit of this evidence and χ², each effect of so many usual sizes."""
    usual = [item.deviation for cause in hypothesis for item in cause.effect.parameters]
    count = unknown_count(hypothesis)
    residual = np.zeros(len(TABLE))
    residual[0] = chi_squared**0.5
    ends = np.array([np.full(count, -np.inf), np.full(count, np.inf)])
    return Fit(hypothesis, np.r_[0.0, 0.0, size * np.array(usual)], ends, ends, residual,
               np.zeros((len(TABLE), count)), np.zeros(count), np.eye(count), cost=-evidence,
               evidence=evidence, deflection=np.zeros(len(TABLE)))


@dataclass
class Case:
    """What was explored, what each fit leaves, and what the numbers of a verdict are."""

    fits: dict[Hypothesis, Fit]
    leaves: dict[Hypothesis, float]
    #: Logarithm of the odds of something smooth beside each fit.
    beside: float = -5.0
    #: Logarithm of a pair's odds against something smooth alone.
    against_smooth: float = 10.0
    odd: str = ""
    alike: tuple[tuple[Cause, ...], ...] = ()
    #: What a factor on the usual sizes adds to the evidence of a hypothesis.
    by_scale: dict[tuple[Hypothesis, float], float] = field(default_factory=dict)
    #: Causes whose size may be none.
    sizeless: tuple[Cause, ...] = ()

    def verdict(self) -> Weighed:
        """The verdict on it."""
        nominal = made((), -60.0, 300.0)
        misfit = SimpleNamespace(table=TABLE, fit=nominal, patterns={},
                                 indistinguishable=self.alike)
        causes = list(dict.fromkeys(cause for hypothesis in self.fits for cause in hypothesis))
        explored = SimpleNamespace(
            causes=causes, widen=1.0, fits=self.fits, simulation=None,
            ranked=lambda: sorted(self.fits.values(), key=lambda fit: -fit.evidence),
            alone=lambda factor: [fit for fit in self.fits.values() if len(fit.hypothesis) == 1])
        adequacy = SimpleNamespace(
            of=lambda fit: SimpleNamespace(p_value=self.leaves.get(fit.hypothesis, FAR_MORE)),
            enough=lambda fit: self.leaves.get(fit.hypothesis, FAR_MORE) >= verdict.ALARM,
            odd_specimen=lambda: self.odd)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(verdict, "odds_of_more", lambda fit, columns: self.beside)
            patch.setattr(verdict, "log_odds_to_smooth", lambda *given: self.against_smooth)
            patch.setattr(verdict, "has_size", lambda fit, cause: cause not in self.sizeless)
            patch.setattr(verdict, "_on_a_rough_bench", lambda unexplained, *given: unexplained)
            patch.setattr(verdict, "evidence", lambda fit, widen: (
                fit.evidence + self.by_scale.get((fit.hypothesis, widen), 0.0)))
            return verdict._weighed(cast(Any, misfit), cast(Any, explored), cast(Any, adequacy))


def clear() -> Case:
    """A zero that leaves noise and is far ahead of a drift that does not."""
    return Case({(ZERO,): made((ZERO,), -10.0, 40.0), (DRIFT,): made((DRIFT,), -40.0, 100.0)},
                {(ZERO,): NOISE, (DRIFT,): MORE})


def of_two() -> Case:
    """A zero and a drift together, neither of which leaves noise alone."""
    case = clear()
    pair = ZERO, DRIFT
    fits = {**case.fits, (ZERO,): made((ZERO,), -50.0, 150.0), pair: made(pair, -10.0, 40.0)}
    return replace(case, fits=fits, leaves={(ZERO,): MORE, (DRIFT,): MORE, pair: NOISE})


def beside(share: float) -> float:
    """Logarithm of the odds with which something beside the library has a share of what is wrong.
    """
    return float(np.log(share / (1 - share) * (SINGLE + PAIR) / DISCREPANCY))


def test_a_cause_that_is_far_ahead_and_leaves_noise_is_named() -> None:
    judged = clear().verdict()
    assert (judged.verdict, judged.named) == ("named", (ZERO,))
    assert judged.rivals == ()
    assert set(judged.robust) == set(verdict.SCALES)


def test_what_leaves_more_than_noise_is_not_named_though_it_is_the_most_probable() -> None:
    case = clear()
    case.leaves[DRIFT,] = NOISE
    assert case.verdict().verdict == "named"
    # As improbable as can be without being out of the question: that is once in a thousand times.
    case.leaves[ZERO,] = 2e-3
    judged = case.verdict()
    assert (judged.verdict, judged.named) == ("ambiguous", ())
    assert judged.posterior is not None
    assert judged.posterior.fits[0].hypothesis == (ZERO,)


def test_a_cause_that_leaves_far_more_than_noise_is_out_where_another_one_leaves_noise() -> None:
    case = clear()
    case.leaves = {(DRIFT,): NOISE, (ZERO,): 0.5e-3}
    # χ² of a zero out of the question is no rival's.
    case.fits[DRIFT,] = made((DRIFT,), -40.0, 35.0)
    judged = case.verdict()
    assert (judged.verdict, judged.named) == ("named", (DRIFT,))
    assert judged.posterior is not None
    assert judged.posterior.fit_of((ZERO,)) is None


def test_where_nothing_leaves_noise_it_is_unexplained_and_nothing_is_out() -> None:
    case = replace(clear(), leaves={})
    judged = case.verdict()
    assert judged.verdict == "unexplained"
    assert judged.posterior is not None
    assert len(judged.posterior.fits) == 2


@pytest.mark.parametrize(("behind", "expected"), [(8.0, "ambiguous"), (10.0, "named")])
def test_a_rival_of_whatever_size_that_misses_by_hardly_more_is_a_doubt(behind: float,
                                                                        expected: str) -> None:
    case = clear()
    case.fits[DRIFT,] = made((DRIFT,), -40.0, 40.0 + behind)
    # One that does not leave noise is none, however near it comes.
    assert case.verdict().verdict == "named"
    case.leaves[DRIFT,] = NOISE
    judged = case.verdict()
    assert judged.verdict == expected
    assert judged.named == ((ZERO,) if expected == "named" else ())
    if expected == "ambiguous":
        assert [fit.hypothesis for fit in judged.rivals] == [(DRIFT,)]
        assert DRIFT in judged.suspects


def test_a_rival_that_may_be_of_no_size_is_a_doubt_but_no_alternative() -> None:
    case = replace(clear(), sizeless=(DRIFT,))
    case.fits[DRIFT,] = made((DRIFT,), -40.0, 41.0)
    case.leaves[DRIFT,] = NOISE
    judged = case.verdict()
    assert (judged.verdict, judged.rivals, judged.suspects) == ("ambiguous", (), (ZERO,))


@pytest.mark.parametrize(("share", "expected"), [(0.25, "named"), (0.42, "ambiguous"),
                                                 (0.6, "unexplained")])
def test_something_beside_the_library_is_a_doubt_from_a_third_on(share: float, expected: str
                                                                 ) -> None:
    judged = replace(clear(), beside=beside(share)).verdict()
    assert judged.posterior is not None
    assert judged.posterior.discrepancy / judged.posterior.wrong == pytest.approx(share)
    assert judged.verdict == expected


@pytest.mark.parametrize("scale", [scale for scale in verdict.SCALES if scale != 1.0])
def test_a_cause_that_stands_out_at_some_usual_sizes_alone_is_doubted(scale: float) -> None:
    case = clear()
    assert case.verdict().verdict == "named"
    judged = replace(case, by_scale={((DRIFT,), scale): 30.0}).verdict()
    assert (judged.verdict, judged.named) == ("ambiguous", ())
    assert judged.robust[1.0] == (ZERO,)
    assert judged.robust[scale] == ()


@pytest.mark.parametrize(("share", "expected"), [(0.88, "ambiguous"), (0.92, "named")])
def test_a_name_takes_nine_tenths_of_the_library_whatever_is_beside_it(share: float, expected: str
                                                                       ) -> None:
    """With a quarter for something unknown a cause of 92 % is named that is printed with 69 %."""
    case = clear()
    case.fits[DRIFT,] = made((DRIFT,), -10.0 + np.log((1 - share) / share), 100.0)
    for unknown in (0.01, 0.25):
        judged = replace(case, beside=beside(unknown)).verdict()
        assert judged.posterior is not None
        assert judged.posterior.in_library()[ZERO] == pytest.approx(share)
        assert judged.posterior.of_causes()[ZERO] == pytest.approx(share * (1 - unknown))
        assert judged.verdict == expected


def test_a_sensor_that_may_wander_is_no_excuse_where_a_cause_is_much_more_probable() -> None:
    assert not Wandering().possible
    assert Wandering(20e-6).possible
    assert not Wandering(20e-6, excluded=True).possible
    weighed = clear().verdict().without_a_name
    assert (weighed.verdict, weighed.named) == ("ambiguous", ())
    unexplained = replace(clear(), leaves={}).verdict()
    assert unexplained.without_a_name is unexplained


def test_shares_of_the_library_leave_out_what_is_beside_it() -> None:
    fits = made((ZERO,), 0.0, 0.0), made((DRIFT,), 0.0, 0.0), made((ZERO, DRIFT), 0.0, 0.0)
    posterior = Posterior(fits, np.array([0.4, 0.04, 0.06]), nothing=0.3, discrepancy=0.2)
    assert posterior.in_library() == {ZERO: pytest.approx(0.92), DRIFT: pytest.approx(0.2)}
    assert posterior.of_causes() == {ZERO: pytest.approx(0.46 / 0.7),
                                     DRIFT: pytest.approx(0.1 / 0.7)}
    assert verdict._sure(posterior) == (ZERO,)


@pytest.mark.parametrize(("odds", "expected"), [(3.2, "named"), (2.8, "ambiguous")])
def test_two_causes_must_explain_much_more_than_something_smooth(odds: float, expected: str
                                                                 ) -> None:
    """By 20 to 1, of which the logarithm is 3."""
    judged = replace(of_two(), against_smooth=odds).verdict()
    assert judged.verdict == expected
    # One cause need not.
    assert replace(clear(), against_smooth=odds).verdict().verdict == "named"


def test_two_causes_that_one_specimen_alone_shows_are_doubted() -> None:
    case = of_two()
    assert set(case.verdict().named) == {ZERO, DRIFT}
    judged = replace(case, odd="B").verdict()
    assert (judged.verdict, judged.odd_specimen) == ("ambiguous", "B")
    # Which is asked only where one cause alone does not explain it.
    assert replace(clear(), odd="B").verdict().verdict == "named"


@pytest.mark.parametrize(("size", "expected"), [(2.8, "ambiguous"), (3.2, "unexplained")])
def test_one_odd_specimen_is_no_two_large_causes(size: float, expected: str) -> None:
    case, pair = of_two(), (ZERO, DRIFT)
    case.fits[pair] = made(pair, -10.0, 40.0, size=size)
    assert case.verdict().verdict == "named"
    assert replace(case, odd="B").verdict().verdict == expected


@pytest.mark.parametrize(("more", "told"), [(3.0, False), (5.0, True)])
def test_two_causes_of_one_class_must_explain_more_than_one_of_them(more: float, told: bool
                                                                    ) -> None:
    case, pair = clear(), (ZERO, DRIFT)
    case.fits[DRIFT,] = made((DRIFT,), -40.0, 41.0)
    case.fits[pair] = made(pair, -9.0, 40.0 - more)
    case.leaves[pair] = NOISE
    of_one_class = replace(case, alike=((ZERO, DRIFT, SAG),)).verdict()
    assert of_one_class.posterior is not None
    assert (of_one_class.posterior.fit_of(pair) is not None) == told
    of_others = replace(case, alike=((ZERO, SAG),)).verdict()
    assert of_others.posterior is not None
    assert of_others.posterior.fit_of(pair) is not None


def said(page: str, words: Sequence[str]) -> list[str]:
    """Words that a page lacks."""
    text = " ".join((DOCS / "explanation" / page).read_text(encoding="utf-8").split())
    return [each for each in words if each not in text]


def test_the_pages_have_the_numbers_of_the_rules() -> None:
    share = f"at least {100 * verdict.SURE:.0f} % of the probability"
    library = f"{share} of all effects in the library"
    noise = f"at least {100 * verdict.ALARM:.0f} times in 100"
    assert pytest.approx(1 / 3) == verdict.DOUBTED
    low, usual, *large = verdict.SCALES
    assert (1 / low, usual, large) == (pytest.approx(3.0), 1.0, [3.0, 10.0])
    assert said("verdict.md", [
        library, noise, f"comes within {verdict.EXCLUDED:.0f} in χ²",
        "a cause that is not in the library has at most a third of the probability",
        "all typical sizes are 3 times smaller, or 3 or 10 times larger"]) == []
    assert said("verdict-details.md", [
        library, noise, f"at least 1 film in {1 / verdict.UNUSUAL:.0f} has its factors",
        f"has a probability above {100 * verdict.DISCREPANCY:.0f} %",
        f"{round(float(np.exp(verdict.PAIRED)))} times as probable as a smooth misfit",
        "unless both are of three typical sizes and more"]) == []
    assert verdict.SURPRISING == 3.0
