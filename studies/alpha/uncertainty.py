"""How far α changes with what a user may choose otherwise.

The mesh, the material, the range of loads.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha.samples import LoadGrid
from tympan.studies.alpha.weights import AlphaResult, AlphaSettings, Progress, alpha
from tympan.studies.case import Settings

Ranges = tuple[tuple[float, float], ...]

_FINER = 1.5


@dataclass(frozen=True)
class Uncertainty:
    """Smallest and largest of each weight of the same membrane circles, by what was changed.

    ``mesh``: elements finer by 1.5. ``material``: each material of the library in the film's place.
    ``loads``: each mass of the fit alone, and the lower and upper half of its voltages. None where
    nothing could be changed.
    """

    mesh: Ranges | None
    material: Ranges | None
    loads: Ranges | None

    def json(self) -> dict[str, list[list[float]] | None]:
        """As a JSON object."""
        return {item.name: None if (ranges := getattr(self, item.name)) is None
                else [list(pair) for pair in ranges]
                for item in fields(self)}


def uncertainty(specimen: Specimen, settings: Settings, alpha_settings: AlphaSettings, rig: Rig,
                nominal: AlphaResult,
                progress: Progress = lambda _: None) -> Uncertainty:
    """Of the weights of a shape that ``nominal`` has.

    A change without an equilibrium to fit is left out.
    """

    def ranges(changes: Iterator[tuple[str, Specimen, Settings, AlphaSettings]]) -> Ranges | None:
        found = []
        for name, changed, finer, loads in changes:
            progress(f"{specimen.name}: α with {name}")
            try:
                found.append(alpha(changed, finer, loads, rig,
                                   radii=nominal.circles).by_basis["membrane"].alpha)
            except InputError:
                continue
        columns = zip(nominal.by_basis["membrane"].alpha, *found, strict=True)
        return tuple((min(column), max(column)) for column in columns) if found else None

    finer = replace(settings, mesh=settings.mesh.refined(_FINER))
    film = specimen.membrane
    others = ((name, replace(specimen, membrane=replace(film, material=entry.material)), settings,
               alpha_settings)
              for name, entry in MATERIALS.items() if entry.material != film.material)
    return Uncertainty(ranges(iter([("a finer mesh", specimen, finer, alpha_settings)])),
                       ranges(others),
                       ranges(((name, specimen, settings, replace(alpha_settings, fit=grid))
                               for name, grid in _parts(alpha_settings.fit))))


def _parts(loads: LoadGrid) -> Iterator[tuple[str, LoadGrid]]:
    if len(loads.masses) > 1:
        yield from ((f"{mass * 1e3:g} g alone", LoadGrid((mass,), loads.voltages))
                    for mass in loads.masses)
    if len(loads.voltages) > 1:
        half = len(loads.voltages) // 2
        voltages = tuple(sorted(loads.voltages))
        yield "lower voltages", LoadGrid(loads.masses, voltages[:half])
        yield "higher voltages", LoadGrid(loads.masses, voltages[half:])
