"""Many specimens under many loads: planned from SWEEP.toml, solved side by side, kept case by case, one table."""
