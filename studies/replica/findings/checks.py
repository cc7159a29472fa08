"""Smaller things of the paper, checked: surfaces, percentages, the prestretch."""

from __future__ import annotations

import numpy as np

from tympan.geometry.outlines import area
from tympan.studies.paper.published import MASSES, NAMES, PERCENTAGES, ROUNDING, SURFACES, ranges
from tympan.studies.paper.table1 import known, paper_actuators
from tympan.studies.replica.findings.finding import Finding, Number


def checks() -> Finding:
    """Electrode surfaces, percentages of Table 2, and what the prestretch factor means."""
    actuators = paper_actuators(1.0)
    surfaces = [area(one.frame) - area(one.plate.outline) for one in actuators]
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
        ("Table 1's electrode surfaces are those of the film, π r₁ r₂ − π r²: "
         f"{', '.join(f'{1e4 * value:.2f}' for value in surfaces)} cm², {1e4 * off:.3f} cm² from the printed ones at "
         "most. Section 2 counts π r₁ r₂, the plate included.",
         f"Of Table 2's percentages {len(far)} of 6 does not follow from its ranges: {NAMES[column]}, "
         f"{1e3 * MASSES[row]:g} g, is {shares[row, column]:.1f} % of the circle, printed "
         f"{PERCENTAGES[row, column]:.0f} %; ranges before rounding could make it up to {largest:.1f} %.",
         f"The prestretch factor 5 is the area's: at constant volume 1 mm over 200 µm is {thickness:g}, so √5 = "
         f"{stretch:.4f} along each axis; 5 along each would leave {1e6 * known('z_ini') / 25:g} µm. Section 3 says "
         "that the stretches count from the unstretched film, yet λ_r of Eq. (3) is 1 without load: they count "
         "from the mounted one, and with Eq. (2) so does λ_z = z/z₀. Eq. (12) divides a sum over N_f by N_s and "
         "calls N, the number of circles, what must be that of actuators."),
        (*(Number(f"film's surface, {name}", value, "m²")
           for name, value in zip(NAMES, surfaces, strict=True)),
         Number("largest difference from Table 1", off, "m²"),
         *(Number(f"percentage from the ranges, {name}, {1e3 * mass:g} g", float(shares[r, c]), "%")
           for r, mass in enumerate(MASSES) for c, name in enumerate(NAMES)),
         Number("percentages that do not follow", float(len(far))),
         Number("thickness ratio", thickness), Number("stretch along each axis", stretch)))
