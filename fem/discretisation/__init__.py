"""Parts that depend on the mesh alone: basis, patterns, assembly."""
