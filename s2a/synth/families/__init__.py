"""Families of furniture with continuous dimensions. Local frames: back at x = 0, centred in y, floor at z = 0, metres."""
