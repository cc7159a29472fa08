"""
The first actuator
==================

A film in an oval frame, carbon grease on both sides, a plate with 17.9 g in its middle: how far
does it sink, how far does a voltage move it, and where does that end?
"""

# %%
# Parts
# -----
# The film is given as it was before it was mounted: 1 mm thick, then stretched by √5 along both
# axes. Frame and plate are outlines; the plate sits 3 mm beside the middle.
import pyvista

import tympan

film = tympan.Film("1 mm", (2.236, 2.236), tympan.material("vhb-4910"), relative_permittivity=4.7)
plate = tympan.Plate(tympan.Circle("1 cm"), offset=("3 mm", "0 mm"))
oval = tympan.Specimen("oval", tympan.Ellipse(("6 cm", "4 cm")), plate, film)

# %%
# The same as a file, ``oval.toml``, is what the command line reads; ``tympan draw oval.toml`` draws
# it with its sizes, and ``tympan.load("oval.toml")`` is this specimen.
#
# One load, one voltage
# ---------------------
# On the command line: ``tympan solve oval.toml --mass "17.9 g" --voltage "3.5 kV" -o solved``.
result = tympan.solve(oval, mass="17.9 g", voltage="3.5 kV")
print(f"{result.status}: the plate sinks {1e3 * result.deflection_m:.3f} mm")
print(f"further up {result.limits.ended}")
result.plot()

# %%
# Colours are the largest true stress, over the flat film seen along the load. The film in space, as
# ParaView and PyVista read it: z is upwards; here it is drawn four times as large.
result.save("solved")
surface = pyvista.read("solved/oval.vtu").scale((1e3, 1e3, 4e3))
surface["stress (kPa)"] = surface["stress_1"] / 1e3
plotter = pyvista.Plotter()
plotter.add_mesh(surface, scalars="stress (kPa)", cmap="viridis", smooth_shading=True,
                 scalar_bar_args={"position_x": 0.2, "position_y": 0.06, "n_labels": 4})
plotter.camera_position = [(50, -150, 100), (0, 0, -12), (0, 0, 1)]
plotter.show()

# %%
# Deflection against voltage
# --------------------------
# Each curve ends where its film does. On the command line:
# ``tympan curve oval.toml --mass "10 g, 17.9 g" -o curve``.
curve = tympan.curve(oval, mass=["10 g", "17.9 g"])
curve.plot()

# %%
# Every result is also a table.
print(curve.to_pandas()[["mass", "voltage", "deflection"]].tail(3).to_string())

# %%
# A notebook shows it as one by itself; this page is also ``examples/first_actuator.ipynb``.
result

# %%
# Help where you type
# -------------------
# In a notebook, Shift+Tab on a name shows its arguments, then what they mean, their units and their
# defaults. ``tympan.`` and Tab lists all names.
#
# .. image:: /shift-tab.png
#    :alt: Arguments of tympan.solve, one a line, then the first lines of their description
