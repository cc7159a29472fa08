"""A lumped model as a file to take away: TOML with plain SI numbers; it reads back equal."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.studies.circles import MembraneCircle
from tympan.studies.files import write_text
from tympan.studies.lumped.actuator import Actuator, Viscous

_HEAD = """\
# The lumped model of an actuator, built by tympan from its field model. SI; keys name the units.
# With y the deflection, u the voltage, r the radius of the circle with the plate's area, and for
# every circle j, of radius R_j:
#   V_j k_j^2 = 2 pi z0/ln(R_j/r),  k_j^2 = (1/r^2 - 1/R_j^2)/(2 ln(R_j/r)^3),
#   l_j = lp sqrt(1 + (k_j y)^2),
#   film energy   E = stiffness sum_j alpha_j V_j (W(l_j, lp) - W(lp, lp))
#   capacitance   C = flat_capacitance
#                     + permittivity sum_j alpha_j V_j eps0 eps_r (l_j^2 - lp^2) lp^2/T^2
#   rest          m g = dE/dy - u^2/2 dC/dy
# T virgin thickness, lp = sqrt(prestretch_x prestretch_y), z0 = T/lp^2, W the material's law (per
# virgin volume). With permittivity_exponent n the bracket in C is
#   lp^(2n) ((l_j lp)^(2 - n) - lp^(4 - 2n)).
# In motion each circle adds to the force
#   alpha_j v_j phi_j/x_j (k1 (x_j - 1 - e_j) + eta2 phi_j dy/dt),  e_j' = k1/eta1 (x_j - 1 - e_j),
# with the paper's cone: x_j = sqrt(1 + (y/L_j)^2), phi_j = dx_j/dy, L_j = R_j - r,
# v_j = 2 pi r z0 L_j.
# Up to highest_voltage the field model was compared; the lumped one knows nothing of pull-in,
# which comes above it.

"""

_WEIGHT: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")


@dataclass(frozen=True)
class LumpedModel:
    """What stands for a specimen: circles of radii [m], the shortest first, weights α, two factors.

    The film's law, thickness, prestretch and permittivity, and the plate's size, are those of
    ``specimen``. ``flat_capacitance`` is the whole flat film's [F], ``highest_voltage`` the highest
    across the film [V] that it is for: these circles keep their hoop stretch, so they do not pull
    in where the film does.
    """

    specimen: Specimen
    radii: tuple[float, ...]
    weights: tuple[float, ...]
    flat_capacitance: float
    highest_voltage: float
    stiffness: float = 1.0
    permittivity: float = 1.0
    viscous: Viscous = field(default_factory=Viscous)

    @property
    def circles(self) -> MembraneCircle:
        """The circles, ready to be moved."""
        return MembraneCircle(self.specimen, np.array(self.radii),
                              flat_capacitance=self.flat_capacitance)

    def check(self, voltage: float) -> None:
        """Refuse a voltage across the film [V] beyond those it is for.

        Raises
        ------
        InputError
            Naming both.
        """
        if abs(voltage) > self.highest_voltage * (1 + 1e-9):
            raise InputError(f"the model was built for at most {self.highest_voltage / 1e3:.5g} kV "
                             "across the film and does not know where it pulls in: build it for "
                             "more with --voltages",
                             key=self.specimen.name, given=f"{voltage / 1e3:.5g} kV")

    def actuator(self, mass: float, rig: Rig = Rig()) -> Actuator:
        """It under a mass [kg]."""
        return Actuator(self.circles, self.weights, mass, self.viscous, rig,
                        self.stiffness, self.permittivity)


def write_model(file: Path, model: LumpedModel) -> None:
    """Write a model's file.

    Raises
    ------
    InputError
        When the specimen's material cannot be written.
    """
    viscous = model.viscous
    content = {
        "stiffness": model.stiffness, "permittivity": model.permittivity,
        "flat_capacitance_F": model.flat_capacitance, "highest_voltage_V": model.highest_voltage,
        "viscous": {"k1_Pa": viscous.k1, "eta1_Pa_s": viscous.eta1, "eta2_Pa_s": viscous.eta2},
        "circle": [{"radius_m": radius, "alpha": weight}
                   for radius, weight in zip(model.radii, model.weights, strict=True)],
        "specimen": specimen_content(model.specimen, plain=True),
    }
    write_text(file, _HEAD + toml(content))


def read_model(file: Path | str) -> LumpedModel:
    """The model of a file.

    Raises
    ------
    InputError
        Naming file, key, what was given and what is allowed.
    """
    table = Table.read(file)
    specimen = load_specimen(replace(table.table("specimen"), plain=True))
    circles = table.tables("circle")
    if not circles:
        raise table.error("circle", "must be at least one circle")
    radii = tuple(circle.number("radius_m", rule=POSITIVE) for circle in circles)
    weights = tuple(circle.number("alpha", rule=_WEIGHT) for circle in circles)
    inside = sum(specimen.plate.outline.semi_axes) / 2
    if min(radii) <= inside:
        raise table.error("circle", f"radii must be larger than the plate's, {inside:g} m",
                          min(radii))
    viscous = table.table("viscous")
    model = LumpedModel(
        specimen, radii, weights, table.number("flat_capacitance_F", rule=NON_NEGATIVE),
        table.number("highest_voltage_V", rule=POSITIVE), table.number("stiffness", rule=POSITIVE),
        table.number("permittivity", rule=NON_NEGATIVE),
        Viscous(viscous.number("k1_Pa", rule=NON_NEGATIVE),
                viscous.number("eta1_Pa_s", rule=POSITIVE),
                viscous.number("eta2_Pa_s", rule=NON_NEGATIVE)))
    for part in (*circles, viscous, table):
        part.done()
    if abs(sum(weights) - 1) > 1e-9:
        raise table.error("circle", "alpha of all circles must add up to 1", sum(weights))
    return model
