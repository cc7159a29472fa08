"""Films as VTU files: z is upwards; files of older versions, where it was not, read the same."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.support.models import deformed, model
from tests.support.specimens import circular
from tympan.fem.membrane.state import State
from tympan.studies.film_surface import FilmSurface, film_surface


@pytest.fixture(scope="module")
def loaded() -> FilmSurface:
    """A film that hangs, with a further field of vectors."""
    made = model(circular(), refine=0.5, order=2, symmetry=False)
    positions, plate = deformed(made)
    vectors = positions - made.discretisation.reference
    return film_surface(made, State(positions, plate), parts=2, critical_mode=vectors)


def test_files_have_z_upwards_and_the_deflection_beside(loaded: FilmSurface, tmp_path: Path
                                                        ) -> None:
    loaded.save(tmp_path / "film.vtu")
    stored = meshio.read(tmp_path / "film.vtu")
    down = loaded.values["displacement"][:, 2]
    assert down.max() > 3e-3
    assert np.array_equal(stored.point_data["deflection"], down)
    assert np.array_equal(stored.points, loaded.points * (1, 1, -1))
    for name in ("displacement", "critical_mode"):
        assert np.array_equal(stored.point_data[name], loaded.values[name] * (1, 1, -1))
    assert np.array_equal(stored.point_data["stress_1"], loaded.values["stress_1"])
    assert not np.signbit(stored.points[stored.points == 0]).any()


@pytest.mark.parametrize("old", [False, True])
def test_files_of_this_version_and_of_older_ones_read_the_same(loaded: FilmSurface, old: bool,
                                                               tmp_path: Path) -> None:
    file = tmp_path / "film.vtu"
    if old:
        meshio.write(file, meshio.Mesh(loaded.points, [("triangle", loaded.triangles)],
                                       point_data=dict(loaded.values)))
    else:
        loaded.save(file)
    read = FilmSurface.load(file)
    assert np.array_equal(read.points, loaded.points)
    assert np.array_equal(read.triangles, loaded.triangles)
    assert read.values.keys() == loaded.values.keys()
    for name, values in loaded.values.items():
        assert np.array_equal(read.values[name], values)
