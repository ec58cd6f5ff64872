"""Velocity over the ground along beams fixed to the body, and velocimeters: Doppler radars and lidars.

With the velocity u over the earth and the deviations v and x, all in inertial axes, the innovation along a beam of the
direction d is ``R d . (u + v - W x x) - d . u``, as that of a body's velocity; with boresight errors e, in the body's
axes, d is ``C (b + e x b)`` (`mcnav.systems.ins.sensors.beams`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.systems.ins.reference.axes import ATTITUDE, VELOCITY, cross_matrix
from mcnav.systems.ins.sensors import body_velocity
from mcnav.systems.ins.sensors.beams import FURTHER, read_beams, select
from mcnav.systems.ins.sensors.comparison import Comparison, Difference, responses
from mcnav.systems.ins.sensors.quantity import BEAMS, Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.surroundings import Surroundings


def geometry(along: Surroundings, axis: int) -> Geometry:
    """Return the responses ``d x u`` to psi, d to v, that of ``-W x x`` to x, and ``b x C^T u`` to boresight errors."""
    beam, spin = along.arrangement[axis, :3], along.spin
    direction = np.asarray(along.body @ beam)
    of_body = np.einsum("nji,nj->ni", along.body, along.velocity)
    return Geometry(
        direction,
        psi=np.cross(direction, along.velocity),
        v=direction,
        x=np.stack([-spin * direction[:, 1], spin * direction[:, 0], np.zeros(len(direction))], axis=1),
        parameters=along.velocity,
        offsets={"boresight": np.cross(beam, of_body)},
        true=np.einsum("ni,ni->n", direction, along.velocity),
    )


def compare(at: Comparison) -> Difference:
    """Return ``(b + e x b) . C~^T v~ - b . C^T v`` with C from the body's axes."""
    true, indicated = at.true, at.indicated
    beams, to_body = at.arrangement[:, :3], (indicated.axes @ true.mounting).T
    used, velocity = beams + np.cross(at.offsets["boresight"], beams), to_body @ indicated.velocity
    true_velocity = beams @ ((true.axes @ true.mounting).T @ true.velocity)
    navigation = responses(len(beams))
    navigation[:, VELOCITY] = used @ to_body
    navigation[:, ATTITUDE] = used @ to_body @ cross_matrix(indicated.velocity)
    others = np.cross(beams, velocity) @ at.offset_states["boresight"]
    return Difference(used @ velocity - true_velocity, navigation, others, true=true_velocity)


QUANTITY: Final = QuantityDefinition(
    name="beam_velocity",
    axes=BEAMS,
    unit="m/s",
    shown_in="m/s",
    usual=0.1,
    geometry=geometry,
    innovation=body_velocity.innovation,
    compare=compare,
    scaled=True,
    by_beam=True,
)

SENSOR: Final = SensorType(
    name="velocimeter",
    words="Velocity over the ground, and distance to it, along one to three beams fixed to the body.",
    quantities={"velocity": "beam_velocity", "range": "beam_range"},
    interval=1.0,
    offsets=("boresight",),
    estimated=("boresight",),
    bounds_attitude=True,
    further=FURTHER,
    arrange=read_beams,
    select=select,
    template="""\
beams = [[0.383, 0.0, 0.924], [-0.191, 0.331, 0.924], [-0.191, -0.331, 0.924]]  # each forward, right, down
velocity = "2 cm/s"  # sigma of white noise along each beam, m/s
range = "0.5 m"  # the same of the distance to the ground, m; leave it out if it is not measured
boresight_error = "1 mrad"  # sigma of a constant error of the directions about each axis of the body, rad
# velocity_scale_factor = "0.1 %"  # sigma of a constant error in proportion to the velocity
# reach = "5 km"  # longest distance at which it measures, m; ground = "0 m" is the altitude of what the beams meet
""",
)
