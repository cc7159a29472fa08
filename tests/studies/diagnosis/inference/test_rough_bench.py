"""A bench where nothing is quite as stated, and one thing is far off or nothing is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.trials import design, every_cause, read, size_of
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import sizes_at


@pytest.mark.study(seconds=18)
@pytest.mark.parametrize("large", ["drift", "sensor_zero"])
def test_what_is_large_is_named_among_much_that_is_small(three_shapes: Simulation, large: str
                                                         ) -> None:
    """No two causes leave noise alone; but small errors of every kind beside that one do."""
    causes, generator = every_cause(three_shapes), np.random.default_rng(2)
    small = {cause: sizes_at(generator, cause, 0.3 * abs(generator.normal())) for cause in causes}
    size = size_of(Cause(large), 12.0)
    sizes = np.concatenate([*(small | {Cause(large): np.array([size])}).values()])
    table = read(three_shapes, design(6e-6), tuple(causes), sizes.tolist(), 2)
    judged = judge(three_shapes, table, causes)
    assert judged.named == (Cause(large),)
    assert judged.weighed.small_errors in (0.1, 0.2, 0.3, 0.5)
    assert judged.chosen is not None
    _, low, high = interval(judged.chosen, 2)
    assert low < size < high
    # Its size is told less sharply than beside noise alone.
    alone = fit(judged.simulation, judged.named, judged.table, judged.chosen.unknowns)
    _, lowest, highest = interval(alone, 2)
    assert high - low > 1.5 * (highest - lowest)
