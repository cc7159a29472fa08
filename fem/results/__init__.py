"""What is read off an equilibrium: fields and integrals."""
