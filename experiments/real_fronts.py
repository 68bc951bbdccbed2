"""Fronts of real rooms: do two annotators agree, do proposals agree with them, and what share does a policy open?

    python experiments/real_fronts.py                                            # agreement alone, from experiments/real_rooms
    python experiments/real_fronts.py scene0000_00=runs/proposed --out FILE      # a folder of s2a annotate auto=true page=false
    python experiments/real_fronts.py --opened rooms/pool.json=bench.json --out experiments/results/real_opened.json

The last takes the index of s2a dataset and the file of s2a bench on it. Its rows are all fronts of a room, also those without a
proposal: annotated ones of real captures, and the parts that move of virtual homes, whose folder with its truth has to lie where
the index names it. A front is opened where its proposal has its kind, and its hinge on the annotator's side where the annotator
gave one, and opens in half of the episodes or more; it is grasped where it is also opened with a grasp in as many.

A pass on the annotation page, played by a program that has annotator A's fronts: false proposals removed, the others taken over,
missing ones drawn with kind and handle, all by the page's own editor; its actions are counted:

    python experiments/real_fronts.py --correct scene0000_00=rooms/scene0000_00/annotated=corrected/scene0000_00 --out pass.json

The annotations hold rectangles, kinds, hinge sides and places of handles of two captures that may not be given on; each file
names the capture by its checksum. Rectangles are compared on the plane of the first: their intersection over union, where
the planes are less than MAX_ANGLE and MAX_OFFSET apart; best pairs first, one to one, from MATCH on.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from proposals import MATCH as MATCH_FACES
from proposals import faces_of, overlap, true_parts

from s2a import scan
from s2a.annotate import existing, files
from s2a.annotate.annotation import Editor
from s2a.annotate.handle import usual_place
from s2a.annotate.region import FrontRegion, GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.core.provenance import provenance
from s2a.scan import folder as scan_files
from s2a.scan.formats import articulate3d
from s2a.scan.imported import SOURCE_FACES

ROOMS = Path(__file__).with_name("real_rooms")
MATCH, MAX_ANGLE, MAX_OFFSET = 0.5, 20.0, 0.12
"""Intersection over union, and [deg] and [m] between the planes of two rectangles of one front."""
OPENED = 0.5
"""Fraction of a part's episodes from which on it counts as opened."""
REASONS = {"check ": "contradicted", "no base pose": "no base", "s2a prepare": "not prepared"}
"""Outcome by the beginning of the reason why a part is left out of an index; other reasons: no plan."""
PACE = 3.0
"""[s] An action on the page, as in experiments/annotate_clicks.py: a click or a drag."""
MISPLACED = 0.15
"""[m] Between a proposal's handle and the annotator's from which on it is put there."""
AIMS = 25
"""Faces of a drawn rectangle that the page looks at."""
KINDS = {"prismatic": "slide", "revolute": "hinge"}


class Front:
    """A rectangle with its kind, the side of its hinge, its handle, and whether that is a knob."""

    def __init__(
        self, corners: list, kind: str, hinge: str | None = None, handle: list | None = None, *, knob: bool = False
    ) -> None:
        self.corners = np.array(corners, float)
        self.kind, self.hinge, self.knob = kind, hinge, knob
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
    return [
        Front(
            r["corners"],
            r["kind"],
            r.get("hinge_side", r.get("hinge")),
            r["handle"],
            knob="knob" in r.get("why", "").replace("no knob", ""),
        )
        for r in records
    ]


def proposed(folder: Path) -> list[Front]:
    """Return the fronts of an annotated folder: rectangles of annotate.json, joints and middles of handles of the scan."""
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
        if handles := [scene.parts[handle].mesh.bounds for handle in scene.handle_parts(part)]:
            front.handle = np.mean(handles, axis=(0, 1))
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


