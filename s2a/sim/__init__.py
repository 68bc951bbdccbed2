"""sim.usd to batched Newton worlds."""
