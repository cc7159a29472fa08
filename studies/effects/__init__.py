"""Effects: what measured data may hold and the nominal model leaves out; one small file each.

A new effect is a file here that registers an :class:`~tympan.studies.effects.effect.Effect` and an
entry in
:data:`_FILES` below. The contract tests and ``docs/effects.md`` follow the registry. One that needs
what specimens and rigs do not have yet (viscosity, a history of voltages) adds that to
:class:`~tympan.geometry.specimen.Film` or
:class:`~tympan.fem.rig.Rig`.

Several effects are applied in the order below whatever the order they are named in: the material
first, so that the flat state its stress refers to is the nominal one.
"""

from importlib import import_module

from tympan.studies.effects.effect import REGISTRY, Effect, Parameter, Setup, Use, extended

_FILES = (
    "film.strain_stiffening", "film.permittivity_stretch", "film.prestretch_anisotropy",
    "film.prestretch_loss", "film.electrode_margin", "film.electrode_stiffness",
    "plate.plate_eccentricity", "plate.unaccounted_mass", "plate.parallel_spring",
    "voltage.amplifier_gain", "voltage.voltage_sag", "voltage.hysteresis",
    "sensor.sensor_gain", "sensor.sensor_zero", "sensor.drift", "film.cone_kinematics",
)

for _file in _FILES:
    import_module(f"tympan.studies.effects.{_file}")

__all__ = ["REGISTRY", "Effect", "Parameter", "Setup", "Use", "extended"]
