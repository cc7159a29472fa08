"""Effects in the readings."""
