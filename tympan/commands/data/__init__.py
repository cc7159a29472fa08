"""Commands about materials and measured data."""
