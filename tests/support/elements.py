"""Designs of one specimen that a search by finite elements looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.design.elements.space import ElementSpace
from tympan.studies.design.ranges import Vary
from tympan.studies.design.requirements import Requirements


def vary(key: str, low: float, high: float) -> Vary:
    """A length that varies."""
    return Vary(key, (key.replace("plate.", "plate.outline.", 1),), low, high)


def element_space(specimen: Specimen, mass: float, voltage: float, variables: tuple[Vary, ...],
                  bounds: Mapping[str, float] = {}, held: tuple[str, ...] = ("area",),
                  rig: Rig = Rig()) -> ElementSpace:
    """A specimen's designs under its loads."""
    return ElementSpace.of(Requirements(
        specimen.name, (specimen,), mass, voltage, {specimen.name: variables}, dict(bounds),
        "stroke", rig, None, held=held))


def asked(space: ElementSpace, **requirements: Any) -> ElementSpace:
    """The same designs under other requirements."""
    return replace(space, requirements=replace(space.requirements, **requirements))
