"""Which policy an asset judges: the exported one, or an npz given by path."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dagster as dg

from assets.policy import served_policy
from assets.project import PROJECT
from pipeline.batch import Manifest


class JudgedPolicyConfig(dg.Config):
    """What is judged."""

    policy: str = ""
    """An npz to judge in place of the exported policy. The release report then calls it another policy's result."""


@dataclass(frozen=True, kw_only=True)
class JudgedPolicy:
    """A policy on the adapted robot, and the digest of what walks, whatever its manifest says."""

    deployed: Any
    digest: str


def judged_policy(config: JudgedPolicyConfig, exported: Manifest, robot: str) -> JudgedPolicy:
    """The policy that is meant. Raises FileError."""
    from pipeline.deployment import digest, load_policy
    from pipeline.validation.deployed import deployed

    policy = load_policy(Path(config.policy)) if config.policy else served_policy(exported)
    return JudgedPolicy(deployed=deployed(PROJECT.adapted_robot(robot), policy), digest=digest(policy))
