"""The Python API: from the files of a scan to a task in simulated worlds.

    from s2a import api

    scene = api.load_scene("demo/scan")
    api.export("demo/scan", out="demo")
    api.insert("demo/geometric.usd", "stapler.usda", "stapler", out="demo/insert", hint="next to the keyboard", llm="rules")
    api.prepare("demo/geometric.usd", "drawer_7", out="demo/sim.usd")
    api.convert("demo/sim.usd", out="demo/mjcf")
    reports = api.certify("demo/sim.usd")
    env = api.make("open_part", room="demo/sim.usd", part="drawer_7", num_envs=16)

Lengths are metres, angles radians, masses kilograms, z is up. `overrides` are `key=value` texts, as on the command line.
Every function raises `s2a.core.errors.InputError` for bad input and for an extra that is not installed.
"""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from s2a import scan as scans
from s2a.core import config, errors
from s2a.scan import Export
from s2a.scene.scene import Scene

if TYPE_CHECKING:
    from s2a.core.check import ValidationReport
    from s2a.language.insert.batch import Insertion
    from s2a.tasks.env import TaskVectorEnv

File = str | PathLike[str]


def load_scene(path: File) -> Scene:
    """Read a scene from a scan folder or from a geometric stage.

    Args:
        path: folder of an Articulate3D, MultiScan or ScanNet++ scan or of a bare mesh; or a geometric.usd (or an insert.usda).

    Raises:
        InputError: neither, or a damaged one.
    """
    return scans.load_scene(Path(path))


def export(scan: File, out: File) -> Export:
    """Write a scan as the two flavours of USD, descriptive and geometric.

    Args:
        scan: folder of the scan.
        out: folder that receives descriptive.usda and geometric.usd.

    Raises:
        InputError: the folder holds no scan, or a damaged one; nothing is written.
    """
    return scans.export(Path(scan), Path(out))


def insert(
    stage: File, object: File, label: str, out: File, hint: str = "", llm: str = "auto", overrides: Sequence[str] = ()
) -> Insertion:
    """Insert an object into a room, as a layer over its stage. Needs `s2a[sim]`, and `s2a[llm]` for llm="chat".

    Args:
        stage: the geometric.usd, or the insert.usda of an earlier insertion; it is not changed.
        object: a mesh or a USD stage, in any unit and orientation.
        label: name of the object in plain words.
        out: folder that receives insert.usda, objects/, descriptive.usda and insert.json.
        hint: placement hint in words, such as "next to the keyboard".
        llm: "chat" (a language model), "replay", "rules", or "auto": chat where OPENAI_API_KEY is set, else rules.
        overrides: other keys of `s2a insert`, such as "image=insert.png".

    Raises:
        InputError: no place was found, no usable answer, or bad input; nothing is written.
    """
    with errors.required():  # imports of an extra, here and below: `s2a.api` itself loads none
        from s2a.language.insert.batch import insert_all
        from s2a.language.insert.settings import InsertSettings

        given = {"stage": stage, "object": object, "label": label, "out": out, "prompt": hint or None}
        return insert_all(_load(InsertSettings, "insert", given, [f"llm={llm}", *overrides]))


def prepare(stage: File, targets: str | Sequence[str], out: File, overrides: Sequence[str] = ()) -> Path:
    """Write the simulation-ready room of a scene; return its path. Needs `s2a[sim]`.

    Args:
        stage: the geometric.usd.
        targets: "all" articulated parts, the id of one, such as "drawer_7", or several of them.
        out: the sim.usd to write; its visuals are written beside it.
        overrides: other keys of `s2a prepare`, such as "free=[cup_75]".

    Raises:
        InputError: a target that is not in the stage or does not move.
    """
    with errors.required():
        from s2a.prepare.room import PrepareSettings, prepare_stage

        prepare_stage(_load(PrepareSettings, "prepare", {"stage": stage, "targets": targets, "out": out}, overrides))
    return Path(out)


