"""Quantities of an equilibrium: fields and integrals."""
