"""
A shape of your own, from a drawing
===================================

Frame, plate and electrode may come from a DXF or STEP file. Here an egg is drawn first, since a
tutorial needs one; yours comes from your CAD program.
"""

# %%
# A drawing
# ---------
# Two half ellipses on the layer ``frame``, in millimetres. A drawing without units is taken to be
# in millimetres too, and where it lies does not matter: an outline's bounding box is centred on the
# origin.
from math import pi
from pathlib import Path

import ezdxf.filemanagement
import ezdxf.units

import tympan

drawing = ezdxf.filemanagement.new(units=ezdxf.units.MM)
shell = drawing.modelspace()
shell.add_ellipse((0, 0), (45, 0), 28 / 45, -pi / 2, pi / 2, {"layer": "frame"})
shell.add_ellipse((0, 0), (30, 0), 28 / 30, pi / 2, 3 * pi / 2, {"layer": "frame"})
drawing.saveas("egg.dxf")

# %%
# The specimen's file beside it
# -----------------------------
text = """
name = "egg"
[frame]
shape = "dxf"
file = "egg.dxf"
layer = "frame"
[plate]
shape = "rounded_rectangle"
semi_axes = ["9 mm", "6 mm"]
corner_radius = "3 mm"
offset = ["-4 mm", "0 mm"]
[membrane]
thickness = "1 mm"
prestretch = [3, 3]
relative_permittivity = 4.7
material = "vhb-4910"
[electrode.outline]
shape = "ellipse"
semi_axes = ["28 mm", "20 mm"]
offset = ["-4 mm", "0 mm"]
"""
Path("egg.toml").write_text(text, encoding="utf-8")
egg = tympan.load("egg.toml")

# %%
# What was read
# -------------
# On the command line: ``tympan draw egg.toml``. Sizes are from edge to edge; the dark part of the
# film is what the electrode covers.
tympan.draw(egg)

# %%
# What it does
# ------------
result = tympan.solve(egg, mass="10 g", voltage="2.5 kV")
print(f"{1e3 * result.deflection_m:.3f} mm, tilted by {1e3 * result.tilt_rad:.2f} mrad")
result.plot()

# %%
# ``tympan export egg.toml -o parts`` writes frame, clamp ring and plate as STEP, DXF and SVG, to
# cut or print.
