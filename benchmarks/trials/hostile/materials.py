"""Coupon tests that would mislead a film, and films beyond the law they are made of."""

from __future__ import annotations

import numpy as np

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import OVAL, SOLVE

#: An elastic rubber on one ramp at one rate: Ogden, 300 kPa with 2 and 3 kPa with 7.
_STRETCH = np.linspace(1.02, 3.0, 40)
RAMP = "mode,stretch,nominal_stress_kPa,t_s,run\n" + "".join(
    f"uniaxial,{x:.4f},{300 * (x - x**-2) + 3 * (x**6 - x**-4.5):.3f},{5 * (x - 1):.3f},1\n"
    for x in _STRETCH)
FEW = "--law neo_hooke --law yeoh --law ogden_1"
#: A law as strips gave it, and a film whose thickness no strip has reached.
FITTED = OVAL + '[membrane.material]\nlaw = "neo_hooke"\nmu = "16 kPa"\nrange = '


@group("materials")
def materials() -> Cases:
    """Fits that say what they cannot know; results that say what was not tested."""
    yield Case("one ramp", f"material fit ramp.csv {FEW}", {"ramp.csv": RAMP}, status=0,
               shows="cannot tell time from stretch(.|\n)*another rate", never="branch]]|Traceback")
    yield Case("branches of one ramp", f"material fit ramp.csv {FEW} --branches 1",
               {"ramp.csv": RAMP}, "--branches: given 1: must be 0: .*cannot tell time")
    yield Case("law far off", f"material fit ramp.csv {FEW}", {"ramp.csv": RAMP}, status=0,
               shows="ogden_1 is ranked last: in equibiaxial")
    yield Case("film without mass", f"material fit ramp.csv {FEW} --film specimen.toml",
               {"ramp.csv": RAMP}, "--mass")
    yield Case("mass without film", f"material fit ramp.csv {FEW} --mass '1 g'",
               {"ramp.csv": RAMP}, "--film")
    yield Case("beyond the law's range", SOLVE, {"specimen.toml": FITTED + "[0.41, 6]\n"},
               status=0, shows="outside its range 0.41 to 6: .*thickness stretch")
    yield Case("range upside down", SOLVE, {"specimen.toml": FITTED + "[6, 0.41]\n"},
               "specimen.toml: membrane.material.range: .*the smaller first")
