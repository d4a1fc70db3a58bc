"""Control steps that a GPU replays against the same steps told launch by launch: what they give and how long they take.

    python -m benchmarks.captured_steps --bundle DIR [--device cuda|cpu] [--num-envs N] [--steps N] [--preset NAME]

Both begin with the same seed and get the same actions. `differs` is the largest difference of rewards and features of a
robot whose episode has not ended, after a few steps, before the solver's rounding has grown into it. Waits of the
processor for the GPU in a step are counted by PyTorch.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

import torch

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from pipeline.training.bundle import read_bundle  # noqa: E402
from pipeline.training.captured import WARM_UP  # noqa: E402
from pipeline.training.environment import VELOCITY_STEPS, AmpEnvironment  # noqa: E402
from pipeline.training.presets import DEFAULT, preset  # noqa: E402

COMPARED = WARM_UP + 8
"""Steps until what both give is compared: some of them are replayed."""
CALM = {"noise": (0.0, 0.0, 0.0, 0.0), "push_impulse": (0.0, 0.0), "push_speed": (0.0, 0.0)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, default=ROOT / "data" / "policies" / "t1" / "bundle")
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--num-envs", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--preset", default=DEFAULT)
    given = parser.parse_args()
    told, replayed = (_run(given, captured) for captured in (False, True))
    alive = told["lived"] & replayed["lived"]
    for name in ("reward", "features"):
        away = (told[name] - replayed[name])[alive].abs()
        size = told[name][alive].abs().max()
        print(f"{name}: differs by {away.max():.2g} at most, {away.mean():.2g} on average, of {size:.3g}")
    print(f"robots compared: {int(alive.sum())} of {given.num_envs}")
    for name, run in (("told", told), ("replayed", replayed)):
        print(
            f"{name}: {1e3 * run['seconds']:.2f} ms a control step, {run['waits']} waits in {VELOCITY_STEPS} steps, "
            f"{run['falls']} falls a minute"
        )
    return 0


def _run(given: argparse.Namespace, captured: bool) -> dict:
    """Steps of one environment from its seed on."""
    options = preset(given.preset).changed(**CALM, captured=captured)
    env = AmpEnvironment(read_bundle(given.bundle), options, given.num_envs, given.device, seed=1)
    env.reset(seed=1)
    drawn = torch.Generator(device=given.device).manual_seed(2)
    lived = torch.ones(given.num_envs, dtype=torch.bool, device=given.device)
    found: dict = {}

    def step() -> None:
        action = 0.3 * torch.randn(given.num_envs, 21, device=given.device, generator=drawn)
        env.step(action)

    with torch.inference_mode():
        for _ in range(COMPARED):
            step()
            lived &= ~env.reset_buf
        found |= {"reward": env.reward_buf.clone(), "features": env.motion_features(), "lived": lived.clone()}
        for _ in range(VELOCITY_STEPS * (WARM_UP + 2)):
            step()
        env.record.take(env.step_dt)
        _finish(given.device)
        begun = time.perf_counter()
        for _ in range(given.steps):
            step()
        _finish(given.device)
        found["seconds"] = (time.perf_counter() - begun) / given.steps
        found["waits"] = _waits(step) if given.device != "cpu" else 0
    found["falls"] = round(env.record.take(env.step_dt)["falls_per_min"], 1)
    return found


def _waits(step) -> int:
    """Of the processor for the GPU, in as many steps as everything comes round in."""
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
