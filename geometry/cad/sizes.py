"""Sizes of the parts for making an actuator, without the CAD kernel that shapes them."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.units import quantity_text
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.pieces import normals


@dataclass(frozen=True)
class PartOptions:
    """Sizes of the parts [m].

    ``width`` is that of frame and clamp ring around the film, ``screw`` the diameter of the holes
    (an M3 screw goes through 3.2 mm). The rings have at least four holes, and one at least every
    ``spacing`` along the frame. The plate has one in the middle, of at most a third of its smaller
    half extent.
    """

    width: float = 10e-3
    frame_height: float = 4e-3
    clamp_height: float = 2e-3
    plate_height: float = 2e-3
    screw: float = 3.2e-3
    spacing: float = 40e-3

    def __post_init__(self) -> None:
        for item in fields(self):
            size = getattr(self, item.name)
            if not 1e-5 <= size <= 10:
                raise InputError("must be from 10 um to 10 m", key=item.name,
                                 given=quantity_text(size, "length"))
        if self.screw > self.width / 2:
            raise InputError("must be at most half the width of the ring", key="screw",
                             given=quantity_text(self.screw, "length"))
        if self.spacing < 2 * self.screw:
            raise InputError("must be at least two diameters of the holes", key="spacing",
                             given=quantity_text(self.spacing, "length"))

    def holes(self, frame: Outline) -> AnyArray:
        """Centres of screw holes at even distances around a frame, shape (holes, 2) [m]."""
        length = float(frame.curve.length)
        count = max(4, int(np.ceil(length / self.spacing)))
        points = frame.points(4096).T
        ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(ahead - points, axis=1))])
        near = np.searchsorted(along, (np.arange(count) + 0.5) / count * along[-1]) % len(points)
        return np.asarray(points[near] + self.width / 2 * normals((ahead - behind)[near]))
