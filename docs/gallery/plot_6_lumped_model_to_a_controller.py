"""
A lumped model, for a controller
================================

A controller wants a few equations, not a mesh. ``lumped`` makes them from the field model alone.
"""

# %%
# The model
# ---------
# On the command line: ``tympan lumped build oval.toml -o lumped``; ``lumped/oval.lumped.toml`` has
# plain SI numbers, and the formulas that go with them as a comment.
import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import step

import tympan

film = tympan.Film("1 mm", (2.236, 2.236), tympan.material("vhb-4910"), relative_permittivity=4.7)
oval = tympan.Specimen("oval", tympan.Ellipse(("6 cm", "4.5 cm")),
                       tympan.Plate(tympan.Circle("1 cm")), film)
built = tympan.lumped.build(oval)
built.plot()

# %%
# Points are the field model, lines the lumped one.
#
# About a point of work
# ---------------------
# Force goes with the square of the voltage: about 0 V the gain is nil, so linearise where you work.
# ``result.to_control()`` is the same as a python-control system, where that is installed; on the
# command line ``tympan lumped linearise oval.toml --voltage "3 kV"``.
result = tympan.lumped.linearise(built.models[0], voltage="3 kV", mass="17.9 g")
plant = result.linear[0]
for pole in plant.named_poles:
    print(f"{pole.name}: {pole.value:.4g} 1/s, {pole.share:.2f} of the gain")
print(f"in the end {1e6 * plant.gain:.3f} µm/V")
time, deflection = step(result.to_scipy(), T=np.linspace(0, 1, 2000))
axes = plt.figure().add_subplot()
axes.plot(time, 1e6 * 100 * deflection)
axes.set(xlabel="time (s)", ylabel="deflection (µm)", title="100 V more at 3 kV, 17.9 g")
