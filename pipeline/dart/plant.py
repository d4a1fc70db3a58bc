"""A robot on flat ground in DART, with the `Plant` interface: torques in, state and foot forces out."""

from collections.abc import Iterator
from xml.etree import ElementTree as Xml

import numpy as np
from jaxtyping import Float

from pipeline import rotation
from pipeline.errors import PipelineError
from pipeline.physics import GRAVITY
from pipeline.robot import Robot
from pipeline.simulation.mujoco_plant import added_moments
from pipeline.simulation.plant import Plant, PlantState, standing_state

try:  # the only package that needs desktop libraries
    import dartpy as dart
except ImportError as error:
    do = "Install the project, and the libraries libGL and libX11 (Debian: apt install libgl1 libx11-6)."
    raise PipelineError(f"walks in DART need the package dartpy, which can't be loaded ({error}). {do}") from error


def dart_skeleton(robot: Robot, friction: float) -> dart.dynamics.Skeleton:
    """Build a skeleton with a floating root, self-collision and position limits; the motors limit speed and torque."""
    loader = dart.utils.DartLoader()
    skeleton = loader.parseSkeletonString(dynamics_urdf(robot), dart.common.Uri(""))
    skeleton.enableSelfCollisionCheck()
    skeleton.disableAdjacentBodyCheck()
    for name in robot.joint_names:
        joint = skeleton.getJoint(name)
        joint.setLimitEnforcement(True)
        joint.setVelocityLowerLimit(0, -np.inf)
        joint.setVelocityUpperLimit(0, np.inf)
        joint.setForceLowerLimit(0, -np.inf)
        joint.setForceUpperLimit(0, np.inf)
    for name in robot.link_names:
        set_friction(skeleton.getBodyNode(name), friction)
    for name, moment in added_moments(robot).items():
        body = skeleton.getBodyNode(name)
        own = body.getInertia()
        body.setInertia(dart.dynamics.Inertia(own.getMass(), own.getLocalCOM(), own.getMoment() + moment))
    return skeleton


def ground_skeleton(friction: float) -> dart.dynamics.Skeleton:
    """Build the ground: a fixed box whose top is the plane z = 0."""
    thickness, side = 1.0, 400.0
    skeleton = dart.dynamics.Skeleton("ground")
    _, body = skeleton.createWeldJointAndBodyNodePair()
    node = body.createShapeNode(dart.dynamics.BoxShape([side, side, thickness]))
    node.setRelativeTranslation([0.0, 0.0, -thickness / 2.0])
    node.createCollisionAspect()
    node.createDynamicsAspect()
    set_friction(body, friction)
    return skeleton


def set_friction(body: dart.dynamics.BodyNode, friction: float) -> None:
    """Set the friction coefficient of all shapes of a body, and zero restitution."""
    for index in range(body.getNumShapeNodes()):
        aspect = body.getShapeNode(index).getDynamicsAspect()
        aspect.setFrictionCoeff(friction)
        aspect.setRestitutionCoeff(0.0)


def dynamics_urdf(robot: Robot) -> str:
    """The URDF without visuals and without the massless links of sites, to which DART would assign a mass."""
    model = Xml.fromstring(robot.urdf)
    for element in list(model):
        site = element.tag == "link" and element.get("name") not in robot.link_names
        if site or (element.tag == "joint" and element.get("type") == "fixed"):
            model.remove(element)
        for visual in element.findall("visual"):
            element.remove(visual)
    return Xml.tostring(model, encoding="unicode")