def convert(
    stage: File, out: File, to: str = "mjcf", parts: str | Sequence[str] = "all", overrides: Sequence[str] = ()
) -> Path:
    """Write a simulation-ready room for other simulators; return the file to load there. Needs `s2a[sim]`.

    Args:
        stage: the sim.usd.
        out: the folder to write: room.xml (MJCF) or room.urdf, and meshes; an earlier one is replaced.
        to: "mjcf" or "urdf".
        parts: "all" articulated parts and free objects move, or the one, or those, that are named; all others are frozen.
        overrides: other keys of `s2a convert`, such as "sim.joint.stiffness=0".

    Raises:
        InputError: no such file, an id that cannot move, or an `out` that is something else; nothing is written.
    """
    with errors.required():
        from s2a.certify import convert as converter

        settings = _load(
            converter.ConvertSettings, "convert", {"stage": stage, "out": out, "to": to, "parts": parts}, overrides
        )
        converter.convert(settings)
        return settings.out / converter.FILES[settings.to]


def certify(stage: File, part: str | None = None, overrides: Sequence[str] = ()) -> list[ValidationReport]:
    """Validate a simulation-ready room; return a report for each part, whose `.passed` is the verdict. Needs `s2a[sim]`.

    Args:
        stage: the sim.usd.
        part: id of one articulated part; None: all.
        overrides: keys of `s2a certify` below `certify`, such as "certify.physics.dt=0.002".

    Raises:
        InputError: no such file.
    """
    with errors.required():
        from s2a.certify.check_suite import CertifyConfig
        from s2a.certify.check_suite import certify as run

        values = config.compose("certify", list(overrides))["certify"]
        return run(Path(stage), config.load(CertifyConfig, values), part)


def certify_asset(asset: File) -> ValidationReport:
    """Check a third-party URDF, MJCF or USD as far as that needs no scan; return its report. Needs `s2a[sim]`.

    Raises:
        InputError: no such file, or one that neither MuJoCo nor Newton can read.
    """
    with errors.required():
        from s2a.certify.asset import certify_asset as run

        return run(Path(asset))[0]


def make(
    task: str,
    room: File,
    part: str | None = None,
    num_envs: int = 1024,
    device: str = "auto",
    seed: int = 0,
    overrides: Sequence[str] = (),
    numpy: bool = False,
) -> TaskVectorEnv:
    """Return a task in worlds of a simulation-ready room, or of the parts of many, as a `gymnasium.vector.VectorEnv`.

    Args:
        task: its name, such as "open_part".
        room: the sim.usd that `prepare` wrote; or the index that `s2a pool` wrote, *.json: world i has its part i modulo their
            number.
        part: id of the part or object to move, such as "drawer_7"; None: the room's only one, or all of the index.
        num_envs: worlds that are stepped together.
        device: "cpu", "cuda:0", or "auto": a GPU where there is one.
        seed: of the start noise.
        overrides: settings as `s2a train` takes them, such as "sim=real", "reward=grasped", "task.start_noise=0".
        numpy: observations, rewards and flags are NumPy arrays, as wrappers of Gymnasium want them, and no tensors.

    Raises:
        InputError: an unknown task, part or setting; not a simulation-ready room; a part of an index.
    """
    with errors.required():
        from s2a import tasks

        return tasks.make(task, Path(room), part, num_envs, device, seed, overrides, numpy)


def export_policy(network: Any, out: File, env: TaskVectorEnv) -> Path:
    """Write a network of one's own as a policy file, for `policy=FILE.onnx` of the commands. Needs `s2a[learn]`.

    Args:
        network: a torch module, observations [world observation] -> mean actions [world action]; or an ONNX file of one.
        out: the ONNX file to write.
        env: of `make`, with the settings in which the network was trained.

    Raises:
        InputError: the network fails on an observation of `env`, or gives something else than its actions.
    """
    with errors.required():
        from s2a.learn.rl.policy_file import wrap

        given = Path(network) if isinstance(network, (str, PathLike)) else network
        return wrap(given, Path(out), env.unwrapped.worlds)


def _load(cls: type[Any], command: str, given: dict[str, Any], overrides: Sequence[str]) -> Any:
    """Return a command's configuration: its defaults, the overrides, and the given top-level values."""
    return config.load(
        cls, {**config.compose(command, list(overrides), cls), **{k: _plain(v) for k, v in given.items()}}
    )


def _plain(value: Any) -> Any:
    return (
        Path(value) if isinstance(value, PathLike) else value if isinstance(value, (str, type(None))) else tuple(value)
    )