def outcomes(index: Path, bench: Path) -> Iterator[dict]:
    """Yield what became of each front of the rooms of a data set.

    Args:
        index: of s2a dataset.
        bench: of s2a bench on that index.
    """
    content, results = json.loads(index.read_text()), json.loads(bench.read_text())["parts"]
    rates = {(row["room"], row["part"]): row for row in results}
    for verdict in content["verdicts"]:
        name, source = verdict["name"], Path(verdict["source"])
        folder = index.parent / name / "annotated"
        folder = folder if folder.is_dir() else source
        home = (source if source.is_dir() else source.resolve().parent) / "truth/truth.json"
        parts = scan.read(folder).movable if not verdict["failed"] else ()
        truths: dict[str, tuple[list[tuple[str, str, str | None]], np.ndarray, float]] = {}
        sides: list[str | None] = [None] * len(parts)
        if home.is_file():
            truths["truth"] = *_virtual(home, folder, parts), MATCH_FACES
        for path in sorted(ROOMS.glob(f"{name}.?.json")):
            annotator = path.stem[-1]
            ids = [record["id"] for record in json.loads(path.read_text())["fronts"]]
            real, fronts = annotated(name, annotator), proposed(folder) if parts else []
            scores = np.array([[one.overlap(other) for other in fronts] for one in real]).reshape(
                len(real), len(fronts)
            )
            truths[annotator] = [(i, one.kind, one.hinge) for i, one in zip(ids, real, strict=True)], scores, MATCH
            sides = [front.hinge for front in fronts]
        kinds = [KINDS[scan.read(folder).joint(part).kind] for part in parts]
        for annotator, (real_parts, scores, least) in truths.items():
            pairs = dict(matches(scores, least))
            for i, (front, kind, side) in enumerate(real_parts):
                row = {"room": name, "truth": annotator, "front": front, "kind": kind, "outcome": "no proposal"}
                if i in pairs:
                    part = parts[pairs[i]]
                    rate, grasped = (
                        rates.get((f"{name}.usd", part), {}).get(key) for key in ("success", "grasp_success")
                    )
                    row |= {"part": part, "success": rate, "grasp_success": grasped}
                    row["outcome"] = outcome(rate, verdict["left_out"].get(part, ""))
                    if wrong := misfit((kind, side), (kinds[pairs[i]], sides[pairs[i]])):
                        row["outcome"] = wrong
                yield row


def misfit(truth: tuple[str, str | None], proposal: tuple[str, str | None]) -> str:
    """Return what is wrong with the kind and hinge side of a proposal; empty where they fit, or a side is not known."""
    if proposal[0] != truth[0]:
        return "wrong kind"
    return "wrong hinge" if truth[1] and proposal[1] and truth[1] != proposal[1] else ""


def outcome(rate: float | None, reason: str) -> str:
    """Return what became of a proposal that fits: its rate in a bench, or why it is not in the index."""
    if rate is not None:
        return "opened" if rate >= OPENED else "opened less than half"
    return next((outcome for start, outcome in REASONS.items() if reason.startswith(start)), "no plan")


def _virtual(truth: Path, folder: Path, parts: tuple[str, ...]) -> tuple[list[tuple[str, str, None]], np.ndarray]:
    """Return id and kind of each part of a virtual home that moves, and its overlaps with annotated parts [truth part]."""
    home, facts = truth.parent.parent, json.loads(truth.read_text())
    real = [(name, KINDS[one["joint"]["kind"]], None) for name, one in facts["parts"].items() if "joint" in one]
    scores = np.zeros((len(real), len(parts)))
    if folder == home:
        return real, np.array([[float(name == part) for part in parts] for name, *_ in real]).reshape(scores.shape)
    if not parts:
        return real, scores
    surface = files.read(folder).surface
    source = np.arange(len(surface.faces))
    # Back from the annotated mesh to the imported one, and to the file that was imported, whose faces are the scan's own.
    for place in (folder, folder.with_name("scan")):
        if (place / SOURCE_FACES).is_file():
            sources = np.load(place / SOURCE_FACES)
            source = np.where(source < 0, -1, sources[source])
    true_faces = {name: faces for name, faces, _ in true_parts(home, files.read(home), facts, surface, source)}
    annotation = articulate3d.read_parts(scan_files.find(folder).parts, files.read(folder).mesh)
    for i, (name, *_) in enumerate(real):
        for j, part in enumerate(parts):
            faces = faces_of(part, annotation)
            scores[i, j] = overlap(surface, faces, true_faces[name]) if name in true_faces else 0.0
    return real, scores


