"""The page's nodes and controls in viser, without a browser."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import usd_room

viser = pytest.importorskip("viser")

from s2a.scene.scene import Joint, Part, Scene  # noqa: E402
from s2a.view.page import layers, panel, scene_nodes, serve  # noqa: E402
from s2a.view.page.glb import thinned  # noqa: E402
from s2a.view.page.room import PageRoom, of_scene  # noqa: E402

PORT = 8600


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer("127.0.0.1", PORT, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def room() -> PageRoom:
    return of_scene(usd_room.room())


def test_a_joint_moves_its_nodes_in_every_layer_that_is_there(server: viser.ViserServer, room: PageRoom) -> None:
    nodes = scene_nodes.SceneNodes(server.scene, room)
    nodes.show(layers.SURFACES)
    nodes.move("drawer_7", 250.0)
    nodes.show(layers.AXES)  # a layer that comes later is where the joint stands
    nodes.move("flap_10", 90.0)
    shift = 0.25 * np.array(room.joints["drawer_7"].axis)
    for name in ("surfaces/drawer_7", f"{layers.AXES}/flap_10"):
        handle = server.scene.get_handle_by_name(f"/{name}")
        np.testing.assert_allclose(handle.position, shift, atol=1e-9)
        np.testing.assert_allclose(handle.wxyz, (1, 0, 0, 0), atol=1e-9)
    half, axis = math.pi / 4, np.array(room.joints["flap_10"].axis)
    turned = server.scene.get_handle_by_name("/surfaces/flap_10").wxyz
    np.testing.assert_allclose(turned, [math.cos(half), *(math.sin(half) * axis)], atol=1e-6)
    assert np.array_equal(server.scene.get_handle_by_name("/surfaces/room").position, (0, 0, 0))


def test_a_hidden_layer_is_not_sent_and_a_shown_one_hides_again(server: viser.ViserServer, room: PageRoom) -> None:
    nodes = scene_nodes.SceneNodes(server.scene, room)
    nodes.show(layers.BY_PART, False)
    assert server.scene.get_handle_by_name(f"/{layers.BY_PART}") is None
    nodes.show(layers.BY_PART)
    nodes.show(layers.BY_PART, False)
    assert server.scene.get_handle_by_name(f"/{layers.BY_PART}").visible is False


def test_a_coarse_room_comes_first_and_while_something_moves(server: viser.ViserServer, room: PageRoom) -> None:
    def seen(name: str) -> bool | None:
        handle = server.scene.get_handle_by_name(name)
        return None if handle is None else handle.visible

    nodes = scene_nodes.SceneNodes(server.scene, room, coarse=thinned(room, 60))
    nodes.show(layers.SURFACES)
    assert (seen("/surfaces"), seen("/coarse/surfaces")) == (None, True)
    nodes.move("drawer_7", 250.0)
    assert nodes.load() and not nodes.load()
    assert (seen("/surfaces"), seen("/coarse/surfaces")) == (False, True)
    nodes.refine()
    assert (seen("/surfaces"), seen("/coarse/surfaces")) == (True, False)
    for name in ("/surfaces/drawer_7", "/coarse/surfaces/drawer_7"):  # both are where the joint stands
        position = server.scene.get_handle_by_name(name).position
        np.testing.assert_allclose(position, 0.25 * np.array(room.joints["drawer_7"].axis), atol=1e-9)
    nodes.coarsen()
    assert (seen("/surfaces"), seen("/coarse/surfaces")) == (False, True)
    nodes.show(layers.SURFACES, False)
    nodes.refine()
    assert (seen("/surfaces"), seen("/coarse/surfaces")) == (False, False)


@pytest.mark.slow
def test_a_turning_camera_sees_fewer_faces_until_it_rests(server: viser.ViserServer, room: PageRoom) -> None:
    nodes = scene_nodes.SceneNodes(server.scene, room, coarse=thinned(room, 60))
    nodes.show(layers.SURFACES)
    whole = lambda: getattr(server.scene.get_handle_by_name("/surfaces"), "visible", None)  # noqa: E731
    watch = scene_nodes.Detail(server, [nodes])
    try:
        for _ in range(6):
            watch.moved()
            time.sleep(scene_nodes.REST / 3)
            assert not whole()
        assert wait(whole, scene_nodes.FIRST + scene_nodes.LOADING)
        watch.moved()
        assert wait(lambda: not whole(), scene_nodes.REST)
        assert wait(whole, scene_nodes.REST)
        watch.fixed = True
        watch.moved()
        time.sleep(scene_nodes.REST / 2)
        assert whole()
    finally:
        watch.close()


def wait(done: Callable[[], bool | None], seconds: float, busy: float = 5.0) -> bool:
    """Wait until something is true, on a busy machine some seconds more."""
    end = time.monotonic() + seconds + busy
    while not done() and time.monotonic() < end:
        time.sleep(0.01)
    return bool(done())


def test_one_part_is_marked_at_a_time(server: viser.ViserServer, room: PageRoom) -> None:
    nodes = scene_nodes.SceneNodes(server.scene, room)
    nodes.move("drawer_7", 100.0)
    nodes.select("cup_22")
    nodes.select("handle_9")
    mark = server.scene.get_handle_by_name(scene_nodes.SELECTED)
    np.testing.assert_allclose(mark.position, 0.1 * np.array(room.joints["drawer_7"].axis), atol=1e-9)
    nodes.select("door_21")  # which has no surface
    assert server.scene.get_handle_by_name(scene_nodes.SELECTED) is None


@pytest.mark.parametrize("limits", [(0.0, 0.0), (-0.4, 0.0), (0.1, 0.3), (0.0, 1e-5)])
def test_controls_take_every_range(server: viser.ViserServer, limits: tuple[float, float]) -> None:
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), limits)
    scene = Scene("odd", {"drawer_1": Part("drawer", usd_room.box((0, 0, 0), (1, 1, 1)), None, joint)})
    controls = panel.Panel(server, scene_nodes.SceneNodes(server.scene, of_scene(scene)))
    controls.select("drawer_1")
    controls.select(None)


def test_a_room_without_joints_or_surfaces_has_a_page(server: viser.ViserServer) -> None:
    still = of_scene(Scene("still", {"wall_1": Part("wall", usd_room.box((0, 0, 0), (1, 1, 1)))}))
    panel.Panel(server, scene_nodes.SceneNodes(server.scene, still))
    assert panel.offered(still) == [layers.SURFACES, layers.BY_PART, layers.SUPPORTS]


def test_the_recording_opens_every_joint_once_and_closes_it(room: PageRoom) -> None:
    shown = dict(serve.timeline(room))
    assert list(shown) == list(room.joints)
    for fractions in shown.values():
        assert fractions.max() == pytest.approx(1.0) and fractions[-1] == pytest.approx(0.0, abs=1e-12)
        assert np.abs(np.diff([0.0, *fractions])).max() < 0.12  # without jumps
