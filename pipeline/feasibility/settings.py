"""Settings of KP5, read from `data/feasibility.yaml`. Importing this module registers all criteria."""

import typing
from dataclasses import dataclass
from typing import Any

from pipeline.feasibility.balance import BalanceSettings
from pipeline.feasibility.clip_criteria import CollisionSettings, LikenessSettings
from pipeline.feasibility.criterion import REGISTERED, Criterion
from pipeline.feasibility.foot_criteria import FootSettings
from pipeline.feasibility.joint_criteria import JointSettings
from pipeline.feasibility.motion import CutSettings
from pipeline.feasibility.root_criteria import RootSettings
from pipeline.feasibility.torque_criteria import TorqueSettings
from pipeline.feasibility.tracking_criteria import TrackingSettings
from pipeline.files.sourced import Unit
from pipeline.quality.sole import ContactSettings
from pipeline.robot.size import RobotSize


@dataclass(frozen=True, kw_only=True)
class FeasibilitySettings:
    """Parameters of the criteria, by section, and of the weights. Criteria are evaluated in the order of sections."""

    calibrated_on: RobotSize
    """Robot that the thresholds are valid for; `pipeline.robot.size.scaled` converts them for another one."""
    cut: CutSettings
    likeness: LikenessSettings
    joints: JointSettings
    torque: TorqueSettings
    contact: ContactSettings
    feet: FootSettings
    collision: CollisionSettings
    root: RootSettings
    tracking: TrackingSettings
    balance: BalanceSettings


def fault_of(criterion: Criterion, kind: type[FeasibilitySettings] = FeasibilitySettings) -> str:
    """Error in a criterion's threshold (no such field, another unit); empty if there is none."""
    section, _, name = criterion.limit.partition(".")
    fields: Any = typing.get_type_hints(typing.get_type_hints(kind).get(section, object), include_extras=True)
    units = [remark.name for remark in getattr(fields.get(name), "__metadata__", ()) if isinstance(remark, Unit)]
    if units == [criterion.unit]:
        return ""
    return f"'{criterion.code}': '{criterion.limit}' is in {units or 'no field'}, the criterion in '{criterion.unit}'"


for _each in REGISTERED.values():
    if _fault := fault_of(_each):
        raise TypeError(_fault)
