"""One reduction for a specimen with any effect, against finite elements; what it refuses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from benchmarks.trials.film_families import GATE, Family, families, on_mesh, specimens
from tympan.base.errors import InputError
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Patch, Specimen
from tympan.studies.diagnosis.reduced.axes import film_axes, sampled_film
from tympan.studies.effects import Setup

OVAL = specimens()[1]


@cache
def still() -> Family:
    """Of effects that leave the mesh alone."""
    return next(families(OVAL))[0]


def edited(effect: str, size: float) -> Specimen:
    axis, *_ = [axis for axis in film_axes(Setup((OVAL,), Rig()), OVAL.name)
                if axis.effect == effect]
    sample = ((0, size * axis.parameter.deviation),)
    return sampled_film(Setup((OVAL,), Rig()), OVAL.name, (axis,), sample).specimen


@pytest.mark.parametrize(("effect", "size"), [
    ("strain_stiffening", 7.0), ("second_invariant", -2.0), ("permittivity_stretch", 1.5),
    ("prestretch_anisotropy", 2.0), ("prestretch_loss", 10.0), ("electrode_stiffness", 8.0)])
def test_films_with_effects_are_those_of_finite_elements(effect: str, size: float) -> None:
    """At sizes at which nothing was solved before, up to three times as large."""
    error, lacking = still().error(edited(effect, size))
    assert error < GATE
    assert not lacking


def test_plates_off_centre_turn_as_rigid_ones() -> None:
    """A plate that stretches as it tilts would be 35 um off."""
    known = [edited("plate_eccentricity", size) for size in (1.0, 2.0)]
    loads = [(1.0, 0.0), (1.0, 6.2e3), (0.8, 6.2e3)]
    family = Family.of(known[0], known[0].mirror_planes, [(film, loads) for film in known])
    error, lacking = family.error(edited("plate_eccentricity", 1.5))
    assert error < GATE
    assert not lacking


def test_an_uneven_film_is_refused() -> None:
    family = still()
    spotted = replace(OVAL, electrode=replace(OVAL.electrode, patches=(Patch((3e-2, 0.0), 5e-3),)))
    uneven = replace(OVAL, membrane=replace(OVAL.membrane, thickness_gradient=(0.1, 0.0)))
    for specimen in (spotted, uneven):
        with pytest.raises(InputError, match="reduced film"):
            family.reduction.film(on_mesh(family.mesh, specimen))
