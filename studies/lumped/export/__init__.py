"""A lumped model for a controller.

As C99 (``c_source.py``), as FMU 2.0 (``fmu.py``), or as a polynomial of the voltage before a slow
and a fast transfer function (``slow_fast.py``). The texts beside them are the templates.
"""
