"""Effects: what measured data may hold and the nominal model leaves out; one small file each.

A new effect is a file here that registers an :class:`~studies.effects.effect.Effect` and an entry in :data:`_FILES`
below. The contract tests and ``docs/effects.md`` follow the registry. One that needs what specimens and rigs do not
have yet (viscosity, a history of voltages) adds that to :class:`~geometry.specimen.Film` or :class:`~fem.rig.Rig`.

Several effects are applied in the order below whatever the order they are named in: the material first, so that the
flat state its stress refers to is the nominal one.
"""

from importlib import import_module

from studies.effects.effect import REGISTRY, Effect, Parameter, Setup, Use, extended

_FILES = (
    "strain_stiffening", "permittivity_stretch", "prestretch_anisotropy", "prestretch_loss", "electrode_margin",
    "electrode_stiffness", "plate_eccentricity", "unaccounted_mass", "parallel_spring", "amplifier_gain", "voltage_sag",
    "hysteresis", "sensor_gain", "sensor_zero", "drift",
)

for _file in _FILES:
    import_module(f"studies.effects.{_file}")

__all__ = ["REGISTRY", "Effect", "Parameter", "Setup", "Use", "extended"]
