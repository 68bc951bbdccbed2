"""Registration of two scans of a room of flat sheets with a drawer and a door, whose joints are exact: see `box_room`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from box_room import FRONT, bar, joined, room, sheet
from scipy.spatial.transform import Rotation

from s2a import api
from s2a.commands import cli
from s2a.joints.register import Proposal, Registration, register
from s2a.joints.register_fit import changed_joint, square, twists, unknowns
from s2a.joints.register_surface import OrientedMesh, align
from s2a.scan.ply_file import write_ply
from s2a.scene.articulation import displace, transform
from s2a.scene.scene import Joint, Mesh

OPEN = {"drawer_6": 0.25, "door_8": 1.0}
FRAME = np.eye(4)
FRAME[:3, :3], FRAME[:3, 3] = Rotation.from_rotvec((0.002, -0.003, 0.04)).as_matrix(), (0.08, -0.05, 0.02)
"""Motion from the first scan's frame to the second's: a few degrees, a few centimetres."""


def scan(
    opened: dict[str, float], box: tuple[float, float] = (3.0, 1.5), noise: float = 0.0
) -> tuple[Mesh, np.ndarray]:
    """Return a scan with parts open and a box on the table at a place, and the part of each face (by its order, -1: box).

    Args:
        opened: coordinates of parts by their ids [m] or [rad].
        box: x and y of the middle of the box, 0.2 m wide [m].
        noise: standard deviation of each coordinate [m].
    """
    scene = room()
    meshes, numbers = [], []
    for index, (name, part) in enumerate(scene.parts.items()):
        vertices = part.mesh.vertices.astype(np.float64)
        for carrier in (name, *scene.ancestors(name)):
            if carrier in opened:
                vertices = displace(vertices, scene.joint(carrier), opened[carrier])
        meshes.append(Mesh(vertices, part.mesh.faces))
        numbers += [index] * len(part.mesh.faces)
    x, y = box
    side = bar((y - 0.1, y + 0.1), (0.7, 0.9), (x - 0.1, x + 0.1))
    back = sheet((x - 0.1, y - 0.1, 0.7), (0, 0, 0.2), (0, 0.2, 0), 0.01)
    meshes += [side, back]
    numbers += [-1] * (len(side.faces) + len(back.faces))
    whole = joined(*meshes)
    shaken = whole.vertices + np.random.default_rng(len(opened)).normal(0.0, noise, whole.vertices.shape)
    return Mesh(shaken, whole.faces), np.array(numbers)


def surface(mesh: Mesh, frame: np.ndarray | None = None) -> OrientedMesh:
    found = OrientedMesh(mesh.vertices.astype(np.float64), mesh.faces)
    return found if frame is None else found.moved(frame)


def found_in(first: Mesh, second: Mesh) -> Registration:
    return register(surface(first), surface(second, FRAME))


@pytest.fixture(scope="module")
def exact() -> Registration:
    """Drawer and door open, the box moved by 0.3 m and nothing noisy."""
    return found_in(scan({})[0], scan(OPEN, box=(2.75, 1.3))[0])


def by_kind(found: Registration) -> dict[str, Proposal]:
    assert sorted(p.joint.kind for p in found.proposals) == ["prismatic", "revolute"]
    return {p.joint.kind: p for p in found.proposals}


def angle(joint: Joint, axis: tuple[float, float, float]) -> float:
    """Return the angle between an axis and the true one [deg]."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(joint.axis, axis)), np.dot(joint.axis, axis))))


def from_axis(joint: Joint, x: float, y: float) -> float:
    """Return the distance of an upright axis from its true place at the height of the door's middle [m]."""
    origin, axis = np.array(joint.origin), np.array(joint.axis)
    return float(np.linalg.norm((origin + axis * (0.5 - origin[2]) / axis[2])[:2] - (x, y)))


def test_a_drawer_and_a_door_have_their_exact_joints_and_a_moved_box_has_none(exact: Registration) -> None:
    parts = by_kind(exact)
    drawer, door = parts["prismatic"].joint, parts["revolute"].joint
    assert angle(drawer, (1, 0, 0)) < 0.1 and angle(door, (0, 0, 1)) < 0.1
    assert drawer.limits == pytest.approx((0.0, 0.25), abs=0.0005)
    assert door.limits == pytest.approx((0.0, 1.0), abs=0.002)
    assert from_axis(door, FRONT, 1.98) < 0.002


def test_the_frames_of_both_scans_are_found_though_parts_moved(exact: Registration) -> None:
    np.testing.assert_allclose(exact.alignment.motion @ FRAME, np.eye(4), atol=5e-4)


@pytest.mark.parametrize(("kind", "names"), [("prismatic", (5, 6)), ("revolute", (7, 8))])
def test_the_moving_faces_are_those_of_front_and_handle(exact: Registration, kind: str, names: tuple[int, int]) -> None:
    mesh, numbers = scan({})
    mine = np.isin(numbers, names)
    proposed = np.zeros(len(mine), bool)
    proposed[by_kind(exact)[kind].faces] = True
    areas = mesh.face_areas
    assert areas[mine & proposed].sum() / areas[mine | proposed].sum() > 0.95


def test_noise_of_a_millimetre_leaves_the_joints_within_the_goals_and_their_deviations() -> None:
    found = found_in(scan({}, noise=0.001)[0], scan(OPEN, box=(2.75, 1.3), noise=0.001)[0])
    parts = by_kind(found)
    drawer, door = parts["prismatic"], parts["revolute"]
    assert angle(drawer.joint, (1, 0, 0)) < 0.2 and angle(door.joint, (0, 0, 1)) < 0.2
    assert abs(drawer.joint.limits[1] / 0.25 - 1) < 0.02 and abs(door.joint.limits[1] - 1) < 0.02
    assert from_axis(door.joint, FRONT, 1.98) < 0.003
    assert np.radians(angle(drawer.joint, (1, 0, 0))) < 4 * drawer.axis_deviation
    assert np.radians(angle(door.joint, (0, 0, 1))) < 4 * door.axis_deviation
    assert abs(drawer.joint.limits[1] - 0.25) < 4 * drawer.open_deviation
    assert abs(door.joint.limits[1] - 1.0) < 4 * door.open_deviation
    assert from_axis(door.joint, FRONT, 1.98) < 4 * door.origin_deviation


