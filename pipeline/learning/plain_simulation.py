"""MuJoCo in the place of MuJoCo Warp where there is no GPU: each environment with a state of its own, in threads.

mjlab's arrays stay what everybody reads and writes. What is written to them (state, controls, forces, fields of the
model that environments have their own of) is taken up before MuJoCo works; what it works out is written back, of steps
between control steps the state alone. So rewards, observations and draws are the same code as on a GPU. Arrays not in
WRITTEN keep what they were made with.

On a plane both engines step alike; on a heightfield they find other contacts.
"""

import copy
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import mujoco
import numpy as np
import torch
import warp as wp
from mjlab.managers.event_manager import RecomputeLevel
from mjlab.sim import Simulation

TAKEN = ("qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied")
"""Of the data, what may be written from outside."""

WRITTEN = (
    *("qpos", "qvel", "qacc", "xpos", "xquat", "xmat", "xipos", "site_xpos", "site_xmat", "geom_xpos", "geom_xmat"),
    *("cvel", "subtree_com", "qfrc_actuator", "actuator_force", "sensordata"),
)
"""Of the data, what MuJoCo works out and is written back; the time too."""

STATE = ("qpos", "qvel")
"""Of that, what motors act by."""


class _Inputs:
    """An array (n, …) that is written from outside, and where each state has its row of it."""

    def __init__(self, array: np.ndarray, views: list[np.ndarray]):
        self._array, self._views = array, views
        self._known = np.full_like(array, np.nan)

    def take_up(self) -> None:
        """Rows that are not what the states have."""
        changed = np.flatnonzero((self._known != self._array).reshape(len(self._array), -1).any(axis=1))
        for row in changed:
            self._views[row][...] = self._array[row]
        self._known[changed] = self._array[changed]

    def read(self, rows: np.ndarray) -> None:
        """What the states have in some rows."""
        for row in rows:
            self._array[row] = self._views[row]
        self._known[rows] = self._array[rows]

    def know(self) -> None:
        """The array is what the states have."""
        self._known[:] = self._array


class _Outputs:
    """An array (n, …) that is written with what each state has."""

    def __init__(self, array: np.ndarray, views: list[np.ndarray]):
        self._array, self._views = array, views
        self._flat = [view.reshape(-1) for view in views]
        self._all = np.empty(array.size)

    def write(self) -> None:
        """All rows; joined first, as one copy for all costs less than one for each."""
        np.concatenate(self._flat, out=self._all)
        self._array[...] = self._all.reshape(self._array.shape)

    def read(self, rows: np.ndarray) -> None:
        """What the states have in some rows."""
        for row in rows:
            self._array[row] = self._views[row].reshape(self._array.shape[1:])


class PlainSimulation(Simulation):
    """Takes the place of a simulation that mjlab made on a processor, with its arrays."""

    def __init__(self, made: Simulation):
        self.__dict__.update(made.__dict__)  # mjlab's scene holds the arrays already: they must stay the same ones
        self._template = copy.copy(made.mj_model)
        self._template.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # Warp has none: who is lost, ends
        self._template.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # axes of inertia may be drawn
        self._models = [self._template] * self.num_envs
        self._states = [mujoco.MjData(self._template) for _ in range(self.num_envs)]
        self._time = self._array("time")
        self._inputs = {name: _Inputs(self._array(name), self._of_each(name)) for name in TAKEN}
        self._outputs = {name: _Outputs(self._array(name), self._of_each(name)) for name in WRITTEN}
        self._own: dict[str, np.ndarray] = {}
        """Fields of the models as they were last taken up."""
        threads = min(len(os.sched_getaffinity(0)), self.num_envs)
        self._parts = [range(self.num_envs)[first::threads] for first in range(threads)]
        self._threads = ThreadPoolExecutor(threads)

    def step(self) -> None:
        """One physics step of all; what else than the state is written back is of its beginning, as in Warp."""
        self._work(mujoco.mj_step)

    def step_between(self) -> None:
        """One physics step of which nobody reads more than state and time: nothing else is written back."""
        self._work(mujoco.mj_step, STATE)

    def forward(self) -> None:
        """Everything that follows from the state."""
        self._work(mujoco.mj_forward)

    def reset(self, env_ids: torch.Tensor | None = None) -> None:
        """The model's own state for some: a mask (n,) or indices; None: for all."""
        chosen = torch.zeros(self.num_envs, dtype=torch.bool)
        chosen[slice(None) if env_ids is None else env_ids] = True
        rows = np.flatnonzero(chosen.numpy())
        for row in rows:
            mujoco.mj_resetData(self._models[row], self._states[row])
        for kept in (*self._inputs.values(), *(self._outputs[name] for name in ("qacc", "sensordata"))):
            kept.read(rows)
        self._time[rows] = 0.0

    def recompute_constants(self, level: RecomputeLevel) -> None:
        """What follows from masses and inertias, in every environment's own model; all of it at any level."""
        self._take_up_models()
        scratch = mujoco.MjData(self._template)
        for model in self._models:
            mujoco.mj_setConst(model, scratch)
        for name in sorted(self._expanded_fields):
            known = self._own[name]
            known[:] = [getattr(model, name).reshape(known.shape[1:]) for model in self._models[: len(known)]]
            self._field(name)[:] = known

    def _work(self, work: Callable[[mujoco.MjModel, mujoco.MjData], None], written: tuple[str, ...] = WRITTEN) -> None:
        self._take_up_models()
        for given in self._inputs.values():
            given.take_up()

        def some(rows: range) -> None:
            models, states = self._models, self._states
            for row in rows:
                work(models[row], states[row])

        with self.nan_guard.watch(self.data):
            list(self._threads.map(some, self._parts))
        for name in written:
            self._outputs[name].write()
        for name in STATE:
            self._inputs[name].know()
        self._time[:] = [state.time for state in self._states]

    def _take_up_models(self) -> None:
        """Fields in which environments have become different, and gravity."""
        for name in (*sorted(self._expanded_fields), "gravity"):
            given = self._field(name)
            known = self._own.get(name)
            if known is None or known.shape != given.shape:
                known = self._own[name] = np.full_like(given, np.nan)
            changed = np.flatnonzero((known != given).reshape(len(given), -1).any(axis=1))
            if len(changed) == 0:
                continue
            if self._models[0] is self._template:
                self._models = [copy.copy(self._template) for _ in range(self.num_envs)]
            for row in range(self.num_envs) if len(given) == 1 else changed:
                owner = self._models[row].opt if name == "gravity" else self._models[row]
                target = getattr(owner, name)
                target[:] = given[min(row, len(given) - 1)].reshape(target.shape)
            known[:] = given

    def _field(self, name: str) -> np.ndarray:
        """A field of mjlab's model (n or 1, …): a view; slopes put another array there for gravity."""
        owner = self._wp_model.opt if name == "gravity" else self._wp_model
        return wp.to_torch(getattr(owner, name)).numpy()

    def _array(self, name: str) -> np.ndarray:
        """A view of an array of mjlab's data (n, …)."""
        return wp.to_torch(getattr(self._wp_data, name)).numpy()

    def _of_each(self, name: str) -> list[np.ndarray]:
        """Views of what every state has by that name."""
        return [getattr(state, name) for state in self._states]
