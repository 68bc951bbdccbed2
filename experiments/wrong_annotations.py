"""Wrong annotations against `s2a check`: how many are caught by class, and how many right ones are.

    python experiments/wrong_annotations.py SCAN ... [--count 25] [--seed 0] [--out FILE]

SCAN is a folder that `s2a sample` wrote. Every part that moves is checked as annotated, which counts the false alarms; then each
class of wrong annotation is drawn `--count` times, from random parts of random scans, and checked. An annotation counts as caught
if a check warns or fails that did not for the right one. Writes experiments/results/wrong_annotations.json and prints a table.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a import scan
from s2a.core.check import Check
from s2a.core.provenance import provenance
from s2a.scan.evidence import Bounds, annotation
from s2a.scan.evidence import annotation as room
from s2a.scan.evidence.front import Front, front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.articulation import opening_direction
from s2a.scene.scene import Joint, Mesh, Part, Scene

RESULTS = Path(__file__).parent / "results/wrong_annotations.json"
TILT = np.radians(15.0)
OFFSET = 0.5
"""[m] A hinge is moved by this much across its axis."""
SCALES = {"mm": 1000.0, "cm": 100.0, "dm": 10.0, "inch": 1 / 0.0254, "foot": 1 / 0.3048}
TURNS = {
    "y up": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "y down": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "x up": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "x down": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "upside down": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}


@dataclass(frozen=True)
class Case:
    """A scan with its right annotation, and what the checks say of it.

    Attributes:
        name: of its folder.
        surface: its surface.
        fronts: of its moving parts.
        right: findings of the room, under the empty id, and of each moving part.
    """

    name: str
    surface: ScanSurface
    fronts: Mapping[str, Front | None]
    right: Mapping[str, list[Check]]


@dataclass(frozen=True)
class Wrong:
    """A wrong annotation that was drawn.

    Attributes:
        case: the scan.
        part: whose joint is wrong; empty: the room is.
        how: it is wrong.
        scene: the scene with it.
    """

    case: Case
    part: str
    how: str
    scene: Scene


def main() -> None:
    """Check right and wrong annotations, write the figures and print a table."""
    args = arguments(__doc__, RESULTS)
    bounds = Bounds()
    start = time.perf_counter()
    cases = [case(path, bounds) for path in args.scans]
    random = np.random.default_rng(args.seed)
    drawn = {name: [pick(cases, random) for _ in range(args.count)] for name, pick in CLASSES.items()}
    wrong = {name: [checked(one, bounds) for one in ones] for name, ones in drawn.items()}
    result = {
        "seed": args.seed,
        "scans": {case.name: len(case.fronts) for case in cases},
        "classes": {name: summary(rows) for name, rows in wrong.items()},
        "all": summary([row for rows in wrong.values() for row in rows]),
        "false_alarms": false_alarms(cases),
        "missed": [row for rows in wrong.values() for row in rows if not row["caught"]],
        "checks": _by_check(wrong),
        "seconds": round(time.perf_counter() - start, 1),
        **provenance("cpu"),
    }
    args.out.parent.mkdir(exist_ok=True)
    args.out.write_text(json.dumps(result, indent=1) + "\n")
    print(table(result))


def case(path: Path, bounds: Bounds) -> Case:
    """Read a scan and check it as it is annotated."""
    surface = ScanSurface(scan.read(path))
    fronts = {part: front(surface, part) for part in surface.scene.movable}
    right = {part: list(annotation.moving_part(surface, part, found, bounds)) for part, found in fronts.items()}
    return Case(path.name, surface, fronts, right | {"": room.room_checks(surface, fronts, bounds)})


def flagged(findings: list[Check]) -> set[str]:
    """Return the names of the checks that warn or fail."""
    return {finding.name for finding in findings if finding.status in ("warn", "fail")}


def false_alarms(cases: list[Case]) -> dict[str, Any]:
    """Return how many right parts and rooms are flagged, and what is said of them."""
    rows = [(case.name, part, found) for case in cases for part, found in case.right.items()]
    bad = [(name, part, finding) for name, part, found in rows for finding in found if flagged([finding])]
    parts = sum(part != "" for _, part, _ in rows)
    return {
        "parts": parts,
        "flagged_parts": len({(name, part) for name, part, _ in bad if part}),
        "rooms": len(rows) - parts,
        "flagged_rooms": len({name for name, part, _ in bad if not part}),
        "said": [f"{name}: {finding.name}: {finding}" for name, _, finding in bad],
    }


Change = Callable[[Joint, Front, np.random.Generator], tuple[str, Joint]]
Picker = Callable[[Sequence[Case], np.random.Generator], Wrong]


def of_joint(change: Change, kind: str | None) -> Picker:
    """Return a function that draws a part with a joint of some kind and changes its joint."""

    def pick(cases: Sequence[Case], random: np.random.Generator) -> Wrong:
        case = cases[random.integers(len(cases))]
        scene = case.surface.scene
        parts = [part for part in scene.movable if kind in (None, scene.joint(part).kind) and case.fronts[part]]
        part = parts[random.integers(len(parts))]
        found = case.fronts[part]
        assert found is not None
        how, joint = change(scene.joint(part), found, random)
        return Wrong(case, part, how, _with_joint(scene, part, joint))

    return pick


def of_scene(transforms: Mapping[str, np.ndarray], labelled: bool) -> Picker:
    """Return a function that draws a scan and transforms all of it; without labels of floors if asked."""

    def pick(cases: Sequence[Case], random: np.random.Generator) -> Wrong:
        case = cases[random.integers(len(cases))]
        how = list(transforms)[random.integers(len(transforms))]
        return Wrong(case, "", how, transformed(case.surface.scene, np.array(transforms[how], float), labelled))

    return pick


def checked(wrong: Wrong, bounds: Bounds) -> dict[str, Any]:
    """Return one wrong annotation and the checks that name it, but do not flag the right one."""
    case, part = wrong.case, wrong.part
    if part:
        findings = list(annotation.moving_part(case.surface.with_scene(wrong.scene), part, case.fronts[part], bounds))
    else:
        surface = ScanSurface(wrong.scene)
        findings = room.room_checks(surface, {p: front(surface, p) for p in wrong.scene.movable[:8]}, bounds)
    return row(wrong, flagged(findings) - flagged(case.right[part]))


def row(wrong: Wrong, checks: set[str]) -> dict[str, Any]:
    """Return one wrong annotation and the checks that name it, for the file."""
    found = {"caught": bool(checks), "checks": sorted(checks)}
    return {"scan": wrong.case.name, "part": wrong.part, "how": wrong.how, **found}


def transformed(scene: Scene, matrix: np.ndarray, labelled: bool) -> Scene:
    """Return a scene whose points are multiplied by a matrix [3 3]: a rotation, or a scale."""
    scale = float(np.cbrt(np.linalg.det(matrix)))

    def moved(part: Part) -> Part:
        joint = part.motion
        if isinstance(joint, Joint):
            axis, origin = matrix @ joint.axis / scale, matrix @ joint.origin
            by = scale if joint.kind == "prismatic" else 1.0
            axis = axis / np.linalg.norm(axis)
            joint = replace(joint, axis=tuple(axis), origin=tuple(origin), limits=tuple(by * x for x in joint.limits))  # type: ignore[arg-type]
        label = part.label if labelled or part.label != "floor" else "object"
        return replace(part, label=label, mesh=Mesh(part.mesh.vertices @ matrix.T, part.mesh.faces), motion=joint)

    return Scene(scene.name, {name: moved(part) for name, part in scene.parts.items()})


def reversed_axis(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Point the axis the other way."""
    return "reversed", replace(joint, axis=_negative(joint.axis))


