"""Write s2a/robot/<name>/spheres.csv: spheres around the surfaces of the convex hulls of a robot's collision geometry.

python tools/robot_spheres.py panda
"""

from __future__ import annotations

import argparse
from pathlib import Path

from s2a import robot
from s2a.robot.collision import cover


def main(name: str) -> None:
    """Write the table: link, center and radius [m]."""
    made = cover(robot.load(name))
    rows = zip(made["link"], made["center"], made["radius"], strict=True)
    lines = ["link,x,y,z,radius"] + [f"{link},{x:.3f},{y:.3f},{z:.3f},{radius:.3f}" for link, (x, y, z), radius in rows]
    path = Path(robot.__file__).parent / name / "spheres.csv"
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join([*lines, ""]))
    print(f"{path}: {len(lines) - 1} spheres")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=robot.names())
    main(parser.parse_args().name)
