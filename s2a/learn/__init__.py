"""Learning: PPO, perception, evaluation, benchmarks, and demonstrations as datasets.

In: tasks in simulated worlds. Out: policies, result files, datasets.
"""
