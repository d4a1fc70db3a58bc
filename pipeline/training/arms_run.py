"""One run of arms from its request to its packed files: train, sweep, choose, measure, pack."""

from __future__ import annotations

import fcntl
import os
import signal
import time
from pathlib import Path
from typing import Any

from pipeline.learning.robot_facts import RobotFacts
from pipeline.learning.training_error import TrainingError
from pipeline.training.arm_pack import pack
from pipeline.training.arm_sweeps import Candidate, Sweeps, best, candidates
from pipeline.training.arms import ArmProcess, ArmsRequest
from pipeline.training.checkpoint_sweep import brief_walks, choosing_walks, measuring_walks

CHOOSE, MEASURE = "chosen_by", "measured"
LOOK_S = 2.0
"""How often it is looked what is new."""
TOLD = ("falls", "command_error", "survival", "score")


class ArmsRun:
    """The arms' processes, their sweeps and what was chosen."""

    def __init__(
        self, request: ArmsRequest, robot: RobotFacts, *, pack: Path | None, first: int, workers: int, brief: bool
    ):
        self._request, self._pack, self._first = request, pack, first
        self._arms = [ArmProcess(request=request, arm=arm, number=at) for at, arm in enumerate(request.arms)]
        self._choosing, self._measuring = (
            (brief_walks(), brief_walks()) if brief else (choosing_walks(), measuring_walks())
        )
        self._robot, self._workers = robot, workers
        self._began, self._packed = time.monotonic(), ()
        self._stopped = False

    def run(self) -> int:
        """Until every arm has its policy, or is stopped; 0 where all have. Raises TrainingError if one runs here."""
        out = self._request.out
        out.mkdir(parents=True, exist_ok=True)
        with (out / "process").open("a+") as held:
            try:
                fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise TrainingError(f"{out}: another process works there already.") from error
            held.truncate(0)
            held.write(str(os.getpid()))
            held.flush()
            (out / "done.txt").unlink(missing_ok=True)
            signal.signal(signal.SIGTERM, self._stop)
            signal.signal(signal.SIGINT, self._stop)
            sweeps = Sweeps(self._request.bundle, self._robot, self._workers)
            try:
                while self._turn(sweeps):
                    time.sleep(LOOK_S)
            finally:
                sweeps.close()
                for arm in self._arms:
                    arm.stop()
                self._bring(force=True)
            (out / "status.txt").replace(out / "done.txt")
            (out / "process").unlink()
        return 0 if all(self._chosen(arm) for arm in self._arms) else 1

    def _stop(self, number: int, frame: Any) -> None:
        self._stopped = True

    def _turn(self, sweeps: Sweeps) -> bool:
        """Look once at everything; whether there is more to do."""
        if self._stopped:
            return False
        busy = False
        for arm in self._arms:
            arm.keep_going()
            training = not arm.done and not arm.failed
            busy |= training
            found = self._candidates(arm)
            for each in found:
                sweeps.ask(each, CHOOSE, self._choosing)
            if not training and found and all(each.figures(CHOOSE) for each in found):
                chosen = best(found, CHOOSE)
                assert chosen is not None
                sweeps.ask(chosen, MEASURE, self._measuring)
        busy |= sweeps.gather() > 0
        self._bring()
        return busy or any(self._chosen(arm) is None and arm.checkpoints() for arm in self._arms)

    def _candidates(self, arm: ArmProcess) -> list[Candidate]:
        return candidates(arm.folder, arm.checkpoints(), self._first, arm.done or arm.failed)

    def _chosen(self, arm: ArmProcess) -> Candidate | None:
        """The best of an arm whose training is over, once it is measured."""
        chosen = best(self._candidates(arm), CHOOSE) if arm.done or arm.failed else None
        return chosen if chosen is not None and chosen.figures(MEASURE) is not None else None

    def _choice(self) -> dict[str, Any]:
        """Of each arm what was chosen, or is best so far, and its figures."""
        arms: dict[str, Any] = {}
        for arm in self._arms:
            found = self._candidates(arm)
            chosen = best(found, CHOOSE)
            known = {each.name: each.figures(CHOOSE) for each in found}
            arms[arm.arm.name] = {
                "seed": arm.arm.seed,
                "options": list(arm.arm.options),
                "state": _state(arm),
                "chosen": chosen.name if chosen else None,
                "final": self._chosen(arm) is not None,
                "scores": {name: {key: figures[key] for key in TOLD} for name, figures in known.items() if figures},
                "chosen_by": chosen.figures(CHOOSE) if chosen else None,
                "measured": chosen.figures(MEASURE) if chosen else None,
            }
        return {"preset": self._request.preset, "options": list(self._request.options), "arms": arms}

    def _bring(self, force: bool = False) -> None:
        """Tell the status, and pack where a sweep is new."""
        choice = self._choice()
        lines = [f"{time.monotonic() - self._began:.0f} s"]
        for arm in self._arms:
            told = choice["arms"][arm.arm.name]
            lines.append(f"{arm.arm.name} ({told['state']}): {arm.last_line()}")
            for kind in ("chosen_by", "measured"):
                if told[kind] is not None:
                    figures = ", ".join(f"{name} {told[kind][name]:.3f}" for name in TOLD)
                    lines.append(f"  {kind} {told['chosen']} of {len(told['scores'])}: {figures}")
        part = self._request.out / "status.part"
        part.write_text("\n".join(lines) + "\n")
        part.replace(self._request.out / "status.txt")
        state = tuple((told["chosen"], len(told["scores"]), told["final"]) for told in choice["arms"].values())
        if self._pack is not None and (force or state != self._packed):
            pack(self._pack, self._arms, choice)
            self._packed = state


def _state(arm: ArmProcess) -> str:
    if arm.done:
        return "trained"
    return "broke off" if arm.failed else f"start {arm.starts}"