def test_a_moved_box_alone_is_no_part() -> None:
    assert found_in(scan({})[0], scan({}, box=(2.8, 1.25))[0]).proposals == []


@pytest.mark.parametrize(
    "joint",
    [
        Joint("revolute", (0.6, 0.0, 0.8), (0.3, -0.2, 0.5), (0.0, 1.1)),
        Joint("prismatic", (0.0, 0.6, 0.8), (0.3, -0.2, 0.5), (0.0, 0.4)),
    ],
)
def test_the_jacobian_is_what_a_step_does_to_points(joint: Joint) -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    there = displace(points, joint, joint.limits[1])
    rates = twists(joint)
    assert rates.shape == (6, unknowns(joint))
    for i in range(unknowns(joint)):
        step = 1e-5 * np.eye(unknowns(joint))[i]
        ahead, back = changed_joint(joint, step), changed_joint(joint, -step)
        numeric = (displace(points, ahead, ahead.limits[1]) - displace(points, back, back.limits[1])) / 2e-5
        np.testing.assert_allclose(np.cross(rates[:3, i], there) + rates[3:, i], numeric, atol=1e-6)


@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_the_angle_to_the_front_changes_as_its_derivative_says(kind: str) -> None:
    front = np.array((0.0, 0.6, 0.8))
    joint = Joint(kind, (0.01, 0.6, (1 - 0.01**2 - 0.36) ** 0.5), (0.3, -0.2, 0.5), (0.0, 0.4))  # type: ignore[arg-type]
    known, _ = square(joint, front)
    for i in range(2):
        step = 1e-6 * np.eye(unknowns(joint))[i]
        turned_axes = [np.array(changed_joint(joint, s * step).axis) for s in (1, -1)]
        if (
            kind == "prismatic"
        ):  # the part of the front's normal across the axis, on the directions across the first one
            u, v = (np.cross(joint.axis, np.eye(3)[0]), None)
            u /= np.linalg.norm(u)
            v = np.cross(joint.axis, u)
            rate = [(ahead - back) @ w / 2e-6 for w in (u, v) for ahead, back in [turned_axes]]
        else:
            rate = [(turned_axes[0] - turned_axes[1]) @ front / 2e-6]
        np.testing.assert_allclose(known[:, i], rate, atol=1e-6)


def test_a_step_of_the_coordinate_moves_along_the_joint() -> None:
    joint = Joint("revolute", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.5))
    np.testing.assert_allclose(transform(changed_joint(joint, np.array([0, 0, 0, 0, 0.2])), 0.7), transform(joint, 0.7))
    np.testing.assert_allclose(twists(joint)[:, -1], (0, 0, 1, 0, 0, 0), atol=1e-8)  # about z, through the origin


def test_a_room_with_another_plan_does_not_overlap() -> None:
    first, _ = scan({})
    other = Mesh(first.vertices * np.array((1.6, 2.1, 0.7), np.float32), first.faces)
    assert align(surface(first), surface(other)).overlap < 0.6


def write_scan(folder: Path, mesh: Mesh) -> Path:
    folder.mkdir()
    write_ply(folder / "mesh_aligned_0.05.ply", Mesh(mesh.vertices, mesh.faces, np.full(mesh.vertices.shape, 180)))
    return folder


def test_the_command_writes_the_parts_as_an_annotation_that_others_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    closed = write_scan(tmp_path / "closed", scan({})[0])
    opened = write_scan(tmp_path / "open", scan({"drawer_6": 0.25})[0])
    assert cli.main(["register", f"closed={closed}", f"open={opened}", f"out={tmp_path / 'out'}"]) == 0
    said = capsys.readouterr().out
    assert "1 parts are open" in said and "drawer.1: prismatic, open by 0.250" in said
    scene = api.load_scene(tmp_path / "out")
    assert scene.movable == ("drawer_1",)
    joint = scene.joint("drawer_1")
    assert angle(joint, (1, 0, 0)) < 0.1 and joint.limits == pytest.approx((0.0, 0.25), abs=0.0005)
    low, high = scene.parts["drawer_1"].mesh.bounds  # the front from y 1.02 to 1.48, and its handle before it
    np.testing.assert_allclose([low, high], [(FRONT, 1.02, 0.02), (0.56, 1.48, 0.98)], atol=0.011)
    [part] = json.loads((tmp_path / "out/register.json").read_text())["parts"]
    assert part["label"] == "drawer.1" and 0 < part["deviations"]["open"] < 0.002


def test_errors_are_one_line_that_names_the_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, _ = scan({})
    closed = write_scan(tmp_path / "closed", first)
    assert cli.main(["register", f"closed={closed}", f"open={tmp_path / 'none'}"]) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert str(tmp_path / "none") in line and "does not exist" in line
    other = Mesh(first.vertices * np.array((1.6, 2.1, 0.7), np.float32), first.faces)
    elsewhere = write_scan(tmp_path / "elsewhere", other)
    out = tmp_path / "out"
    assert cli.main(["register", f"closed={closed}", f"open={elsewhere}", f"out={out}"]) == 2
    [line] = capsys.readouterr().err.strip().splitlines()
    assert str(elsewhere) in line and "give two scans of one room" in line and not out.exists()
