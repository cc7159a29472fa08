"""Motion in time: a film that creeps, a plate that swings, a circuit that charges."""
