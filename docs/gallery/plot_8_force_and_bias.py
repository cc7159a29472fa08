"""
Force, bias and stroke
======================

A film pulls the plate back, a weight pulls it down, and a voltage makes the film softer. How far
the plate moves depends on what pulls: a weight pulls the same everywhere. Buckled beams push on
more the further they are pushed.
"""

# %%
# The film alone
# --------------
# A tensile tester holds the plate at each displacement and reads the force, without voltage and at
# 6 kV. On the command line: ``tympan force disc.toml --voltage "0 kV, 6 kV" --to "6.5 mm"``.
import matplotlib.pyplot as plt

import tympan

film = tympan.Film("1 mm", (5**0.5, 5**0.5), tympan.NeoHooke("20 kPa"), relative_permittivity=4.7)
disc = tympan.Specimen("disc", tympan.Circle("4.5 cm"), tympan.Plate(tympan.Circle("1 cm")), film)
question = {"mass": "20 g", "voltage": ["0 kV", "6 kV"], "to": "6.5 mm"}
weight = tympan.force(disc, **question)
print(f"a weight of 20 g: stroke {1e3 * weight.loads[0].stroke_m:.2f} mm")

# %%
# Buckled beams
# -------------
# Three beams of plastic, 30 mm long, are pushed together by 0.4 mm, so that they bow. The plate
# carries their middle. At 3 mm they are straight: above they push up, below they push down.
beams = tympan.BuckledBeam(length="30 mm", width="4 mm", thickness="0.12 mm", modulus="1.5 GPa",
                           compression="0.4 mm", number=3, middle="3 mm")
pushed = tympan.force(disc, rig=tympan.Rig(biases=(beams,)), **question)
print(f"with beams: stroke {1e3 * pushed.loads[0].stroke_m:.2f} mm")

# %%
# Load lines
# ----------
# Where what pulls (a load line) crosses the film's curve, the plate is in equilibrium. The line of
# the beams runs nearly along the film's curves: a small change of the curve moves the crossing far.
axes = plt.figure().add_subplot()
for curve in weight.curves:
    axes.plot([1e3 * w for w in curve.displacement_m], curve.force_N,
              label=f"film at {1e-3 * curve.voltage_V:g} kV")
for result, line, name in ((weight, ":", "20 g"), (pushed, "--", "20 g and beams")):
    load = result.loads[0]
    axes.plot([1e3 * w for w in load.displacement_m], load.force_N, line, color="0.3", label=name)
    axes.plot([1e3 * place.displacement_m for place in load.crossings],
              [place.force_N for place in load.crossings], "o", color="0.3")
axes.set(xlabel="displacement (mm)", ylabel="force (N)", ylim=(0, 0.5),
         title="the film's force, and what pulls")
axes.legend(loc="lower right")

# %%
# With stiffer beams the line crosses a curve three times: the actuator has two stable positions.
stiffer = tympan.BuckledBeam(length="30 mm", width="4 mm", thickness="0.13 mm", modulus="1.5 GPa",
                             compression="0.4 mm", number=3, middle="3 mm")
snapping = tympan.force(disc, rig=tympan.Rig(biases=(stiffer,)), **question)
for place in snapping.loads[0].crossings:
    print(f"{1e-3 * place.voltage_V:g} kV: {1e3 * place.displacement_m:.2f} mm, "
          f"{'stable' if place.stable else 'not stable'}")
