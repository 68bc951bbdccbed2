"""What a scene says of parts that it does not have."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.errors import InputError
from s2a.scene import Mesh, Part, Scene


@pytest.mark.parametrize(
    ("asked", "said"),
    [("drawer_70", "did you mean: drawer_7"), ("teddy_bear_12", "s2a view path=STAGE lists its parts")],
)
def test_an_unknown_part_gets_close_names_or_the_way_to_find_them(asked: str, said: str) -> None:
    empty = Mesh(np.empty((0, 3)), np.empty((0, 3)))
    with pytest.raises(InputError, match=f"{asked!r} is not in scene 'room'; {said}$"):
        Scene("room", {"drawer_7": Part("drawer", empty)}).part(asked)
