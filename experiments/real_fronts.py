"""Fronts of real rooms: do two annotators agree, and do proposals agree with them?

    python experiments/real_fronts.py                                            # agreement alone, from experiments/real_rooms
    python experiments/real_fronts.py scene0000_00=runs/proposed --out FILE      # a folder of s2a annotate auto=true page=false

The annotations hold rectangles, kinds, hinge sides and places of handles of two captures that may not be given on; each file
names the capture by its checksum. Rectangles are compared on the plane of the first: their intersection over union, where
the planes are less than MAX_ANGLE and MAX_OFFSET apart; best pairs first, one to one, from MATCH on.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from s2a.core.provenance import provenance

ROOMS = Path(__file__).with_name("real_rooms")
MATCH, MAX_ANGLE, MAX_OFFSET = 0.5, 20.0, 0.12
"""Intersection over union, and [deg] and [m] between the planes of two rectangles of one front."""


class Front:
    """A rectangle with its kind, the side of its hinge, and its handle."""

    def __init__(self, corners: list, kind: str, hinge: str | None = None, handle: list | None = None) -> None:
        self.corners = np.array(corners, float)
        self.kind, self.hinge = kind, hinge
        self.handle = None if handle is None else np.array(handle, float)
        right, up = self.corners[1] - self.corners[0], self.corners[3] - self.corners[0]
        self.axes = np.stack([right / np.linalg.norm(right), up / np.linalg.norm(up)])
        self.normal = np.cross(*self.axes)
        self.middle = self.corners.mean(axis=0)

    def overlap(self, other: Front) -> float:
        """Return the intersection over union on this front's plane; 0 where the planes differ."""
        if self.normal @ other.normal < np.cos(np.radians(MAX_ANGLE)):
            return 0.0
        if abs((other.middle - self.middle) @ self.normal) > MAX_OFFSET:
            return 0.0
        mine, theirs = ((one.corners - self.middle) @ self.axes.T for one in (self, other))
        low, high = np.maximum(mine.min(axis=0), theirs.min(axis=0)), np.minimum(mine.max(axis=0), theirs.max(axis=0))
        shared = np.prod((high - low).clip(0.0))
        return float(shared / (np.prod(np.ptp(mine, axis=0)) + np.prod(np.ptp(theirs, axis=0)) - shared))


def annotated(capture: str, annotator: str) -> list[Front]:
    """Return the fronts that an annotator gave a capture."""
    records = json.loads((ROOMS / f"{capture}.{annotator}.json").read_text())["fronts"]
    return [Front(r["corners"], r["kind"], r.get("hinge_side", r.get("hinge")), r["handle"]) for r in records]


def proposed(folder: Path) -> list[Front]:
    """Return the fronts of an annotated folder: rectangles of annotate.json, joints of the scan."""
    from s2a import scan

    scene = scan.read(folder)
    records = json.loads((folder / "annotate.json").read_text())["parts"]
    fronts = []
    for part, record in zip(scene.movable, records, strict=True):
        joint, front = scene.joint(part), Front(record["rectangle_m"], "slide")
        if joint.kind == "revolute":
            place = (np.array(joint.origin) - front.middle) @ front.axes.T
            along = int(np.argmax(np.abs(front.axes @ np.array(joint.axis))))
            sides = ("bottom", "top") if along == 0 else ("left", "right")
            front.kind, front.hinge = "hinge", sides[int(place[1 - along] > 0)]
        fronts.append(front)
    return fronts


def matches(scores: np.ndarray, min_iou: float) -> list[tuple[int, int]]:
    """Return pairs of a truth and a front, best overlaps first, one to one, of `min_iou` or more; scores [truth front]."""
    pairs, left = [], scores.copy()
    while left.size and left.max() >= min_iou:
        i, j = (int(k) for k in np.unravel_index(np.argmax(left), left.shape))
        pairs.append((i, j))
        left[i], left[:, j] = -1.0, -1.0
    return pairs


def compared(truth: list[Front], fronts: list[Front]) -> dict:
    """Return how fronts match a truth."""
    scores = np.array([[one.overlap(other) for other in fronts] for one in truth]).reshape(len(truth), len(fronts))
    pairs = [(truth[i], fronts[j], float(scores[i, j])) for i, j in matches(scores, MATCH)]

    def f1(count: int) -> float:
        return round(2 * count / max(len(truth) + len(fronts), 1), 3)

    hinged = [(a, b) for a, b, _ in pairs if a.hinge and b.hinge]
    handles = [
        float(np.linalg.norm(a.handle - b.handle)) for a, b, _ in pairs if a.handle is not None and b.handle is not None
    ]
    return {
        "truth": len(truth),
        "fronts": len(fronts),
        "matched": len(pairs),
        "precision": round(len(pairs) / max(len(fronts), 1), 3),
        "recall": round(len(pairs) / max(len(truth), 1), 3),
        "f1": f1(len(pairs)),
        "f1_at_0.3_and_0.7": [f1(len(matches(scores, min_iou))) for min_iou in (0.3, 0.7)],
        "median_iou": round(float(np.median([score for *_, score in pairs])), 3) if pairs else None,
        "kind_right": [sum(a.kind == b.kind for a, b, _ in pairs), len(pairs)],
        "hinge_right": [sum(a.hinge == b.hinge for a, b in hinged), len(hinged)],
        "median_handle_m": round(float(np.median(handles)), 3) if handles else None,
    }


def main() -> None:
    """Compare the annotators, and proposals with each of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proposals", nargs="*", help="CAPTURE=FOLDER")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    rows = {}
    for path in sorted(ROOMS.glob("*.A.json")):
        capture = path.name.removesuffix(".A.json")
        rows[f"{capture}: A and B"] = compared(annotated(capture, "A"), annotated(capture, "B"))
    for text in given.proposals:
        capture, _, folder = text.partition("=")
        for annotator in "AB":
            rows[f"{capture}: {annotator} and proposals"] = compared(
                annotated(capture, annotator), proposed(Path(folder))
            )
    print("\n".join(f"{name}: {row}" for name, row in rows.items()))
    if given.out:
        given.out.write_text(json.dumps({"rows": rows, "provenance": provenance("cpu")}, indent=1) + "\n")


if __name__ == "__main__":
    main()
