"""MuJoCo on the CPU instead of MuJoCo Warp: one MjData per environment, stepped in threads.

The interface remains mjlab's arrays. Inputs (state, controls, forces, per-environment model fields) are copied to
MuJoCo before each call; outputs are copied back, after intermediate physics steps only the state. Rewards, observations
and randomization therefore use the same code as on a GPU. Arrays outside OUTPUT_FIELDS keep their initial values.

On a plane both engines give equal steps; on a heightfield their contacts differ.
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

INPUT_FIELDS = ("qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied")
"""Input fields of the data."""

OUTPUT_FIELDS = (
    *("qpos", "qvel", "qacc", "xpos", "xquat", "xmat", "xipos", "site_xpos", "site_xmat", "geom_xpos", "geom_xmat"),
    *("cvel", "subtree_com", "qfrc_actuator", "actuator_force", "sensordata"),
)
"""Fields of the data that MuJoCo computes and that are copied back, besides the time."""

STATE = ("qpos", "qvel")
"""Output fields that motors read."""


class _Inputs:
    """An input array (n, …) of mjlab, and the views of its rows in each MjData."""

    def __init__(self, array: np.ndarray, views: list[np.ndarray]):
        self._array, self._views = array, views
        self._synced = np.full_like(array, np.nan)

    def copy_changed(self) -> None:
        """Copy the changed rows to MjData."""
        changed = np.flatnonzero((self._synced != self._array).reshape(len(self._array), -1).any(axis=1))
        for row in changed:
            self._views[row][...] = self._array[row]
        self._synced[changed] = self._array[changed]

    def read(self, rows: np.ndarray) -> None:
        """Copy `rows` from MjData."""
        for row in rows:
            self._array[row] = self._views[row]
        self._synced[rows] = self._array[rows]

    def mark_synced(self) -> None:
        """Mark the array as equal to MjData."""
        self._synced[:] = self._array


class _Outputs:
    """An output array (n, …) of mjlab, and the views of its rows in each MjData."""

    def __init__(self, array: np.ndarray, views: list[np.ndarray]):
        self._array, self._views = array, views
        self._flat = [view.reshape(-1) for view in views]
        self._all = np.empty(array.size)

    def write(self) -> None:
        """Copy all rows from MjData, concatenated first, because one copy is faster than n."""
        np.concatenate(self._flat, out=self._all)
        self._array[...] = self._all.reshape(self._array.shape)

    def read(self, rows: np.ndarray) -> None:
        """Copy `rows` from MjData."""
        for row in rows:
            self._array[row] = self._views[row].reshape(self._array.shape[1:])


class PlainSimulation(Simulation):
    """Replacement for a CPU simulation of mjlab that keeps its arrays."""

    def __init__(self, simulation: Simulation):
        self.__dict__.update(simulation.__dict__)  # mjlab's scene already refers to these arrays
        self._template = copy.copy(simulation.mj_model)
        self._template.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # as in Warp: divergence terminates
        self._template.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE  # inertia axes may be randomized
        self._models = [self._template] * self.num_envs
        self._states = [mujoco.MjData(self._template) for _ in range(self.num_envs)]
        self._time = self._array("time")
        self._inputs = {name: _Inputs(self._array(name), self._views(name)) for name in INPUT_FIELDS}
        self._outputs = {name: _Outputs(self._array(name), self._views(name)) for name in OUTPUT_FIELDS}
        self._model_fields: dict[str, np.ndarray] = {}
        """Model fields as last copied to the models."""
        threads = min(len(os.sched_getaffinity(0)), self.num_envs)
        self._chunks = [range(self.num_envs)[first::threads] for first in range(threads)]
        self._threads = ThreadPoolExecutor(threads)

    def step(self) -> None:
        """One physics step; outputs other than the state are those at its beginning, as in MuJoCo Warp."""
        self._run(mujoco.mj_step)

    def step_between(self) -> None:
        """One physics step that copies back only state and time."""
        self._run(mujoco.mj_step, STATE)

    def forward(self) -> None:
        """Compute all outputs from the state."""
        self._run(mujoco.mj_forward)

    def reset(self, env_ids: torch.Tensor | None = None) -> None:
        """Reset to the model's initial state; `env_ids`: a mask (n,) or indices, None for all."""
        mask = torch.zeros(self.num_envs, dtype=torch.bool)
        mask[slice(None) if env_ids is None else env_ids] = True
        rows = np.flatnonzero(mask.numpy())
        for row in rows:
            mujoco.mj_resetData(self._models[row], self._states[row])
        for array in (*self._inputs.values(), *(self._outputs[name] for name in ("qacc", "sensordata"))):
            array.read(rows)
        self._time[rows] = 0.0

    def recompute_constants(self, level: RecomputeLevel) -> None:
        """Recompute all constants that depend on masses and inertias, in every model, whatever the level."""
        self._copy_changed_models()
        scratch = mujoco.MjData(self._template)
        for model in self._models:
            mujoco.mj_setConst(model, scratch)
        for name in sorted(self._expanded_fields):
            values = self._model_fields[name]
            values[:] = [getattr(model, name).reshape(values.shape[1:]) for model in self._models[: len(values)]]
            self._field(name)[:] = values

    def _run(
        self, function: Callable[[mujoco.MjModel, mujoco.MjData], None], outputs: tuple[str, ...] = OUTPUT_FIELDS
    ) -> None:
        self._copy_changed_models()
        for array in self._inputs.values():
            array.copy_changed()

        def run_rows(rows: range) -> None:
            models, states = self._models, self._states
            for row in rows:
                function(models[row], states[row])

        with self.nan_guard.watch(self.data):
            list(self._threads.map(run_rows, self._chunks))
        for name in outputs:
            self._outputs[name].write()
        for name in STATE:
            self._inputs[name].mark_synced()
        self._time[:] = [state.time for state in self._states]

    def _copy_changed_models(self) -> None:
        """Copy changed per-environment model fields, and gravity, to the models."""
        for name in (*sorted(self._expanded_fields), "gravity"):
            field = self._field(name)
            synced = self._model_fields.get(name)
            if synced is None or synced.shape != field.shape:
                synced = self._model_fields[name] = np.full_like(field, np.nan)
            changed = np.flatnonzero((synced != field).reshape(len(field), -1).any(axis=1))
            if len(changed) == 0:
                continue
            if self._models[0] is self._template:
                self._models = [copy.copy(self._template) for _ in range(self.num_envs)]
            for row in range(self.num_envs) if len(field) == 1 else changed:
                owner = self._models[row].opt if name == "gravity" else self._models[row]
                target = getattr(owner, name)
                target[:] = field[min(row, len(field) - 1)].reshape(target.shape)
            synced[:] = field

    def _field(self, name: str) -> np.ndarray:
        """View of a field of mjlab's model (n or 1, …); slopes replace the array of gravity."""
        owner = self._wp_model.opt if name == "gravity" else self._wp_model
        return wp.to_torch(getattr(owner, name)).numpy()

    def _array(self, name: str) -> np.ndarray:
        """View of an array of mjlab's data (n, …)."""
        return wp.to_torch(getattr(self._wp_data, name)).numpy()

    def _views(self, name: str) -> list[np.ndarray]:
        """Views of a field in each MjData."""
        return [getattr(state, name) for state in self._states]
