"""Command `s2a do`: execute a sentence in simulation: a language model or rules plan, the planner acts."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from s2a.core.bounds import CountFromZero
from s2a.core.errors import CheckFailed, InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.provenance import provenance
from s2a.language.ask import UsageLog
from s2a.language.client import LlmConfig, choose, kind_of
from s2a.language.do import goal as goals
from s2a.language.do.episode import ExecutionConfig, RoomChange, Skills, execute, tasks_of
from s2a.language.do.facts import gather
from s2a.language.do.live import LiveRoom
from s2a.language.do.plan import check_sentence
from s2a.language.do.rules import rules
from s2a.language.do.run import Result, RoomContext, do
from s2a.learn.perception.follow import read_policy
from s2a.motion.trajectory import PlannerConfig
from s2a.robot import Robot
from s2a.scene.usd import descriptive, sim_stage
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.sim.camera import CameraConfig
from s2a.sim.depth_cameras import DepthCameraConfig
from s2a.sim.simulation import SimConfig, device_of
from s2a.view import states

OPENED = 0.2  # [m] Path by which the parts of the key `opened` stand open
SENTENCE = "sentence"  # The key that the first argument gives, if that is no key=value


@dataclass(frozen=True)
class Config:
    """Keys of `s2a do`.

    Attributes:
        sentence: the task in words: the first argument, in quotation marks; or null with a goal.
        goal: a YAML file of relations that the room is to satisfy (docs/do.md), instead of a sentence; or null.
        opened: ids of parts that stand open by 0.2 m when the robot starts, or all; needs a goal.
        stage: the sim.usd of the room.
        scene: the descriptive.usda of the room, with the annotator's labels and the furniture that parts belong to; null: labels
            come from ids.
        out: the do.json to write.
        images: folder for an image of the room after each skill, 1_open.png and so on, or null.
        states: npz file for the pose of everything after every control step, for s2a view; needs a robot that drives; or null.
        llm: the language model.
        record: a file for the model's answers, to replay them, or null.
        plan_only: Plan and check, and execute nothing.
        retries: number of answers of the model that may be rejected, per plan.
        replans: number of further plans of the model after a skill has failed.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: seed of the start noise.
        robot: the robot that the stage was prepared for, such as panda or baxter; or one that drives, such as panda_mobile.
        sim: physics settings, the same for all skills.
        tasks: files of further tasks, each a skill by the name of its file (docs/new_task.md).
        skills: the task of each skill, and the thresholds of its metrics.
        planner: the planner's motion.
        policy: policy for the skills of its task, instead of the planner: an .onnx or .depth; pretrained or
            pretrained_depth, which open; null: none.
        camera: how images are taken.
        depth_camera: the cameras of a policy with depth cameras.
    """

    sentence: str | None
    goal: Path | None
    opened: str | tuple[str, ...]
    stage: Path
    scene: Path | None
    out: Output
    images: Output | None
    states: Output | None
    llm: LlmConfig
    record: Output | None
    plan_only: bool
    retries: CountFromZero
    replans: CountFromZero
    device: str
    seed: CountFromZero
    robot: Robot
    sim: SimConfig
    tasks: tuple[Path, ...]
    skills: Skills
    planner: PlannerConfig
    policy: Path | None
    camera: CameraConfig
    depth_camera: DepthCameraConfig


def run(config: Config) -> str:
    """Do what a sentence says, or reach a goal, write the record, and return what was done.

    Raises:
        InputError: a sentence that is ambiguous, of unknown things or impossible; a goal that the room cannot have; nothing is
            written.
        CheckFailed: a skill failed, and no other plan did better, or a relation of the goal does not hold; the record is written.
    """
    _check_keys(config)
    sentence = check_sentence(config.sentence) if config.sentence is not None else ""
    model = choose(config.llm, config.record, rules) if sentence else None
    described = descriptive.read(config.scene) if config.scene else None
    room = sim_stage.read(config.stage)
    refuse_unphysical(config.stage, room)
    skills = tasks_of(config.skills)
    opening = max(getattr(each.task, "opening", 0.0) for each in vars(config.skills).values())
    context = RoomContext(room, described, config.robot.name, opening, skills)
    start: RoomChange = RoomChange()
    relations: tuple[goals.Condition, ...] = ()
    if config.goal:
        facts = gather(room, described, {}, config.robot.name)
        relations = goals.read(config.goal, facts)
        start = goals.opened(room, goals.listed(config.opened, facts, "key 'opened'"), OPENED)
    usage = UsageLog(config.llm.prices)
    replans = 0 if kind_of(config.llm) == "rules" else config.replans  # the rules have one plan a sentence
    live = LiveRoom(config.stage, room, _settings(config), start) if _drives(config) else None
    executor = live.execute if live else None if config.plan_only else _executor(config, room)
    with atomic_write(config.out) as out:
        if model:
            result = do(context, sentence, model, config.retries, replans, usage, executor)
        else:
            assert executor is not None, "a goal is not only planned"
            result = goals.pursue(context, relations, executor, live.settle() if live else start)
        record = _record(config, sentence, result, usage) | (live.about() if live else {})
        if config.goal:
            record |= {"goal": [each.words for each in relations], "opened": [*start.joints], "unmet": result.unmet}
        out.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    if live and config.states and live.frames.q:  # none where no skill had a plan
        with atomic_write(config.states) as out:
            states.write(live.states(not result.problem), out)
    if result.problem:
        raise CheckFailed(_summary(config, result))
    return _summary(config, result)


def _drives(config: Config) -> bool:
    return config.robot.drive is not None and not config.plan_only


def _check_keys(config: Config) -> None:
    """Raise InputError for keys that exclude each other."""
    if (config.sentence is None) == (config.goal is None):
        raise InputError('give a sentence, such as s2a do "open the top drawer", or goal=FILE.yaml; not both')
    if config.opened and not config.goal:
        raise InputError("key 'opened' needs a goal; a sentence begins in the room as its file has it")
    if config.goal and config.plan_only:
        raise InputError("key 'plan_only' needs a sentence: skills for a goal are chosen one after the other")
    if config.images and config.images.exists() and not config.images.is_dir():
        raise InputError(f"key 'images' is {str(config.images)!r}, a file; give a folder")
    drives = _drives(config)
    if not drives and config.states:
        raise InputError("key 'states' records a robot that drives; give robot=panda_mobile, without plan_only=true")
    if drives and (name := "images" if config.images else "policy" if config.policy else ""):
        raise InputError(f"key {name!r} needs a robot with a fixed base; leave it out, or give robot=panda")


def _settings(config: Config) -> ExecutionConfig:
    """Return how skills are executed."""
    return ExecutionConfig(
        config.robot.name,
        device_of(config.device),
        config.seed,
        config.sim,
        config.skills,
        config.planner,
        config.camera,
        read_policy(config.policy, config.depth_camera) if config.policy else None,
    )


def _executor(config: Config, room: sim_stage.SimRoom) -> Any:
    """Return what executes a skill in an episode of its own."""
    settings = _settings(config)
    tasks = {each.task.name for each in vars(config.skills).values()}
    if settings.policy and not settings.policy.world:
        raise InputError(
            f"policy {config.policy}: does not state its task; write it with s2a.api.export_policy (docs/own_network.md)"
        )
    if settings.policy and settings.policy.world and (task := settings.policy.world[1].name) not in tasks:
        raise InputError(f"policy {config.policy}: of task {task}; give one of {', '.join(sorted(tasks))}")

    def executor(skill: Any, state: Any, number: int) -> Any:
        image = None
        if config.images:
            config.images.mkdir(parents=True, exist_ok=True)
            image = config.images / f"{number}_{skill.skill}.png"
        return execute(skill, config.stage, room, state, settings, image)

    return executor


def _record(config: Config, sentence: str, result: Result, usage: UsageLog) -> dict[str, Any]:
    """Return what is written."""
    return {
        "sentence": sentence or None,
        "stage": str(config.stage),
        "scene": str(config.scene) if config.scene else None,
        "llm": kind_of(config.llm) if sentence else None,
        "seed": config.seed,
        "robot": config.robot.name,
        "done": not result.problem and bool(result.skills),
        "problem": result.problem,
        "plans": result.plans,
        "skills": result.skills,
        "between_skills": "the arm is set to home and its base to the next skill's place; neither way is simulated",
        "answers": usage.entries,
        "total": usage.total(),
        **provenance(device_of(config.device)),
    }


def _summary(config: Config, result: Result) -> str:
    """Return what was done, a line a skill."""
    head = "planned, not executed" if config.plan_only else f"not done: {result.problem}" if result.problem else "done"
    if result.unmet:
        head = f"{len(result.unmet)} relations do not hold"
    lines = [f"{config.out}: {head}", *(f"  {words}: {reason}" for words, reason in result.unmet.items())]
    if config.plan_only:
        return "\n".join([*lines, *(f"  {check}" for check in result.plans[-1]["checks"])])
    for each in result.skills:
        names = " ".join(filter(None, (each["skill"], each["object"], each["part"] or each["support"])))
        lines.append(f"  {names}: {'succeeded' if each['success'] else 'failed'}, {each['seconds']:.0f} s")
    return "\n".join(lines)
