"""What a scene says of parts that it does not have."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.core.errors import InputError
from s2a.scene.scene import Joint, Mesh, Part, Scene


@pytest.mark.parametrize(
    ("asked", "said"),
    [("drawer_70", "did you mean: drawer_7"), ("teddy_bear_12", "s2a view path=STAGE lists its parts")],
)
def test_an_unknown_part_gets_close_names_or_the_way_to_find_them(asked: str, said: str) -> None:
    empty = Mesh(np.empty((0, 3)), np.empty((0, 3)))
    with pytest.raises(InputError, match=f"{asked!r} is not in scene 'room'; {said}$"):
        Scene("room", {"drawer_7": Part("drawer", empty)}).part(asked)


def square(y: float, side: float) -> Mesh:
    """Return a square at x = 0 from a corner at y [m]."""
    corners = np.array([[0, y, 0], [0, y + side, 0], [0, y + side, side], [0, y, side]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def test_a_gripper_holds_the_largest_of_several_handles_with_what_touches_it() -> None:
    handles = {
        "bar_2": square(0.0, 0.10),
        "post_3": square(0.12, 0.02),
        "bar_4": square(0.6, 0.09),
        "paint_5": Mesh([], []),
    }
    parts = {
        "drawer_1": Part("drawer", square(-1.0, 2.0), None, Joint("prismatic", (1, 0, 0), (0, 0, 0), (0.0, 0.4))),
        **{name: Part("handle", mesh, "drawer_1", graspable=True) for name, mesh in handles.items()},
    }
    scene = Scene("room", parts)
    assert scene.grasp_parts("drawer_1") == tuple(handles)
    assert scene.handle_parts("drawer_1") == ("bar_2", "post_3")
    # By area: 0.01 m2 with its middle at y 0.05, and 0.0004 m2 at 0.13.
    assert scene.grasp_point("drawer_1")[1] == pytest.approx((0.01 * 0.05 + 0.0004 * 0.13) / 0.0104)
