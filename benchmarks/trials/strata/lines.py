"""Datasets of lines over films with effects in them, and with what goes wrong in writing them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.trials.strata.evidence import (
    Evidence,
    ReadingPlan,
    by_elements,
    cross,
    sheets,
    write_dataset,
)
from benchmarks.trials.synthetic_trials import FINEST, Array, Truth, design_of
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import States
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Use

SHAPES: dict[str, tuple[float, float]] = {"round": (45e-3, 45e-3), "long": (60e-3, 45e-3)}
MASSES, VOLTAGES = (10e-3, 20e-3), (0.0, 1.5e3, 2.5e3, 3.2e3, 3.8e3)
FILM = Film(1e-3, (5**0.5, 5**0.5), NeoHooke(20e3), 4.7)


def plan_of(shapes: Sequence[str] = tuple(SHAPES), offset: tuple[float, float] = (0.0, 0.0),
            places: Callable[[Specimen], Array] | None = cross) -> ReadingPlan:
    """Each shape under each mass at each voltage; lines at the lowest and highest of the heavier.
    """
    specimens = tuple(Specimen(name, Ellipse(SHAPES[name]), Plate(Circle(10e-3), offset), FILM)
                      for name in shapes)
    number, mass, voltage = (axis.ravel() for axis in np.meshgrid(
        np.arange(len(specimens)), MASSES, VOLTAGES, indexing="ij"))
    design = design_of("lines", Setup(specimens, Rig()), States.of(number, mass, voltage))
    ends = (voltage == VOLTAGES[0]) | (voltage == VOLTAGES[-1])
    scanned = np.flatnonzero((mass == MASSES[-1]) & ends & (places is not None))
    return ReadingPlan(design, scanned=scanned, places=places or cross)


def seen(uses: Sequence[Use] = (), shapes: Sequence[str] = tuple(SHAPES),
         offset: tuple[float, float] = (0.0, 0.0),
         places: Callable[[Specimen], Array] | None = cross) -> Evidence:
    """What is read without noise of films 5 % stiffer and 3 % less permittive than stated, with
    effects hidden in them."""
    causes = tuple(Cause(name, which) for name, _, which in uses)
    sizes = tuple(item.size(value) for cause, (_, values, _) in zip(causes, uses, strict=True)
                  for item, value in zip(cause.effect.parameters, values, strict=True))
    read = by_elements(plan_of(shapes, offset, places),
                       Truth(1.05, 0.97, causes, sizes, mesh=FINEST))
    assert read is not None
    return read


def write(folder: Path, uses: Sequence[Use] = (), seed: int = 0, *, noise: float = 10e-6,
          zero: float = 0.2e-3, places: Callable[[Specimen], Array] | None = cross,
          head: Mapping[str, Any] = {}, offset: tuple[float, float] = (0.0, 0.0),
          shapes: Sequence[str] = tuple(SHAPES), scale: float = 1.0,
          change: Callable[[Array], Array] = lambda places: places,
          read: Evidence | None = None) -> Path:
    """A dataset of what is :func:`seen`, or has been before (``read``), with noise.

    Without ``places`` nothing is read over the films; ``change`` is what a wrong frame makes of
    the places, ``scale`` what a wrong unit makes of lines; ``head``: more keys of dataset.toml.
    """
    plan = plan_of(shapes, offset, places)
    read = read or seen(uses, shapes, offset, places)
    files = sheets(plan, read, noise, np.random.default_rng(seed), zero)
    if line := files.get("field.csv"):
        line["x"], line["y"] = change(np.stack([line["x"], line["y"]], axis=1)).T
        line["displacement"] = scale * line["displacement"]
    return write_dataset(folder, plan.design, files, noise, **head)
