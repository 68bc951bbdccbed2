"""Up direction and unit of meshes that state nothing, state it, or state it wrongly."""

from __future__ import annotations

import furnished_room
import numpy as np
import pytest
import trimesh

from s2a.core.errors import InputError
from s2a.scan import frame, upright
from s2a.scan.source import Stated
from s2a.scan.surfels import sample

GLTF = Stated("y", 1.0, "glTF")


def off(direction: object, truth: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(np.dot(np.array(direction), truth), -1, 1))))


def find(
    mesh: trimesh.Trimesh, turn: np.ndarray, stated: Stated, up: object = "auto", **more: object
) -> frame.FileFrame:
    return frame.find(mesh.vertices @ turn.T, mesh.faces, stated, up, "auto", **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("ceiling", [True, False])
def test_a_furnished_room_is_levelled_from_any_rotation(ceiling: bool) -> None:
    mesh = furnished_room.room(ceiling=ceiling)
    for turn in furnished_room.rotations(3, 1):
        result = find(mesh, turn, Stated())
        assert off(result.up, turn[:, 2]) < 1.0
        assert result.apply(mesh.vertices @ turn.T)[:, 2] == pytest.approx(mesh.vertices[:, 2], abs=0.05)
        assert np.linalg.det(result.rotation) == pytest.approx(1.0)
        assert result.confidence is not None and result.confidence > 0.75 and result.unit == 1.0


def test_a_direction_near_an_axis_is_that_axis() -> None:
    tilt = trimesh.transformations.rotation_matrix(np.radians(0.5), (1, 0, 0))[:3, :3]
    assert find(furnished_room.room(), tilt, Stated()).up == (0.0, 0.0, 1.0)
    leveled = find(furnished_room.room(), tilt, Stated(), level=True)
    assert off(leveled.up, tilt[:, 2]) < 0.05


def test_a_vector_is_taken_as_given_and_corrected_on_request() -> None:
    turn = furnished_room.rotations(1, 4)[0]
    given = (7.0 * turn[:, 2]).round(1).tolist()
    result = find(furnished_room.room(), turn, Stated(), given)
    assert result.up == pytest.approx(np.array(given) / np.linalg.norm(given)) and result.confidence is None
    assert off(find(furnished_room.room(), turn, Stated(), given, level=True).up, turn[:, 2]) < 0.05


@pytest.mark.parametrize("name", frame.UP)
def test_an_axis_and_its_vector_give_the_same_rotation(name: str) -> None:
    mesh = furnished_room.room()
    named, vector = (find(mesh, np.eye(3), Stated(), up) for up in (name, frame.UP[name]))
    assert (named.rotation == vector.rotation).all()
    assert (named.rotation @ np.array(frame.UP[name]) == (0, 0, 1)).all()


@pytest.mark.parametrize("vector", [(0, 0, 0), (1, float("nan"), 0), (1, 2)])
def test_a_vector_without_direction_is_refused(vector: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="three finite numbers"):
        find(furnished_room.room(), np.eye(3), Stated(), vector)


def test_a_statement_that_the_room_refutes_is_asked_for() -> None:
    with pytest.raises(InputError, match=r"glTF states y up, but the surface agrees with z (0\.9|1\.0)"):
        find(furnished_room.room(), np.eye(3), GLTF)


def test_a_statement_is_believed_with_a_warning_where_the_surface_rather_speaks_against_it() -> None:
    shell = trimesh.creation.box((5.0, 4.0, 2.5))  # 2.5 m are rather a room's height than 4 m
    shell.invert()
    result = find(shell, np.eye(3), GLTF)
    assert result.up == (0.0, 1.0, 0.0) and any("agrees better with" in doubt for doubt in result.doubts)


def test_a_statement_along_no_surface_gives_way_to_a_clear_room() -> None:
    turn = furnished_room.rotations(1, 2)[0]
    result = find(furnished_room.room(), turn, GLTF)
    assert off(result.up, turn[:, 2]) < 1.0 and "no horizontal surface faces it" in result.doubts[0]


def test_a_stated_tilt_is_a_doubt_and_corrected_on_request() -> None:
    tilt = trimesh.transformations.rotation_matrix(np.radians(4), (1, 0, 0))[:3, :3] @ np.array(
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    )
    result = find(furnished_room.room(), tilt, GLTF)
    assert result.up == (0.0, 1.0, 0.0) and "tilts by 4.0 deg" in result.doubts[0]
    leveled = find(furnished_room.room(), tilt, GLTF, level=True)
    assert off(leveled.up, tilt[:, 2]) < 0.05 and not leveled.doubts
    assert "levelled by 4.0 deg" in leveled.summary()


def sphere() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=5)


