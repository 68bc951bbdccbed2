"""How fast `s2a collect` writes demonstrations, beside the bare camera sensor in the same worlds, on one device.

    python tools/bench_collect.py stage=ROOM.usd part=drawer_7 [num_envs=8 device=cuda:0 format=robomimic ...] [--out FILE]

Takes every key of `s2a collect` but `out` and `episodes`: each of ROUNDS rounds runs one episode in every world and writes those
that succeed into a temporary folder. A frame is one camera's colours, depth and instances at one time in one world.

- sensor: the cameras alone, colours and depth, left on the device.
- images: with instances, and brought to where they are encoded from.
- simulation: physics and who acts, without any camera, at so many frames of it.
- encoders: the processes alone, on images that stand still, which is the most that they can do.
- written: all of it together, as `s2a collect` does it; demonstrations a minute of the same rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from s2a.commands.collect import Config, Session
    from s2a.learn.collect.video import Encoders

# What is imported here, every process that encodes images imports too, since it begins as this module: so no physics.
ROUNDS = 2
SECONDS = 5.0
"""For which each part is timed alone."""


def main() -> None:
    """Print the rates, and write them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("keys", nargs="+", metavar="key=value")
    parser.add_argument("--out", type=Path, help="write the row as JSON")
    args = parser.parse_args()
    from s2a.commands.collect import Config
    from s2a.core import config

    with tempfile.TemporaryDirectory() as folder:
        keys = [*args.keys, f"out={folder}/set", "episodes=1"]
        settings = config.load(Config, config.compose("collect", keys))
        row = measured(settings, Path(folder))
    print(json.dumps(row, indent=1))
    if args.out:
        args.out.write_text(json.dumps(row, indent=1) + "\n")


def measured(settings: Config, folder: Path) -> dict:
    """Return the rates of all parts [frame/s]."""
    import numpy as np

    from s2a.commands.collect import begin, format_of
    from s2a.core.provenance import provenance
    from s2a.learn.collect.video import SLOTS
    from s2a.sim.camera import CAMERAS

    session = begin(settings)
    env, views, collector = session.env, session.views, session.collector
    dataset = format_of(settings.format)(settings.out, collector.features)
    images = len(CAMERAS) * settings.num_envs
    with collector.encoders(dataset) as encoders:
        encoders.begin(folder / "alone")
        for _ in range(SLOTS):
            collector.render(encoders)
            encoders.add(np.ones(settings.num_envs, dtype=bool))
        rates = {
            "sensor": images * rate(lambda: list(views.render(env.sim.joint_q, instances=False)), env.sim.device),
            "images": images * rate(lambda: collector.render(encoders), env.sim.device),
            "simulation": images / settings.every * rate(lambda: act(session), env.sim.device),
            "encoders": images * rate(lambda: encode(encoders, np.ones(settings.num_envs, dtype=bool)), "cpu"),
        }
        encoders.end()
        env.reset_all(settings.seed)
        start, kept, frames = time.perf_counter(), 0, 0
        for k in range(ROUNDS):
            for episode in collector.run(session.policy, settings.seed + k, folder, encoders, session.words):
                dataset.add(episode)
                kept += 1
            frames += len(CAMERAS) * collector.encoded
        seconds = time.perf_counter() - start
    rates["written"] = frames / seconds
    return {
        **provenance(env.sim.device),
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "keys": {"part": session.stage.target, "num_envs": settings.num_envs, "every": settings.every, "format": settings.format,
                 "size": [settings.views.width, settings.views.height], "seed": settings.seed},
        "frames_a_second": {name: round(value, 1) for name, value in rates.items()},
        "written_of_sensor": round(rates["written"] / rates["sensor"], 3),
        "episodes": ROUNDS * settings.num_envs, "kept": kept, "frames": frames, "seconds": round(seconds, 1),
        "demonstrations_a_minute": round(60.0 * kept / seconds, 2),
        "megabytes": round(sum(file.stat().st_size for file in settings.out.rglob("*") if file.is_file()) / 1e6, 2),
    }  # fmt: skip


def act(session: Session) -> None:
    """Do a control step."""
    session.env.step(session.policy(session.env.observation.clone()))


def encode(encoders: Encoders, alive: np.ndarray) -> None:
    """Encode the frame that is in the slot."""
    encoders.slot()
    encoders.add(alive)


def rate(function: Callable[[], object], device: str) -> float:
    """Return calls a second."""
    function()
    _sync(device)
    start = now = time.perf_counter()
    calls = 0
    while now - start < SECONDS:
        function()
        _sync(device)
        calls, now = calls + 1, time.perf_counter()
    return calls / (now - start)


def _sync(device: str) -> None:
    """Wait for the device."""
    if device.startswith("cuda"):
        import torch

        torch.cuda.synchronize(device)


if __name__ == "__main__":
    main()
