"""Flow of the dashpots of viscous branches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from tympan.base.fields import Key
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule
from tympan.geometry.specimen import FLOWS

_SHARE: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")
_POWER: Rule = (lambda x: 0 < x <= 20, "must be above 0, at most 20")


@FLOWS.register
@dataclass(frozen=True)
class ShearThinning:
    """A viscosity that grows with the dashpot's stretch and falls with the stress that drives it.

    η/η₀ = r + (1 − r + k (I₁ᵛ^β₁ − 3^β₁)) / (1 + (J₂/σ²)^β₂), I₁ᵛ = tr C_v, J₂ = (I₁ᵉ²/3 − I₂ᵉ) μ²
    of C C_v⁻¹, half the square of the branch's deviatoric Kirchhoff stress. Kumar and Lopez-Pamies
    (C. R. Mecanique 344, 2016) give it for a neo-Hookean branch, with r = η_∞/η₀, k = K₁/η₀, σ =
    K₂^(−1/2); it is taken from FElupe's example of that paper, and the paper itself was not read.
    The branch's ``time`` is η₀/μ. Their VHB 4910, whose branch has two other terms, has η₀ 7014 kPa
    s, η_∞ 0.1 kPa s, K₁ 3507 kPa s, K₂ 1 kPa⁻², β₁ 1.852, β₂ 0.26.

    Examples
    --------
    At the stress σ the viscosity has lost half of the falling part:

    >>> ShearThinning(1e3, 2.0, least_viscosity=0.5).relative_viscosity(3.0, 1e6)
    0.75
    """

    flow: ClassVar[str] = "shear_thinning"
    thinning_stress: Annotated[float, Key("σ: stress at which half is gone of what falls",
                                          "stress", POSITIVE)]
    thinning_exponent: Annotated[float, Key("β₂", rule=_POWER)]
    least_viscosity: Annotated[float, Key("r: what is left of η₀ at large stresses",
                                          rule=_SHARE)] = 0.0
    stretch_gain: Annotated[float, Key("k: growth with the dashpot's stretch, over η₀",
                                       rule=NON_NEGATIVE)] = 0.0
    stretch_exponent: Annotated[float, Key("β₁ of that growth", rule=_POWER)] = 1.0

    def relative_viscosity(self, stretch: Any, stress_squared: Any) -> Any:
        grown = stretch**self.stretch_exponent - 3.0**self.stretch_exponent
        falls = 1 - self.least_viscosity + self.stretch_gain * grown
        share = stress_squared / self.thinning_stress**2
        return self.least_viscosity + falls / (1 + share**self.thinning_exponent)
