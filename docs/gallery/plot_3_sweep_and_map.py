"""
A sweep, and a map of it
========================

What does the shape do to the stroke? Frames of one area and several aspect ratios, each with plates
of three sizes.
"""

# %%
# The plan
# --------
# A sweep is a file: every combination under ``[grid]``, row by row under ``[list]``, a sample under
# ``[sample]``. On the command line ``tympan sweep SWEEP.toml -o sweep`` runs it on all processors,
# and goes on where it was ended.
from pathlib import Path

import tympan

Path("oval.toml").write_text("""
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["4 cm", "4 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [3, 3]
relative_permittivity = 4.7
material = "vhb-4910"
""", encoding="utf-8")
Path("SWEEP.toml").write_text("""
specimen = "oval.toml"
mass = ["20 g"]
voltage = ["0 kV", "2 kV", "3 kV"]
[grid]
"plate.radius" = ["6 mm", "10 mm", "14 mm"]
"frame.semi_axes" = [["40 mm", "40 mm"], ["50 mm", "32 mm"], ["64 mm", "25 mm"]]
""", encoding="utf-8")
result = tympan.sweep("SWEEP.toml", folder="sweep")

# %%
# The table
# ---------
# An xarray dataset with units, whose indices are the keys of the grid, mass and voltage; on disk
# ``sweep/sweep.nc``.
table = result.to_xarray()
print(dict(table["deflection_m"].sizes))
print(table["deflection_m"].sel({"plate.radius": 10e-3, "voltage": 3e3}).values.ravel())

# %%
# The map
# -------
# Stroke is the deflection at the highest voltage less that without. The page ``sweep/sweep.html``,
# which the command writes, has maps of any result over any two keys, to choose from.
result.plot(of="stroke", over=("plate.radius", "frame.semi_axes"))

# %%
# :doc:`/optimum` has the best shape under limits.
