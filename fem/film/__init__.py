"""The film as a material: laws, energy density, tension field, breakdown."""
