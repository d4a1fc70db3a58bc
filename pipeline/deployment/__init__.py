"""Policy code of the robot: observation, network, joint targets. Used by engines, exports, logs; needs only numpy."""

from pipeline.deployment.controller import History, PolicyController, Reading, frame
from pipeline.deployment.policy import (
    Policy,
    PolicyGains,
    digest,
    find_policy,
    gains_by_joint,
    load_policy,
    save_policy,
)
from pipeline.deployment.task import DeploymentTask, deployment_task, policy_task
