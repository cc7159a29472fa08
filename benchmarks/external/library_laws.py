"""Laws of the library's silicones and rubber: how they were found, and checks not fitted to.

``python -m benchmarks.external.library_laws`` prints the constants, and the checks of
docs/howto/materials.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.external.rubber import foretold, load
from tympan.base.arrays import Array
from tympan.fem.film.laws import Yeoh
from tympan.studies.data.coupon import MODES
from tympan.studies.material.families import FAMILIES

#: Largest stretch of Treloar's readings that is fitted: beyond it his rubber crystallises.
CRYSTALLISES = 5.0
#: Smallest stretch at which a ratio of stresses of two rubbers is taken: below, it is noise.
_SEEN = 1.05

#: Sylgard 184 cured 48 min at 100 °C: Young's modulus [Pa], from a nominal stress that is linear in
#: the strain up to the strain below it. Johnston and others, J. Micromech. Microeng. 24, 035017
#: (2014), as a catalogue of material references transcribes its Table 2.
SYLGARD_MODULUS = 2.05e6
#: The strain up to which they found it linear.
SYLGARD_STRAIN = 0.4
#: Half of the 95 % interval of that modulus [Pa], six strips.
SYLGARD_INTERVAL = 0.12e6
#: Stretch and nominal stress [Pa] at which Sylgard 184 breaks: Table 2 of PMC11019708, after its
#: maker.
SYLGARD_BREAKS = (2.4, 7.1e6)
#: Shore A hardness and Young's modulus [Pa] of Sylgard 184 cured at 25 and at 200 °C: abstract of
#: Johnston and others, which gives both as ranges over the temperatures of curing.
SYLGARD_HARDNESS = ((44.0, 1.32e6), (54.0, 2.97e6))

#: Elastosil Film 2030, Yeoh's constants [Pa]: Hoffstadt, Koellnberger, Maas, ACTUATOR 2018, as
#: Solano, Zhang, Cattafesta quote them.
ELASTOSIL = Yeoh((180.7e3, -16.7e3, 6.6e3))
#: Its Shore A hardness, of its maker's product listing.
ELASTOSIL_HARDNESS = 27.0
#: Prestretches of two films by their static deflection and by their resonance, after that law:
#: Solano, Zhang, Cattafesta, Table 3. Where the law and both measurements hold, they agree.
ELASTOSIL_FILMS = ((1.17, 1.13), (1.46, 1.29))


@dataclass(frozen=True)
class Check:
    """What a law says of something it was not fitted to, and what was measured."""

    material: str
    what: str
    law: float
    measured: float

    @property
    def off(self) -> float:
        """Relative error of the law."""
        return self.law / self.measured - 1


def rubber() -> tuple[Array, dict[str, float]]:
    """Constants of Ogden's law for Treloar's rubber, and its error in each mode over the stress.

    It is fitted to his uniaxial and equibiaxial readings; pure shear is held out.
    """
    coupons = load("treloar_1944")
    result = foretold("ogden_3", coupons[coupons.stretch <= CRYSTALLISES],
                      ("uniaxial", "equibiaxial"))
    return result.values, result.error


def other_rubber(values: Array) -> dict[str, float]:
    """Stress of Kawabata's rubber over that of the law, by mode: the factor with least error."""
    coupons, factors = load("kawabata_1981"), {}
    for mode in MODES:
        part = coupons[(coupons.mode == mode) & (coupons.stretch > _SEEN)]
        stress = FAMILIES["ogden_3"].stress(*part.in_plane, values)
        factors[mode] = float(stress @ part.stress / (stress @ stress))
    return factors


def sylgard() -> tuple[Yeoh, float]:
    """Yeoh's law of two constants on the line of Sylgard 184, and its error over the stress.

    A third constant follows the line no better than its rounding, and turns down beyond it.
    """
    stretch = np.linspace(1.02, 1 + SYLGARD_STRAIN, 20)
    stress = SYLGARD_MODULUS * (stretch - 1)
    columns = FAMILIES["yeoh"].columns(stretch, stretch**-0.5, np.empty(0))[:, :2]
    c, *_ = np.linalg.lstsq(columns, stress)
    missed = columns @ c - stress
    return Yeoh(tuple(c.tolist())), float(np.sqrt(np.mean(missed**2) / np.mean(stress**2)))


def modulus_of_hardness(shore: float) -> float:
    """Young's modulus [Pa] of a rubber of a Shore A hardness.

    Gent, Rubber Chem. Technol. 31, 896 (1958), as commonly quoted, not read.
    """
    return 1e6 * 0.0981 * (56 + 7.62336 * shore) / (0.137505 * (254 - 2.54 * shore))


def checks() -> list[Check]:
    """Every check of a law against what it was not fitted to."""
    breaks, strength = SYLGARD_BREAKS
    law, _ = sylgard()
    return [
        Check("sylgard-184", "nominal stress at break, stretch 2.4 [Pa]",
              float(law.derivatives(breaks, breaks**-0.5)[1]), strength),
        *(Check("sylgard-184", f"modulus of Shore A {shore:g} [Pa]", modulus_of_hardness(shore),
                modulus) for shore, modulus in SYLGARD_HARDNESS),
        Check("elastosil-2030", "initial modulus, from Shore A 27 [Pa]", 6 * ELASTOSIL.c[0],
              modulus_of_hardness(ELASTOSIL_HARDNESS)),
        *(Check("elastosil-2030", f"tension of a film, static {still:g}, resonance {swings:g} [Pa]",
                _tension(still), _tension(swings)) for still, swings in ELASTOSIL_FILMS)]


def _tension(stretch: float) -> float:
    """Force per length of an equibiaxial film of Elastosil over its virgin thickness [Pa]."""
    return float(ELASTOSIL.derivatives(stretch, stretch)[1]) / stretch


def main() -> None:
    """Print constants and checks."""
    values, errors = rubber()
    law, error = sylgard()
    print("natural-rubber, ogden:", np.array2string(values, precision=6))
    print("  error by mode, pure shear held out:", errors)
    print("  Kawabata's rubber over the law:", other_rubber(values))
    print(f"sylgard-184, yeoh: {law.c}, error on the line {error:.3f}")
    for check in checks():
        print(f"{check.material}: {check.what}: law {check.law:.4g}, measured {check.measured:.4g}"
              f", {check.off:+.0%}")


if __name__ == "__main__":
    main()
