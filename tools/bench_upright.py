"""Up directions of captures with known truth: how many are found, asked for, or silently wrong; and the weights of the evidence.

    python tools/bench_upright.py bench captures.json [--rotations 10] [--parts]
    python tools/bench_upright.py fit captures.json

captures.json lists meshes and their true up direction in the file's coordinates: {"scans/room.ply": [0, 0, 1], ...}; paths are
relative to it. A mesh that was fused from a recording may name its folder, of whose cameras the poses then speak, too:
{"scans/room.ply": {"up": [0, -0.9, -0.4], "frames": "recordings/room"}}; --surface leaves out such poses, and labels.

No mesh with a truth is part of the repository: ScanNet's and 7-Scenes' terms forbid it, and virtual rooms come
from `s2a sample`, whose meshes have z up.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import frame, labelled_boxes, recording_formats, upright
from s2a.scan import source as mesh_files
from s2a.scan.source import SourceMesh, Stated
from s2a.scan.surfels import sample

WRONG = 5.0
"""An up direction farther than this from the truth is wrong [deg]."""
FEWEST = 200
"""Faces of a part at least."""
NEGATIVE = ("hanging", "hanging_deep", "plinths", "shelves")
"""Evidence against a direction; all other evidence may only speak for it."""


@dataclass
class Count:
    """Outcomes of one capture.

    Attributes:
        stored: outcome of the file as it is.
        right: rotations whose direction was found.
        asked: rotations for which a key was asked.
        wrong: rotations with another direction, no question and no warning.
        warned: rotations with another direction and a warning.
        keyed: of those asked, how many are right with one key.
    """

    stored: str
    right: int = 0
    asked: int = 0
    wrong: int = 0
    warned: int = 0
    keyed: int = 0


def main() -> None:
    """Run the bench or the fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mode", choices=["bench", "fit"])
    parser.add_argument("captures", type=Path)
    parser.add_argument("--rotations", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--surface", action="store_true", help="without the poses of cameras and the labels of the capture"
    )
    parser.add_argument("--parts", action="store_true", help="each rotation is of another part of the capture")
    options = parser.parse_args()
    place = options.captures.parent
    meshes, hints = dict[Path, np.ndarray](), dict[Path, frame.Hint | None]()
    for name, truth in json.loads(options.captures.read_text()).items():
        up = truth["up"] if isinstance(truth, dict) else truth
        meshes[place / name] = np.array(up) / np.linalg.norm(up)
        recording = place / truth["frames"] if isinstance(truth, dict) else None
        hints[place / name] = None if options.surface else hint_of(place / name, recording)
    if options.mode == "fit":
        fit(meshes, options.seed)
    else:
        bench(meshes, hints, options.rotations, options.seed, options.parts)


def hint_of(path: Path, recording: Path | None) -> frame.Hint | None:
    """Return what the cameras of a recording, or the labels of a capture, speak for."""
    if recording is not None and (up := recording_formats.read(recording).up) is not None:
        return frame.Hint(up, "the cameras")
    boxes = labelled_boxes.read_quest(path)[1] if labelled_boxes.recognise_quest(path) else []
    up = labelled_boxes.upwards(boxes)
    return None if up is None else frame.Hint(up, "the labels")


def bench(
    meshes: dict[Path, np.ndarray], hints: dict[Path, frame.Hint | None], rotations: int, seed: int, parts: bool
) -> None:
    """Print the outcomes of each capture, as stored and in random rotations, whole or of its parts, that state nothing."""
    total = Count("")
    print(f"{'capture':40s} as stored  right asked warned wrong  with a key  seconds a mesh")
    for path, truth in meshes.items():
        source, start = load(path), time.perf_counter()
        count = Count(outcome(source, truth, source.stated, frame.by_name(path), hints[path]))
        for i, turn in enumerate(turns(rotations, seed)):
            turned, hint = moved(source, turn), hints[path]
            hint = hint and frame.Hint(turn @ hint.up, hint.by)
            if parts:
                kept = PARTS[i % len(PARTS)](source, truth, np.random.default_rng([seed, i]))
                turned = replace(turned, faces=source.faces[kept])
                if len(turned.faces) < FEWEST:
                    continue
            result = outcome(turned, turn @ truth, Stated(), None, hint)
            setattr(count, result, getattr(count, result) + 1)
            if result == "asked":
                count.keyed += (
                    outcome(turned, turn @ truth, Stated(), None, hint, (turn @ truth).round(2).tolist()) == "right"
                )
        seconds = (time.perf_counter() - start) / (rotations + 1)
        print(
            f"{path.stem[-40:]:40s} {count.stored:9s}  {count.right:5d} {count.asked:5d} {count.warned:6d} {count.wrong:5d}"
            f"  {count.keyed:3d} of {count.asked:<3d}  {seconds:.2f}",
            flush=True,
        )
        for key in ("right", "asked", "warned", "wrong", "keyed"):
            setattr(total, key, getattr(total, key) + getattr(count, key))
    print(
        f"of {rotations * len(meshes)} rotated meshes: {total.right} right, {total.asked} asked, "
        f"{total.warned} wrong with a warning, {total.wrong} silently wrong"
    )


