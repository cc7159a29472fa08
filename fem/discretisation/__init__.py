"""What depends on the mesh alone: basis, patterns, assembly."""
