"""What was read of coupons and what both models say of it; films at other temperatures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.specimen import Specimen
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reduced.coupon_tests import ICE, USUAL_KELVIN, CouponTests
from tympan.studies.diagnosis.result import Columns


def strips(tests: CouponTests, judged: Judgement, chosen: Fit | None) -> Columns:
    """The readings with both models, by the columns of strips.csv."""
    table, coupons, row = judged.table, tests.coupons, tests.rows
    names = [specimen.name for specimen in judged.simulation.setup.specimens]
    nominal, best = judged.nominal, chosen or judged.nominal
    return {
        "line": table.line,
        "specimen": np.array([names[number] for number in tests.film[row].tolist()], str),
        "run": table.run, "leg": table.states.run[table.state], "mode": coupons.mode[row],
        "t": coupons.time[row], "stretch": coupons.stretch[row], "voltage": coupons.volts[row],
        "temperature_C": coupons.degrees[row], "sigma": table.noise.total,
        "read": table.value, "baseline": nominal.predicted(table),
        "extended": best.predicted(table)}


def at_temperature(specimen: Specimen, celsius: float) -> Specimen:
    """The specimen as its film is at a temperature [°C], under a name of its own."""
    film = specimen.membrane
    factor = ((celsius + ICE) / USUAL_KELVIN) ** film.temperature_power
    warm = replace(film, material=scaled(film.material, factor), temperature_power=0.0,
                   branches=tuple(replace(branch, modulus=factor * branch.modulus)
                                  for branch in film.branches))
    return replace(specimen, name=f"{specimen.name} at {celsius:.4g} C", membrane=warm)
