"""
α for a new shape
=================

A lumped model knows circles only. α says with which weights two circular actuators stand for
another shape; what it means, and what not, is in :doc:`/explanation/alpha`.
"""

# %%
# A stadium, twice as long as it is wide.
import tympan

film = tympan.Film("1 mm", (2.236, 2.236), tympan.material("vhb-4910"), relative_permittivity=4.7)
stadium = tympan.Specimen("stadium", tympan.Stadium(("6 cm", "3 cm")),
                          tympan.Plate(tympan.Circle("1 cm")), film)

# %%
# On the command line: ``tympan alpha stadium.toml``.
result = tympan.alpha(stadium)
best = result.by_basis["membrane"]
for radius, weight in zip(result.circles, best.alpha, strict=True):
    print(f"a circle of {1e3 * radius:.0f} mm with weight {weight:.3f}")
print(f"force off by {100 * best.held_out_error:.3f} % at loads that were not fitted")
result.plot()

# %%
# An α belongs to its kind of circle: these are circles of the same film. Other kinds, such as the
# straight cones of the source paper, have other weights: :doc:`/explanation/alpha`.
