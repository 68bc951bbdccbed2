"""Families of furniture with continuous dimensions. Local frames: back at x = 0, centred in y, floor at z = 0, metres.

Each module names the source of its ranges by site. "Common size" is a range for which no source was opened.
"""
