"""Registers the walking policy that Booster Lab exported."""

from booster_deploy.utils.registry import register_task

from .walk import BoosterLabWalkControllerCfg

register_task("booster_lab_walk", BoosterLabWalkControllerCfg())
