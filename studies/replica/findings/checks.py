"""Smaller things of the paper, checked: surfaces, percentages, the prestretch."""

from __future__ import annotations

import numpy as np

from tympan.geometry.outlines import area
from tympan.studies.paper.published import MASSES, NAMES, PERCENTAGES, ROUNDING, SURFACES, ranges
from tympan.studies.paper.table1 import known, paper_actuators
from tympan.studies.replica.findings.finding import Evidence, Finding
from tympan.studies.replica.words import sentences


def checks() -> Finding:
    """Electrode surfaces, percentages of Table 2, and what the prestretch factor means."""
    actuators = paper_actuators(1.0)
    surfaces = [area(film.frame) - area(film.plate.outline) for film in actuators]
    off = float(np.abs(np.array(surfaces) - SURFACES).max())
    read = ranges()
    shares = 100 * read / read[:, :1]
    far = [(row, column) for row in range(2) for column in range(3)
           if round(float(shares[row, column])) != PERCENTAGES[row, column]]
    row, column = far[0]
    largest = 100 * (read[row, column] + ROUNDING) / (read[row, 0] - ROUNDING)
    thickness = known("z_ini") / known("z_0")
    stretch = float(np.sqrt(actuators[0].membrane.area_prestretch))
    return Finding(
        "checks", "Smaller things, checked",
        sentences("checks", surfaces=", ".join(f"{1e4 * value:.2f}" for value in surfaces),
                  off_cm2=1e4 * off, count=len(far), name=NAMES[column],
                  mass_g=1e3 * MASSES[row], share=shares[row, column],
                  printed=PERCENTAGES[row, column], largest=largest, thickness=thickness,
                  stretch=stretch, thinnest_um=1e6 * known("z_ini") / 25),
        (*(Evidence(f"film's surface, {name}", value, "m²")
           for name, value in zip(NAMES, surfaces, strict=True)),
         Evidence("largest difference from Table 1", off, "m²"),
         *(Evidence(f"percentage from the ranges, {name}, {1e3 * mass:g} g",
                    float(shares[r, c]), "%")
           for r, mass in enumerate(MASSES) for c, name in enumerate(NAMES)),
         Evidence("percentages that do not follow", float(len(far))),
         Evidence("thickness ratio", thickness), Evidence("stretch along each axis", stretch)))
