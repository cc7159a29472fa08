"""Small vibrations about an equilibrium."""
