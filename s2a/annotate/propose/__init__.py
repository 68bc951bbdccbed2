"""Fronts proposed by a network that sees the planes of a scan: their rectangles, their handles, what opens how."""

from s2a.annotate.propose.config import ProposeConfig as ProposeConfig
