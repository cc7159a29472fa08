"""Many specimens under many loads.

Planned from SWEEP.toml, solved side by side, kept case by case, one table.
"""
