"""The verification page's claims hold, the page is the one they make, and a wrong number would be
caught."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.verification import __main__ as command
from benchmarks.verification import page
from benchmarks.verification.claim import Claim, Pair
from tympan.fem.film.laws import NeoHooke
from tympan.studies import case as cases

PAGE = Path(__file__).parent.parent / "docs" / "verification.md"
CLAIMS = {claim.title: claim for claim in page.claims()}


@pytest.mark.parametrize("title", CLAIMS)
def test_claim_holds(title) -> None:
    for pair, fine in CLAIMS[title].judged():
        assert fine, (f"{pair.quantity}: {pair.computed} against {pair.reference}, "
                      f"error {pair.error:.2e}")


def test_every_file_of_claims_is_a_chapter() -> None:
    """One that is not would be run by nobody."""
    files = {file.stem for file in Path(page.__file__).parent.glob("*.py")
             if "@claim" in file.read_text(encoding="utf-8")}
    assert files - {"claim"} == {chapter.__name__.rpartition(".")[2] for chapter in page.CHAPTERS}


def test_the_page_shows_every_claim_and_no_failure() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert [line[4:] for line in text.splitlines() if line.startswith("### ")] == list(CLAIMS)
    for claim in CLAIMS.values():
        assert f"| {claim.title} |" in text
        assert f"Reference: {claim.reference}." in text
    assert f"{len(CLAIMS)} of {len(CLAIMS)} claims hold" in text
    assert "**NO**" not in text


@pytest.mark.parametrize(
    ("pair", "error"),
    [
        (Pair("right", 2.0, 2.0), 0.0),
        (Pair("1 % high", 2.02, 2.0), 0.01),
        (Pair("1 % low", -1.98, -2.0), 0.01),
        (Pair("not zero", 0.03, 0.0), 0.03),
        (Pair("no number", math.nan, 2.0), math.inf),
        (Pair("infinite", math.inf, 2.0), math.inf),
        (Pair("order above theory", 4.4, 4.0, at_least=True), 0.0),
        (Pair("order below theory", 3.4, 4.0, at_least=True), 0.6),
        (Pair("order that is no number", math.nan, 4.0, at_least=True), math.inf),
    ],
    ids=lambda value: value.quantity if isinstance(value, Pair) else "",
)
def test_the_error_of_a_pair(pair, error) -> None:
    assert pair.error == pytest.approx(error, rel=1e-9)


def test_a_claim_fails_just_beyond_its_tolerance_and_without_numbers() -> None:
    def judged(computed: float) -> list[bool]:
        return [fine for _, fine in Claim("", "", 1e-3, lambda: [Pair("", computed, 1.0)]).judged()]

    assert judged(1.0009) == judged(0.9991) == [True]
    assert judged(1.0011) == judged(0.9989) == judged(math.nan) == [False]
    with pytest.raises(ValueError, match="nothing was compared"):
        list(Claim("empty", "", 1e-3, list).judged())


def test_a_law_one_in_ten_thousand_too_stiff_is_caught(monkeypatch) -> None:
    """Through the finite elements and through the film's density; with the model's cache emptied
    before and after."""
    energy = NeoHooke.energy
    monkeypatch.setattr(NeoHooke, "energy",
                        lambda law, excess: tuple(1.0001 * part for part in energy(law, excess)))
    cases.meshed.cache_clear()
    for title in CLAIMS:
        if title.startswith(("Small deflection", "Gas pressure", "Prestretched disc",
                             "Largest pressure")):
            assert not all(fine for _, fine in CLAIMS[title].judged()), title
    cases.meshed.cache_clear()


@pytest.mark.parametrize(("shift", "status"), [(0.0, 0), (1e-6, 1)])
def test_the_command_s_status_says_whether_all_claims_hold(tmp_path, monkeypatch, capsys, shift,
                                                           status) -> None:
    claim = next(claim for title, claim in CLAIMS.items()
                 if title.startswith("Largest pressure in a"))
    planted = replace(claim, pairs=lambda: [Pair("p", 1.0 + shift, 1.0, "Pa")], tolerance=1e-9)
    planted.pairs.__module__ = claim.pairs.__module__
    monkeypatch.setattr(page, "claims", lambda: [planted])
    monkeypatch.setattr(page, "draw", lambda path: path.touch())
    monkeypatch.setattr(sys, "path", list(sys.path))
    assert command.main(["-o", str(tmp_path)]) == status
    assert ("FAILS" in capsys.readouterr().err) == bool(status)
    text = (tmp_path / "verification.md").read_text(encoding="utf-8")
    assert ("**NO**" in text) == bool(status)
    assert f"| p | {1 + shift:.9g} Pa | 1 Pa |" in text
