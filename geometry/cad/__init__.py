"""The specimen's parts in cadquery, and drawings read with it."""
