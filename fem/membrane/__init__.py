"""Film, plate and loads as one discrete mechanical system."""
