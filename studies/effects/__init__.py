"""Effects: what measured data may hold and the nominal model leaves out.

A new effect is a function in :mod:`~tympan.studies.effects.library` under the decorator
:func:`~tympan.studies.effects.effect.effect`. Diagnoses, the contract tests and the documentation
follow the registry. One that needs what specimens and rigs do not have yet (viscosity, a history of
voltages) adds that to :class:`~tympan.geometry.specimen.Film` or a record of :mod:`tympan.fem.rig`.

Effects of users' own packages are loaded by entry points of the group ``tympan.effects``
(:mod:`tympan.base.plugins`).

Several effects are applied in the order of the registry, whatever the order they are named in: the
material first, so that the flat state its stress refers to is the nominal one.
"""

from tympan.studies.effects.effect import EFFECTS, Effect, EffectParameter, Setup, Use, extended

# isort: split
from tympan.base.plugins import load_plugins
from tympan.studies.effects import library as library

load_plugins("tympan.effects", EFFECTS)

__all__ = ["EFFECTS", "Effect", "EffectParameter", "Setup", "Use", "extended"]
