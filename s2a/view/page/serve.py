"""The page as a server on this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import viser

from s2a.scene.geometry.orbit_camera import CameraPose
from s2a.view.page.detail import Detail, coarse
from s2a.view.page.light import AMBIENT, LIGHTS
from s2a.view.page.panel import WIDTH, Panel
from s2a.view.page.room import PageRoom
from s2a.view.page.scene_nodes import SceneNodes

HOST = "127.0.0.1"
"""Nobody but this machine's users sees the page; from elsewhere: ssh -L 8080:localhost:8080 HOST."""

NEAR = 0.05
"""[m] Nearer surfaces are cut; a smaller distance leaves far ones to flicker."""


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
