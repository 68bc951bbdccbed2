"""The network that follows a part from frame to frame, and the estimates that it makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

ESTIMATE = {
    "point": 3, "across": 3, "inwards": 3, "axis": 3, "along": 3, "size": 3, "slides": 1, "lever_arm": 1, "travel": 1,
    "opening": 1, "speed": 1, "within": 1, "held": 1, "error": 1,
}  # fmt: skip
"""Numbers of an estimate by name, of the part where it now is, in the robot's base frame: grasp point [m]; directions across the
grasp, along which the fingers close, and inwards; axis of the joint, positive opens; direction in which the point moves; extents
of the grasp [m]; 1 for a slide; lever arm of a hinge, travel, opening [m] and its speed [m/s]; whether the gripper holds from
within, whether the part is grasped; the estimate's own error [m]."""
SIDEWAYS = np.array([0.0, 0.3, 1.0])
"""Of the two directions across a handle, which differ by half a turn of the gripper, the one that points this way is taken."""
WIDTH = sum(ESTIMATE.values())
TOOL = 3 + 9 + 3 + 4
"""Numbers of the tool: its place from the estimate, axes, displacement since the last frame; fingers: width, speed, lead;
age of the episode."""
VIEWS, NEAR = 4, 256
"""Windows, as of `s2a.sim.depth_cameras.VIEWS`; pixels nearest to a guess that are seen a second time."""
COARSE, FINE, TARGET_SIZE = 0.4, 0.05, 0.04
"""[m] Scales in which places are seen, and the size of the mark on the pointed place."""


def columns() -> dict[str, slice]:
    """Return the columns of an estimate by name."""
    out, first = {}, 0
    for name, width in ESTIMATE.items():
        out[name] = slice(first, first := first + width)
    return out


C = columns()
VECTORS = ("across", "inwards", "axis", "along")


@dataclass
class SightFrame:
    """What the network takes, of each world.

    Attributes:
        points: of all views from the estimate before, base frame [m], shape [world view height width 3]; NaN for none.
        target: the pointed place, from the estimate before [m], shape [world 3].
        before: the estimate before, its point at zero, shape [world WIDTH].
        tool: shape [world TOOL].
    """

    points: torch.Tensor
    target: torch.Tensor
    before: torch.Tensor
    tool: torch.Tensor


