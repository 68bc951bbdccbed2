"""What "simulation-ready" means, measured: a stage's structure, its surfaces, and what it does under physics."""

import logging

import mujoco

# MuJoCo writes its warnings into a file in the working directory, unless told of a better place.
mujoco.set_mju_user_warning(logging.getLogger(__name__).info)
