"""Environments in which rotors are on the links that they move, in part or wholly (`rotors.py`)."""

from __future__ import annotations

import mujoco
import numpy as np
import torch
from mjlab.managers.event_manager import RecomputeLevel, requires_model_fields

from pipeline.training.masks import replace
from pipeline.training.rotors import rotors_on_links

LEVELS = 5
"""Shares from none to all that environments have."""


@requires_model_fields("body_inertia", "body_iquat", "dof_armature", recompute=RecomputeLevel.set_const)
def draw_rotors_on_links(env, env_ids: torch.Tensor | None) -> None:
    """At the start: some environments have a share of their rotors on the links, the others none."""
    model, options, count = env.sim.mj_model, env.context.options, env.num_envs
    level = torch.randint(1, LEVELS, (count,), device=env.device)
    level *= torch.rand(count, device=env.device) < options.rotor_link_share
    moved = [rotors_on_links(model, each / (LEVELS - 1)) for each in range(LEVELS)]
    bodies = torch.from_numpy(np.unique(model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE]))
    rows = torch.arange(count, device=env.device)[:, None]
    bodies = bodies.long().to(env.device)[None]
    for name, values in zip(
        ("body_inertia", "body_iquat"), zip(*[each[:2] for each in moved], strict=True), strict=True
    ):
        table = torch.from_numpy(np.stack(values)).float().to(env.device)
        getattr(env.sim.model, name)[rows, bodies] = table[level][rows, bodies]
    table = torch.from_numpy(np.stack([armature for _, _, armature in moved])).float().to(env.device)
    replace(env.sim.model.dof_armature[:], torch.ones_like(level, dtype=torch.bool), table[level])
    env.rotor_link_share.copy_(level / (LEVELS - 1))
