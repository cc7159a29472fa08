"""Finite-element model of the prestretched hyperelastic membrane under plate load and voltage."""
