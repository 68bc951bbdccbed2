"""Collision hulls of the target, its furniture, the room and free objects."""
