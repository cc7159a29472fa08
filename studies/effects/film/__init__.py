"""Effects in the film and its electrodes."""
