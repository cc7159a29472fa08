"""A lumped model for a controller: as C99, as FMU."""
