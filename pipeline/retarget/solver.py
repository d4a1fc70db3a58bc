"""Inverse kinematics with placo: one quadratic program per frame, warm-started from the previous frame.

There is one solver per process and robot, because placo leaks memory when a solver is freed, and building one takes
longer than solving a short clip. A solver keeps no state of a clip: every clip starts from the same state.
"""

from dataclasses import dataclass

import numpy as np
import placo
from jaxtyping import Bool, Float

from pipeline import rotation
from pipeline.clips.human_clip import FEET
from pipeline.errors import ClipError
from pipeline.quality.retargeting import LIMBS
from pipeline.retarget.robot_body import ankle_pitch, measure
from pipeline.retarget.settings import RetargetSettings, WeightSettings
from pipeline.retarget.solver_urdf import frame_on, solver_urdf
from pipeline.retarget.targets import Targets
from pipeline.robot import Robot

LEG = ("thigh", "shank")
"""Name suffixes of the leg segments in `LIMBS`."""
LIMIT_MARGIN = 1e-6
"""Distance [rad] kept from position limits, so that rounding stays inside them."""

ANKLE_MARGIN = 0.06
"""Distance [rad] kept from the ankle's toes-up limit; with the roll at its limit too, foot and shank would overlap."""

SAME = 1e-5
"""Largest difference [m, rad] of two solutions of a frame that are treated as equal."""

ROOT_QUAT = [6, 3, 4, 5]
"""Indices of the root's orientation, wxyz, in placo's state."""


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """Solution of the solver, t frames."""

    root_pos_w: Float[np.ndarray, "t 3"]
    root_quat_w: Float[np.ndarray, "t 4"]
    """wxyz, sign-continuous."""
    joint_pos: Float[np.ndarray, "t j"]


