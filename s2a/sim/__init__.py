"""Simulation: batched Newton worlds of a prepared room, contacts, cameras, soft bodies.

In: `sim.usd` and a robot. Out: states of worlds, contact forces, images.
"""
