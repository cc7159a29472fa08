"""Films of a diagnosis under measured loads: the extended model's, compared with the nominal's.

They are solved by finite elements, as ``tympan solve`` solves the specimens that a diagnosis
writes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator

from tympan.base.errors import InputError
from tympan.studies.case import Case, Settings, solve
from tympan.studies.diagnosis.calibration import read_film
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import LoadedFilm
from tympan.studies.effects import Setup
from tympan.studies.film_surface import FilmSurface

#: Most specimens whose films are solved and stored: a page has no room for more.
_MOST = 12
#: Loads tried for each specimen, from the largest on: under the largest one the film may have no
#: equilibrium.
_TRIED = 4


def loaded_films(judged: Judgement, extended: Setup | None) -> Iterator[LoadedFilm]:
    """Solve each specimen's film under its largest load at which both models have one."""
    if not judged.simulation.loaded:
        return
    nominal = judged.simulation.extended((), judged.nominal.unknowns)
    setups = nominal, extended or nominal
    for number in np.unique(judged.table.specimen).tolist()[:_MOST]:
        for mass, voltage, state in _loads(judged.table, number)[:_TRIED]:
            films = [_film(Case(read_film(setup, judged.table.states, state), mass=mass,
                                voltage=voltage, rig=setup.rig), Settings(formula=setup.formula))
                     for setup in setups]
            if films[0] is not None and films[1] is not None:
                yield LoadedFilm(nominal.specimens[number].name, mass, voltage,
                                 over_nominal(films[1], films[0]))
                break


def _loads(table: ReadingTable, number: int) -> list[tuple[float, float, int]]:
    """List masses [kg] and voltages [V] under which a specimen was read, largest first.

    Each has the number of a state.
    """
    rows = table.specimen == number
    loads = zip(table.mass[rows].tolist(), table.voltage[rows].tolist(),
                table.state[rows].tolist(), strict=True)
    states = {(mass, voltage): state for mass, voltage, state in loads}
    return sorted(((*load, state) for load, state in states.items()), reverse=True)


def _film(case: Case, settings: Settings) -> FilmSurface | None:
    try:
        return solve(case, settings, film=True).film
    except InputError:  # an effect may lead to a film that cannot be meshed
        return None


def over_nominal(film: FilmSurface, nominal: FilmSurface) -> FilmSurface:
    """Add ``nominal_deflection`` [m] at a film's points, from a film in the same frame."""
    deflection = nominal.values["displacement"][:, 2]
    if film.mounted.shape != nominal.mounted.shape or not np.allclose(
            film.mounted, nominal.mounted, rtol=0, atol=1e-9):
        # The plate may be shifted: where it hides the other film, the depth is that of its rim.
        places, first = np.unique(nominal.mounted[:, :2], axis=0, return_index=True)
        between = LinearNDInterpolator(places, deflection[first], fill_value=0.0)
        deflection = between(film.mounted[:, :2])
    return replace(film, values={**film.values, "nominal_deflection": np.asarray(deflection)})
