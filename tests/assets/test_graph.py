"""The graph as it is meant: keys, lineage, checks. A key misspelt would silently become an external stub."""

from typing import Any

import dagster as dg
import pytest

from assets.definitions import defs
from assets.freshness import topological
from assets.plan import EXPORTS, Plan, group_of, plans, robot_plans
from assets.report import robot_asset
from assets.robot_motions import robot_assets
from assets.sources import find_motions
from pipeline.batch import Manifest
from pipeline.batch.code_version import BELOW_ALL_STAGES
from pipeline.project import PROJECT, Project
from tests.factories.bare_project import bare_project

LINEAGE = {
    "raw_motions": set(),
    "hardware_logs": set(),
    "hardware_trials": {"hardware_logs"},
    "motion_catalog": {"raw_motions"},
    "failure_modes": {"hardware_trials", "actuator_calibration", "k1/actuator_calibration"},
    "sim_to_real_report": {"failure_modes"},
    "curation_feedback": {"failure_modes"},
    "approved_windows": {"curation_feedback"},
    "approved_variants": {"curation_feedback"},
    "approved_weights": {"curation_feedback"},
    "approved_limits": {"curation_feedback"},
    "approved_randomization": {"curation_feedback"},
    "selected_motions": {"motion_catalog", "approved_windows"},
    "repaired_motions": {"selected_motions"},
    "robot_model": set(),
    "actuator_measurements": set(),
    "actuator_calibration": {"actuator_measurements"},
    "adapted_robot": {"actuator_calibration", "robot_model", "approved_limits"},
    "retargeted_motions": {"repaired_motions", "robot_model"},
    "motion_variants": {"retargeted_motions", "robot_model", "approved_variants"},
    "reference_motions": {"motion_variants", "adapted_robot"},
    "tracking_policy": {"reference_motions", "adapted_robot"},
    "augmented_motions": {"reference_motions", "tracking_policy", "adapted_robot"},
    "feasible_motions": {"augmented_motions", "reference_motions", "adapted_robot", "approved_weights"},
    "expert_db": {"feasible_motions", "robot_model"},
    "t1/amp_policy": {
        *("expert_db", "adapted_robot", "approved_randomization"),
        *("reference_motions", "augmented_motions", "tracking_policy"),
    },
    "exported_policy": {"t1/amp_policy", "robot_model"},
    "mujoco_validation": {"exported_policy", "adapted_robot"},
    "cross_engine_validation": {"exported_policy", "adapted_robot"},
    "webots_validation": {"exported_policy", "adapted_robot"},
    "limit_cycles": {"exported_policy", "adapted_robot", "hardware_trials"},
}
LINEAGE |= {name: {"expert_db"} for name in EXPORTS.values()}
LINEAGE["release_report"] = {
    *("exported_policy", "mujoco_validation", "cross_engine_validation", "webots_validation", "limit_cycles"),
    *("expert_db", "actuator_calibration", "adapted_robot"),
    *("hardware_trials", "sim_to_real_report"),
}

POLICY = (
    *("t1/amp_policy", "exported_policy", "limit_cycles", "release_report"),
    *("mujoco_validation", "cross_engine_validation", "webots_validation"),
)
"""What is made of the database and asked of the policy."""

TRACKING = ("motion_variants", "tracking_policy")
"""What KP4 is made with beside clips that are named after motions."""

MODEL = ("robot_model", "actuator_measurements", "actuator_calibration", "adapted_robot")
"""What is about the robot and no stage of motions."""

FIELD = ("hardware_logs", "hardware_trials", "failure_modes", "sim_to_real_report", "curation_feedback")
"""What is about logs."""

APPROVED = ("approved_windows", "approved_variants", "approved_weights", "approved_limits", "approved_randomization")
"""What a person approved of the feedback from hardware; the windows are all robots'."""


def lineage(definitions: dg.Definitions) -> dict[str, set[str]]:
    graph = definitions.resolve_asset_graph()
    return {
        key.to_user_string(): {parent.to_user_string() for parent in graph.get(key).parent_keys}
        for key in graph.get_all_asset_keys()
    }


def test_the_t1s_assets_but_its_training_have_bare_keys():
    found = lineage(defs)
    assert {key: parents for key, parents in found.items() if not key.startswith("k1/")} == LINEAGE


def test_only_motions_measurements_logs_and_approvals_are_external():
    graph = defs.resolve_asset_graph()
    from_outside = {"raw_motions", "hardware_logs", "actuator_measurements", *APPROVED}
    found = {key.to_user_string() for key in graph.external_asset_keys}
    assert {key for key in found if "/" not in key} == from_outside
    assert {key for key in found if "/" in key} == {f"k1/{name}" for name in ("actuator_measurements", *APPROVED[1:])}