def opened(rows: list[dict]) -> dict:
    """Return the shares of fronts that are opened, and opened with a grasp, and how many there are of each outcome."""
    counts = Counter(row["outcome"] for row in rows)
    grasped = sum(row["outcome"] == "opened" and (row["grasp_success"] or 0.0) >= OPENED for row in rows)
    shares = {name: round(n / max(len(rows), 1), 3) for name, n in (("opened", counts["opened"]), ("grasped", grasped))}
    return {"fronts": len(rows), **shares, "outcomes": dict(counts)}


def corrected(capture: str, folder: Path, out: Path) -> dict:
    """Correct proposals as on the page until they are an annotator's fronts, and write them; return what was done.

    Actions: a proposal is selected and removed; a wrong hinge is selected, its mode chosen, its side clicked; so is a handle that
    is not where the annotator saw it; of a missing front the rectangle is dragged, the kind chosen, the hinge's side clicked,
    the handle's mode and place clicked, where handles usually are if the annotator saw none; the shape of a knob that is not in
    the surface is chosen. Turns of the camera are not counted, one or more a missing front.
    """
    scanned = files.read(folder)
    surface = scanned.surface
    earlier = existing.read(folder, scanned.mesh, surface)
    editor = Editor(earlier.start(surface), GrowConfig())
    real, fronts, actions = annotated(capture, "A"), proposed(folder), Counter[str]()
    scores = np.array([[one.overlap(other) for other in fronts] for one in real]).reshape(len(real), len(fronts))
    pairs = {j: i for i, j in matches(scores, MATCH) if real[i].kind == fronts[j].kind}
    for j in reversed(range(len(fronts))):
        editor.select(j)
        truth, selected = real[pairs[j]] if j in pairs else None, False
        if truth is None:
            editor.remove()
            actions["removed"] += 2
        elif truth.hinge and truth.hinge != fronts[j].hinge:
            editor.hinge(_side(truth)[None])
            actions["hinge"] += 3
            selected = True
        if truth is not None and _misplaced(truth, fronts[j]):
            editor.select(j)
            actions["handle"] += (not selected) + _give_handle(editor, truth)
    unseen = assumed = 0
    for i in sorted(set(range(len(real))) - set(pairs.values())):
        truth = real[i]
        faces = _seen(editor.annotation.surface, truth)
        if not len(faces):
            unseen += 1
            continue
        editor.rectangle_around(faces, lambda region, corners=truth.corners: _on(region, corners))
        if truth.kind == "slide":
            editor.slide()
            actions["drawn"] += 3
        else:
            editor.hinge(_side(truth)[None])
            actions["drawn"] += 4
        assumed += truth.handle is None
        actions["drawn"] += _give_handle(editor, truth)
    files.write(editor.annotation, scanned, out, earlier, annotated=str(folder), auto=False, edit=True)
    count = sum(actions.values()) + 1  # save
    return {
        "truth": len(real),
        "proposals": len(fronts),
        "right": len(pairs),
        "drawn": len(real) - len(pairs) - unseen,
        "not_scanned": unseen,
        "assumed_handles": assumed,
        "actions": {**actions, "save": 1},
        "seconds": PACE * count,
    }