class SightNetwork(nn.Module):
    """Frames -> estimates, places relative to the estimate before, and the mask of the pointed part.

    Every view passes the same layers down to a quarter of its size. Each cell there votes for the grasp point and weighs its
    vote; the pixels nearest to the mean of the votes are seen a second time in a finer scale, by the same layers each and their
    maximum (PointNet, Qi et al. 2017).
    """

    def __init__(self, width: int = 64) -> None:
        """Make the layers; `width` of the first."""
        super().__init__()
        self.width = width
        half = width // 2
        self.cells = nn.Sequential(_conv(8, half, 5, 2), _conv(half, width, 3, 2), _conv(width, width, 3, 1))
        self.view = nn.Parameter(torch.zeros(VIEWS, width))
        self.deep = nn.Sequential(_conv(width, 2 * width, 3, 2), _conv(2 * width, 2 * width, 3, 2))
        self.state = _layers(WIDTH + TOOL + 3, 2 * width, 2 * width)
        self.context = _layers(VIEWS * 4 * width + 2 * width, 4 * width, 2 * width)
        self.votes = nn.Sequential(_layers(3 * width + 3, width), nn.Linear(width, 5))
        self.near = _layers(3 + 3, width, 2 * width)
        self.head = nn.Sequential(
            _layers(2 * width + 2 * width + width + 2 * width, 4 * width, 2 * width), nn.Linear(2 * width, WIDTH)
        )

    def forward(self, frame: SightFrame) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return estimates [world WIDTH], guesses of the grasp point [world 3], and logits of the mask [world view cell cell]."""
        n, views, high, wide = frame.points.shape[:4]
        valid = frame.points[..., :1].isfinite()
        points = torch.nan_to_num(frame.points)
        heat = torch.exp(
            -(points - frame.target[:, None, None, None]).square().sum(-1, keepdim=True) / (2 * TARGET_SIZE**2)
        )
        seen = [torch.tanh(points / COARSE), torch.tanh(points / FINE), valid.to(points.dtype), heat]
        pixels = torch.cat(seen, dim=-1) * valid
        cells = self.cells(pixels.flatten(0, 1).permute(0, 3, 1, 2)).unflatten(0, (n, views))
        cells = cells + self.view[:, :, None, None]
        deep = self.deep(cells.flatten(0, 1)).unflatten(0, (n, views)).flatten(3)
        state = self.state(torch.cat([frame.before, frame.tool, torch.tanh(frame.target / COARSE)], dim=1))
        whole = torch.cat([deep.mean(3), deep.amax(3)], dim=2).flatten(1)
        context = self.context(torch.cat([whole, state], dim=1))
        grid = high // 4
        places, there = _pooled(points, valid, grid)
        flat = cells.permute(0, 1, 3, 4, 2).reshape(n, views * grid * grid, -1)
        spread = context[:, None].expand(-1, flat.shape[1], -1)
        vote = self.votes(torch.cat([flat, spread, torch.tanh(places / COARSE)], dim=2))
        weight = (vote[..., :1] - 1e4 * (1.0 - there)).softmax(dim=1)
        guess = (weight * (places + 0.1 * vote[..., 1:4])).sum(dim=1)
        local = (weight * flat).sum(dim=1)
        head = self.head(torch.cat([context, state, local, self._look(points, valid, guess.detach())], dim=1))
        mask = vote[..., 4].unflatten(1, (views, grid, grid))
        return _estimate(head, guess.detach()), guess, mask

    def _look(self, points: torch.Tensor, valid: torch.Tensor, guess: torch.Tensor) -> torch.Tensor:
        """Return what the pixels nearest to a guess show in a fine scale, shape [world feature]."""
        away = (points - guess[:, None, None, None]).flatten(1, 3)
        far = away.square().sum(-1) + 1e3 * (~valid).flatten(1).to(away.dtype)
        index = far.topk(NEAR, dim=1, largest=False).indices[..., None]
        some = away.gather(1, index.expand(-1, -1, 3))
        return self.near(torch.cat([torch.tanh(some / FINE), torch.tanh(some / COARSE)], dim=2)).amax(dim=1)


def _layers(first: int, *widths: int) -> nn.Sequential:
    """Return linear layers with normalisation in between."""
    sizes = (first, *widths)
    each = [(nn.Linear(a, b), nn.LayerNorm(b), nn.ELU()) for a, b in zip(sizes, sizes[1:], strict=False)]
    return nn.Sequential(*(layer for group in each for layer in group))


def _conv(inputs: int, outputs: int, size: int, stride: int) -> nn.Sequential:
    """Return a convolution with normalisation of groups."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2), nn.GroupNorm(max(1, outputs // 16), outputs), nn.ELU()
    )


