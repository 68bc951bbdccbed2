"""Somebody who annotates a scan in Chromium with clicks, who sees where the truth says that parts are."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import browser
import numpy as np

from s2a.annotate import files, panel, region, shown
from s2a.annotate.region import FrontRegion, GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.commands.annotate import START
from s2a.core import config
from s2a.scene.geometry.camera import OrbitCamera, framing_pose

WIDTH, HEIGHT, PORT = 1280, 800, 8470
PACE = 3.0
"""[s] A person's time for an action: to look, to move the mouse, to click."""
SETTLE = 30.0
"""[s] In which the scan is there."""
NO_NOTICE = "document.querySelectorAll('[class*=otification]').forEach(e => e.remove())"
"""Takes viser's note away that nothing but the processor draws, which covers a corner."""


class Person:
    """Clicks, drags and presses, and counts them.

    Attributes:
        actions: how many since the last part.
    """

    def __init__(self, page, eye: np.ndarray, target: np.ndarray, fov: float) -> None:
        self.page, self.eye, self.target, self.fov = page, eye, target, fov
        self.actions = 0

    def pixel(self, point: np.ndarray) -> np.ndarray:
        found = browser.pixel(point, self.eye, self.target, self.fov, (WIDTH - panel.WIDTH, HEIGHT))
        assert (found > 0).all() and (found < (WIDTH - panel.WIDTH, HEIGHT)).all(), "out of sight"
        return found

    def click(self, point: np.ndarray) -> None:
        self.actions += 1
        self.page.click(*self.pixel(point))

    def drag(self, one: np.ndarray, other: np.ndarray) -> None:
        self.actions += 1
        self.page.drag(self.pixel(one), self.pixel(other))

    def press(self, caption: str) -> None:
        self.actions += 1
        self.page.press(caption)

    def sees(self, text: str) -> None:
        self.page.wait(lambda: text in self.page.text() or text in self.page.value("part"), 240.0)


def front(truth: dict, part: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the middle of a part's front, and half of its sides [m], to the right and up as seen from the room."""
    pose, size = np.array(truth[part]["pose"]), truth[part]["size"]
    return pose[:3, 3], pose[:3, 1] * size[1] / 2, pose[:3, 2] * size[2] / 2


def edge(truth: dict, part: str) -> np.ndarray:
    """Return the way from the middle of a part's front to its hinge [m], shape [3]."""
    middle, right, high = front(truth, part)
    joint = truth[part]["joint"]
    axis, away = np.array(joint["axis"]), np.array(joint["origin"]) - middle
    away -= axis * (away @ axis)
    return sum(side * (away @ side) / (side @ side) for side in (right, high))


@contextmanager
def page_of(scan_folder: Path, out: Path, keys: Sequence[str]) -> Iterator[str]:
    """Run `s2a annotate` with further keys until the block ends; yield the page's address."""
    command = [sys.executable, "-m", "s2a", "annotate", f"scan={scan_folder}", f"out={out}", f"port={PORT}", *keys]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        while "Ctrl-C ends it" not in (line := process.stderr.readline()):
            assert line, "the command ended"
        found = re.search(r"http://localhost:\d+", line)
        assert found
        yield found[0]
    finally:
        process.terminate()
        process.wait(30)


def start(surface: SplitSurface, azimuth: float) -> tuple[OrbitCamera, np.ndarray, np.ndarray]:
    """Return the camera with which the page begins, where it stands and what it aims at [m], [3] each."""
    camera = config.load(OrbitCamera, config.compose("annotate", [f"camera.azimuth={azimuth}"])["camera"])
    view = framing_pose(surface.vertices, START, camera)
    return camera, np.array(view.eye), np.array(view.target)


def annotate(
    scan_folder: Path, truth: dict, parts: dict, azimuth: float, shift: float, out: Path, images: Path | None = None
) -> list[dict]:
    """Annotate parts in Chromium; return the actions and the seconds of each.

    Args:
        scan_folder: the imported scan.
        truth: of all parts, by their ids.
        parts: what is annotated, and where one sees its handle; all but the first as seen where one faces that.
        azimuth: of the camera with which the page begins [rad].
        shift: height that the import added [m].
        out: folder that the page writes.
        images: folder for screenshots.
    """
    surface = files.read(scan_folder).surface
    camera, eye, target = start(surface, azimuth)
    up = np.array([0.0, 0.0, shift])
    figures = []
    keys = [f"camera.azimuth={azimuth}", "max_faces=60000"]
    with page_of(scan_folder, out, keys) as address, browser.browser(WIDTH, HEIGHT) as page:
        page.open(address)
        page.wait(lambda: "Click a front" in page.text(), 120.0)
        time.sleep(SETTLE)  # no screenshot: without a graphics processor the first takes longer than the driver waits
        page.driver.execute_script(NO_NOTICE)
        person = Person(page, eye, target, camera.fov)
        for number, (part, handle) in enumerate(parts.items(), start=1):
            began, person.actions = time.monotonic(), 0
            middle, right, high = (vector for vector in front(truth, part))
            middle = middle + up
            held = np.array(truth[handle]["pose"])[:3, 3] + up
            if number == 1:
                place = middle - 0.4 * right - 0.5 * high
                person.click(place)
                person.sees("Does it slide or turn?")
                person.press("face it")
                found = grown(surface, person.eye, place)
                person.eye, person.target = shown.facing(found, camera.fov)
                time.sleep(5.0)
            person.drag(middle - right + high, middle + right - high)
            person.sees(f"{number} drawer: joint?")
            if truth[part]["joint"]["kind"] == "prismatic":
                person.press("slides out")
            else:
                person.press("turns: edge")
                person.sees("Click the edge")
                person.click(middle + 0.95 * edge(truth, part))
            person.sees("Click the handle")
            person.click(held)
            person.page.wait(lambda: "no handle" not in page.value("part"), 240.0)
            figures.append({"part": part, "actions": person.actions, "clock_s": round(time.monotonic() - began, 1)})
            if images:
                page.wait(lambda: "hinge_" in page.text() or "slide_" in page.text(), 240.0)
                _image(page, images / f"annotate_{number}.png")
        if images:
            page.type("open [%]", 60)
            time.sleep(5.0)
            _image(page, images / "annotate_open.png")
        page.press("save")
        page.wait(lambda: "next: s2a check" in page.text(), 240.0)
        assert page.errors() == []
    return figures


def _image(page, path: Path) -> None:
    """Write a screenshot, unless a busy machine takes longer than the driver waits."""
    with suppress(browser.TimeoutException):
        page.image(path)


def grown(surface: SplitSurface, eye: np.ndarray, place: np.ndarray) -> FrontRegion:
    """Return the region that a click at a place makes."""
    found = shown.place(surface.mesh(), eye, (place - eye) / np.linalg.norm(place - eye))
    assert found is not None
    return region.grow(surface, found[0], GrowConfig())
