"""The lumped model's constants from readings at rest and in time."""
