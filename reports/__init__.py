"""Figures and the HTML report, drawn from what a study stored."""
