"""Read an MJCF through MuJoCo's MjSpec."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from pipeline import rotation
from pipeline.errors import FileError
from pipeline.robot_import.maker_model import MakerJoint, MakerModel, MakerShape, MakerSite, link_of, quat_of

KINDS = {
    mujoco.mjtGeom.mjGEOM_BOX: ("box", 3),
    mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", 1),
    mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", 2),
    mujoco.mjtGeom.mjGEOM_CAPSULE: ("capsule", 2),
    mujoco.mjtGeom.mjGEOM_MESH: ("mesh", 0),
}


def read_mjcf(path: Path) -> MakerModel:
    """The robot in an MJCF: the body with the free joint, or the only one of the world. Raises FileError."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        notes = _without_missing_meshes(spec, path)
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        problem = f"MuJoCo cannot read it ({' '.join(str(error).split())})."
        raise FileError(path, problem, "Correct the MJCF.") from error
    root = _root(path, model)
    owner = _owners(path, model, root)
    bodies = [body for body in range(root, model.nbody) if owner.get(body) == body]
    index = {body: position for position, body in enumerate(bodies)}
    frames = {body: _in_owner(model, body, owner) for body in owner}
    stated = _full_inertias(spec)
    links = []
    for body in bodies:
        inertia = _lumped(model, [each for each in owner if owner[each] == body], frames, stated)
        parent = model.body_parentid[body]
        placement = pinocchio.SE3.Identity() if body == root else frames[parent] * _placement(model, body)
        joint = None if body == root else _joint(model, int(model.body_jntadr[body]))
        above = -1 if body == root else index[owner[parent]]
        links.append(link_of(model.body(body).name, above, joint, placement, inertia))
    name_of = {body: model.body(owner[body]).name for body in owner}
    shapes, more = _shapes(model, name_of, frames)
    sites = tuple(
        MakerSite(name=model.site(site).name, link=name_of[body], pos=np.array(frames[body].act(model.site_pos[site])))
        for site, body in enumerate(model.site_bodyid.tolist())
        if body in owner and model.site(site).name
    )
    return MakerModel(path=path, links=tuple(links), shapes=shapes, sites=sites, notes=(*notes, *more))


def _without_missing_meshes(spec: mujoco.MjSpec, path: Path) -> tuple[str, ...]:
    """Remove geoms whose mesh file is missing; return a sentence for each mesh."""
    folder = path.parent / spec.meshdir if spec.meshdir else path.parent
    missing = [mesh for mesh in spec.meshes if mesh.file and not (folder / mesh.file).is_file()]
    names = {mesh.name or Path(mesh.file).stem for mesh in missing}
    for geom in [geom for geom in spec.geoms if geom.meshname in names]:
        spec.delete(geom)
    for mesh in missing:
        spec.delete(mesh)
    return tuple(f"the mesh '{name}' is not there, so its shapes are missing." for name in sorted(names))


def _root(path: Path, model: mujoco.MjModel) -> int:
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist()
    top = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    found = free or top
    if len(found) != 1:
        problem = f"it has {len(free)} bodies with a free joint and {len(top)} bodies on the world."
        raise FileError(path, problem, "Leave the robot alone in the file, with a free joint on its root body.")
    return found[0]


