"""Feed-forward of a steered plate: places at rest whose voltages move the plate along a path.

At a frequency the film is stiffer than at rest: its branches have no time to flow, and the plate
has inertia. On the wanted path p, with its branches' places z_b, the model needs voltages with

½ Σ u_i ∂C_i/∂p = ∂W/∂p − f + F,   F = M p̈ + D ṗ + Σ K_b (p − z_b),   ż_b = (p − z_b)/τ_b.

So motion adds a force F to the static map, and the static inverse holds the plate against it if it
is asked for the place that the linear film of the centre would have under −F. The freedoms that
are not steered move along without inertia.

A voltage holds for a sample, so path, speed and F are those of its middle. The wanted place is
therefore given one sample ahead. F is exact for the linear model; :func:`moving_voltages` is the
same without linearisation, and slower.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.lumped.steered.inverse import SteeredInverse, held_at
from tympan.studies.lumped.steered.model import SteeredModel


@dataclass(frozen=True, eq=False)
class Forward:
    """v = C m + D r and m⁺ = A m + B r: places to ask for, of wanted places a sample ahead.

    r is the place wanted at the end of the sample; the memory m has the branches' places and the
    wanted places now and a sample ago. ``rest``: the memory after a long rest at a place. All
    places are relative to the centre.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    rest: Array

    @classmethod
    def of(cls, model: SteeredModel, inverse: SteeredInverse, interval: float) -> Forward:
        """Linearise a model's motion about the centre of its inverse."""
        squared = inverse.squared(inverse.centre)
        linear, start = model.linearise(squared), model.rest(squared)
        _, stiffness, by_u = model.pull(start, squared)
        asked = np.linalg.pinv(linear.gain * inverse.supply**2) * inverse.supply**2
        left, half = model.springs_over(interval / 2)
        seen, count, many = model.steered, len(model.steered), len(left) * model.count
        hidden = [number for number in range(model.count) if number not in seen]
        # Columns: branches, places now, a sample ago, a sample ahead.
        now, before, ahead = (slice(many + part * count, many + (part + 1) * count)
                              for part in range(3))
        path, speed, bend = (np.zeros((count, many + 3 * count)) for _ in range(3))
        unit = np.eye(count)
        path[:, now], path[:, ahead] = unit / 2, unit / 2
        speed[:, now], speed[:, ahead] = -unit / interval, unit / interval
        bend[:, before], bend[:, now], bend[:, ahead] = (
            unit / interval**2, -2 * unit / interval**2, unit / interval**2)
        force = (model.mass[:, seen] @ bend + model.damping[:, seen] @ speed
                 + (stiffness + half)[:, seen] @ path)
        force[:, :many] -= np.hstack(list(left[:, None, None] * model.springs))
        # Unknown are the places to ask for, and the freedoms that move along.
        found = np.linalg.solve(np.hstack([-by_u @ asked, -(stiffness + half)[:, hidden]]), force)
        moved = np.zeros((model.count, many + 3 * count))
        moved[seen], moved[hidden] = path, found[count:]
        whole = np.zeros((many + 2 * count, many + 3 * count))
        for branch, share in enumerate(left**2):
            rows = slice(branch * model.count, (branch + 1) * model.count)
            whole[rows] = (1 - share) * moved
            whole[rows, rows] += share * np.eye(model.count)
        whole[now, ahead] = whole[before, now] = unit
        still = -np.linalg.solve(stiffness, by_u @ asked)
        return cls(whole[:, :-count], whole[:, ahead], found[:count, :-count],
                   found[:count, ahead], np.vstack([*[still] * len(left), unit, unit]))


def moving_voltages(model: SteeredModel, inverse: SteeredInverse, wanted: Array, interval: float
                    ) -> Iterator[Array]:
    """Solve U² of the segments [V²] that move the model along wanted places, sample by sample.

    ``wanted``: places at the samples, (samples, steered), with one before the first, at which the
    film has rested, and one after the last.
    """
    seen = model.steered
    flowed = np.tile(held_at(model, wanted[0], inverse.supply)[1], (len(model.times), 1))
    left, half = model.springs_over(interval / 2)
    for before, now, ahead in zip(wanted, wanted[1:], wanted[2:], strict=False):
        force = (model.mass[:, seen] @ (ahead - 2 * now + before) / interval**2
                 + model.damping[:, seen] @ (ahead - now) / interval
                 - np.einsum("b,bij,bj->i", left, model.springs, flowed))
        squared, place = held_at(model, (now + ahead) / 2, inverse.supply, half, force)
        share = left[:, None] ** 2
        flowed = share * flowed + (1 - share) * place
        yield squared
