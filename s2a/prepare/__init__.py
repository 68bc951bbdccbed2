"""Preparation: what a simulator needs of every articulated part, free object and the room around them.

In: a `Scene` and a robot. Out: `SimRoom`, which `sim.usd` holds: joints, colliders, masses, grasps, base poses.
"""