def outcome(
    mesh: SourceMesh,
    truth: np.ndarray,
    stated: Stated,
    habits: Stated | None,
    hint: frame.Hint | None,
    up: str | list[float] = "auto",
) -> str:
    """Return "right", "asked", "warned" or "wrong" for a mesh."""
    try:
        result = frame.find(mesh.vertices, mesh.faces, stated, up, "auto", habit=habits, hint=hint)
    except InputError:
        return "asked"
    if np.degrees(np.arccos(np.clip(np.dot(result.up, truth), -1, 1))) <= WRONG:
        return "right"
    return "warned" if result.doubts else "wrong"


def load(path: Path) -> SourceMesh:
    """Return the mesh of a capture."""
    return labelled_boxes.read_quest(path)[0] if labelled_boxes.recognise_quest(path) else mesh_files.read(path)


def moved(mesh: SourceMesh, turn: np.ndarray) -> SourceMesh:
    """Return a mesh turned by a rotation [3 3]."""
    return SourceMesh(
        mesh.vertices @ turn.T, mesh.faces, mesh.uv, mesh.colors, mesh.material, mesh.materials, mesh.stated
    )


def turns(count: int, seed: int) -> list[np.ndarray]:
    """Return random rotations, shape [3 3] each."""
    quaternions = np.random.default_rng(seed).normal(size=(count, 4))
    matrices = []
    for w, x, y, z in quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True):
        rows = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrices.append(np.array(rows))
    return matrices


def fit(meshes: dict[Path, np.ndarray], seed: int) -> None:
    """Print the weights under which the true directions of whole captures and of parts of them are likeliest."""
    names, groups = list(upright.WEIGHTS), []
    for path, truth in meshes.items():
        source = load(path)
        rng = np.random.default_rng([seed, len(source.faces)])
        for part, turn in zip(PARTS, turns(len(PARTS), int(rng.integers(1 << 30))), strict=True):
            faces = source.faces[part(source, truth, rng)]
            if len(faces) < FEWEST:
                continue
            found = upright.candidates(sample(source.vertices @ turn.T, faces))
            angles = [np.degrees(np.arccos(np.clip(one.up @ turn @ truth, -1, 1))) for one in found]
            if found and min(angles) < WRONG:
                evidence = np.array([[one.evidence[name] for name in names] for one in found])
                groups.append((evidence, int(np.argmin(angles))))
        print(f"{path.stem}: {len(groups)} examples", flush=True)
    weights = likeliest(groups, np.array([-1 if name in NEGATIVE else 1 for name in names]))
    print("\n".join(f'    "{name}": {weight:.1f},' for name, weight in zip(names, weights, strict=True)))


def likeliest(groups: list[tuple[np.ndarray, int]], sign: np.ndarray, ridge: float = 0.002) -> np.ndarray:
    """Return the weights [evidence] of a conditional logit model, each of its sign, by Adam on its penalised likelihood.

    Args:
        groups: evidence for each candidate of a capture, shape [candidate evidence], and the true one's place.
        sign: 1 or -1, shape [evidence].
        ridge: weight of the weights' squares.
    """
    weights = mean = square = np.zeros(len(sign))
    for step in range(1, 2500):
        gradient = ridge * weights
        for evidence, true in groups:
            powers = np.exp(evidence @ weights - (evidence @ weights).max())
            gradient = gradient + (powers / powers.sum() @ evidence - evidence[true]) / len(groups)
        mean, square = 0.9 * mean + 0.1 * gradient, 0.99 * square + 0.01 * gradient**2
        weights = weights - 0.03 * (mean / (1 - 0.9**step)) / (np.sqrt(square / (1 - 0.99**step)) + 1e-8)
        weights = np.where(weights * sign > 0, weights, 0.0)
    return weights


def heights(mesh: SourceMesh, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the relative height of each face and how far it faces up, -1 to 1, shape [face] each."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    height = corners.mean(axis=1) @ up
    low, high = np.quantile(height, (0.002, 0.998))
    return (height - low) / (high - low), normals @ up / (np.linalg.norm(normals, axis=1) + 1e-12)


def whole(mesh: SourceMesh, up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Keep all faces."""
    return np.ones(len(mesh.faces), bool)


def without_ceiling(mesh: SourceMesh, up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Keep what is no ceiling."""
    height, facing = heights(mesh, up)
    return ~((height > 0.8) & (facing < -0.8))


def lower_part(mesh: SourceMesh, up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Keep what a low scan holds."""
    return without_ceiling(mesh, up, rng) & (heights(mesh, up)[0] < rng.uniform(0.45, 0.8))


def half(mesh: SourceMesh, up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Keep one side of an upright plane."""
    across = np.cross(up, rng.normal(size=3))
    along = mesh.vertices[mesh.faces].mean(axis=1) @ across
    kept: np.ndarray = along > np.quantile(along, rng.uniform(0.35, 0.65))
    return kept


def strip(mesh: SourceMesh, up: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Keep what lies within a metre or two of a wall."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1) * (np.abs(heights(mesh, up)[1]) < 0.2)
    face = int(rng.choice(len(area), p=area / area.sum()))
    inwards = normals[face] - (normals[face] @ up) * up
    along = corners.mean(axis=1) @ (inwards / np.linalg.norm(inwards))
    return (along > along[face] - 0.1) & (along < along[face] + rng.uniform(0.9, 1.7))


PARTS = (whole, whole, without_ceiling, lower_part, half, strip)
"""What is left of a capture, for the fit."""


if __name__ == "__main__":
    main()
