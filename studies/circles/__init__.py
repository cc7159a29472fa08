"""One circular actuator of the lumped model: how its film is shaped."""
