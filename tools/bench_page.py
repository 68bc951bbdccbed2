"""Seconds until the page of a room is drawn in headless Chromium, frames a second as it turns, and the size of its file.

    python tools/bench_page.py PATH [PATH ...] [--max-faces N] [--before TREE] [--out experiments/results/bench_page.json]

PATH is what `s2a view` takes. Seconds count from when the command was entered: until its address is printed, the controls are
there, and a tenth of the window is not background; "processor" is what the command itself had of a core by the first. TREE is
an older checkout, whose page is measured right before the other's, so that ratios hold on a busy machine. Needs chromium and
chromedriver, and the extras view and dev. The record holds the load of the machine: without a graphics processor the
browser renders on the cores that the command needs too.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/support"))
from browser import Page, browser  # type: ignore[import-not-found]

from s2a.core.provenance import provenance
from s2a.view.page import cards
from s2a.view.page.room import read
from s2a.view.page.scene_nodes import thinned

ROOT = Path(__file__).parents[1]
SIZE, PANEL = (1280, 800), 390
"""[pixel] Of the window, and of the controls at its right."""
BACKGROUND, DRAWN = 245, 0.1
"""Level from which a pixel is background, and the fraction of others from which the room is drawn."""
PATIENCE, SETTLED, TURNING = 120.0, 10.0, 10.0
"""[s] For each wait, before the room is turned, and for which it is turned."""
COUNT = "window.frames_drawn = 0; (function f() { window.frames_drawn++; requestAnimationFrame(f) })()"


def main() -> None:
    """Measure every room and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path)
    parser.add_argument("--max-faces", type=int)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--out", type=Path, default=Path("experiments/results/bench_page.json"))
    args = parser.parse_args()
    rows = []
    for path in args.paths:
        room = read(cards.of_path(path)[0])
        faces = thinned(room, args.max_faces).faces if args.max_faces else room.faces
        old = {"before": opened(path, args.max_faces, args.before)} if args.before else {}
        new = opened(path, args.max_faces, ROOT)
        rows.append({"path": str(path), "faces": faces, **new, **written(path), **old})
        print(json.dumps(rows[-1]), flush=True)
    args.out.write_text(json.dumps({**provenance("cpu"), "window": SIZE, "rooms": rows}, indent=1) + "\n")


def opened(path: Path, max_faces: int | None, tree: Path) -> dict:
    """Open the page of a room as a checkout has it, and turn it."""
    command = [sys.executable, "-m", "s2a", "view", f"path={path.absolute()}", "page=true"]
    command += [f"max_faces={max_faces}"] if max_faces else []
    with browser(*SIZE) as page:
        page.open("about:blank")
        start = time.monotonic()
        env = os.environ | {"PYTHONPATH": str(tree.absolute())}
        server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tree, env=env)
        try:
            row = {
                "address": _address(server),
                "printed": round(time.monotonic() - start, 1),
                "processor": _processor(server),
            }
            page.open(row.pop("address"))
            page.wait(lambda: "Joints (" in page.text(), PATIENCE)
            row["controls"] = round(time.monotonic() - start, 1)
            page.wait(lambda: _filled(page.image()) > DRAWN, PATIENCE)
            row["drawn"] = round(time.monotonic() - start, 1)
            return row | _turned(page) | {"load": round(os.getloadavg()[0], 1)}
        finally:
            server.send_signal(signal.SIGINT)
            server.wait(20)


def _address(server: subprocess.Popen) -> str:
    """Return the address that the command prints."""
    assert server.stderr
    for line in server.stderr:
        if " at http" in line:
            return line.split(" at ")[1].split(";")[0]
    raise SystemExit("the command ended without an address")


def _processor(server: subprocess.Popen) -> float:
    """Return the processor time that the command has had [s], which tells more than the clock on a busy machine."""
    fields = Path(f"/proc/{server.pid}/stat").read_text().rpartition(")")[2].split()
    return round((int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), 2)


def _filled(image: np.ndarray) -> float:
    """Return the fraction of the window beside the controls that is not background."""
    return float((image[:, : SIZE[0] - PANEL] < BACKGROUND).any(axis=-1).mean())


def _turned(page: Page) -> dict:
    """Turn the room with the mouse once all of it is there; return the frames a second, and those of the second half."""
    time.sleep(SETTLED)
    page.driver.execute_script(COUNT)
    _mouse(page, "mousePressed", 400)
    start, step, half = time.monotonic(), 0, (0.0, 0)
    while (now := time.monotonic() - start) < TURNING:
        step += 1
        _mouse(page, "mouseMoved", 400 + step * 3 % 300)
        if now > TURNING / 2 and not half[0]:
            half = (time.monotonic() - start, page.driver.execute_script("return window.frames_drawn"))
    count, now = page.driver.execute_script("return window.frames_drawn"), time.monotonic() - start
    later = (count - half[1]) / (now - half[0])
    return {"frames_per_second": round(count / now, 1), "frames_per_second_later": round(later, 1)}


def _mouse(page: Page, kind: str, x: int) -> None:
    event = {"type": kind, "x": x, "y": 400, "button": "left", "buttons": 1, "clickCount": 1}
    page.driver.execute_cdp_cmd("Input.dispatchMouseEvent", event)


def written(path: Path) -> dict:
    """Write the file of a room; return its size."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "room.html"
        subprocess.run([sys.executable, "-m", "s2a", "view", f"path={path}", f"html={file}"], check=True)
        return {"html_megabytes": round(file.stat().st_size / 1e6, 1)}


if __name__ == "__main__":
    main()
