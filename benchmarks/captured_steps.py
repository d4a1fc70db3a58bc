"""Control steps replayed as CUDA graphs, compared with eager control steps: results and time.

    python -m benchmarks.captured_steps --bundle DIR [--device cuda|cpu] [--num-envs N] [--steps N] [--preset NAME]
                                        [--json]

Both runs use the same seed and actions, without noise and pushes. After a few steps, some of them replayed, the mean
differences of rewards and motion features are compared over environments whose first episode continues; individual ones
differ by accumulated rounding. After more steps, in which episodes have ended, every environment that has just been
reset must have one frame of history, joints within limits and a standing height. PyTorch counts the synchronizations
with the GPU over one period of all recurring work. Finally, robots in the air must fall along their gravity, which is
tilted if the preset has slopes. Actions and heights are the T1's, so the bundle must be of a T1.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import torch

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.report import Bar, machine, report  # noqa: E402
from pipeline.physics import GRAVITY  # noqa: E402
from pipeline.training.bundle import read_bundle  # noqa: E402
from pipeline.training.captured import WARM_UP  # noqa: E402
from pipeline.training.config import DEFAULT, preset  # noqa: E402
from pipeline.training.environment import VELOCITY_STEPS, AmpEnvironment  # noqa: E402
from pipeline.training.mdp.observations import HISTORY  # noqa: E402

COMPARED = WARM_UP + 8
"""Control steps before the comparison."""
CALM = {"randomization.noise": 0.0, "pushes.impulse_n_s": (0.0, 0.0), "pushes.kick_m_s": (0.0, 0.0)}
DIFFERENCE = 1e-3
"""Largest mean difference relative to the largest value."""
ASTRAY_M = 1e-4
"""Largest deviation [m]; slopes of 8 degrees change the path by 0.0012 m."""
HEIGHT_M = (0.5, 0.9)
"""Range of root heights at the start of an episode [m]."""


@dataclass(frozen=True, kw_only=True)
class Run:
    """Result of a run, captured or eager; tensors of all environments (n, ...)."""

    reward: torch.Tensor
    features: torch.Tensor
    lived: torch.Tensor
    """Whether the first episode of each environment has not ended."""
    begun: int
    """Number of environments whose episode begins at the last step."""
    sound: int
    """Number of these environments with a valid start."""
    astray_m: float
    """Largest deviation of a falling robot from the path of its gravity [m]."""
    seconds: float
    """Duration of a control step."""
    waits: int


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, default=ROOT / "data" / "policies" / "t1" / "bundle")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--preset", default=DEFAULT)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    launched, replayed = (_run(given, captured) for captured in (False, True))
    alive = launched.lived & replayed.lived
    bars = [Bar(name="robots compared", value=int(alive.sum()), sense=">=", bound=1)]
    for name in ("reward", "features"):
        ours, others = getattr(replayed, name)[alive], getattr(launched, name)[alive]
        away = float((ours - others).abs().mean() / others.abs().max())
        bars.append(
            Bar(name=f"{name}: mean difference", value=away, unit="of the largest", sense="<=", bound=DIFFERENCE)
        )
    for name, run in (("launched", launched), ("replayed", replayed)):
        bars += [
            Bar(name=f"{name}: episodes that begin", value=run.begun, sense=">=", bound=1),
            Bar(name=f"{name}: of these not sound", value=run.begun - run.sound, sense="<=", bound=0),
            Bar(name=f"{name}: fell astray", value=run.astray_m, unit="m", sense="<=", bound=ASTRAY_M),
            Bar(name=f"{name}: a control step", value=1e3 * run.seconds, unit="ms"),
            Bar(name=f"{name}: waits in {VELOCITY_STEPS} steps", value=run.waits, sense="<=", bound=0),
        ]
    return 0 if report(bars, machine=machine(), json=given.json) else 1


def _run(given: argparse.Namespace, captured: bool) -> Run:
    """Run an environment, captured or eager, from its seed."""
    config = preset(given.preset).changed({**CALM, "simulation.num_envs": given.num_envs})
    env = AmpEnvironment(read_bundle(given.bundle), config, given.device, 1, captured=captured)
    env.reset(seed=1)
    drawn = torch.Generator(device=given.device).manual_seed(2)
    lived = torch.ones(given.num_envs, dtype=torch.bool, device=given.device)

    def step() -> torch.Tensor:
        action = 0.3 * torch.randn(given.num_envs, 21, device=given.device, generator=drawn)
        observation, *_ = env.step(action)
        return observation["actor"]

    with torch.inference_mode():
        for _ in range(COMPARED):
            step()
            lived &= ~env.reset_buf
        reward, features = env.reward_buf.clone(), env.motion_features()
        for _ in range(VELOCITY_STEPS * (WARM_UP + 2)):
            step()
        env.episode_length_buf[: max(1, given.num_envs // 8)] = env.max_episode_length
        seen = step()
        begun, sound = env.reset_buf.clone(), _sound(env, seen)
        _finish(given.device)
        started = time.perf_counter()
        for _ in range(given.steps):
            step()
        _finish(given.device)
        seconds = (time.perf_counter() - started) / given.steps
        waits = _waits(step) if given.device != "cpu" else 0
        astray_m = _astray_m(env)
    return Run(
        astray_m=astray_m,
        reward=reward,
        features=features,
        lived=lived,
        begun=int(begun.sum()),
        sound=int((begun & sound).sum()),
        seconds=seconds,
        waits=waits,
    )


def _sound(env: AmpEnvironment, seen: torch.Tensor) -> torch.Tensor:
    """Environments (n,) with a valid state for the start of an episode."""
    frames = seen.unflatten(1, (HISTORY, -1))
    first = (frames[:, :-1] == 0.0).flatten(1).all(dim=1) & (frames[:, -1] != 0.0).any(dim=1)
    height, joints = env.sim.data.qpos[:, 2], env.sim.data.qpos[:, 7:]
    low, high = env.joint_limits
    inside = ((joints >= low) & (joints <= high)).all(dim=1)
    return first & inside & (height > HEIGHT_M[0]) & (height < HEIGHT_M[1]) & (env.episode_length_buf == 0)


def _astray_m(env: AmpEnvironment) -> float:
    """Largest deviation of a falling robot's centre of mass from the path of its (tilted) gravity in two steps, in the
    default pose above the ground, with slopes at their maximum [m]."""
    env.set_disturbance(1.0)
    env.step(torch.zeros(env.num_envs, 21, device=env.device))
    data, root = env.sim.data, env.scene["robot"].indexing.root_body_id
    data.qpos[:, 2] += 5.0
    data.qpos[:, 7:] = env.default_joint_pos
    data.qvel[:] = 0.0
    env.sim.forward()
    begun = data.subtree_com[:, root].clone()
    for _ in range(2):
        env.step(torch.zeros(env.num_envs, 21, device=env.device))
    steps = round(2 * env.step_dt / env.physics_dt)
    fall_m = 0.5 * steps * (steps + 1) * env.physics_dt**2 * GRAVITY
    off = (data.subtree_com[:, root] - begun - fall_m * env.slopes.down_w).norm(dim=1)
    return float(off[env.episode_length_buf >= 2].max())


def _waits(step) -> int:
    """Number of synchronizations with the GPU in one period of all recurring work."""
    torch.cuda.set_sync_debug_mode("warn")
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        for _ in range(VELOCITY_STEPS):
            step()
    torch.cuda.set_sync_debug_mode("default")
    return len(seen)


def _finish(device: str) -> None:
    if device != "cpu":
        torch.cuda.synchronize()


if __name__ == "__main__":
    raise SystemExit(main())
