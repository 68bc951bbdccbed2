"""Are boxes of a real scan's objects those that a person measures, and masses those that one estimates? 55 of ScanNet's.

    python experiments/real_boxes.py --scan captures/scene0000_00

Of scene0000_00; reads experiments/results/real_boxes_by_hand.json. A box counts if each side is within 20 % or 4 cm of the
measured one, whichever is more (a voxel of the scan is 1 to 2 cm); with the labels as they are, and without what they spill
onto. A mass counts within a factor of two of an estimate from remembered data sheets; nothing was weighed. Of all that has
one, and of what one person carries, up to HEAVY. Writes experiments/results/real_boxes.json.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from s2a import scan
from s2a.commands.prepare import Config
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.prepare.free_objects import free_object
from s2a.scan import rest
from s2a.scene.scene import Scene
from s2a.scene.upright_box import upright_box

RESULTS = Path(__file__).parent / "results"
FRACTION, LEAST = 0.2, 0.04
HEAVY = 10.0
"""[kg] Of what one person carries."""


def main() -> None:
    """Compare, and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scan", type=Path, required=True)
    parser.add_argument("--out", type=Path, default=RESULTS / "real_boxes.json")
    args = parser.parse_args()
    measured = json.loads((RESULTS / "real_boxes_by_hand.json").read_text())["objects"]
    body = rest.stray_faces
    rest.stray_faces = lambda *_: np.empty(0, int)
    rows = {"as labelled": compared(scan.read(args.scan), measured)}
    rest.stray_faces = body
    rows["body"] = compared(scan.read(args.scan), measured)
    counts = {name: sum(row["within"] for row in each.values()) for name, each in rows.items()}
    masses = weighed(scan.read(args.scan), measured)
    counts |= {
        f"masses{text}": [sum(row["within"] for row in some), len(some)]
        for text, most in (("", np.inf), (" of what one carries", HEAVY))
        if (some := [row for row in masses.values() if row["hand"] <= most])
    }
    args.out.write_text(
        json.dumps(
            {**provenance("cpu"), "within": counts, "of": len(measured), "rows": rows, "masses": masses}, indent=1
        )
        + "\n"
    )
    print(counts, "of", len(measured))


def compared(scene: Scene, measured: dict[str, dict]) -> dict[str, dict]:
    """Return each object's box [m], its horizontal sides in the order that fits better, and whether it is within bounds."""
    rows = {}
    for name, each in measured.items():
        size, hand = np.array(upright_box(scene.parts[name].mesh.vertices).size), np.array(each["size"])
        orders = [size, size[[1, 0, 2]]]
        best = min(orders, key=lambda box: np.max(np.abs(box - hand) / np.maximum(FRACTION * hand, LEAST)))
        within = bool((np.abs(best - hand) <= np.maximum(FRACTION * hand, LEAST)).all())
        rows[name] = {"box": best.round(3).tolist(), "hand": each["size"], "within": within}
    return rows


def weighed(scene: Scene, measured: dict[str, dict]) -> dict[str, dict]:
    """Return each object's mass as a free object [kg], and whether it is within a factor of two of the estimate."""
    free = config.load(Config, config.compose("prepare", ["stage=x", "targets=all", "out=y"])).prepare.free
    rows = {}
    for name, each in measured.items():
        if "mass" in each:
            mass = free_object(scene, name, free).body.mass
            within = each["mass"] / 2 <= mass.mass <= 2 * each["mass"]
            rows[name] = {"mass": round(mass.mass, 2), "hand": each["mass"], "by": mass.source, "within": within}
    return rows


if __name__ == "__main__":
    main()
