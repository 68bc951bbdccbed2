"""Fronts proposed by geometry and colour alone: flat patches, their handles, what opens how."""

from s2a.annotate.propose.config import ProposeConfig as ProposeConfig
from s2a.annotate.propose.run import cut as cut
from s2a.annotate.propose.run import propose as propose
