"""A film at a few points: as exact as its field model on what it was made from."""
