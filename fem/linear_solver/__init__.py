"""Sparse symmetric systems, factorised in an order made for meshes."""