class DartPlant(Plant):
    """DART's rigid bodies with hard contacts: a boxed linear complementarity problem, Dantzig's method."""

    def __init__(self, robot: Robot, timestep_s: float = 0.005, friction: float = 1.0):
        self.robot, self.timestep_s, self.friction = robot, timestep_s, friction
        self._feet_names = [robot.link_names[robot.tree.site_link[robot.site(name)]] for name in robot.feet]
        self.reset()

    def reset(self, state: PlantState | None = None) -> None:
        """Restart from a state; None: the default pose on the ground.

        The world is rebuilt, because collision detectors cache earlier pairs, which would make results irreproducible.
        """
        self._build()
        start = standing_state(self.robot) if state is None else state
        positions, velocities = self._skeleton.getPositions(), self._skeleton.getVelocities()
        positions[self._joints], velocities[self._joints] = start.joint_pos, start.joint_vel
        self._skeleton.setPositions(positions)
        pose = dart.math.Isometry3()
        pose.set_rotation(rotation.to_matrix(start.root_quat_w))
        pose.set_translation(start.root_pos_w)
        self._root.setTransform(pose)
        self._skeleton.setVelocities(velocities)
        self._set_root_velocity(start.root_lin_vel_w, rotation.rotate(start.root_quat_w, start.root_ang_vel_b))

    def _build(self) -> None:
        robot = self.robot
        self._skeleton = dart_skeleton(robot, self.friction)
        self._trunk = self._skeleton.getBodyNode(robot.root_link)
        self._root = self._skeleton.getRootJoint()
        self._joints = np.array([self._skeleton.getDof(name).getIndexInSkeleton() for name in robot.joint_names])
        self._feet = [self._skeleton.getBodyNode(name) for name in self._feet_names]
        self._sides = {
            body.getShapeNode(index).getName(): side
            for side, body in enumerate(self._feet)
            for index in range(body.getNumShapeNodes())
        }
        self._world = dart.simulation.World()
        self._world.setGravity([0.0, 0.0, -GRAVITY])
        self._world.setTimeStep(self.timestep_s)
        self._world.addSkeleton(ground_skeleton(self.friction))
        self._world.addSkeleton(self._skeleton)

    def state(self) -> PlantState:
        positions, velocities = self._skeleton.getPositions(), self._skeleton.getVelocities()
        quat_w = rotation.from_rotvec(positions[:3])
        return PlantState(
            root_pos_w=positions[3:6].copy(),
            root_quat_w=quat_w,
            root_lin_vel_w=np.array(self._trunk.getLinearVelocity()),
            root_ang_vel_b=rotation.rotate_inverse(quat_w, np.array(self._trunk.getAngularVelocity())),
            joint_pos=positions[self._joints],
            joint_vel=velocities[self._joints],
        )

    def step(self, torque: Float[np.ndarray, " j"], force_w: Float[np.ndarray, " 3"] | None = None) -> None:
        forces = np.zeros(self._skeleton.getNumDofs())
        forces[self._joints] = torque
        self._skeleton.setForces(forces)
        if force_w is not None:
            self._trunk.addExtForce(force_w, self._trunk.getLocalCOM(), False, True)
        self._world.step()

    def foot_wrench_w(self) -> Float[np.ndarray, "2 6"]:
        """Contact force [N] and moment about the foot links' origins [N m] on both feet in the last step."""
        wrench = np.zeros((2, 6))
        origins = [np.array(body.getWorldTransform().translation()).reshape(3) for body in self._feet]
        for side, point, force in self._foot_contacts():
            wrench[side, :3] += force
            wrench[side, 3:] += np.cross(point - origins[side], force)
        return wrench

    def kick(self, delta_v_w: Float[np.ndarray, " 3"]) -> None:
        """Add `delta_v_w` [m/s] to the velocity of the root and thereby of all links."""
        state = self.state()
        ang_vel_w = rotation.rotate(state.root_quat_w, state.root_ang_vel_b)
        self._set_root_velocity(state.root_lin_vel_w + delta_v_w, ang_vel_w)

    def _set_root_velocity(self, linear_w: np.ndarray, angular_w: np.ndarray) -> None:
        self._root.setAngularVelocity(angular_w)
        self._root.setLinearVelocity(linear_w)

    def _foot_contacts(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Foot index, contact point and force on the foot, per contact; DART reports the force on the first object."""
        result = self._world.getLastCollisionResult()
        for index in range(result.getNumContacts()):
            contact = result.getContact(index)
            for shape, sign in ((contact.collisionObject1, 1.0), (contact.collisionObject2, -1.0)):
                side = self._sides.get(shape.getShapeFrame().getName())
                if side is not None:
                    yield side, np.array(contact.point), sign * np.array(contact.force)
