"""The page of a run or of demonstrations: a time line on which the worlds move, side by side."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import viser

from s2a.scene.geometry.camera import CameraPose
from s2a.view.page import glb
from s2a.view.page.panel import CARDS, WIDTH, first, offered
from s2a.view.page.room import PageRoom, Played, PlayedWorld, unit
from s2a.view.page.scene_nodes import Detail, SceneNodes, coarse
from s2a.view.page.serve import address, started

SPEEDS = {"slow": 0.25, "real time": 1.0, "fast": 4.0}
TICK = 1 / 15
"""[s] Between two images while it plays."""


@contextmanager
def served(room: PageRoom, played: Played, view: CameraPose, fov: float, port: int) -> Iterator[str]:
    """Serve the page of worlds that move; yield its address. Arguments as of `serve.served`."""
    with started(view, fov, port, WIDTH) as server:
        player = Player(server, room, played, apart(room, view))
        try:
            yield address(server)
        finally:
            player.close()


def apart(room: PageRoom, view: CameraPose) -> np.ndarray:
    """Return the step from a world to the next [m], shape [3]: to the camera's right, by the room's width there and a gap."""
    ahead = np.array(view.target) - np.array(view.eye)
    right = np.array([ahead[1], -ahead[0], 0.0]) / max(float(np.hypot(*ahead[:2])), 1e-6)
    points = np.concatenate([part.surface.vertices for part in room.parts.values()])
    return np.asarray(right * (float(np.ptp(points @ right)) + 0.5))


def whole(view: CameraPose, room: PageRoom, count: int) -> CameraPose:
    """Return a view of one world moved and drawn back, so that it shows `count` worlds."""
    eye, target = np.array(view.eye), np.array(view.target)
    middle = apart(room, view) * (count - 1) / 2
    # Beside the panel a window of 1280 x 800 pixels leaves an image that is hardly wider than high.
    return CameraPose(tuple(target + middle + count * (eye - target)), tuple(target + middle))


class Player:
    """Worlds in the scene, and the controls of their time.

    Attributes:
        frame: which is shown.
    """

    def __init__(self, server: viser.ViserServer, room: PageRoom, played: Played, step: np.ndarray) -> None:
        """Add everything to a server; `step` leads from a world to the next [m], shape [3]."""
        self._server, self._played, self.frame = server, played, 0
        self._worlds = [
            _World(server.scene, f"/world_{k}", room, played, world, k * step) for k, world in enumerate(played.worlds)
        ]
        self._detail = Detail(server, [world.nodes for world in self._worlds])
        self._ended, self._playing = threading.Event(), threading.Event()
        gui = server.gui
        gui.set_panel_label(room.name)
        gui.add_html(CARDS)
        with gui.add_folder("Time"):
            self._button = gui.add_button("play")
            self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="real time")
            self._time = gui.add_slider("time [s]", 0.0, self._seconds(played.frames - 1), self._seconds(1), 0.0)
        with gui.add_folder("Show"):
            for layer in offered(room):
                box = gui.add_checkbox(layer, layer == first(room))
                box.on_update(self._showing(layer))
                self._show(layer, box.value)
        self._card = gui.add_html("")
        self._button.on_click(lambda _: self._toggle())
        self._time.on_update(lambda _: self.show(round(self._time.value * self._played.rate)))
        self.show(0)
        threading.Thread(target=self._run, daemon=True).start()

    def show(self, frame: int) -> None:
        """Put all worlds where they were in a frame."""
        if frame != self.frame:
            self._detail.moved()
        self.frame = frame
        with self._server.atomic():
            for world in self._worlds:
                world.show(frame)
        self._card.content = "".join(f"<div class='s2a-card'>{world.facts(frame)}</div>" for world in self._worlds)

    def close(self) -> None:
        """End the threads that play and watch."""
        self._detail.close()
        self._ended.set()
        self._playing.set()

    def _seconds(self, frame: int) -> float:
        return round(frame / self._played.rate, 4)

    def _showing(self, layer: str) -> Callable[[viser.GuiEvent], None]:
        return lambda event: self._show(layer, event.target.value)

    def _show(self, layer: str, visible: bool) -> None:
        for world in self._worlds:
            world.nodes.show(layer, visible)

    def _toggle(self) -> None:
        if self._playing.is_set():
            self._stop()
            return
        if self.frame >= self._played.frames - 1:
            self._time.value = 0.0  # type: ignore[misc] # mypy overlooks its setter
        self._button.label = "pause"
        self._playing.set()

    def _stop(self) -> None:
        self._playing.clear()
        self._button.label = "play"

    def _run(self) -> None:
        """Let the time go on while it plays, whatever an image takes."""
        while not self._ended.is_set():
            self._playing.wait()
            began, at = time.monotonic(), self.frame / self._played.rate
            while self._playing.is_set() and not self._ended.is_set():
                time.sleep(TICK)
                now = at + SPEEDS[self._speed.value] * (time.monotonic() - began)
                last = self._seconds(self._played.frames - 1)
                self._time.value = min(round(now * self._played.rate) / self._played.rate, last)  # type: ignore[misc]
                if now >= last:
                    self._stop()


class _World:
    """The nodes of one world: room and robot.

    Attributes:
        nodes: of the room.
    """

    def __init__(
        self, scene: viser.SceneApi, root: str, room: PageRoom, played: Played, world: PlayedWorld, at: np.ndarray
    ) -> None:
        scene.add_frame(root, show_axes=False, position=at)
        scene.add_label(f"{root}/name", world.name, position=_above(room))
        room = room.with_movers(world.moved)
        self.nodes = SceneNodes(scene, room, root, coarse(room, len(played.worlds)))
        self._room, self._world = room, world
        self._links = [
            scene.add_glb(
                f"{root}/robot/{k}", glb.encode(mesh, both_sides=True), cast_shadow=False, receive_shadow=False
            )
            for k, mesh in enumerate(played.links)
        ]

    def show(self, frame: int) -> None:
        """Put everything where it was in a frame; after the last one it stays there."""
        world, k = self._world, min(frame, self._world.frames - 1)
        self.nodes.put({i: float(q[k]) for i, q in world.q.items()}, {i: pose[k] for i, pose in world.moved.items()})
        for handle, pose in zip(self._links, world.links[k], strict=True):
            handle.position, handle.wxyz = pose[:3], pose[[6, 3, 4, 5]]

    def facts(self, frame: int) -> str:
        """Return a line about a frame, as HTML."""
        k = min(frame, self._world.frames - 1)
        said = [self._world.name]
        for part, q in self._world.q.items():
            name, size = unit(self._room.joints[part])
            said.append(f"{part} {q[k] / size:.0f} {name}")
        return ", ".join(said) + (" (ended)" if frame >= self._world.frames else "")


def _above(room: PageRoom) -> np.ndarray:
    points = np.concatenate([part.surface.vertices for part in room.parts.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([*(low + high)[:2] / 2, high[2] + 0.1])