def test_another_robot_has_prefixed_keys_and_shares_what_is_human():
    other = dg.Definitions(
        assets=[*defs.assets, *robot_assets("k9")],
        resources=defs.resources,
    )
    found = lineage(other)
    assert found["k9/retargeted_motions"] == {"repaired_motions", "k9/robot_model"}
    assert found["k9/expert_db"] == {"k9/feasible_motions", "k9/robot_model"}
    assert {key for key in found if key.startswith("k9/")} == {
        f"k9/{name}"
        for name in LINEAGE.keys() - set(EXPORTS.values())
        if "motions" in name or name in (*MODEL, *TRACKING, "expert_db", *APPROVED[1:])
    } - {"k9/raw_motions", "k9/selected_motions", "k9/repaired_motions"}


def test_an_input_is_found_where_its_annotation_is_text():
    @robot_asset("numpy")
    def motion_variants(retargeted_motions: "Manifest", plan: "Plan"):
        """An asset of a module whose annotations are not evaluated."""

    assert motion_variants(robot_plans("k1")["motion_variants"]).dependency_keys == {
        dg.AssetKey(["k1", "retargeted_motions"])
    }


def test_every_asset_has_a_plan_a_description_and_a_group():
    graph = defs.resolve_asset_graph()
    known = plans(PROJECT)
    for key in graph.materializable_asset_keys:
        assert key in known
        assert graph.get(key).description
        name, robot = key.path[-1], known[key].robot
        assert graph.get(key).group_name == group_of(name, robot)


def test_the_groups_show_the_stages_and_keep_training_apart():
    graph = defs.resolve_asset_graph()
    groups: dict[str, set[str]] = {}
    for key in graph.get_all_asset_keys():
        groups.setdefault(str(graph.get(key).group_name), set()).add(key.path[-1])
    shared = {"sources", "KP1_selection", "KP2_repair", "hardware_feedback"}
    of_robot = {"robot", "KP3_retargeting", "KP4_augmentation", "KP5_feasibility", "database", "training", "validation"}
    assert set(groups) == shared | {f"{robot}_{name}" for robot in ("t1", "k1") for name in of_robot}
    assert groups["t1_training"] == {"amp_policy", "approved_randomization"}
    assert groups["KP1_selection"] == {"selected_motions", "approved_windows"}


def test_what_would_make_wrong_data_blocks():
    graph = defs.resolve_asset_graph()
    blocking = {
        (key.asset_key.to_user_string(), key.name)
        for key in graph.asset_check_keys
        if graph.get_check_spec(key).blocking and "/" not in key.asset_key.to_user_string()
    }
    others = ("raw_motions", *MODEL, *APPROVED, *FIELD, *POLICY, *EXPORTS.values(), "tracking_policy", "expert_db")
    stages = [name for name in LINEAGE if name not in others]
    expected = {(name, check) for name in stages for check in ("every_clip_accounted_for", "finite_numbers")}
    expected |= {(name, "sound_frames") for name in stages if name not in ("motion_catalog", "selected_motions")}
    expected |= {("robot_model", "models_agree"), ("expert_db", "whole_database")}
    expected |= {("adapted_robot", "adapted_models_agree"), ("exported_policy", "gives_the_networks_actions")}
    expected |= {("webots_validation", "project_is_the_robot")}
    assert blocking == expected | {("feasible_motions", "stored_as_evaluated")}


def test_topological_order_puts_parents_first():
    keys = {name: dg.AssetKey([name]) for name in "abcd"}
    parents = {keys["d"]: {keys["b"], keys["c"]}, keys["b"]: {keys["a"]}, keys["c"]: {keys["a"]}, keys["a"]: set()}
    assert topological(parents) == [keys[name] for name in "abcd"]


@pytest.fixture
def copied(root, tmp_path) -> Project:
    return bare_project(root, tmp_path)


@pytest.mark.parametrize("name", ["motion_catalog", "actuator_calibration", "feasible_motions"])
def test_a_fingerprint_follows_the_settings_and_not_their_remarks(name, copied):
    plan = plans(copied)[dg.AssetKey([name])]
    path = copied.settings(plan.settings_files[0])
    before, text = plan.fingerprint(copied), path.read_text()
    path.write_text(text + "\n# a remark\n")
    assert plan.fingerprint(copied) == before
    path.write_text(text + "\nanother_key: 1\n")
    assert plan.fingerprint(copied) != before


