"""What measured data say the simulation gets wrong, which effect explains it, the gain."""
