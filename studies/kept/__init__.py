"""Files kept on disk for later runs: meshes, and films solved for a diagnosis."""
