"""The round actuators that readings with something hidden in them are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

GRAVITY, THICKNESS, STRETCH = 9.80665, 1e-3, 5**0.5
#: Radii of plate and frame [m], by name.
SHAPES = {"small": (8e-3, 3e-2), "middle": (1e-2, 4.5e-2), "large": (1e-2, 7e-2)}
MASSES = (1e-2, 2e-2)


@dataclass(frozen=True)
class Hidden:
    """What is there and nobody states [SI]; stiffness and permittivity are factors.

    ``branch`` is a modulus, ``time`` its own; ``others`` are more of them.
    """

    stiffness: float = 1.05
    permittivity: float = 0.97
    electrode: float = 0.0
    unaccounted: float = 0.0
    added: float = 0.0
    spring: float = 0.0
    air: float = 0.0
    tether: float = 0.0
    branch: float = 0.0
    time: float = 5.0
    others: tuple[tuple[float, float], ...] = ()
    damping: float = 0.0
    resistance: float = 0.0
    lag: float = 0.0

    def only(self, *names: str) -> None:
        """Refuse what those who make the readings do not know, but for the two factors."""
        unknown = [field.name for field in fields(self)
                   if field.name not in ("stiffness", "permittivity", *names)
                   and getattr(self, field.name) != field.default]
        if unknown:
            raise ValueError(f"cannot be hidden in these readings: {unknown}")


SPECIMEN = """[[specimen]]
name = "{name}"
frame = {{ shape = "circle", radius = "{frame} m" }}
plate = {{ shape = "circle", radius = "{plate} m" }}
[specimen.membrane]
thickness = "1 mm"
prestretch = [{stretch!r}, {stretch!r}]
relative_permittivity = 4.7
{density}material = {{ law = "neo_hooke", mu = "20 kPa" }}
"""


def specimen_table(name: str, density: float | None = None) -> str:
    """A shape as a table of dataset.toml; with the film's density [kg/m³] where it has mass."""
    plate, frame = SHAPES[name]
    line = "" if density is None else f'density = "{density:g} kg/m^3"\n'
    return SPECIMEN.format(name=name, plate=plate, frame=frame, stretch=STRETCH, density=line)


def dataset_file(noise: float, shapes: Iterable[str] = SHAPES,
                 density: float | None = None) -> str:
    """What dataset.toml says of some shapes and of the noise of readings [m]."""
    return f'name = "hidden"\nnoise = "{1e6 * noise} um"\n' + "".join(
        specimen_table(name, density) for name in shapes)
