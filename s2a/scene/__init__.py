"""The scene: meshes, joints and parts, their geometry, and the USD files that hold them.

In: arrays and USD stages. Out: `Scene`, the two flavours of a scanned room, and `sim.usd`.
"""
