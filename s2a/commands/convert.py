"""Command `s2a convert`: write a simulation-ready stage as MJCF or URDF, for other simulators."""

from s2a.certify.convert import FILES, PAIRS, ConvertSettings, convert
from s2a.certify.links import LinkedRoom

Config = ConvertSettings


def run(config: Config) -> str:
    """Write the room in another format; return what is in it.

    Raises:
        InputError: no simulation-ready stage; an id that cannot move; `out` is a file, or a folder of something else.
    """
    linked = convert(config)
    return "\n".join([f"{config.out / FILES[config.to]}: {_count(linked)}", *_lost(config, linked)])


def _count(linked: LinkedRoom) -> str:
    jointed = sum(i in linked.room.articulations for i in linked.active)
    hulls = sum(len(link.colliders) for link in linked.links.values())
    surfaces = sum(len(link.visuals) for link in linked.links.values())
    return (
        f"{jointed} articulated parts and {len(linked.active) - jointed} free objects move; "
        f"{hulls} convex hulls, {surfaces} surfaces"
    )


def _lost(config: Config, linked: LinkedRoom) -> list[str]:
    """Return a line about what URDF cannot hold."""
    if config.to != "urdf":
        return []
    joint = config.sim.joint
    unit = "N/m at the grasp point" if joint.spring == "grasp" else "N/m or N m/rad"
    lines = [f"  {PAIRS}: {len(linked.filtered())} pairs of links that do not collide"]
    if joint.stiffness:
        lines.append(
            f"  without the spring of {joint.stiffness:g} {unit} that closes each part, which URDF cannot hold"
        )
    return lines
