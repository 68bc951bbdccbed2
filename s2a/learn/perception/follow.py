"""The policy with depth cameras: estimates of the part from frame to frame, for a policy of states."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from PIL import Image
from torch import nn

from s2a import tasks
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.perception.sight import TOOL, WIDTH, C, SightFrame, SightNetwork, fractions, moved_target, observed
from s2a.learn.rl import policy_file
from s2a.learn.rl.policy_file import PolicyFile
from s2a.sim.depth_cameras import SIZE, VIEWS, DepthCameraConfig, DepthView, WorldCameras, tool_poses
from s2a.sim.simulation import SimConfig
from s2a.tasks.base import MdpConfig, active, columns_of
from s2a.tasks.env import VecEnv

PRETRAINED_DEPTH = "pretrained_depth"
"""Names the policy with depth cameras that comes with s2a."""
DEPTH = ".depth"
"""Ending of a policy with depth cameras, as `s2a perceive` writes it."""
EVERY = 6
"""Control steps a frame: ten frames a second."""
FINGERS = ("joint_positions", "joint_velocities", "target_lead", "target_velocities")
"""Observations whose last two columns are of the fingers, mirrored where the gripper holds from within."""
LOST = 1.5
"""[m] From the pointed place, beyond which an estimate is given up."""


class StatePolicy(nn.Module):
    """A policy of true states, as torch runs it."""

    def __init__(self, path: Path) -> None:
        """Read a policy file."""
        super().__init__()
        weights = policy_file.weights(path)
        self.register_buffer("mean", weights["obs_normalizer._mean"])
        self.register_buffer("deviation", weights["obs_normalizer._std"] + policy_file.NORMALIZER_EPS)
        names = sorted({name.split(".")[1] for name in weights if name.startswith("mlp.")}, key=int)
        layers: list[nn.Module] = []
        for name in names:
            weight, bias = weights[f"mlp.{name}.weight"], weights[f"mlp.{name}.bias"]
            layer = nn.Linear(weight.shape[1], weight.shape[0])
            layer.weight.data, layer.bias.data = weight, bias
            layers += [layer, nn.ELU()]
        self.mlp = nn.Sequential(*layers[:-1])
        self.requires_grad_(False)

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the mean action [world action]."""
        return self.mlp((observation - self.mean) / self.deviation)


@dataclass(frozen=True)
class Sighting:
    """A frame of all worlds on its way through the network.

    Attributes:
        frame: the network's input.
        about: the place to which its places are relative, base frame [m], shape [world 3].
        is_part: fraction of each cell's pixels on the part, shape [world view cell cell].
    """

    frame: SightFrame
    about: torch.Tensor
    is_part: torch.Tensor