class Solver:
    """A robot in placo with all tasks. Not thread-safe; `solver_for` returns it."""

    def __init__(self, robot: Robot):
        self.robot, self.body = robot, measure(robot)
        self._wrapper = placo.RobotWrapper("", placo.Flags.ignore_collisions, solver_urdf(robot))
        self._joints = robot.controlled_index
        self._columns = np.array([self._wrapper.get_joint_offset(name) for name in robot.controlled])
        self._lower, self._upper = robot.joint_lower + LIMIT_MARGIN, robot.joint_upper - LIMIT_MARGIN
        for side in range(2):
            joint, sign = ankle_pitch(robot, side)
            limit = self._lower if sign > 0.0 else self._upper
            limit[joint] += sign * ANKLE_MARGIN
        for name in robot.controlled:
            lower, upper = (float(limit[robot.joint(name)]) for limit in (self._lower, self._upper))
            self._wrapper.set_joint_limits(name, lower, upper)
        self._solver = self._wrapper.make_solver()
        self._solver.enable_joint_limits(True)
        self._add_tasks()
        self._matrices: tuple | None = None

    def _add_tasks(self) -> None:
        solver, zero, identity = self._solver, np.zeros(3), np.eye(3)
        human = {part: frame_on(self.robot, name) for part, name in self.robot.human.items()}
        self._pelvis_horizontal = solver.add_position_task(human["pelvis"], zero)
        self._pelvis_horizontal.mask.set_axises("xy", "task")
        self._pelvis_height = solver.add_position_task(human["pelvis"], zero)
        self._pelvis_height.mask.set_axises("z", "task")
        self._trunk = solver.add_orientation_task(human["trunk"], identity)
        self._waist, self._posture = solver.add_joints_task(), solver.add_joints_task()
        self._foot_position = [solver.add_position_task(human[f"{side}_foot"], zero) for side in FEET]
        self._foot_height = [solver.add_position_task(human[f"{side}_foot"], zero) for side in FEET]
        for horizontal, height in zip(self._foot_position, self._foot_height, strict=True):
            horizontal.mask.set_axises("xy", "task")
            height.mask.set_axises("z", "task")
        self._foot_orientation = [solver.add_orientation_task(human[f"{side}_foot"], identity) for side in FEET]
        self._limbs = [
            solver.add_axisalign_task(human[limb], axis, axis)
            for (limb, _, _), axis in zip(LIMBS, self.body.limb_axes_b, strict=True)
        ]
        self._weighted = [  # tasks whose weights change, in the order of _weights_of_pelvis and _weights_of_foot
            ("pelvis_horizontal", [self._pelvis_horizontal]),
            ("pelvis_height", [self._pelvis_height]),
            ("foot_height", self._foot_height),
            ("leg", [task for (limb, _, _), task in zip(LIMBS, self._limbs, strict=True) if limb.endswith(LEG)]),
        ]
        for side, position, orientation in zip(FEET, self._foot_position, self._foot_orientation, strict=True):
            self._weighted += [(side, [position]), (side, [orientation])]

    def solve(
        self,
        clip: str,
        targets: Targets,
        posture: Float[np.ndarray, "t j"],
        posture_weight: float,
        settings: RetargetSettings,
        start: Trajectory | None = None,
        changed: Bool[np.ndarray, " t"] | None = None,
    ) -> Trajectory:
        """Joint motion within all limits that follows `targets`, and `posture` with `posture_weight`.

        Frame 0 is iterated from `posture`, or from the first frame of `start`.
        Raises ClipError with the clip and the frame if the program has no solution.

        Args:
            clip: name of the clip, for errors
            targets: targets of pelvis, feet, trunk and limbs
            posture: reference joint angles [rad]
            posture_weight: weight of `posture` [1/rad^2]
            settings: weights, rate and limits
            start: trajectory for similar targets
            changed: frames whose targets differ from those of `start`. Only these are solved, and the following ones
                until the motion equals `start` again; all others are copied from it. None: all frames are solved.
        """
        frames = len(posture)
        feed = _Feed(self, targets, posture, settings.weights)
        if start is None:
            self._start(targets.pelvis_pos_w[0], targets.trunk_quat_w[0], posture[0])
        else:
            self._start(start.root_pos_w[0], start.root_quat_w[0], start.joint_pos[0])
        self._configure(settings.weights, posture_weight)
        self._limit_speed(settings)
        states, todo = np.empty((frames, len(self._wrapper.state.q))), None
        if start is not None and changed is not None:
            states, todo = self._states_of(start), changed.tolist()
        solve, update_kinematics, state = self._solver.solve, self._wrapper.update_kinematics, self._wrapper.state
        solving = todo is None or todo[0]
        for frame in range(frames):
            if not solving:
                if todo is None or not todo[frame]:
                    continue
                self._go_to(states[frame - 1])
                self._solver.enable_velocity_limits(True)
            feed.set(frame)
            try:
                for _ in range(settings.settle_iterations if frame == 0 else 1):
                    step = solve(True)
                    update_kinematics()
                    if frame == 0 and np.abs(step).max() < SAME:
                        break
            except RuntimeError as error:
                problem = f"the inverse kinematics has no solution ({error})."
                raise ClipError(clip, "no_solution", problem, frame) from error
            if frame == 0:
                self._solver.enable_velocity_limits(True)
            q = state.q
            solving = todo is None or todo[frame] or bool(np.abs(q - states[frame]).max() > SAME)
            states[frame] = q
        joint_pos = np.tile(self.robot.default_joint_pos, (frames, 1))
        joint_pos[:, self._joints] = states[:, self._columns]
        return Trajectory(
            root_pos_w=states[:, :3].copy(),
            root_quat_w=rotation.make_continuous(states[:, ROOT_QUAT]),
            joint_pos=joint_pos,
        )

    def matrices_of(self, targets: Targets) -> tuple[Float[np.ndarray, "t 3 3"], Float[np.ndarray, "t 2 3 3"]]:
        """Rotation matrices of trunk and feet; cached, because the passes of a clip share them."""
        quats = (targets.trunk_quat_w, targets.foot_quat_w)
        if self._matrices is None or any(new is not old for new, old in zip(quats, self._matrices[0], strict=True)):
            self._matrices = (quats, (rotation.to_matrix(quats[0]), rotation.to_matrix(quats[1])))
        return self._matrices[1]

    def _start(
        self,
        root_pos_w: Float[np.ndarray, " 3"],
        root_quat_w: Float[np.ndarray, " 4"],
        joint_pos: Float[np.ndarray, " j"],
    ) -> None:
        self._solver.enable_velocity_limits(False)
        self._wrapper.reset()
        q = np.array(self._wrapper.state.q)
        q[:3] = root_pos_w
        q[ROOT_QUAT] = root_quat_w
        q[self._columns] = np.clip(joint_pos, self._lower, self._upper)[self._joints]
        self._go_to(q)

    def _go_to(self, q: Float[np.ndarray, " q"]) -> None:
        self._wrapper.state.q = q
        self._wrapper.update_kinematics()

    def _states_of(self, trajectory: Trajectory) -> Float[np.ndarray, "t q"]:
        """placo's states of a trajectory: root position, root orientation xyzw, joints."""
        states = np.tile(np.array(self._wrapper.state.q), (len(trajectory.joint_pos), 1))
        states[:, :3] = trajectory.root_pos_w
        states[:, ROOT_QUAT] = trajectory.root_quat_w
        states[:, self._columns] = trajectory.joint_pos[:, self._joints]
        return states

    def _limit_speed(self, settings: RetargetSettings) -> None:
        self._solver.dt = 1.0 / settings.fps
        limits = settings.speed_share * self.robot.retarget_speed_limit[self._joints]
        for name, limit in zip(self.robot.controlled, limits.tolist(), strict=True):
            self._wrapper.set_velocity_limit(name, limit)

    def _configure(self, weights: WeightSettings, posture_weight: float) -> None:
        self._trunk.configure("trunk", "soft", weights.trunk)
        self._waist.configure("waist", "soft", weights.waist)
        self._posture.configure("posture", "soft", posture_weight)
        for (limb, _, _), task in zip(LIMBS, self._limbs, strict=True):
            if not limb.endswith(LEG):
                task.configure(limb, "soft", weights.arms)


