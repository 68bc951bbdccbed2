"""A simulation-ready room for other simulators: MJCF for MuJoCo, URDF for PyBullet, ROS, SAPIEN and Drake.

Both formats are written from the same Newton model (`s2a.certify.convert.links`), so that what is frozen, cut and filtered is
what the simulation here has.
"""
