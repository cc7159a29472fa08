"""Finite-element model of the prestretched hyperelastic membrane under plate load and voltage."""

from tympan.base.late import load_late

# SciPy 1.17 copies every public name of NumPy (`clone_module` of the array-API package in it), and
# so imports these, which nobody here uses: they took 0.15 s of the 0.55 s to import scikit-fem.
load_late("numpy.f2py", "numpy.testing")