def _owners(path: Path, model: mujoco.MjModel, root: int) -> dict[int, int]:
    """Each body of the robot with the movable body that it belongs to. Raises FileError for joints but one hinge."""
    owner = {root: root}
    for body in range(root + 1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent not in owner:
            continue
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        if count == 0:
            owner[body] = owner[parent]
            continue
        name, hinge = model.body(body).name, model.jnt_type[first] == mujoco.mjtJoint.mjJNT_HINGE
        if count > 1 or not hinge or np.any(np.abs(model.jnt_pos[first]) > 1e-9):
            problem = f"body '{name}' does not move on one hinge through its origin."
            raise FileError(path, problem, "Give it one hinge at its origin in a copy of the file, or none.")
        if not name or not model.joint(first).name:
            raise FileError(path, f"body {body} ('{name}') or its joint has no name.", "Name both.")
        owner[body] = body
    return owner


def _placement(model: mujoco.MjModel, body: int) -> pinocchio.SE3:
    return _se3(model.body_pos[body], model.body_quat[body])


def _se3(pos: np.ndarray, quat: np.ndarray) -> pinocchio.SE3:
    return pinocchio.SE3(Rotation.from_quat(np.roll(quat, -1)).as_matrix(), np.array(pos))


def _in_owner(model: mujoco.MjModel, body: int, owner: dict[int, int]) -> pinocchio.SE3:
    """Frame of a body in the frame of the movable body that it belongs to."""
    placement = pinocchio.SE3.Identity()
    while owner[body] != body:
        placement = _placement(model, body) * placement
        body = int(model.body_parentid[body])
    return placement


def _full_inertias(spec: mujoco.MjSpec) -> dict[str, np.ndarray]:
    """Body -> inertia matrix stated by the file; compiling converts them to principal axes with rounding."""
    found = {}
    for body in spec.bodies:
        if body.name and np.isfinite(body.fullinertia).all() and np.any(body.fullinertia):
            xx, yy, zz, xy, xz, yz = body.fullinertia
            found[body.name] = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return found


def _lumped(
    model: mujoco.MjModel, bodies: list[int], frames: dict[int, pinocchio.SE3], stated: dict[str, np.ndarray]
) -> pinocchio.Inertia:
    total = pinocchio.Inertia.Zero()
    for body in bodies:
        turn = Rotation.from_quat(np.roll(model.body_iquat[body], -1)).as_matrix()
        principal = turn @ np.diag(model.body_inertia[body]) @ turn.T
        about = stated.get(model.body(body).name, principal)
        own = pinocchio.Inertia(float(model.body_mass[body]), np.array(model.body_ipos[body]), about)
        if own.mass > 0.0:
            total = total + frames[body].act(own)
    return total


def _joint(model: mujoco.MjModel, joint: int) -> MakerJoint:
    limited = bool(model.jnt_limited[joint])
    torque, kp, kd = _drive(model, joint)
    if model.jnt_actfrclimited[joint]:
        torque = float(model.jnt_actfrcrange[joint, 1])
    armature = float(model.dof_armature[model.jnt_dofadr[joint]])
    return MakerJoint(
        name=model.joint(joint).name,
        axis=np.array(model.jnt_axis[joint]),
        lower=float(model.jnt_range[joint, 0]) if limited else None,
        upper=float(model.jnt_range[joint, 1]) if limited else None,
        torque=torque,
        speed=None,
        armature=armature or None,
        kp=kp,
        kd=kd,
    )


def _drive(model: mujoco.MjModel, joint: int) -> tuple[float | None, float | None, float | None]:
    """Torque limit [N m], stiffness and damping that the joint's actuator states."""
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_trnid[actuator, 0] != joint:
            continue
        gear = float(abs(model.actuator_gear[actuator, 0]))
        servo = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_AFFINE
        torque = kp = kd = None
        if model.actuator_forcelimited[actuator]:
            torque = gear * float(model.actuator_forcerange[actuator, 1])
        elif not servo and model.actuator_ctrllimited[actuator]:
            torque = gear * float(model.actuator_gainprm[actuator, 0]) * float(model.actuator_ctrlrange[actuator, 1])
        if servo:
            kp, kd = -float(model.actuator_biasprm[actuator, 1]), -float(model.actuator_biasprm[actuator, 2])
        return torque, kp or None, kd or None
    return None, None, None


def _shapes(
    model: mujoco.MjModel, name_of: dict[int, str], frames: dict[int, pinocchio.SE3]
) -> tuple[tuple[MakerShape, ...], tuple[str, ...]]:
    shapes, notes = [], []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        if body not in name_of:
            continue
        kind, count = KINDS.get(model.geom_type[geom], ("", 0))
        if not kind:
            notes.append(f"body '{name_of[body]}': geom {geom} has a kind that is not used.")
            continue
        own = frames[body] * _se3(model.geom_pos[geom], model.geom_quat[geom])
        quat = quat_of(np.array(own.rotation))
        points = None
        if kind == "mesh":
            mesh = int(model.geom_dataid[geom])
            first, vertices = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            points = model.mesh_vert[first : first + vertices].astype(float)
            points = np.array(own.translation) + rotation.rotate(quat, points)
        shapes.append(
            MakerShape(
                name=model.geom(geom).name,
                link=name_of[body],
                kind=kind,
                shown=bool(model.geom_group[geom] <= 2),
                collides=bool(model.geom_contype[geom] or model.geom_conaffinity[geom]),
                pos=np.array(own.translation),
                quat=quat,
                size=tuple(model.geom_size[geom, :count].tolist()),
                points=points,
            )
        )
    return tuple(shapes), tuple(dict.fromkeys(notes))
