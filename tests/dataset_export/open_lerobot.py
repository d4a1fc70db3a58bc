"""Open a data set with LeRobot's own loader and print what it finds as JSON: python open_lerobot.py FOLDER.

Run in a process of its own with the packages of lerobot.lock on PYTHONPATH (test_lerobot_loader.py).
"""

import json
import sys

import torch

try:
    import torchvision  # noqa: F401
except RuntimeError:  # of another build than torch: its compiled operators are missing, which only images need
    operators = torch.library.Library("torchvision", "DEF")
    for name in ("nms", "qnms"):
        operators.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")

from lerobot.datasets.lerobot_dataset import LeRobotDataset

STEP_S = 0.02


def main(folder: str) -> None:
    """Print rate, tasks, statistics, every frame, and a training batch with the state of three frames."""
    whole = LeRobotDataset("local/booster_lab", root=folder)
    frames = [{name: plain(value) for name, value in whole[index].items()} for index in range(len(whole))]
    windows = LeRobotDataset(
        "local/booster_lab", root=folder, delta_timestamps={"observation.state": [-STEP_S, 0.0, STEP_S]}
    )
    batch = next(iter(torch.utils.data.DataLoader(windows, batch_size=4, sampler=[0, 1, 2, len(windows) - 1])))
    second = LeRobotDataset("local/booster_lab", root=folder, episodes=[1])
    found = {
        "fps": whole.fps,
        "episodes": whole.num_episodes,
        "robot": whole.meta.robot_type,
        "tasks": list(whole.meta.tasks.index),
        "mean": plain(whole.meta.stats["observation.state"]["mean"]),
        "frames": frames,
        "windows": plain(batch["observation.state"]),
        "beyond the episode": plain(batch["observation.state_is_pad"]),
        "second episode": [plain(second[index]["index"]) for index in range(len(second))],
    }
    print(json.dumps(found))


def plain(value: object) -> object:
    """Arrays and tensors as lists."""
    return value.tolist() if hasattr(value, "tolist") else value


if __name__ == "__main__":
    main(sys.argv[1])
