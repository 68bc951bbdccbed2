"""The settings of a soft body; apart from its simulation, which takes a second to import."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import Count, Fraction, NotNegative, Positive


@dataclass(frozen=True)
class SoftShape:
    """How an asset is made a soft body.

    Attributes:
        length: of its longest extent [m].
        cells: of the simulated grid along that.
        fill: least fraction of a cell that the asset fills for the cell to be simulated.
    """

    length: Positive
    cells: Count
    fill: Fraction


@dataclass(frozen=True)
class SoftConfig:
    """A soft body and how it is simulated.

    Attributes:
        shape: of the body.
        density: [kg/m^3].
        shear: the material's modulus mu [Pa].
        bulk: its modulus lambda [Pa].
        damping: of its deformation [Pa s].
        particle_radius: by which the vertices stand off what they touch [m].
        contact_stiffness: of a vertex on what it touches [N/m].
        contact_damping: likewise [N s/m].
        friction: coefficient between the body and everything.
        friction_speed: below which friction is viscous [m/s]: a grip creeps by this times the fraction of friction it uses.
        contact_gap: up to which vertices are looked at for contact [m].
        substeps: of a control step; even.
        iterations: of VBD in a substep.
        arm_iterations: of MuJoCo's solver and of its line search.
        grip_stiffness: position gain of the finger joints [N/m].
        grip_force: with which each finger presses at most [N].
    """

    shape: SoftShape
    density: Positive
    shear: Positive
    bulk: Positive
    damping: NotNegative
    particle_radius: Positive
    contact_stiffness: Positive
    contact_damping: NotNegative
    friction: NotNegative
    friction_speed: Positive
    contact_gap: Positive
    substeps: Count
    iterations: Count
    arm_iterations: Count
    grip_stiffness: Positive
    grip_force: Positive
