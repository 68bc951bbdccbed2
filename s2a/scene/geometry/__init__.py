"""Queries and operations on meshes; Warp as a geometry library."""
