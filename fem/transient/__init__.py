"""Motion in time: viscous creep of the film, oscillation of the plate, charging by a circuit."""