def _pooled(points: torch.Tensor, valid: torch.Tensor, grid: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the mean place of the valid pixels of each cell, shape [world cell 3], and whether it has one, [world cell 1]."""
    n, views, high = points.shape[:3]
    step = high // grid
    weight = valid.to(points.dtype)
    shape = (n, views, grid, step, grid, step, -1)
    total, count = (points * weight).reshape(shape).sum((3, 5)), weight.reshape(shape).sum((3, 5))
    return (total / count.clamp(min=1.0)).flatten(1, 3), (count > 0.0).to(points.dtype).flatten(1, 3)


def _estimate(numbers: torch.Tensor, guess: torch.Tensor) -> torch.Tensor:
    """Return a network's numbers as an estimate: directions of length 1, across normal to inwards; fractions as logits."""
    part = {name: numbers[:, c] for name, c in C.items()}
    inwards = nn.functional.normalize(part["inwards"], dim=1)
    across = part["across"] - (part["across"] * inwards).sum(dim=1, keepdim=True) * inwards
    out = {
        "point": guess + 0.01 * part["point"],
        "across": nn.functional.normalize(across, dim=1),
        "inwards": inwards,
        "axis": nn.functional.normalize(part["axis"], dim=1),
        "along": nn.functional.normalize(part["along"], dim=1),
        "size": nn.functional.softplus(part["size"]) * 0.03,
        "lever_arm": nn.functional.softplus(part["lever_arm"]) * 0.4,
        "travel": nn.functional.softplus(part["travel"]) * 0.4,
        "opening": nn.functional.softplus(part["opening"] - 3.0) * 0.2,
        "speed": 0.05 * part["speed"],
        "error": nn.functional.softplus(part["error"]) * 0.02,
    }
    return torch.cat([out.get(name, part[name]) for name in ESTIMATE], dim=1)


def truths(
    observation: torch.Tensor, columns: Mapping[str, slice], tool: torch.Tensor, grasped: torch.Tensor
) -> torch.Tensor:
    """Return the true estimates [world WIDTH] from exact observations of the task; fractions as 0 or 1.

    Args:
        observation: of the environment, shape [world observation].
        columns: of it, by term.
        tool: the tool frame in the base frame, shape [world 4 4].
        grasped: 0 or 1, shape [world].
    """
    of = {name: observation[:, c] for name, c in columns.items()}
    turn = tool[:, :3, :3]
    across, inwards = (torch.einsum("nij,nj->ni", turn, of[name]) for name in ("grasp_y", "grasp_z"))
    slides, lever_arm, travel = of["joint_kind"].split(1, dim=1)
    unit = torch.where(slides > 0.5, 1.0, lever_arm.clamp(min=1e-6))
    values = {
        "point": tool[:, :3, 3] + of["to_grasp"],
        "across": across,
        "inwards": inwards,
        "axis": of["joint_axis"],
        "along": of["opening_direction"],
        "size": of["grasp_size"],
        "slides": slides,
        "lever_arm": lever_arm,
        "travel": travel,
        "opening": of["opening"],
        "speed": of["velocity"] * unit,
        "within": of["holds_from_within"],
        "held": grasped[:, None].to(observation.dtype),
        "error": torch.zeros_like(slides),
    }
    return torch.cat([values[name] for name in ESTIMATE], dim=1)


def observed(
    observation: torch.Tensor,
    columns: Mapping[str, slice],
    tool: torch.Tensor,
    estimate: torch.Tensor,
    later: torch.Tensor | float,
) -> torch.Tensor:
    """Return observations of the task in which an estimate takes the place of the truth; joints stay as they are.

    Args:
        observation: shape [world observation].
        columns: of it, by term.
        tool: the tool frame in the base frame, shape [world 4 4].
        estimate: with fractions from 0 to 1, shape [world WIDTH].
        later: time since it was made [s], of all or shape [world 1]: it moves on at its speed.
    """
    e = {name: estimate[:, c] for name, c in C.items()}
    slides = (e["slides"] > 0.5).to(estimate.dtype)
    speed = e["speed"] * e["held"]
    point = e["point"] + speed * later * e["along"]
    opening = e["opening"] + speed * later
    unit = torch.where(slides > 0.5, 1.0, e["lever_arm"].clamp(min=0.05))
    between = point - tool[:, :3, 3]
    back = tool[:, :3, :3].transpose(1, 2)
    near, across, inwards = (torch.einsum("nij,nj->ni", back, v) for v in (between, e["across"], e["inwards"]))
    values = {
        "to_grasp": between,
        "coordinate": opening / unit,
        "velocity": speed / unit,
        "grasp_point": near,
        "grasp_y": across,
        "grasp_z": inwards,
        "joint_axis": e["axis"],
        "opening_direction": e["along"],
        "grasp_size": e["size"],
        "joint_kind": torch.cat([slides, e["lever_arm"] * (1.0 - slides), e["travel"]], dim=1),
        "opening": opening,
        "fine_point": (near / 0.02).clamp(-2.5, 2.5),
        "holds_from_within": (e["within"] > 0.5).to(estimate.dtype),
    }
    out = observation.clone()
    for name, value in values.items():
        out[:, columns[name]] = value
    return out


def fractions(estimate: torch.Tensor) -> torch.Tensor:
    """Return an estimate whose logits (slides, within, held) are fractions from 0 to 1."""
    out = estimate.clone()
    for name in ("slides", "within", "held"):
        out[:, C[name]] = estimate[:, C[name]].sigmoid()
    return out


def loss(
    estimate: torch.Tensor,
    guess: torch.Tensor,
    mask: torch.Tensor,
    truth: torch.Tensor,
    is_part: torch.Tensor,
    there: torch.Tensor,
) -> dict[str, torch.Tensor]:
    """Return the terms of the loss of estimates [world WIDTH] with logits, weighed as a policy needs them.

    Args:
        estimate: of the network.
        guess: its guess of the grasp point, shape [world 3].
        mask: its logits, shape [world view cell cell].
        truth: shape [world WIDTH], places relative to the estimate before.
        is_part: fraction of each cell's pixels on the part, as `mask`.
        there: cells where something was measured, as `mask`.
    """
    e, t = ({name: values[:, c] for name, c in C.items()} for values in (estimate, truth))

    def centimetres(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
        return nn.functional.huber_loss(100.0 * a, 100.0 * b, reduction="none").sum(dim=1)

    def off(name: str) -> torch.Tensor:
        return 1.0 - (e[name] * t[name]).sum(dim=1)

    hinge = 1.0 - t["slides"][:, 0]
    entropy = nn.functional.binary_cross_entropy_with_logits
    error = (e["point"] - t["point"]).norm(dim=1, keepdim=True).detach()
    terms = {
        "point": centimetres(e["point"], t["point"]),
        "guess": 0.5 * centimetres(guess, t["point"]),
        "across": 20.0 * off("across"),
        "inwards": 20.0 * off("inwards"),
        "axis": 10.0 * off("axis"),
        "along": 20.0 * off("along"),
        "size": 0.3 * centimetres(e["size"], t["size"]),
        "lever_arm": 0.05 * hinge * centimetres(e["lever_arm"], t["lever_arm"]),
        "travel": 0.02 * centimetres(e["travel"], t["travel"]),
        "opening": 0.5 * centimetres(e["opening"], t["opening"]),
        "speed": 0.5 * centimetres(e["speed"], t["speed"]),
        "error": 0.3 * centimetres(e["error"], error.clamp(max=0.3)),
    }
    for name, weight in (("slides", 2.0), ("within", 1.0), ("held", 0.5)):
        terms[name] = weight * entropy(e[name], t[name], reduction="none")[:, 0]
    each = entropy(mask, is_part, reduction="none") * there
    terms["mask"] = each.sum((1, 2, 3)) / there.sum((1, 2, 3)).clamp(min=1.0)
    return {name: term.mean() for name, term in terms.items()}


def turned(
    frame: SightFrame, truth: torch.Tensor, turn: torch.Tensor, scale: torch.Tensor, mirror: torch.Tensor
) -> tuple[SightFrame, torch.Tensor]:
    """Return frames and truths turned by matrices [world 3 3], mirrored ones included, and scaled, shape [world 1].

    `mirror`: -1 where a matrix mirrors, else 1, shape [world 1].
    """
    hinge = truth[:, C["slides"]] < 0.5
    place, axes, moved, rest = frame.tool.split((3, 9, 3, 4), dim=1)
    x, y, z = (_turn(turn, axis) for axis in axes.split(3, dim=1))
    tool = [_turn(turn, place) * scale, mirror * x, y, z, _turn(turn, moved) * scale, rest]
    points = _turn(turn, frame.points) * scale[:, :, None, None, None]
    before = turned_estimate(frame.before, turn, scale, mirror, hinge)
    after = turned_estimate(truth, turn, scale, mirror, hinge)
    return SightFrame(points, _turn(turn, frame.target) * scale, before, torch.cat(tool, dim=1)), after


def turned_estimate(
    estimate: torch.Tensor, turn: torch.Tensor, scale: torch.Tensor, mirror: torch.Tensor, hinge: torch.Tensor
) -> torch.Tensor:
    """Return estimates turned as `turned` does; the axis of a `hinge` [world 1] keeps its sense of rotation in a mirror."""
    part = {name: estimate[:, c] for name, c in C.items()}
    vectors = {name: _turn(turn, part[name]) for name in ("point", *VECTORS)}
    # Of the two directions across a handle the one upwards or to the left is taken, whether mirrored or not.
    level = part["across"][:, 2:].abs() < 0.3
    vectors["across"] = torch.where(level, vectors["across"] * mirror, vectors["across"])
    vectors["axis"] = torch.where(hinge, vectors["axis"] * mirror, vectors["axis"])
    out = {**part, **vectors}
    for name in ("point", "size", "lever_arm", "travel", "opening", "speed", "error"):
        out[name] = out[name] * scale
    return torch.cat([out[name] for name in ESTIMATE], dim=1)


def _turn(turn: torch.Tensor, vectors: torch.Tensor) -> torch.Tensor:
    """Return vectors [world ... 3] turned by matrices [world 3 3]."""
    return (vectors.reshape(len(vectors), -1, 3) @ turn.transpose(1, 2)).view_as(vectors)


def moved_target(target: torch.Tensor, estimate: torch.Tensor) -> torch.Tensor:
    """Return where a place on the closed part [world 3] is now, by an estimate with fractions, base frame [m]."""
    e = {name: estimate[:, c] for name, c in C.items()}
    lever = e["lever_arm"].clamp(min=0.05)
    origin = e["point"] - lever * torch.cross(e["along"], e["axis"], dim=1)
    angle, out = e["opening"] / lever, target - origin
    axis, cos, sin = e["axis"], angle.cos(), angle.sin()
    dot = (axis * out).sum(dim=1, keepdim=True)
    swung = origin + cos * out + sin * torch.cross(axis, out, dim=1) + (1.0 - cos) * dot * axis
    return torch.where(e["slides"] > 0.5, target + e["opening"] * e["along"], swung)
