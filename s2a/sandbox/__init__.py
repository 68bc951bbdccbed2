"""A script that nobody has read runs confined, and its result is compared with the plan."""
