"""Joints from data (satellite): registered from two scans, identified from pulls, optimised through the simulation.

In: scans, recordings of pulls, `sim.usd`. Out: joints, their dynamics, time laws of pulls.
"""
