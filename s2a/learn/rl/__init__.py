"""Observations to actions: PPO and a planner."""

import os

# rsl_rl imports GitPython, which refuses to be imported where there is no git.
os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")
