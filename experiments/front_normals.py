"""Normals of scanned drawer fronts, as refining takes them, against the truth of virtual scans.

    python experiments/front_normals.py SCAN ...

SCAN is a folder that `s2a sample` wrote: there a drawer slides along the normal of its front. Prints how far the normals look up
and sideways of the true ones [deg], and that in units of the standard deviations given with them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from s2a import scan
from s2a.prepare.refine_front import Faces, seen_front
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.usd import geometric

ALIKE = 0.95
"""Cosine between a part's front and its axis from which it is a drawer's."""


def main() -> None:
    """Print a line for each direction."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", type=Path, help="folders that s2a sample wrote")
    rows = np.array([row for path in parser.parse_args().scans for row in errors(path)])
    print(f"{len(rows)} fronts")
    for k, name in enumerate(("up", "sideways")):
        off, unit = rows[:, k], rows[:, k] / rows[:, 2 + k]
        root = [float(np.sqrt((each**2).mean())) for each in (off, unit)]
        print(f"{name}: mean {off.mean():+.3f} deg, root mean square {root[0]:.3f} deg, {root[1]:.2f} deviations")


def errors(path: Path) -> list[tuple[float, float, float, float]]:
    """Return how far each drawer front's normal looks up and sideways, and the standard deviations of both [deg]."""
    scene, truth = scan.read(path), geometric.read(path / "truth/truth.usda")
    faces, found = Faces(ScanSurface(scene)), []
    for part in scene.movable:
        axis, shown = np.array(truth.joint(part).axis), front(faces.surface, part)
        if truth.joint(part).kind != "prismatic" or shown is None or abs(shown.normal @ axis) < ALIKE:
            continue
        seen = seen_front(faces, part, shown)
        side = np.cross((0.0, 0.0, 1.0), axis)
        if seen is None or np.linalg.norm(side) < 0.5:
            continue
        side /= np.linalg.norm(side)
        up = np.cross(axis, side)
        normal = seen.normal * np.sign(seen.normal @ axis)
        found.append(tuple(np.degrees([normal @ up, normal @ side, seen.sigma(up), seen.sigma(side)])))
    return found


if __name__ == "__main__":
    main()
