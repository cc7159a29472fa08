"""Figures, one file for each command."""
