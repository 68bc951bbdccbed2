"""The page as a server on this machine, as one file that needs none, and with a time line on which worlds move."""

import html
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import viser

from s2a.scene.articulation import open_limit
from s2a.scene.geometry.camera import CameraPose
from s2a.view.page import glb
from s2a.view.page.glb import AMBIENT, LIGHTS
from s2a.view.page.layers import LARGE
from s2a.view.page.panel import CARDS, WIDTH, Panel, first, offered
from s2a.view.page.room import PageRoom, Played, PlayedWorld, unit
from s2a.view.page.scene_nodes import Detail, SceneNodes, coarse

HOST = "127.0.0.1"  # Nobody but this machine's users sees the page; from elsewhere: ssh -L 8080:localhost:8080 HOST

NEAR = 0.05  # [m] Nearer surfaces are cut; a smaller distance leaves far ones to flicker


@contextmanager
def served(room: PageRoom, view: CameraPose, fov: float, port: int) -> Iterator[str]:
    """Serve the page of a room; yield its address.

    Args:
        room: what is shown.
        view: where its camera begins.
        fov: vertical field of view [rad].
        port: of the server; the next free one where it is taken.
    """
    with started(view, fov, port, WIDTH) as server:
        nodes = SceneNodes(server.scene, room, coarse=coarse(room))
        detail = Detail(server, [nodes])
        Panel(server, nodes, detail)
        try:
            yield address(server)
        finally:
            detail.close()


@contextmanager
def started(view: CameraPose, fov: float, port: int, width: int) -> Iterator[viser.ViserServer]:
    """Start a server with camera, lights and an empty panel of `width` pixels at the right, as `served`; stop it at the end."""
    server = viser.ViserServer(HOST, port, verbose=False)
    try:
        set_up(server, view, fov)
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(width)
        yield server
    finally:
        server.stop()


def address(server: viser.ViserServer) -> str:
    """Return where a browser on this machine finds it."""
    return f"http://localhost:{server.get_port()}"


def set_up(server: viser.ViserServer, view: CameraPose, fov: float) -> None:
    """Place camera and lights: the scan's colours hold its light already, so that most of it comes from everywhere.

    An environment map would take software renderers many seconds to prepare.
    """
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_ambient("/light/all_around", intensity=AMBIENT)
    for name, intensity, direction in LIGHTS:
        scene.add_light_directional(f"/light/{name}", intensity=intensity, position=direction)
    server.initial_camera.position, server.initial_camera.look_at = view.eye, view.target
    server.initial_camera.fov, server.initial_camera.near = fov, NEAR


PORT = 8090  # The player is written by a server that nobody visits
SECONDS, FRAMES = 2.0, 30  # Time that a joint takes to open and close, and its frames
PAUSE = 0.5  # [s] before each joint
TITLE = "<title>Viser</title>"


def write(room: PageRoom, view: CameraPose, fov: float, path: Path) -> None:
    """Write a room to one self-contained HTML file: all layers, and a time line on which its joints open one by one.

    `fov`: vertical field of view [rad].
    """
    server = viser.ViserServer(HOST, PORT, verbose=False)
    try:
        set_up(server, view, fov)
        nodes = SceneNodes(server.scene, room)
        for layer in (each for each in offered(room) if each not in LARGE):
            nodes.show(layer)
            nodes.show(layer, layer == first(room))
        names = {part: server.scene.add_label(f"/names/{part}", part, visible=False) for part in room.joints}
        serializer = server.get_scene_serializer()
        for part, fractions in timeline(room):
            serializer.insert_sleep(PAUSE)
            names[part].position, names[part].visible = _top(room, part), True
            for fraction in fractions:
                nodes.move(part, fraction * open_limit(room.joints[part]) / unit(room.joints[part])[1])
                serializer.insert_sleep(SECONDS / FRAMES)
            names[part].visible = False
        title = f"<title>{html.escape(room.name)}</title>"
        path.write_text(serializer.as_html().replace(TITLE, title), encoding="utf-8")
    finally:
        server.stop()


def timeline(room: PageRoom) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the jointed parts with the fractions of their open limit through which they pass, 0 at the end."""
    for part in room.joints:
        yield part, 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, FRAMES + 1)[1:])


def _top(room: PageRoom, part: str) -> np.ndarray:
    """Return the place of a part's name [m], shape [3]: above its middle; on its joint where it has no surface."""
    low, high = room.parts[part].surface.bounds
    return np.array(room.joints[part].origin) if np.isnan(low).any() else np.array([*(low + high)[:2] / 2, high[2]])


SPEEDS = {"slow": 0.25, "real time": 1.0, "fast": 4.0}
TICK = 1 / 15  # [s] Between two images while it plays


@contextmanager
def served_worlds(room: PageRoom, played: Played, view: CameraPose, fov: float, port: int) -> Iterator[str]:
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
        words = [self._world.name]
        for part, q in self._world.q.items():
            name, size = unit(self._room.joints[part])
            words.append(f"{part} {q[k] / size:.0f} {name}")
        return html.escape(", ".join(words)) + (" (ended)" if frame >= self._world.frames else "")


def _above(room: PageRoom) -> np.ndarray:
    points = np.concatenate([part.surface.vertices for part in room.parts.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    return np.array([*(low + high)[:2] / 2, high[2] + 0.1])
