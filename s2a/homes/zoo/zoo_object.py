"""An object of the zoo: a shape with its label, built upright in millimetres and returned in metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from s2a.homes.solids import Surface
from s2a.homes.zoo.shapes import scaled

Category = Literal["bathroom", "kitchen", "bedroom", "stationery", "living room"]
Placement = Literal["on", "against wall", "hanging", "inside"]


@dataclass(frozen=True)
class ZooObject:
    """A labelled object.

    Attributes:
        label: what it is called.
        category: the kind of place it belongs to.
        surface: its shape [m], upright in its natural pose on z = 0, its front towards +x.
        placement: on something, standing or leaning against a wall, hanging on one, or kept inside something.
        rare: The label is a brand's or a rare word.
    """

    label: str
    category: Category
    surface: Surface
    placement: Placement
    rare: bool

    @property
    def slug(self) -> str:
        """The label as a file name."""
        return "_".join("".join(c if c.isalnum() else " " for c in self.label.lower()).split())


def zoo_object(
    label: str, category: Category, surface: Surface, placement: Placement = "on", *, rare: bool = False
) -> ZooObject:
    """Return the object that a shape in millimetres is, set on z = 0."""
    shape = scaled(surface, 1e-3, 1e-3, 1e-3)
    low = shape.vertices.min(axis=0)
    shape.vertices[:, 2] -= low[2]
    return ZooObject(label, category, shape, placement, rare)
