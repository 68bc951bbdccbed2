"""Observations to actions: PPO and a planner."""