def stairs() -> trimesh.Trimesh:
    steps = [furnished_room.turned_box((1.0, 0.28, 0.18 * (k + 1)), (0, 0.28 * k, 0), 0.0) for k in range(12)]
    return trimesh.util.concatenate(steps)


def table_top() -> trimesh.Trimesh:
    top = trimesh.creation.box((1.2, 0.8, 0.04))
    cup = trimesh.creation.cylinder(0.05, 0.2)
    cup.apply_translation((0.2, 0.1, 0.12))
    return trimesh.util.concatenate([furnished_room.open_below(top), furnished_room.open_below(cup)])


def without_floor() -> trimesh.Trimesh:
    mesh = furnished_room.room()
    mesh.update_faces(mesh.triangles_center[:, 2] > 0.05)
    return mesh


def inside_out() -> trimesh.Trimesh:
    mesh = furnished_room.room()
    mesh.invert()
    return mesh


def half() -> trimesh.Trimesh:
    mesh = furnished_room.room().subdivide_to_size(0.2)
    mesh.update_faces(mesh.triangles_center @ (1.0, 0.4, 0.0) > 0.0)
    return mesh


@pytest.mark.parametrize("scan", [sphere, stairs, table_top, without_floor, inside_out, half])
def test_what_is_no_whole_room_is_asked_for_or_right(scan: object) -> None:
    mesh = scan()  # type: ignore[operator]
    for turn in furnished_room.rotations(2, 3):
        try:
            result = find(mesh, turn, Stated())
        except InputError as error:
            assert "; give u" in str(error) and "\n" not in str(error)
        else:
            assert off(result.up, turn[:, 2]) < 5.0


def test_half_a_room_is_told_without_a_doubt_only_by_more_confidence_than_the_whole() -> None:
    whole, part = (
        upright.certain(upright.candidates(sample(mesh.vertices, mesh.faces)))
        for mesh in (furnished_room.room(), half())
    )
    assert whole < 0.8 < 0.99 < part


def test_a_hint_decides_what_the_surface_leaves_open() -> None:
    mesh, asked = without_floor(), 0
    for turn in furnished_room.rotations(3, 3):
        try:
            find(mesh, turn, Stated())
        except InputError:
            asked += 1
        result = find(mesh, turn, Stated(), hint=frame.Hint(turn[:, 2], "the labels"))
        assert off(result.up, turn[:, 2]) < 5.0 and result.why_up.endswith("the labels")
    assert asked


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_hint_of_another_frame_is_not_followed_in_silence(axis: int, sign: float) -> None:
    wrong = frame.Hint(sign * np.eye(3)[axis], "the labels")
    for mesh in (furnished_room.room(), furnished_room.room(ceiling=False)):
        try:
            result = find(mesh, np.eye(3), Stated(), hint=wrong)
        except InputError:
            continue
        assert off(result.up, np.eye(3)[2]) < 5.0 or "agrees better with" in result.doubts[0]


@pytest.mark.parametrize(
    ("height", "unit"), [(2.5, 1.0), (1.37, 1.0), (0.9, 1.0), (250.0, 0.01), (2500.0, 0.001), (98.0, 0.0254)]
)
def test_the_height_tells_the_unit_also_of_a_part_of_a_room(height: float, unit: float) -> None:
    box = trimesh.creation.box((2 * height, 1.5 * height, height))
    assert frame.find(box.vertices, box.faces, Stated(), "z", "auto").unit == unit


def test_a_height_that_is_none_is_asked_for() -> None:
    box = trimesh.creation.box((40, 40, 20))
    with pytest.raises(InputError, match="the unit cannot be determined"):
        frame.find(box.vertices, box.faces, Stated(), "z", "auto")