def _give_handle(editor: Editor, front: Front) -> int:
    """Give the selected part the handle that an annotator saw, or one where handles usually are; return the actions."""
    item = editor.item
    editor.handle(usual_place(item.region, item.joint) if front.handle is None else front.handle)
    if front.handle is None or not front.knob or not editor.item.completed:
        return 2
    editor.handle(front.handle, "knob")
    return 3


def _misplaced(truth: Front, front: Front) -> bool:
    """Return whether the annotator saw the handle of a proposal elsewhere, or one where it has none."""
    if truth.handle is None:
        return False
    return front.handle is None or bool(np.linalg.norm(front.handle - truth.handle) > MISPLACED)


def _seen(surface: SplitSurface, front: Front) -> np.ndarray:
    """Return faces that a front's rectangle shows, the one at its middle first."""
    places = (surface.centroids - front.middle) @ np.column_stack([*front.axes, front.normal])
    half = np.array([np.ptp((front.corners - front.middle) @ axis) / 2 for axis in front.axes])
    inside = (np.abs(places[:, :2]) < 0.9 * half).all(axis=1) & (np.abs(places[:, 2]) < MAX_OFFSET)
    faces = np.flatnonzero(inside & (surface.normals @ front.normal > 0.5))
    faces = faces[np.argsort(np.linalg.norm(places[faces, :2], axis=1))]
    return faces[:: max(1, len(faces) // AIMS)]


def _on(region: FrontRegion, corners: np.ndarray) -> np.ndarray:
    """Return corners on a region's plane."""
    return corners - np.outer((corners - region.center) @ region.normal, region.normal)


def _side(front: Front) -> np.ndarray:
    """Return the middle of the side of a hinge: the annotated one; of one that is not known, the one farther from the handle."""
    right, up = (np.ptp((front.corners - front.middle) @ axis) / 2 * axis for axis in front.axes)
    hinge = front.hinge
    if hinge is None:
        hinge = "left" if front.handle is None or (front.handle - front.middle) @ right > 0 else "right"
    return front.middle + {"right": right, "left": -right, "top": up, "bottom": -up}[hinge]


def _write_opened(pairs: list[tuple[Path, ...]], out: Path | None) -> None:
    """Print the shares of fronts that are opened in each room and in all; write them and the fronts to a file."""
    rows, benches = [], []
    for index, bench in pairs:
        rows += outcomes(index, bench)
        about = json.loads(bench.read_text())
        benches.append({key: about[key] for key in ("policy", "episodes_a_part", "seed", "commit", "device")})
    groups: dict[str, list[dict]] = {}
    for row in rows:
        for group in ("all", row["room"]):
            groups.setdefault(f"{group}: {row['truth']}", []).append(row)
    figures = {name: opened(some) for name, some in sorted(groups.items())}
    print("\n".join(f"{name}: {figure}" for name, figure in figures.items()))
    if out:
        about = {"benches": benches, "figures": figures, "rows": rows, "provenance": provenance("cpu")}
        out.write_text(json.dumps(about, indent=1) + "\n")


def main() -> None:
    """Compare the annotators, and proposals with each of them; or say what is opened."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proposals", nargs="*", help="CAPTURE=FOLDER")
    parser.add_argument("--opened", nargs="+", metavar="INDEX=BENCH", help="pool.json of s2a dataset=file of s2a bench")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--correct", nargs="+", metavar="CAPTURE=ANNOTATED=OUT", help="play a pass on the page")
    given = parser.parse_args()
    if given.correct:
        passes = {
            text.split("=")[0]: corrected(text.split("=")[0], *map(Path, text.split("=")[1:])) for text in given.correct
        }
        print("\n".join(f"{name}: {row}" for name, row in passes.items()))
        if given.out:
            given.out.write_text(json.dumps({"rooms": passes, "provenance": provenance("cpu")}, indent=1) + "\n")
        return
    if given.opened:
        _write_opened([tuple(map(Path, pair.split("="))) for pair in given.opened], given.out)
        return
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
