"""Clicks and seconds of annotating three parts of a phone's scans -> rooms in experiments/results/annotate_clicks.json.

    python experiments/annotate_clicks.py kitchen_190 office_192 study_196 [--work runs/clicks] [--out FILE]

A room is ROOM_SEED of `s2a sample`. A script in Chromium clicks where the truth says that parts are: the first
three that one sees from one place and whose handle is there. Then planner and robot open them, 2 episodes each. Needs the extra
view, selenium and Chromium. A room that is there is not run again.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
import browser
import clicking

from s2a import scan
from s2a.annotate import files, panel, shown
from s2a.annotate.region import FrontRegion
from s2a.annotate.surface import SplitSurface
from s2a.commands import cli
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.scene.scene import Mesh

AZIMUTHS = np.arange(-3.0, 3.2, 0.2)
NEAR, SEEN = 0.03, 0.06
"""[m] From a place to what the camera sees there, of the first part and of the others."""
EDGE = 20.0
"""[pixel] To the window's border."""
SHAKE = 8.0
"""[pixel] A click may be so far off: by a hand, and since a phone's scan is bent."""


def main() -> None:
    """Annotate and open what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+")
    parser.add_argument("--work", type=Path, default=Path("runs/clicks"))
    parser.add_argument("--out", type=Path, default=Path("experiments/results/annotate_clicks.json"))
    args = parser.parse_args()
    content = json.loads(args.out.read_text()) if args.out.is_file() else {"rooms": []}
    for name in args.rooms:
        if any(row["room"] == name for row in content["rooms"]):
            continue
        content["rooms"].append({"room": name, **_room(name, args.work / name), **provenance("cpu")})
        with atomic_write(args.out) as file:
            file.write_text(json.dumps(content, indent=1) + "\n")


def _room(name: str, work: Path) -> dict[str, object]:
    room, seed = name.rsplit("_", 1)
    sample, imported, out = work / "sample", work / "scan", work / "annotated"
    if not imported.is_dir():
        _s2a("sample", f"room={room}", f"seed={seed}", "detail=phone", f"out={sample}")
        _s2a("import", f"mesh={sample / 'scan.glb'}", f"out={imported}", "texel=0.02")
    truth = json.loads((sample / "truth" / "truth.json").read_text())["parts"]
    shift = json.loads((imported / "import.json").read_text())["matrix"][2][3]
    azimuth, parts = choose(files.read(imported).surface, truth, shift)
    if not parts:
        return {"parts": [], "left_out": "no three parts with handles are seen from one place"}
    figures = clicking.annotate(imported, truth, parts, azimuth, shift, out, work / "images")
    checks = cli.main(["check", f"scan={out}"])
    _s2a("export", f"scan={out}", f"out={work}")
    _s2a("prepare", f"stage={work / 'geometric.usd'}", "targets=all", f"out={work / 'room.usd'}")
    for row, part in zip(figures, scan.read(out).movable, strict=True):
        report = work / f"{part}.json"
        _s2a(
            "evaluate",
            f"stage={work / 'room.usd'}",
            f"part={part}",
            "num_envs=2",
            "task.episode_steps=1200",
            f"out={report}",
        )
        found = json.loads(report.read_text())
        row |= {"seconds_at_3_s": clicking.PACE * row["actions"], "opening_m": round(found["opening"]["mean"], 3)}
        row |= {rate: found[rate]["rate"] for rate in ("success", "grasp_success")}
    return {"azimuth": round(azimuth, 2), "parts": figures, "check_passed": checks == 0}


def choose(surface: SplitSurface, truth: dict, shift: float) -> tuple[float, dict[str, str]]:
    """Return an azimuth [rad] from which a part is seen, and three with their handles that are seen where one faces the first."""
    mesh, up = surface.mesh(), np.array([0.0, 0.0, shift])
    size = (clicking.WIDTH - panel.WIDTH, clicking.HEIGHT)
    handles = _handles(truth)

    def sees(eye: np.ndarray, target: np.ndarray, fov: float, places: list[np.ndarray]) -> bool:
        pixels = np.array([browser.pixel(place, eye, target, fov, size) for place in places])
        return bool((pixels > EDGE).all() and (pixels < np.array(size) - EDGE).all())

    def hits(eye: np.ndarray, place: np.ndarray, distance: float) -> bool:
        found = shown.place(mesh, eye, (place - eye) / np.linalg.norm(place - eye))
        return found is not None and float(np.linalg.norm(found[1] - place)) < distance

    for azimuth in AZIMUTHS:
        camera, eye, target = clicking.start(surface, azimuth)
        for first in handles:
            middle, right, high = clicking.front(truth, first)
            middle, outward = middle + up, np.array(truth[first]["pose"])[:3, 0]
            place = middle - 0.4 * right - 0.5 * high
            if not sees(eye, target, camera.fov, [place]):
                continue
            if not hits(eye, place, NEAR):
                continue
            found = clicking.grown(surface, eye, place)
            if not _safe(mesh, eye, place, found, 2 * np.tan(camera.fov / 2) / size[1]):
                continue
            there, aim = shown.facing(found, camera.fov)
            seen = []
            for part, handle in handles.items():
                middle_, right_, high_ = clicking.front(truth, part)
                middle_ = middle_ + up
                held = np.array(truth[handle]["pose"])[:3, 3] + up
                ends = [middle_ - right_ + high_, middle_ + right_ - high_, held]
                alike = np.array(truth[part]["pose"])[:3, 0] @ outward > 0.95
                if alike and sees(there, aim, camera.fov, ends) and hits(there, middle_ - 0.3 * right_, SEEN):
                    seen.append((part != first, float(np.linalg.norm(middle_ - middle)), part))
            if len(seen) >= 3 and first in [part for *_, part in seen]:
                return float(azimuth), {part: handles[part] for *_, part in sorted(seen)[:3]}
    return 0.0, {}


def _safe(mesh: Mesh, eye: np.ndarray, place: np.ndarray, region: FrontRegion, pixel: float) -> bool:
    """Return whether clicks SHAKE off a place are on the same region; pixel: size of one a metre away [m]."""
    ray = place - eye
    aside = np.cross(ray, (0.0, 0.0, 1.0))
    ways = [way / np.linalg.norm(way) for way in (aside, np.cross(ray, aside))]
    off = SHAKE * pixel * np.linalg.norm(ray)
    rays = [ray + sign * off * way for way in ways for sign in (-1, 1)]
    found = [shown.place(mesh, eye, each / np.linalg.norm(each)) for each in rays]
    return all(each is not None and each[0] in region.faces for each in found)


def _handles(truth: dict) -> dict[str, str]:
    """Return the handle of each moving part that has one, by the numbers in their labels."""
    number = {part: ".".join(each["label"].split(".")[1:]) for part, each in truth.items()}
    styled = {number[part]: part for part, each in truth.items() if each.get("style")}
    moving = [part for part, each in truth.items() if each.get("joint") and number[part]]
    found = {part: styled.get(f"{number[part]}.1") or styled.get(f"{number[part]}.1.1") for part in moving}
    return {part: handle for part, handle in found.items() if handle}


def _s2a(*arguments: str) -> None:
    if cli.main(list(arguments)) != 0:
        sys.exit(f"s2a {' '.join(arguments)} failed")


if __name__ == "__main__":
    main()
