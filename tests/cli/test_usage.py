"""What is typed: help, version, typos, shell completion, and the values that options take."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from pipeline.batch import store
from pipeline.cli import arguments, policy_arguments
from pipeline.cli.main import COMMANDS, main, parse
from pipeline.dataset_export import FORMATS
from pipeline.readers.read_motion import SUFFIXES
from pipeline.validation.suites import SUITES

HEAVY = ("numpy", "torch", "mujoco", "pandas", "scipy", "dagster", "pinocchio", "pipeline.readers", "pipeline.robot")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "Missing subcommand"),
        (["dance"], "Unrecognized options: dance"),
        (["retarget", "a.bvh"], "--out"),
        (["retarget", "a.bvh", "--out", "o.csv", "--fps", "0"], "0 is not a rate in Hz, expected more than 0"),
        (["retarget", "a.bvh", "--out", "o.csv", "--fsp", "30"], "--fps"),
        (["inspect", "a.bvh", "--source-fps", "nan"], "nan is not a rate in Hz"),
        (["inspect", "a.bvh", "--quaternion", "zyx"], "xyzw"),
        (["view", "a", "--port", "x"], "x is not a port, expected 1 to 65535"),
        (["view", "a", "--poses", "41"], "41 is not a number of poses, expected 1 to 40"),
        (["export", "db", "--out", "o", "--format", "fbx"], "lerobot"),
        (["validate", "a.npz", "--json", "/"], "/ is a folder, expected a file"),
        (["cross-engine", "a.npz", "--json", "/"], "/ is a folder, expected a file"),
        (["simulate-robot", "o.mcap", "--command", "1,2"], "'1,2' is not 4 numbers separated by commas"),
        (["simulate-robot", "o.mcap", "--push", "1,2,inf"], "'1,2,inf' is not 3 numbers separated by commas"),
        (["simulate-robot", "o.mcap", "--weaker", "Waist=0"], "'Waist=0' is not JOINT=NUMBER"),
        (["simulate-robot", "o.mcap", "--seconds", "-1"], "-1 is not a number above 0"),
        (["simulate-robot", "o.mcap", "--rate", "0"], "0 is out of range, expected 1 to 500"),
        (["simulate-robot", "o.mcap", "--seed=-1"], "-1 is not a seed, expected 0 to 4294967295"),
        (["simulate-robot", "o.mcap", "--gains", "nan"], "nan is not a number above 0"),
        (["simulate-robot", "o.mcap", "--command-scale", "0"], "0 is not a number above 0"),
        (["simulate-robot", "o.mcap", "--delay=-1"], "-1 is out of range, expected 0 to 1"),
        (["simulate-robot", "o.mcap", "--message-loss", "2"], "2 is out of range, expected 0 to 0.99"),
        (["simulate-robot", "o.mcap", "--friction=-1"], "-1 is out of range, expected 0 or more"),
        (["simulate-robot", "o.mcap", "--hold", "2,1"], "'2,1' is not T,UNTIL with 0 <= T < UNTIL [s]"),
        (["play", "a.npz", "--friction=-1"], "-1 is out of range, expected 0 or more"),
        (["validate", "a.npz", "--workers=-1"], "-1 is not a number of processes, expected 0 to 1000"),
        (["database", "remove"], "restore"),
    ],
)
def test_wrong_usage_ends_with_2_and_names_the_problem_and_the_help(capsys, words, message):
    assert main(words) == 2
    shown = re.sub(r"[│\s]+", " ", capsys.readouterr().err)
    assert message in shown and "booster-lab" in shown and "--help" in shown


def test_the_model_file_that_check_robot_compares_with_is_optional(capsys):
    assert main(["check-robot", "--help"]) == 0
    assert "check-robot [-h] DIR [AGAINST]" in capsys.readouterr().out


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
def test_help_ends_with_0(capsys, command):
    assert main([*command, "--help"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith(" ".join(["usage: booster-lab", *command]))
    assert command or all(name in shown for name in COMMANDS)


def test_the_help_of_retarget_lists_every_suffix(capsys):
    assert main(["retarget", "--help"]) == 0
    shown = re.sub(r"[│\s]+", " ", capsys.readouterr().out)
    assert f"motion file ({', '.join(sorted(SUFFIXES))})" in shown


def test_the_version_is_that_of_the_project(root: Path, capsys):
    assert main(["--version"]) == 0
    version = re.search(r'^version = "(.+)"', (root / "pyproject.toml").read_text(), re.MULTILINE)
    assert version and capsys.readouterr().out == f"booster-lab {version[1]}\n"


@pytest.mark.parametrize("words", [["--help"], ["--version"], ["retarge"], ["retarget", "--fsp", "3"]])
def test_help_and_typos_import_nothing_heavy(root: Path, words: list[str]):
    program = "import sys; from pipeline.cli.main import main; main(sys.argv[1:]); print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program, *words], cwd=root, capture_output=True, text=True, check=True)
    imported = done.stdout.splitlines()[-1].split()
    assert "tyro" in imported and not set(HEAVY) & set(imported)


@pytest.mark.parametrize("words", [["--help"], ["inspect", "data/motions/stand.bvh", "--write-map"]])
def test_output_that_nobody_reads_any_more_ends_quietly(root: Path, words: list[str]):
    program = "import sys; from pipeline.cli.main import main; sys.exit(main(sys.argv[1:]))"
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([sys.executable, "-c", program, *words], cwd=root, stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


def test_bash_completes_commands_and_options(root: Path, tmp_path: Path, capsys):
    assert main(["--tyro-print-completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out)

    def completed(*words: str) -> set[str]:
        line = " ".join(words)
        program = (
            f"source {script}; COMP_WORDS=({line}); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )); COMP_LINE='{line}'; "
            f"COMP_POINT=${{#COMP_LINE}}; $(complete -p booster-lab | sed 's/.*-F \\([^ ]*\\).*/\\1/') booster-lab; "
            'printf "%s\\n" "${COMPREPLY[@]}"'
        )
        done = subprocess.run(["bash", "-c", program], cwd=root, capture_output=True, text=True, check=True)
        return {line.strip() for line in done.stdout.splitlines()}

    assert "retarget" in completed("booster-lab", "ret")
    assert {"--fps", "--out"} <= completed("booster-lab", "retarget", "--")


def test_choices_are_those_of_the_stages():
    def choices(kind: type, option: str) -> set[str]:
        return set(get_args(get_type_hints(kind)[option]))

    assert choices(arguments.Export, "format") == set(FORMATS)
    assert choices(policy_arguments.Validate, "suite") == set(SUITES)
    assert arguments.MOST_ASKINGS == store.MOST_ASKINGS


def test_every_option_arrives():
    words = (
        "simulate-robot o.mcap --command=-0.5,0,0,1 --command 2,0.5,0,0 --hot Waist=2 --hold 1,2 --push 1,20,0 "
        "--message-loss 0.1 --script sway --command-scale 0.5"
    )
    given = parse(words.split())
    assert given.command == ((-0.5, 0.0, 0.0, 1.0), (2.0, 0.5, 0.0, 0.0))
    assert given.differences.hot == (("Waist", 2.0),) and given.differences.message_loss == 0.1
    assert given.differences.command_scale == 0.5 and given.script == "sway"
    assert given.events.hold == (1.0, 2.0) and given.events.push == ((1.0, 20.0, 0.0),) and given.events.stop is None
    given = parse(["export", "db", "--format", "gmr", "--skill", "walk", "run", "--out", "o"])
    assert given.skill == ("walk", "run") and given.out == Path("o") and given.naming is None
    given = parse(["inspect", "a.bvh", "--up=-y", "--source-fps", "50", "--json", "--asf", "a.asf"])
    assert given.json and not given.write_map
    assert (given.statement.up, given.statement.fps, given.statement.asf) == ("-y", 50.0, "a.asf")
    given = parse(["webots-project", "--out", "o", "--run", "ode", "--ankle-kd", "2"])
    assert given.engine == "ode" and given.ankle_kd == 2.0 and given.policy is None
    assert parse(["view", "a", "--no-browser"]).no_browser
    assert parse(["check-robot", "a", "b"]).against == Path("b")
    assert parse(["sources", "forget", "a", "b"]).names == ("a", "b")
    given = parse(["database", "restore", "v1", "--robot", "k1"])
    assert (given.action, given.version, given.robot) == ("restore", "v1", "k1")
