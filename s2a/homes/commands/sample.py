"""Command `s2a sample`: furnish a virtual room and scan it: writes an annotated scan."""

import json

from s2a.core.outputs import atomic_write
from s2a.homes.sample import SampleConfig, sample

Config = SampleConfig

TRUTH = "truth/truth.json"  # By this file, which no real scan has, a folder is known to be an earlier sample


def run(config: Config) -> str:
    """Furnish, scan and annotate the room, and return what was written."""
    with atomic_write(config.out, earlier=TRUTH) as out:
        sample(config, out)
        truth = json.loads((out / TRUTH).read_text())
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    return f"{config.out}: scan {truth['name']} of a virtual {config.room}, {size / 1e6:.0f} MB"
