"""Curves and loaded films of the nominal and the extended model in a report."""
