"""Runs GMR (General Motion Retargeting) on prepared human frames. Started by `retarget.py` with the Python of an
environment in which `mink`, `mujoco`, `daqp` and `qpsolvers` are installed; it imports nothing of the project.

    gmr_worker.py GMR_REPO IN.npz OUT.npz REPEAT

IN: `names` (b,), `pos` (t, b, 3) [m], `quat` (t, b, 4) wxyz, world z up. OUT: `qpos` (t, 7 + joints) as in GMR's model,
`joint_names`, `cpu_s` (REPEAT,), processor seconds of runs after the first, each from GMR's initial pose. GMR's package
is imported without its viewer and body models, its T1 without the meshes.
"""

from __future__ import annotations

import sys
import tempfile
import time
import types
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

HEIGHT = 1.75
"""Height of the person [m] that GMR's own loader of LAFAN1 states for every file."""


def main(repo: Path, source: Path, out: Path, repeat: int) -> None:
    data = np.load(source)
    names, pos, quat = data["names"].tolist(), data["pos"], data["quat"]
    frames = [{name: (pos[t, index], quat[t, index]) for index, name in enumerate(names)} for t in range(len(pos))]
    cpu_s = []
    for _ in range(1 + repeat):
        retargeter, joint_names = load(repo)
        start_s = time.process_time()
        qpos = np.array([retargeter.retarget(frame) for frame in frames])
        cpu_s.append(time.process_time() - start_s)
    np.savez(out, qpos=qpos, joint_names=joint_names, cpu_s=cpu_s[1:])


def load(repo: Path) -> tuple[Any, list[str]]:
    """GMR's retargeter for BVH and T1, and the joints behind the free one in the order of qpos."""
    package = types.ModuleType("general_motion_retargeting")
    package.__path__ = [str(repo / "general_motion_retargeting")]
    sys.modules["general_motion_retargeting"] = package  # GMR's __init__ would import the viewer
    from general_motion_retargeting import (  # pyright: ignore[reportMissingImports]  # lives in GMR's own environment
        motion_retarget,
        params,
    )

    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "t1.xml"
        model.write_text(without_meshes(Path(params.ROBOT_XML_DICT["booster_t1"]).read_text()))
        motion_retarget.ROBOT_XML_DICT = {"booster_t1": model}
        retargeter = motion_retarget.GeneralMotionRetargeting(
            src_human="bvh", tgt_robot="booster_t1", actual_human_height=HEIGHT
        )
    return retargeter, [retargeter.model.joint(index).name for index in range(1, retargeter.model.njnt)]


def without_meshes(mjcf: str) -> str:
    """The model without mesh files and what shows them; every body keeps its own inertial."""
    root = ET.fromstring(mjcf)
    for parent in root.iter():
        for child in list(parent):
            if child.tag == "mesh" or (child.tag == "geom" and "mesh" in child.attrib):
                parent.remove(child)
    return ET.tostring(root, encoding="unicode")


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:4]), repeat=int(sys.argv[4]))
