"""
Time and hysteresis
===================

Acrylic films creep. A viscous branch beside the law of the film gives it a memory; :doc:`/time`
says what must be known before a number in time means anything.
"""

# %%
# A film with a branch: a spring of 1 MPa that relaxes in 30 s.
import matplotlib.pyplot as plt

import tympan

film = tympan.Film("1 mm", (2.236, 2.236), tympan.NeoHooke("20 kPa"), relative_permittivity=4.7,
                   branches=(tympan.ViscousBranch("1 MPa", "30 s"),))
disc = tympan.Specimen("disc", tympan.Circle("4.5 cm"), tympan.Plate(tympan.Circle("1 cm")), film)
at_rest = tympan.solve(disc, mass="17.9 g", voltage="6 kV")
print(f"at rest {1e3 * at_rest.deflection_m:.3f} mm")

# %%
# Up and down
# -----------
# The voltage rises and falls at a steady rate: slowly the film follows, quickly it lags behind. On
# the command line: ``tympan path disc.toml --mass "17.9 g" --rate "50 V/s" --turn "6 kV" -o loop``.
coarse = tympan.Settings(tympan.MeshSettings(order=2))
axes = plt.figure().add_subplot()
for rate in (20.0, 200.0):
    duration = 2 * 6e3 / rate
    driven = tympan.transient(disc, signal="ramp", mass="17.9 g", high="6 kV", duration=duration,
                              interval=duration / 2000, settings=coarse)
    samples = driven.to_pandas()
    axes.plot(samples["voltage_V"] / 1e3, 1e3 * samples["displacement_m"], label=f"{rate:g} V/s")
axes.set(xlabel="voltage (kV)", ylabel="deflection (mm)", title="up and down again")
axes.legend()