def tilted(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Tilt the axis by 15 degrees towards a random direction."""
    aside = np.cross(joint.axis, random.normal(size=3))
    axis = np.cos(TILT) * np.array(joint.axis) + np.sin(TILT) * aside / np.linalg.norm(aside)
    return "tilted", replace(joint, axis=tuple(axis / np.linalg.norm(axis)))


def other_edge(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Move a hinge to the opposite edge; in half of the cases its axis is reversed too, so that it opens the same way."""
    across = np.cross(joint.axis, front.normal)
    across /= np.linalg.norm(across)
    origin = np.array(joint.origin)
    moved = origin + 2 * float((front.center - origin) @ across) * across
    if random.uniform() < 0.5:
        return "opposite edge", replace(joint, origin=tuple(moved))
    return "opposite edge, axis reversed", replace(joint, origin=tuple(moved), axis=_negative(joint.axis))


def far_hinge(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Move a hinge by half a metre across its axis."""
    aside = np.cross(joint.axis, random.normal(size=3))
    return "0.5 m off", replace(joint, origin=tuple(joint.origin + OFFSET * aside / np.linalg.norm(aside)))


def other_kind(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Swap the kind: the word alone, or as someone would who takes a drawer for a door, and the other way round."""
    swapped = replace(joint, kind="prismatic" if joint.kind == "revolute" else "revolute")
    if random.uniform() < 0.5:
        return f"{joint.kind}, type swapped", swapped
    if joint.kind == "revolute":
        return "pulled forwards", Joint("prismatic", tuple(front.normal), joint.origin, (0.0, 0.4))
    side, sign = random.integers(2), random.choice([-1.0, 1.0])
    edge = front.center + sign * front.axes[:, side] * front.size[side] / 2
    axis = front.axes[:, 1 - side]
    hinge = Joint("revolute", tuple(axis / np.linalg.norm(axis)), tuple(edge), (0.0, 1.57))
    outward = float(opening_direction(hinge, front.center) @ front.normal) > 0
    return "turned about an edge", hinge if outward else replace(hinge, axis=_negative(hinge.axis))


def doubled(joint: Joint, front: Front, random: np.random.Generator) -> tuple[str, Joint]:
    """Double the limits."""
    return f"{joint.kind}, doubled", replace(joint, limits=(2 * joint.limits[0], 2 * joint.limits[1]))


def _negative(axis: tuple[float, float, float]) -> tuple[float, float, float]:
    return (-axis[0], -axis[1], -axis[2])


def _with_joint(scene: Scene, part: str, joint: Joint) -> Scene:
    parts = {**scene.parts, part: replace(scene.parts[part], motion=joint)}
    return Scene(scene.name, parts, scene.origin)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return how many rows are caught, and how many without the check that reads the names of parts."""
    caught = sum(row["caught"] for row in rows)
    unnamed = sum(bool(set(row["checks"]) - {"kind"}) for row in rows)
    return {
        "wrong": len(rows),
        "caught": caught,
        "fraction": round(caught / max(1, len(rows)), 3),
        "caught_without_names": unnamed,
    }


def _by_check(wrong: Mapping[str, list[dict[str, Any]]]) -> dict[str, dict[str, int]]:
    """Return how often each check names a class."""
    return {name: dict(Counter(c for row in rows for c in row["checks"]).most_common()) for name, rows in wrong.items()}


def table(result: Mapping[str, Any]) -> str:
    """Return the figures as Markdown."""
    lines = ["| wrong annotation | drawn | caught | | without names |", "|---|---|---|---|---|"]
    rows = {**result["classes"], "all": result["all"]}
    lines += [
        f"| {name} | {row['wrong']} | {row['caught']} | {row['fraction']:.0%} | {row['caught_without_names']} |"
        for name, row in rows.items()
    ]
    alarms = result["false_alarms"]
    lines.append(f"\n{alarms['flagged_parts']} of {alarms['parts']} right parts flagged, ")
    lines[-1] += f"{alarms['flagged_rooms']} of {alarms['rooms']} rooms"
    lines += [f"missed: {row['scan']} {row['part']} {row['how']}" for row in result["missed"]]
    return "\n".join([*lines, *(f"false alarm: {text}" for text in alarms["said"])])


def arguments(description: str | None, results: Path) -> argparse.Namespace:
    """Return what the command line asks for; `results` is the file that is written by default."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", type=Path, help="folders that s2a sample wrote")
    parser.add_argument("--count", type=int, default=25, help="wrong annotations of each class")
    parser.add_argument("--seed", type=int, default=0, help="of the wrong annotations")
    parser.add_argument("--out", type=Path, default=results, help="file to write")
    return parser.parse_args()


UNITS = {name: np.eye(3) * factor for name, factor in SCALES.items()}
ROTATIONS = {name: np.array(rows) for name, rows in TURNS.items()}
CLASSES = {
    "axis sign": of_joint(reversed_axis, None),
    "axis tilted 15 degrees": of_joint(tilted, None),
    "hinge at the wrong edge": of_joint(other_edge, "revolute"),
    "hinge 0.5 m off": of_joint(far_hinge, "revolute"),
    "wrong kind": of_joint(other_kind, None),
    "doubled limits": of_joint(doubled, None),
    "up axis": of_scene(ROTATIONS, labelled=True),
    "up axis, no floor labelled": of_scene(ROTATIONS, labelled=False),
    "units": of_scene(UNITS, labelled=True),
}
"""Classes of wrong annotations: how one is drawn."""

if __name__ == "__main__":
    main()
