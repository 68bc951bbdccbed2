"""Perception: points of a part in a depth image, and a network that estimates grasp, joint and size from them."""