class Follower:
    """Estimates of the parts of all worlds, made again with every frame.

    Attributes:
        estimate: with fractions, base frame, shape [world WIDTH].
        started: which worlds have had a frame of their episode that shows the part, shape [world].
    """

    def __init__(
        self, env: VecEnv, cameras: WorldCameras, network: SightNetwork, policy: StatePolicy, seed: int
    ) -> None:
        """Begin without an estimate."""
        n, device = env.num_envs, env.sim.device
        self.env, self.cameras, self.network, self.policy = env, cameras, network, policy
        self.estimate = torch.zeros(n, WIDTH, device=device)
        self.started = torch.zeros(n, dtype=torch.bool, device=device)
        self._used: list[tuple[torch.Tensor, torch.Tensor]] = []  # estimates and `started` of frames, the oldest acts
        self._calls = 0
        self._target = torch.zeros(n, 3, device=device)
        self._tool = torch.eye(4, device=device).repeat(n, 1, 1)
        self._age, self._later = torch.zeros(n, 1, device=device), 0.0
        self._random = torch.Generator(device).manual_seed(seed)
        internal = [env.sim.stages[i].internal for i in env.sim.stage_of_env]
        self.sense = 1.0 - 2.0 * torch.tensor(internal, dtype=torch.float32, device=device)[:, None]

    def forget(self, worlds: torch.Tensor) -> None:
        """Drop the estimates of worlds (shape [world], bool) whose episode ended."""
        for started in (self.started, *(each for _, each in self._used)):
            started &= ~worlds

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the action [world action] for an observation [world observation], of which it takes the joints alone.

        Takes a frame in every EVERY-th call; a world acts from the first frame of its episode on.
        """
        self.forget(self.env.episode_step == 0)
        if self._calls % EVERY == 0:
            self.observe()
        self._calls += 1
        return self.act(observation)

    @torch.no_grad()
    def observe(self) -> Sighting:
        """Take a frame, and estimate."""
        sighting = self._frame()
        estimate = fractions(self.network(sighting.frame)[0])
        estimate[:, C["point"]] += sighting.about
        self.estimate, self._later = estimate, 0.0
        self._used = [*self._used, (estimate, self.started.clone())][-1 - self.cameras.config.delay :]
        return sighting

    def _frame(self) -> Sighting:
        """Return the network's input now."""
        tool, new = tool_poses(self.env.sim, self.cameras), ~self.started
        first = new[:, None]
        self.cameras.refit()
        self.cameras.begin(new)
        moved = self._moved()
        wide = self.cameras.see("wide", moved[:, C["point"]])
        pointed, shown = self._pointed(wide)
        self._target = torch.where(first, pointed, self._target)
        now = moved_target(self._target, moved)
        lost = first | ((moved[:, C["point"]] - now).norm(dim=1, keepdim=True) > LOST)
        about = torch.where(lost, torch.where(first, self._target, now), moved[:, C["point"]])
        views = [wide, *(self.cameras.see(name, about) for name in VIEWS[1:])]
        before = torch.where(first, 0.0, moved)
        before[:, C["point"]] = 0.0
        self._age = torch.where(first, 0.0, self._age + 1.0)
        shift = torch.where(first, 0.0, tool[:, :3, 3] - self._tool[:, :3, 3])
        self._tool = tool
        numbers = [tool[:, :3, 3] - about, tool[:, :3, :3].transpose(1, 2).flatten(1), shift * 10.0, self._fingers()]
        inputs = torch.cat([*numbers, torch.tanh(self._age / 10.0)], dim=1)
        self.started = self.started | shown
        points = torch.stack([_relative(view, about) for view in views], dim=1)
        is_part = cells(torch.stack([view.is_part for view in views], dim=1))
        target = torch.where(first, self._target, now) - about
        return Sighting(SightFrame(points, target, before, inputs), about, is_part)

    @torch.no_grad()
    def act(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the actions of the state policy on the estimates; none in worlds that have none yet."""
        delay, step = self.cameras.config.delay, self.env.sim.config.control_dt
        estimate, started = self._used[0]
        later = self._later + (len(self._used) - 1) * EVERY * step
        self._later += step
        sense = self.sense * (1.0 - 2.0 * (estimate[:, C["within"]] > 0.5).float())
        tool, columns = tool_poses(self.env.sim, self.cameras), self.env.task.columns
        believed = observed(felt(observation, columns, sense), columns, tool, estimate, later)
        action = self.policy(believed.clamp(-5.0, 5.0)).clamp(-1.0, 1.0)
        action[:, -2:] *= sense
        return action * (started & (len(self._used) > delay))[:, None]

    def _moved(self) -> torch.Tensor:
        """Return the estimates, moved on at their speed."""
        speed = self.estimate[:, C["speed"]] * self.estimate[:, C["held"]] * self._later
        out = self.estimate.clone()
        out[:, C["point"]] += speed * self.estimate[:, C["along"]]
        out[:, C["opening"]] += speed
        return out

    def _pointed(self, wide: DepthView) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the place under the one pixel of each world, base frame [m], and where it shows something, shape [world]."""
        n, pixel = len(wide.is_part), self.cameras.config.pixel
        shown = (wide.valid if pixel else wide.is_part).flatten(1)
        if pixel:
            column, row = pixel
            index = torch.full((n, 1), row * wide.valid.shape[2] + column, device=shown.device)
        else:
            even = shown.float() + (~shown.any(dim=1, keepdim=True)).float()
            index = torch.multinomial(even, 1, generator=self._random)
        points = wide.points.flatten(1, 2).gather(1, index[..., None].expand(-1, -1, 3))[:, 0]
        return points, shown.gather(1, index)[:, 0]

    def _fingers(self) -> torch.Tensor:
        """Return position, velocity and lead of the fingers, as they truly are, shape [world 3]."""
        columns = self.env.task.columns
        fingers = felt(self.env.observation, columns, self.sense)
        last = [columns[name].stop for name in FINGERS[:3]]
        return torch.cat([fingers[:, stop - 2 : stop].mean(dim=1, keepdim=True) for stop in last], dim=1)

    def image(self, worlds: torch.Tensor) -> Image.Image:
        """Return what the cameras see of some worlds, a column each: depth, the pointed place green, the estimated grasp red."""
        rows, estimate, noise = [], self._moved(), self.cameras.random.get_state()
        self.cameras.refit()
        for name in VIEWS:
            view = self.cameras.see(name, estimate[:, C["point"]])
            points, valid = view.points[worlds], view.valid[worlds]
            depth = (points - points.new_tensor([0.0, 0.0, 0.5])).norm(dim=-1)
            image = ((1.0 - depth / 2.0).clamp(0.05, 1.0) * valid)[..., None].repeat(1, 1, 1, 3)
            for color, place in ((1, moved_target(self._target, estimate)), (0, estimate[:, C["point"]])):
                far = (points - place[worlds, None, None]).norm(dim=-1) + 10.0 * ~valid
                mark = (far < far.amin(dim=(1, 2), keepdim=True) + 0.002) & (far < 0.05)
                image[mark] = 0.0
                image[..., color] = torch.where(mark, 1.0, image[..., color])
            rows.append(torch.cat(list(image), dim=1))
        self.cameras.random.set_state(noise)  # an episode goes on as it would without an image
        pixels = (255.0 * torch.cat(rows, dim=0)).to(torch.uint8).cpu().numpy()
        return Image.fromarray(pixels.repeat(3, axis=0).repeat(3, axis=1))


def felt(observation: torch.Tensor, columns: Mapping[str, slice], sense: torch.Tensor) -> torch.Tensor:
    """Return observations whose fingers are mirrored where `sense` [world 1] is -1."""
    out = observation.clone()
    for name in FINGERS:
        last = columns[name].stop
        out[:, last - 2 : last] *= sense
    return out


def _relative(view: DepthView, about: torch.Tensor) -> torch.Tensor:
    """Return a view's points from a place of each world, NaN where nothing was measured."""
    return torch.where(view.valid[..., None], view.points - about[:, None, None], torch.nan)


def cells(pixels: torch.Tensor) -> torch.Tensor:
    """Return the fraction of true pixels in cells of four by four, shape [world view cell cell]."""
    return nn.functional.avg_pool2d(pixels.float(), 4)


class DepthPolicy:
    """A policy with depth cameras as `s2a perceive` writes it: its network, and the bundled policy of states that acts.

    Attributes:
        name: of the file.
        world: how physics is stepped and what the robot has to do, of the policy of states.
    """

    def __init__(self, path: Path, camera: DepthCameraConfig) -> None:
        """Read a file, or the one that comes with s2a where `path` is "pretrained_depth".

        Raises:
            InputError: there is no such file, it is none of s2a perceive, or it is of another policy of states.
        """
        self.name = PRETRAINED_DEPTH if str(path) == PRETRAINED_DEPTH else path.name
        self.network = read_network(path)
        self._camera = camera
        self.world = state_world()

    def worlds(self, sim: SimConfig, task: MdpConfig) -> tuple[SimConfig, MdpConfig]:
        """Return the world of the policy of states."""
        return self.world

    def bound(self, env: VecEnv) -> Follower:
        """Return the action [world action] for an observation [world observation]; the cameras see the worlds themselves.

        Places, errors and noise of the cameras are drawn by the environment's seed.

        Raises:
            InputError: a room has no visuals, or the environment observes something else than the policy of states.
        """
        PolicyFile(Path(policy_file.PRETRAINED)).bound(env)
        device = env.sim.device
        cameras = WorldCameras(env.sim, self._camera, env.seed)
        policy = StatePolicy(Path(policy_file.PRETRAINED)).to(device)
        return Follower(env, cameras, self.network.to(device), policy, env.seed)


def read_policy(path: Path, camera: DepthCameraConfig) -> PolicyFile | DepthPolicy:
    """Read a policy of states or with depth cameras, by its ending or name; errors as of these."""
    if is_depth(path):
        return DepthPolicy(path, camera)
    return PolicyFile(path)


def is_depth(path: Path) -> bool:
    """Return whether a path names a policy with depth cameras."""
    return str(path) == PRETRAINED_DEPTH or path.suffix == DEPTH


def file_of(path: Path) -> Path:
    """Return the file that a path or the name of a bundled policy means; InputError where there is none."""
    if not is_depth(path):
        return policy_file.file_of(path)
    file = Path(__file__).parents[1] / "policies/open_part.depth" if str(path) == PRETRAINED_DEPTH else path
    if not file.is_file():
        raise InputError(f"policy {str(path)!r}: no such file; give what s2a perceive wrote, or {PRETRAINED_DEPTH}")
    return file


def state_world() -> tuple[SimConfig, MdpConfig]:
    """Return the world of the bundled policy of states, without the errors of the grasp that it was trained with."""
    world = PolicyFile(Path(policy_file.PRETRAINED)).world
    assert world is not None, "the bundled policy holds the settings of its training"
    return world[0], replace(world[1], grasp_error=(0.0, 0.0), grasp_turn=(0.0, 0.0))  # type: ignore[call-arg]


def _state_hash() -> str:
    return hashlib.sha256(policy_file.file_of(Path(policy_file.PRETRAINED)).read_bytes()).hexdigest()


def write_network(network: SightNetwork, path: Path) -> None:
    """Write a policy with depth cameras: the network in half precision, and the hash of the policy of states."""
    weights = {name: value.cpu().half() for name, value in network.state_dict().items()}
    with atomic_write(path) as out:
        torch.save({"width": network.width, "state_policy": _state_hash(), "weights": weights}, out)


def read_network(path: Path) -> SightNetwork:
    """Read the network of a policy with depth cameras; nothing in the file is executed. Errors as of DepthPolicy."""
    file = file_of(path)
    try:
        saved = torch.load(file, weights_only=True, map_location="cpu")
        network = SightNetwork(int(saved["width"]))
        network.load_state_dict({name: value.float() for name, value in saved["weights"].items()})
        state_policy = str(saved["state_policy"])
    except Exception as error:  # of torch, pickle, zipfile: whatever a damaged or foreign file makes them raise
        why = (str(error) or type(error).__name__).splitlines()[0]
        raise InputError(f"{file}: not a policy of s2a perceive ({why})") from error
    if state_policy != _state_hash():
        raise InputError(f"{file}: trained with another bundled policy than that of this version; train it again")
    return network.eval().requires_grad_(False)


def export(network: SightNetwork, out: Path) -> list[Path]:
    """Write OUT_estimate.onnx and OUT_act.onnx, for any number of worlds, and return them.

    The first takes the "points", "target", "before" and "tool" of a frame (`sight.SightFrame`) and returns the "estimate",
    relative to the place that the points are relative to. The second takes the "obs" of the policy of states, whatever they say
    of the part, with the fingers as they truly are: the graph mirrors them where the estimate holds from within. It also takes
    the tool's "pose" [world 4 4]; the "estimate" in the base frame; and the time "later" [s] since it was made,
    shape [world 1]. It returns the "actions".
    """
    policy, (_, task) = StatePolicy(Path(policy_file.PRETRAINED)), state_world()
    joints = policy.mlp[-1].out_features
    columns = columns_of(active(tasks.task(task.name).OBSERVATIONS, task), joints)
    views = torch.zeros(2, len(VIEWS), SIZE, SIZE, 3)
    frame = {
        "points": views,
        "target": views[:, 0, 0, 0],
        "before": torch.zeros(2, WIDTH),
        "tool": torch.zeros(2, TOOL),
    }
    now = {"obs": torch.zeros(2, len(policy.mean[0])), "pose": torch.eye(4).repeat(2, 1, 1)}
    now |= {"estimate": torch.zeros(2, WIDTH), "later": torch.zeros(2, 1)}
    files = [out.with_name(f"{out.stem}_{name}.onnx") for name in ("estimate", "act")]
    estimate, act = _EstimateGraph(copy.deepcopy(network).cpu()).eval(), _ActGraph(policy, columns).eval()
    for file, module, inputs, output in ((files[0], estimate, frame, "estimate"), (files[1], act, now, "actions")):
        with atomic_write(file) as place:
            policy_file.write_graph(module, inputs, output, place)
    return files


class _EstimateGraph(nn.Module):
    """A frame -> its estimate, with fractions."""

    def __init__(self, network: SightNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(
        self, points: torch.Tensor, target: torch.Tensor, before: torch.Tensor, tool: torch.Tensor
    ) -> torch.Tensor:
        return fractions(self.network(SightFrame(points, target, before, tool))[0])


class _ActGraph(nn.Module):
    """Observations of the joints, and an estimate -> actions."""

    def __init__(self, policy: StatePolicy, columns: Mapping[str, slice]) -> None:
        super().__init__()
        self.policy, self._columns = policy, columns

    def forward(
        self, obs: torch.Tensor, pose: torch.Tensor, estimate: torch.Tensor, later: torch.Tensor
    ) -> torch.Tensor:
        sense = 1.0 - 2.0 * (estimate[:, C["within"]] > 0.5).to(obs.dtype)
        believed = observed(felt(obs, self._columns, sense), self._columns, pose, estimate, later)
        actions = self.policy(believed.clamp(-5.0, 5.0)).clamp(-1.0, 1.0)
        return torch.cat([actions[:, :-2], actions[:, -2:] * sense], dim=1)
