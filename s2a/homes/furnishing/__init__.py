"""Furnished homes: ten kinds of rooms whose shape, furniture and handles are drawn from continuous ranges, see `furnish`."""

from s2a.homes.furnishing.kinds import HOMES, furnish, home, stream

__all__ = ["HOMES", "furnish", "home", "stream"]
