"""
Your data, diagnosed
====================

Readings that the simulation does not foretell: what is wrong with it, or with them? Here the
readings are made up, with every load 2 g heavier than its label, so that the answer is known.
"""

# %%
# A dataset
# ---------
# A folder with ``dataset.toml``, which has the specimens, and ``static.csv``, which has the
# readings; two of each state, since repeats tell the noise. ``tympan data readings`` checks it.
from pathlib import Path

import numpy as np

import tympan

HEAVIER = 2e-3
Path("readings").mkdir(exist_ok=True)
Path("readings/dataset.toml").write_text("""
name = "hidden weight"
noise = "10 um"
[[specimen]]
name = "disc"
[specimen.frame]
shape = "circle"
radius = "4.5 cm"
[specimen.plate]
shape = "circle"
radius = "1 cm"
[specimen.membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
material = "vhb-4910"
""", encoding="utf-8")

film = tympan.Film("1 mm", (2.236, 2.236), tympan.material("vhb-4910"), relative_permittivity=4.7)
disc = tympan.Specimen("disc", tympan.Circle("4.5 cm"), tympan.Plate(tympan.Circle("1 cm")), film)
noise = np.random.default_rng(1)
rows = ["specimen,mass_g,voltage_kV,displacement_mm"]
for mass in (10, 20, 40):
    for voltage in (0, 1, 2, 3, 4, 5):
        rest = tympan.solve(disc, mass=1e-3 * mass + HEAVIER, voltage=f"{voltage} kV")
        deflection = 1e3 * rest.deflection_m
        rows += [f"disc,{mass},{voltage},{deflection + noise.normal(0, 0.01):.4f}"
                 for repeat in range(2)]
Path("readings/static.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")

# %%
# The diagnosis
# -------------
# On the command line: ``tympan diagnose readings -o diagnosis``, which writes a page,
# ``diagnosis.html``. It is ambiguous: by one disc a weight that every load has is not told from one
# that the electrodes have, but for its size. Another disc would tell them apart, or a balance.
result = tympan.diagnose("readings")
print(f"the verdict: {result.verdict}")
cause = result.causes[0]
size = cause.parameters["m_0"]
print(f"{cause.effect}: {size.value:.2f} {size.unit} ({size.low:.2f} to {size.high:.2f}), "
      f"probability {cause.probability:.2f}")
print("or", ", ".join(other.effect for other in result.causes[1:]))
result.plot()

# %%
# How such a verdict is reached is in :doc:`/explanation/verdict`, how often it is right in
# :doc:`/hidden-effects`.