class _Feed:
    """Set the targets of a solver's tasks frame by frame.

    All numbers of a frame are copied into one buffer, and each task gets a view of it: slicing all arrays in every
    frame takes three times as long.
    """

    def __init__(self, solver: Solver, targets: Targets, posture: Float[np.ndarray, "t j"], weights: WeightSettings):
        self._solver = solver
        self._names, waist = solver.robot.controlled, solver.body.waist
        self._waist_name = None if waist is None else solver.robot.joint_names[waist]
        posture = posture[:, solver._joints]
        self._posture = None if (posture == posture[0]).all() else posture
        parts = (targets.pelvis_pos_w, *solver.matrices_of(targets), targets.foot_pos_w, targets.limb_dir_w)
        self._rows = np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)
        self._row, pieces, stop = np.empty(self._rows.shape[1]), [], 0
        for part in parts:
            start, stop = stop, stop + part[0].size
            pieces.append(self._row[start:stop].reshape(part.shape[1:]))
        self._pelvis, self._trunk, soles, feet, limbs = pieces
        self._feet = list(
            zip(solver._foot_position, solver._foot_height, feet, solver._foot_orientation, soles, strict=True)
        )
        self._limbs = list(zip(solver._limbs, limbs, strict=True))
        self._waist: list[float] = (solver.body.waist_sign * targets.waist_pos).tolist()
        if self._posture is None:
            solver._posture.set_joints(dict(zip(self._names, posture[0].tolist(), strict=True)))
        columns = [*_weights_of_pelvis(targets, weights), *_weights_of_foot(targets, 0, weights)]
        columns += _weights_of_foot(targets, 1, weights)
        self._weights = list(zip(*(column.tolist() for column in columns), strict=True))
        self._weights_now: tuple[float, ...] = (np.nan,) * len(columns)

    def set(self, frame: int) -> None:
        solver, self._row[:] = self._solver, self._rows[frame]
        solver._pelvis_horizontal.target_world = solver._pelvis_height.target_world = self._pelvis
        solver._trunk.R_world_frame = self._trunk
        if self._waist_name is not None:
            solver._waist.set_joint(self._waist_name, self._waist[frame])
        if self._posture is not None:
            for _ in map(solver._posture.set_joint, self._names, self._posture[frame].tolist()):
                pass
        for horizontal, height, foot, orientation, sole in self._feet:
            horizontal.target_world = height.target_world = foot
            orientation.R_world_frame = sole
        for task, direction in self._limbs:
            task.targetAxis_world = direction
        weights = self._weights[frame]
        if weights != self._weights_now:
            for (name, tasks), weight, now in zip(solver._weighted, weights, self._weights_now, strict=True):
                if weight != now:
                    for task in tasks:
                        task.configure(name, "soft", weight)
            self._weights_now = weights


Weight = Float[np.ndarray, " t"]


def _weights_of_pelvis(targets: Targets, weights: WeightSettings) -> tuple[Weight, Weight, Weight, Weight]:
    """Weights of the pelvis (horizontal, height), of the feet's height and of the legs' directions in each frame."""
    held, smoothed = targets.pelvis_held, targets.pelvis_smoothed
    horizontal = _between(weights.pelvis_horizontal, weights.pelvis_held, held)
    foot_height = _between(weights.foot_height, weights.foot_height_held, held)
    return (
        _between(horizontal, weights.path_smoothed, smoothed),
        _between(weights.pelvis_height, weights.path_smoothed, smoothed),
        _between(foot_height, weights.foot_height_smoothed, smoothed),
        _between(weights.legs, weights.legs_held, held),
    )


def _weights_of_foot(targets: Targets, side: int, weights: WeightSettings) -> tuple[Weight, Weight]:
    """Weights of a foot's horizontal position and of its orientation in each frame."""
    return (
        _between(weights.swing_position, weights.stance_position, targets.grip[:, side]),
        np.where(targets.contacts[:, side], weights.stance_orientation, weights.swing_orientation),
    )


def _between(low: float | Weight, high: float, share: Weight) -> Weight:
    """Geometric interpolation from `low` (share 0) to `high` (share 1)."""
    return np.where(share == 1.0, high, low * (high / low) ** share) if share.any() else np.full_like(share, low)


def solver_for(robot: Robot) -> Solver:
    """The solver of a robot in this process, built on first use."""
    if robot.digest not in _SOLVERS:
        _SOLVERS[robot.digest] = Solver(robot)
    return _SOLVERS[robot.digest]


_SOLVERS: dict[str, Solver] = {}
"""Solvers by the robot's digest; the only state that a process keeps between clips."""
