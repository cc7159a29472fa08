"""Bounds of quantities: one grammar for files, options and Python, and what a weaker one is."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.studies.wanted import (
    QUANTITIES,
    Bound,
    read_bounds,
    scattering,
    table_bounds,
    wanted_bounds,
)

#: Both senses of each quantity; a margin has a least value alone.
SENSES = [(name, least) for name, quantity in QUANTITIES.items() for least in (True, False)
          if least or not name.endswith("_margin")]


@pytest.mark.parametrize(("name", "least"), SENSES)
def test_a_relaxed_bound_is_weaker_whatever_it_is_relaxed_to(name: str, least: bool) -> None:
    """All values that keep a bound keep the relaxed one, and some keep that alone."""
    rng = np.random.default_rng(5)
    for value in rng.uniform(1.0, 9.0, 20):
        bound, values = Bound(name, float(value), least), rng.uniform(0.5, 12.0, 200)
        for other in rng.uniform(0.5, 12.0, 20):
            weaker = bound.relaxed_to(float(other))
            stricter = other >= value if least else other <= value
            # A margin below 1 can be asked for by nobody.
            assert (weaker is None) == (stricter or not bound.quantity.rule[0](other))
            if weaker is not None:
                kept, more = bound.missed(values) <= 0, weaker.missed(values) <= 0
                assert more[kept].all()
                assert bound.missed(np.array(weaker.value)) > 0 >= weaker.missed(
                    np.array(weaker.value))
        eased = bound.relaxed_by(0.01)
        assert eased is None or eased == bound.relaxed_to(bound.value * (0.99 if least else 1.01))
    assert Bound(name, 1.0, least).relaxed_to(None) is None


def test_what_reduced_films_do_not_know_so_nearly_misses_no_bound() -> None:
    for share in (0.99, 0.9995, 1.0005, 1.01):
        for least in (True, False):
            bound = Bound("stroke", share * 2e-3, least)
            assert bound.kept_by(2e-3) == (share != (1.01 if least else 0.99))


def test_that_a_film_bears_its_voltage_cannot_be_relaxed() -> None:
    for name in ("tension_margin", "breakdown_margin"):
        assert Bound(name, 1.0, True).relaxed_by(0.01) is None
        assert Bound(name, 1.2, True).relaxed_by(0.01) is not None


@pytest.mark.parametrize(("name", "given", "expected"), [
    ("stroke", "2 mm", [(2e-3, True)]), ("max_field", "30 MV/m", [(30e6, False)]),
    ("stroke", "at most 5 mm", [(5e-3, False)]), ("tension_margin", 1.2, [(1.2, True)]),
    ("deflection", ["at least 3 mm", "at most 6 mm"], [(3e-3, True), (6e-3, False)]),
    ("stroke", ["2 mm", "at most 3 mm"], [(2e-3, True), (3e-3, False)]),
    ("capacitance", "at  least 1 nF", [(1e-9, True)])])
def test_a_bound_is_the_same_in_a_file_an_option_and_python(
        name: str, given: object, expected: list[tuple[float, bool]]) -> None:
    found = read_bounds(name, given)
    assert [(bound.value, bound.least) for bound in found] == expected
    assert [*found] == [*table_bounds(Table("T.toml", {name: given}))]
    assert [*found] == [*wanted_bounds({name: given})]
    words = [given] if not isinstance(given, list) else given
    assert [*found] == [*wanted_bounds(", ".join(f"{name} = {word}" for word in words))]
    assert [*found] == [read_bounds(name, bound.text[len(name):])[0] for bound in found]


@pytest.mark.parametrize(("name", "given", "message"), [
    ("strok", "2 mm", "did you mean 'stroke'"), ("stroke", "2 g", "must be a length"),
    ("stroke", 2.0, "has no unit"), ("stroke", "-1 mm", "must be positive"),
    ("deflection", "3 mm", 'must say whether it is the least or the largest value: "at least'),
    ("tension_margin", "at most 2", "must be a least value"),
    ("tension_margin", 0.9, "must be a margin from 1 to 10"),
    ("tension_margin", "1.2 mm", "must be a number without a unit"),
    ("stroke", ["2 mm", "3 mm"], "at most one bound of each sense"), ("stroke", [], "a bound"),
    ("stroke", ["at least 3 mm", "at most 2 mm"], "least value above the largest")])
def test_a_wrong_bound_is_one_message(name: str, given: object, message: str) -> None:
    for read in (lambda: table_bounds(Table("T.toml", {name: given})),
                 lambda: wanted_bounds({name: given})):
        with pytest.raises(InputError, match=message):
            read()
    with pytest.raises(InputError, match=rf"T\.toml: {name}"):
        table_bounds(Table("T.toml", {name: given}))


@pytest.mark.parametrize("text", ["stroke", "stroke =", "= 2 mm", "stroke = 2,5 mm", " , "])
def test_a_text_that_is_no_bounds_is_told_what_bounds_are(text: str) -> None:
    with pytest.raises(InputError, match='such as "stroke = at least 2 mm"'):
        wanted_bounds(text)


def test_a_bound_with_the_other_sense_has_a_key_of_its_own() -> None:
    assert [Bound("stroke", 1.0, least).key for least in (True, False)] == [
        "stroke", "stroke at most"]
    assert len({Bound(name, 1.0, least).key for name, least in SENSES}) == len(SENSES)
    assert {"stroke", "deflection", "limit", "capacitance"} <= {*scattering()}
    assert "width" not in scattering()
