"""Robots: kinematics, geometry, limits."""
