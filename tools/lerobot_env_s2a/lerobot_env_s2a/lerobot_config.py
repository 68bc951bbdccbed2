"""LeRobot's keys of an environment of s2a: `--env.type=s2a --env.room=FILE`."""

from dataclasses import dataclass, field
from typing import Any

from gymnasium.vector import VectorEnv
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig

import lerobot_env_s2a
from s2a import robot as robots


@EnvConfig.register_subclass("s2a")
@dataclass
class S2aConfig(EnvConfig):
    """Keys of the environment; those that LeRobot has of every environment beside them.

    Attributes:
        room: the sim.usd of `s2a prepare`, or the index of `s2a pool`.
        task: its name, as "open_part".
        part: what moves, of a room with several.
        keys: further keys of `s2a collect`; none that the others set.
        robot: that the room was prepared for.
        device: "cpu" or "cuda:0".
        size: width and height of the images [pixel].
    """

    room: str = ""
    task: str | None = "open_part"
    fps: int = 20
    part: str | None = None
    keys: list[str] = field(default_factory=list)
    robot: str = "panda"
    device: str = "cpu"
    size: int = 128

    def __post_init__(self) -> None:
        """Derive the features from the robot."""
        spec = robots.load(self.robot)
        state, images = len(spec.recorded) - 1, (self.size, self.size, 3)
        self.features = {
            "action": PolicyFeature(type=FeatureType.ACTION, shape=(len(spec.joints),)),
            "agent_pos": PolicyFeature(type=FeatureType.STATE, shape=(state,)),
            **{f"pixels/{name}": PolicyFeature(type=FeatureType.VISUAL, shape=images) for name in ("scene", "wrist")},
        }
        self.features_map = {
            "action": "action",
            "agent_pos": "observation.state",
            **{f"pixels/{name}": f"observation.images.{name}" for name in ("scene", "wrist")},
        }

    @property
    def package_name(self) -> str:
        """Name space of the environments in Gymnasium."""
        return lerobot_env_s2a.PACKAGE

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """What `S2aEnv` takes, but its task."""
        names = ("room", "part", "keys", "robot", "device", "size")
        return {name: getattr(self, name) for name in names}

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, VectorEnv]]:
        """Return the environments by task: of a pool, one for each part."""
        return lerobot_env_s2a.vectors(count=n_envs, asynchronous=use_async_envs, task=self.task, **self.gym_kwargs)
