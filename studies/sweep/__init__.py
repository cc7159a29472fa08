"""Many specimens under many loads, planned from SWEEP.toml: kept case by case, one table."""
