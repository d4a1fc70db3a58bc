"""What runs on the robot: observation, network, joint targets. Used by engines, exports and logs; needs only numpy."""

from pipeline.deployment.controller import History, PolicyController, frame
from pipeline.deployment.policy import Policy, PolicyGains, digest, load_policy, save_policy
from pipeline.deployment.task import DeploymentTask, deployment_task, policy_task

__all__ = [
    "DeploymentTask",
    "History",
    "Policy",
    "PolicyController",
    "PolicyGains",
    "deployment_task",
    "digest",
    "frame",
    "load_policy",
    "policy_task",
    "save_policy",
]
