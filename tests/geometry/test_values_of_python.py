"""Values made in Python pass the checks of a file: one rule for a key, whoever gives it."""

from __future__ import annotations

import timeit
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import tympan
from benchmarks.trials.python_words import words_of_python
from tests.oracles.laws import SAMPLES
from tests.support.biases import DECLARED
from tests.support.specimens import circular, skewed
from tympan.base.errors import InputError
from tympan.base.fields import Field, fields_of
from tympan.fem.film.flows import ShearThinning
from tympan.geometry.outlines import Circle, examples
from tympan.geometry.specimen import Electrode, Film, Patch, Plate, Region, Specimen, ViscousBranch
from tympan.studies.case import Case

#: A value of every class that Python makes of what its file may hold.
VALUES = [skewed().membrane, ViscousBranch(1e5, 3.0), ShearThinning(1e3, 2.0),
          Plate(Circle(0.01)), Region(Circle(0.01)), Patch((0.0, 0.0), 0.01), Electrode(),
          tympan.Rig(), Case(circular()), *DECLARED.values(), *examples().values(),
          *(sample.law for sample in SAMPLES.values()), tympan.ConstantStrength(3e7)]


def _numbers(*kinds: Any) -> list[Any]:
    """Every field of numbers of every class."""
    return [pytest.param(value, field, id=f"{type(value).__name__}.{field.name}")
            for value in VALUES for field in fields_of(type(value)) if field.item in kinds]


def _given(value: Any, field: Field, number: Any) -> Any:
    """The value with a number in place of its own, or of the first of several."""
    own = getattr(value, field.name)
    return replace(value, **{field.name: (number, *own[1:]) if field.several else number})


@pytest.mark.parametrize(("value", "field"), _numbers(float, int))
def test_what_is_no_number_is_refused_with_its_key(value: Any, field: Field) -> None:
    for wrong in (float("nan"), True, np.bool_(True), np.ma.masked, 10**400, "", "much", [], {}):
        with pytest.raises(InputError) as refused:
            _given(value, field, wrong)
        assert str(refused.value).startswith(f"{field.key}: ")
        assert not words_of_python(str(refused.value))


@pytest.mark.parametrize(("value", "field"), _numbers(float, int))
def test_a_number_beyond_the_limits_of_its_key_is_refused(value: Any, field: Field) -> None:
    """The same that a file is refused for, in the same words."""
    for number in (-1e31, -1.0, 0.0, 0.5, 2.5, 1e31, float("inf")):
        holds, words = field.made
        if not holds(number):
            with pytest.raises(InputError) as refused:
                _given(value, field, number)
            assert (refused.value.allowed, refused.value.key) == (words, field.key)
        elif 1e30 < number < float("inf"):
            with pytest.raises(InputError, match=r"must be finite, at most 1e\+30"):
                _given(value, field, number)


@pytest.mark.parametrize(("value", "field"), _numbers(int))
def test_whole_numbers_are_whole(value: Any, field: Field) -> None:
    with pytest.raises(InputError, match=r"whole number|number of a line"):
        _given(value, field, 3.5)
    made = getattr(_given(value, field, 3.0), field.name)
    assert type(made[0] if field.several else made) is int


def test_numbers_of_numpy_and_whole_ones_are_numbers() -> None:
    for number in (np.float32(0.5), np.array(0.5), np.ma.array(0.5)):
        assert replace(tympan.Rig(), sensor_gain=number).sensor_gain == 0.5
    assert replace(tympan.Rig(), spring=np.int64(5)).spring == 5


def test_an_imaginary_step_does_not_count() -> None:
    film = replace(circular().membrane, density=1e-30j, prestretch=(2.0 + 1e-30j, 2.0))
    assert film.density == 1e-30j
    with pytest.raises(InputError, match="thickness"):
        replace(film, thickness=-1.0 + 1e-30j)


@pytest.mark.parametrize("name", ["../../esc", "/tmp/a", "a/b", "", " ", ".hidden", 101 * "a"])
def test_a_name_that_is_no_files_name_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"^name: .*(must serve as a file name|is empty)"):
        replace(circular(), name=name)


@pytest.mark.parametrize("make", [
    lambda: Film("1 mm", 2.0, "vhb-4910", layers="2"),
    lambda: tympan.ForceTable(["1 mm"], ["1 N"]),
    lambda: tympan.ForceTable([0.0, 1e-300], [0.0, 1.0]),
    lambda: tympan.BuckledBeam("4 mm", "5 mm", "20 mm", "3 GPa", "0.1 mm"),
    lambda: tympan.Film("1 mm", 2.0, tympan.NeoHooke),
    lambda: tympan.Rig(guide=["free"]),
    lambda: tympan.Rig(biases=[3]),
    lambda: tympan.Settings(symmetry=1),
    lambda: tympan.load(""),
    lambda: tympan.load(3),
    lambda: tympan.material([]),
    lambda: tympan.material(" "),
    lambda: tympan.solve(circular(), mass=True),
    lambda: tympan.draw(circular(), ""),
    lambda: tympan.result.Result(None).save(""),
    lambda: tympan.result.file_writers(int, __import__("pathlib").Path(".mat")),
], ids=range(16))
def test_a_message_has_no_words_of_python(make: Any) -> None:
    with pytest.raises(InputError) as refused:
        make()
    assert not words_of_python(str(refused.value))


def test_to_make_a_film_stays_quick() -> None:
    """Families make thousands: the limits of all its numbers cost less than the film itself."""
    film = skewed().membrane
    seconds = min(timeit.repeat(lambda: replace(film, thickness=1e-3), number=200, repeat=5)) / 200
    assert seconds < 200e-6


def test_specimens_made_in_python_are_those_of_files() -> None:
    with pytest.raises(InputError, match=r"^thickness: given '-1 mm': must be positive"):
        replace(circular().membrane, thickness=-1e-3)
    with pytest.raises(InputError, match=r"^thickness: given '-1 mm': must be positive"):
        replace(circular().membrane, thickness="-1 mm")
    assert isinstance(replace(circular(), name="a b.c-1"), Specimen)


@pytest.mark.parametrize(("key", "value", "words"), [
    ("relative_permittivity", 0.5, "must be at least 1"), ("prestretch", (25.0, 2.0), "must be"),
    ("permittivity_exponent", 11.0, "must be from -10 to 10"), ("density", -1.0, "must be 0 "),
    ("thickness", 0.2, "must be positive, from")])
def test_a_door_refuses_what_a_fit_may_pass_through(key: str, value: Any, words: str) -> None:
    """A number that no file may have is made, for a fit, and refused where it is to be solved."""
    film = replace(circular().membrane, **{key: value})
    with pytest.raises(InputError, match=rf"^membrane\.{key}: .*{words}"):
        tympan.solve(replace(circular(), membrane=film), mass="1 g")
