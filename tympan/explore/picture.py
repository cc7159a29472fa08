"""A scene as the page draws it: arrays for vtk.js, the scale of its colours, and the camera."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.explore.session import Scene
from tympan.reports.colouring import COLOURINGS, tick_places

Array = NDArray[Any]

#: How far lines lie before the film, of the frame's half extent.
_BEFORE = 4e-4

#: Directions from the film to the eye, and what is up in the picture.
LOOKS = {"oblique": ((0.0, -0.85, 0.62), (0.0, 0.0, 1.0)),
         "above": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
         "side": ((0.0, -1.0, 0.03), (0.0, 0.0, 1.0))}

#: How what is drawn takes the light.
LOOK_OF = {
    "mapped": {"interpolateScalarsBeforeMapping": True},
    "matt": {"ambient": 0.72, "diffuse": 0.36, "specular": 0.0},
    "plate_look": {"ambient": 0.8, "diffuse": 0.25, "specular": 0.0, "color": [0.84, 0.84, 0.85]},
    "edge_look": {"lighting": False, "color": [0.1, 0.1, 0.12], "lineWidth": 2},
    "hatch_look": {"lighting": False, "color": [0.0, 0.0, 0.0], "lineWidth": 1.5}}


def encoded(values: Array) -> dict[str, Any]:
    """An array of numbers as vtk.js components take it."""
    flat = np.ascontiguousarray(values, np.float32 if values.dtype.kind == "f" else np.uint32)
    return {"bvals": b64encode(flat.ravel().data).decode(), "dtype": str(flat.dtype),
            "shape": list(flat.shape)}


def film_state(scene: Scene) -> dict[str, Any]:
    """Points and cells of all that is drawn [mm]."""
    assert scene.film is not None
    before = np.array([0.0, 0.0, _BEFORE * 1e3 * float(np.abs(scene.frame[:, :2]).max())])
    edges = (1e3 * scene.frame + before, 1e3 * scene.plate + before)
    hatches = 1e3 * scene.hatches.reshape(-1, 3) + before
    state: dict[str, Any] = {
        # Both sides of an edge have points of their own, which rounding must not part.
        "film_points": encoded(np.round(1e3 * scene.film.points, 4)),
        "film_polys": encoded(_cells(scene.film.triangles)),
        "plate_points": encoded(1e3 * scene.plate),
        "plate_polys": encoded(_cells(np.arange(len(scene.plate))[None])),
        "edge_points": encoded(np.vstack(edges)),
        "edge_lines": encoded(_loops(*map(len, edges))),
        "hatch_points": None, "hatch_lines": None}
    if len(hatches):
        state |= {"hatch_points": encoded(hatches),
                  "hatch_lines": encoded(_cells(np.arange(len(hatches)).reshape(-1, 2)))}
    return state


def colour_state(scene: Scene, colouring: str) -> dict[str, Any]:
    """The film's colours and what they mean."""
    assert scene.film is not None
    quantity = COLOURINGS[colouring]
    values = quantity.of(scene.film)
    scale = quantity.scale(float(values.min()), float(values.max()))
    return {
        "film_field": {"name": colouring, "values": encoded(values), "numberOfComponents": 1,
                       "type": "Float32Array", "location": "PointData",
                       "dataRange": [scale.low, scale.high]},
        "colour_range": [scale.low, scale.high],
        "scale": {"words": quantity.title, "ticks": tick_places(scale)}}


def camera(scene: Scene, name: str) -> dict[str, Any]:
    """Where the eye is, to see the whole film from a direction of :data:`LOOKS` [mm]."""
    towards, up = (np.array(vector) for vector in LOOKS[name])
    size = 1e3 * float(np.hypot(*np.abs(scene.frame[:, :2]).max(axis=0)))
    eye = 2.7 * size * towards / np.linalg.norm(towards)
    return {"position": eye.tolist(), "focalPoint": [0.0, 0.0, 0.0], "viewUp": up.tolist(),
            "centerOfRotation": [0.0, 0.0, 0.0], "viewAngle": 30}


def _cells(corners: Array) -> Array:
    """Cells as VTK lists them: the number of corners before those of each."""
    counts = np.full((len(corners), 1), corners.shape[1])
    return np.hstack([counts, corners]).ravel().astype(np.uint32)


def _loops(*counts: int) -> Array:
    """Closed lines through points that stand one loop after another."""
    parts: list[Array] = []
    for start, count in zip(np.cumsum([0, *counts]), counts, strict=False):
        parts += [np.array([count + 1]), np.arange(start, start + count), np.array([start])]
    return np.concatenate(parts).astype(np.uint32)
