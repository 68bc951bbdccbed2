"""The process that compares a saved stage with the plan: USD's parser may crash on it, and the program goes on.

`s2a.language.sandbox.jail` starts it as it starts that of a script, with the same sandbox layers and limits.
"""

import json
import os
import sys
from typing import Any

from s2a.language.sandbox import worker


def main(descriptor: int) -> None:
    """Enable the layers of the job that a descriptor holds, and compare the stage on standard input with the plan.

    Reported is the reason of a violation, or nothing; the layer with the new prim goes to a descriptor that the job names.
    """
    job = worker.read_job(descriptor)
    worker.tell(job["report"], {"active": worker.enable_layers(job, _preload)})
    task = json.load(sys.stdin)
    error, layer = _compare(task, job["stage_text"])
    worker.tell(job["report"], error)
    os.write(job["result"], layer)
    os._exit(0)


def _compare(task: dict[str, Any], geometry_free_text: str) -> tuple[dict[str, Any], bytes]:
    """Return the report and, in USD's text, the layer."""
    from s2a.language.sandbox.diff import Placement, compare  # loads USD, which the jail's parent does without
    from s2a.language.sandbox.operations import PolicyViolation

    try:
        layer = compare(task["saved"].encode(), geometry_free_text, Placement(**task["plan"]))
        return {}, layer.ExportToString().encode()
    except PolicyViolation as violation:
        return {"reason": violation.reason[:2000]}, b""


def _preload() -> None:
    """Import and use once what a comparison needs: later loads would be denied their files."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # the layers hold for one thread
    worker.preload()
    import s2a.language.sandbox.diff  # noqa: F401
