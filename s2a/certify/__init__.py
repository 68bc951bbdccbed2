"""Validation of a simulation-ready stage: its structure, its surfaces, and its behaviour under physics."""

import logging

import mujoco

# MuJoCo writes its warnings into a file in the working directory, unless given a handler.
mujoco.set_mju_user_warning(logging.getLogger(__name__).info)
