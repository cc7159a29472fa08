"""What the source paper states: its actuators, Table 1, Table 2, published numbers."""
