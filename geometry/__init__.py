"""Specimens: outlines, plate, film, their files, CAD and meshes."""
