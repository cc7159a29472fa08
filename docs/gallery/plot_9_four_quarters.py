"""
Four quarters tilt a plate
==========================

An electrode in four quarters moves the plate up and down, and tilts it two ways. This tutorial
finds what tilts are in reach, and lets the plate's normal draw a circle. :doc:`/howto/segments` has
all that segments can be.
"""

# %%
# A round film with four quarters. Each has a name; between them 1 mm of film is bare.
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation

import tympan

film = tympan.Film("1 mm", (2.236, 2.236), tympan.NeoHooke("20 kPa"), relative_permittivity=4.7)
quarters = tuple(tympan.Segment(name=name, sector=(f"{start} deg", f"{start + 90} deg"))
                 for name, start in zip("ABCD", (-45, 45, 135, 225), strict=True))
disc = tympan.Specimen("quarters", tympan.Circle("4.5 cm"), tympan.Plate(tympan.Circle("1 cm")),
                       film, tympan.Electrode(segments=quarters, gap="1 mm"))
tympan.draw(disc, plt.figure().add_subplot())

# %%
# One quarter
# -----------
# A voltage by name; the others have none. On the command line:
# ``tympan solve quarters.toml --mass "17.9 g" --voltage "A = 3.5 kV"``. The plate moves away from
# the quarter that gives way, and its side there sinks.
coarse = tympan.Settings(tympan.MeshSettings(order=2))
one = tympan.solve(disc, mass="17.9 g", voltage="A = 3.5 kV", settings=coarse)
print(f"tilt {1e3 * one.tilt_x_rad:.2f} mrad along x, {1e3 * one.shift_x_m:.2f} mm aside")

# %%
# Tilts in reach
# --------------
# Two quarters, each from 0 to 3.5 kV: every combination comes from a reduced film.
reach = tympan.steer(disc, mass="17.9 g", settings=coarse,
                     voltage={"A": "0 kV..3.5 kV in 15", "B": "0 kV..3.5 kV in 15"})
reach.plot(plt.figure().add_subplot())

# %%
# The normal draws a circle
# -------------------------
# Opposite quarters share a voltage. Its squares go as 1 ± cos and 1 ± sin of the direction. Slowly
# the plate's normal goes around, and the deflection stays almost the same.
directions = np.linspace(0, 2 * np.pi, 16, endpoint=False)
voltages = [{name: 3.5e3 * np.sqrt((1 + np.cos(direction - number * np.pi / 2)) / 2)
             for number, name in enumerate("ABCD")} for direction in directions]
states = [tympan.solve(disc, mass="17.9 g", voltage=each, settings=coarse) for each in voltages]
slopes = 1e3 * np.array([(state.tilt_x_rad, state.tilt_y_rad) for state in states])
radius = np.hypot(*slopes.T)
print(f"radius {radius.mean():.2f} mrad, round to {np.ptp(radius) / radius.mean():.1%}")

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
bars = left.bar(range(4), [0.0] * 4, tick_label=list("ABCD"), color=plt.rcParams[
    "axes.prop_cycle"].by_key()["color"][:4])
left.set(ylabel="voltage (kV)", ylim=(0, 3.7))
right.plot(*np.vstack([slopes, slopes[:1]]).T, color="#c3c8cf")
normal, = right.plot(*slopes[:1].T, "o", markersize=10)
right.set(xlabel="slope along x (mrad)", ylabel="slope along y (mrad)", aspect="equal")


def frame(number: int) -> list[object]:
    """Show one direction."""
    for bar, voltage in zip(bars, voltages[number].values(), strict=True):
        bar.set_height(voltage / 1e3)
    normal.set_data(*slopes[number:number + 1].T)
    return [*bars, normal]


moving = FuncAnimation(figure, frame, frames=len(directions), interval=150)
moving.save("circle.gif", writer="pillow", dpi=60)
