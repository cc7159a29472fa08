"""How far α changes with the mesh, the material and the range of loads."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha.samples import LoadGrid
from tympan.studies.alpha.weights import AlphaResult, AlphaSettings, Progress, alpha
from tympan.studies.case import Settings

Ranges = tuple[tuple[float, float], ...]

_FINER = 1.5


def uncertainty(specimen: Specimen, settings: Settings, alpha_settings: AlphaSettings, rig: Rig,
                nominal: AlphaResult, progress: Progress = lambda _: None
                ) -> dict[str, Ranges | None]:
    """Smallest and largest of each weight of ``nominal``'s membrane circles, by what was changed.

    ``mesh``: elements finer by 1.5. ``material``: each material of the library in the film's place.
    ``loads``: each mass of the fit alone, and the lower and upper half of its voltages. None where
    nothing could be changed; a change without an equilibrium to fit is left out.
    """
    film, fit = specimen.membrane, alpha_settings.fit
    half, voltages = len(fit.voltages) // 2, tuple(sorted(fit.voltages))
    grids = {f"{mass * 1e3:g} g alone": LoadGrid((mass,), fit.voltages)
             for mass in fit.masses if len(fit.masses) > 1}
    if half:
        grids |= {"lower voltages": LoadGrid(fit.masses, voltages[:half]),
                  "higher voltages": LoadGrid(fit.masses, voltages[half:])}
    finer = replace(settings, mesh=settings.mesh.refined(_FINER))
    changes: dict[str, Iterable[tuple[str, Specimen, Settings, AlphaSettings]]] = {
        "mesh": [("a finer mesh", specimen, finer, alpha_settings)],
        "material": [(name, replace(specimen, membrane=replace(film, material=entry.material)),
                      settings, alpha_settings)
                     for name, entry in MATERIALS.items() if entry.material != film.material],
        "loads": [(name, specimen, settings, replace(alpha_settings, fit=grid))
                  for name, grid in grids.items()]}
    ranges: dict[str, Ranges | None] = {}
    for kind, cases in changes.items():
        weights = [nominal.by_basis["membrane"].alpha]
        for name, changed, mesh, loads in cases:
            progress(f"{specimen.name}: α with {name}")
            try:
                result = alpha(changed, mesh, loads, rig, radii=nominal.circles)
            except InputError:
                continue
            weights.append(result.by_basis["membrane"].alpha)
        columns = zip(*weights, strict=True)
        ranges[kind] = (tuple((min(column), max(column)) for column in columns)
                        if len(weights) > 1 else None)
    return ranges