def _numbers(values: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Where each number of a settings file stands, with unit and source or without."""
    if not isinstance(values, dict):
        return [path]
    if "value" in values:
        return [(*path, "value")]
    return [at for name, below in values.items() for at in _numbers(below, (*path, name))]


@pytest.mark.parametrize(
    ("file", "least", "stale"),
    [
        ("feasibility.yaml", 60, {"reference_motions", "feasible_motions"}),
        ("commands.yaml", 5, {"feasible_motions", "curation_feedback"}),
    ],
)
def test_each_number_of_kp5_makes_stale_what_is_told_by_it_and_nothing_above(file, least, stale, copied):
    """Of the limits KP5 alone; of the commands also the feedback that is told in their cells."""
    import copy
    import dataclasses

    import yaml

    from pipeline.files.settings import read_yaml

    asked = [plan for plan in plans(copied).values() if plan.settings_files]
    named = {plan.name: dataclasses.replace(plan, robot=None) for plan in asked}  # a robot's digest takes its time
    path = copied.settings(file)
    values = read_yaml(path)
    before = {name: plan.fingerprint(copied) for name, plan in named.items()}
    numbers = _numbers(values)
    assert len(numbers) >= least
    for *sections, last in numbers:
        changed = copy.deepcopy(values)
        at = changed
        for name in sections:
            at = at[name]
        at[last] = "another"
        path.write_text(yaml.safe_dump(changed))
        found = {name for name, plan in named.items() if plan.fingerprint(copied) != before[name]}
        assert found == stale, (*sections, last)


def test_every_settings_file_is_an_input_of_some_asset(root):
    files = {path.name for path in (root / "data").glob("*.yaml")}
    taken = {name for plan in plans(PROJECT).values() for name in plan.settings_files}
    assert files - taken == {"database.yaml"}, "which decides whether a database is written and not what is in it"


def test_every_package_is_the_code_of_some_asset_or_of_no_result(root):
    packages = {path.parent.name for path in (root / "pipeline").glob("*/__init__.py")}
    taken = {name for plan in plans(PROJECT).values() for name in plan.packages}
    shown = {"cli", "curation_page", "viewing"}
    before = {"generator", "project", "robot_check", "robot_import"}
    assert packages - taken - {*BELOW_ALL_STAGES} == shown | before


def test_below_kp5_lie_the_database_and_what_is_made_of_it_alone():
    below, todo = set(), ["feasible_motions"]
    while todo:
        above = todo.pop()
        new = {name for name, parents in LINEAGE.items() if above in parents} - below
        below |= new
        todo += new
    assert below == {"expert_db", *EXPORTS.values(), *POLICY}


def test_what_is_asked_of_all_robots_follows_each_robots_folder(copied):
    asked = [plan for plan in plans(copied).values() if plan.every_robot]
    assert {plan.name for plan in asked} == {"hardware_trials", "failure_modes"}
    before = [plan.fingerprint(copied) for plan in asked]
    aliases = copied.robot_folder("k1") / "joints.csv"
    aliases.write_text(aliases.read_text() + "\n")
    assert not set(before) & {plan.fingerprint(copied) for plan in asked}


def test_files_that_may_hold_a_robots_motion_follow_each_robots_folder(copied):
    (copied.root / "data" / "motions").mkdir()
    copied.settings("sources.yaml").write_text("sources:\n  - {name: mine, folder: motions, licence: MIT}\n")
    for name in ("person.bvh", "robot.csv"):
        (copied.root / "data" / "motions" / name).write_text("root_x,root_y\n1,2\n")
    before = {name: content for name, _, content, _ in find_motions(copied).files()}
    joints = copied.robot_folder("k1") / "joints.csv"
    joints.write_text(joints.read_text() + "\n")
    after = {name: content for name, _, content, _ in find_motions(copied).files()}
    assert {name for name in before if before[name] != after[name]} == {"mine/robot"}


def test_failures_follow_the_policies_at_hand(copied):
    (failures,) = (plan for plan in plans(copied).values() if plan.any_policy)
    before = failures.fingerprint(copied)
    policy = copied.shipped_policies("k1") / "walk" / "policy.npz"
    policy.parent.mkdir(parents=True)
    policy.write_bytes(b"a policy")
    assert failures.fingerprint(copied) != before
    (policy.parent / "lost.npz").symlink_to(policy.parent / "nowhere")
    (policy.parent / "folder.npz").mkdir()
    assert failures.fingerprint(copied) != before, "what can't be read stops no run"


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("robot_model", "robot.toml"),
        ("robot_model", "joints.csv"),
        ("mujoco_validation", "validation.yaml"),
        ("exported_policy", "deployment.yaml"),
    ],
)
def test_each_file_of_a_robot_makes_stale_what_reads_it(copied, name, file):
    plan = robot_plans("k1")[name]
    before, path = plan.fingerprint(copied), copied.robot_folder("k1") / file
    path.write_text(path.read_text() + ("\nanother_key: 1\n" if file.endswith("yaml") else "\n"))
    assert plan.fingerprint(copied) != before
