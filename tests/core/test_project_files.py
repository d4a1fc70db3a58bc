"""The files of a public project agree with each other and with the tree."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

MOST_BYTES = 20_000_000
"""Most that a clone's files may take."""


def read_yaml(path: Path):
    return yaml.safe_load(path.read_text())


def test_the_licence_is_stated_in_every_place(root: Path):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert project["license"] == read_yaml(root / "CITATION.cff")["license"] == "Apache-2.0"
    assert "Apache License\n                           Version 2.0" in (root / "LICENSE").read_text()
    assert project["version"] == read_yaml(root / "CITATION.cff")["version"]


def test_the_changelog_has_the_version(root: Path):
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert f"\n## {project['version']}\n" in (root / "CHANGELOG.md").read_text()


def test_the_citation_names_the_paper_and_its_authors(root: Path):
    paper = read_yaml(root / "CITATION.cff")["preferred-citation"]
    assert paper["title"].startswith("Booster Lab: A Data-Centric Pipeline")
    assert [each["family-names"] for each in paper["authors"]] == ["Chen", "Zheng", "Zhang", "Zhao"]


def test_the_commit_hooks_are_the_linters_of_make_check(root: Path):
    (repository,) = read_yaml(root / ".pre-commit-config.yaml")["repos"]
    hooks = [hook["entry"].removeprefix(".venv/bin/") for hook in repository["hooks"]]
    recipe = (root / "Makefile").read_text().split("\ncheck: setup\n")[1].split("\n\n")[0]
    commands = [line.strip().removeprefix("$(BIN)/") for line in recipe.splitlines()]
    assert hooks == [command for command in commands if not command.startswith(("dagster", "dg"))]


def test_links_between_documents_lead_somewhere(root: Path):
    pages = [*root.glob("*.md"), *(root / "docs").glob("*.md"), *(root / "examples").glob("*.md")]
    broken = [
        f"{page.relative_to(root)}: {target}"
        for page in pages
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text())
        if "://" not in target and not (page.parent / target).exists()
    ]
    assert broken == []


def test_the_readme_is_short_and_no_line_of_the_docs_is_long(root: Path):
    assert len((root / "README.md").read_text().split()) <= 600
    pages = [*root.glob("*.md"), *(root / "docs").glob("*.md")]
    long = [f"{page.name}: {line[:60]}" for page in pages for line in page.read_text().splitlines() if len(line) > 400]
    assert long == []


def test_the_tree_stays_light(root: Path):
    if not (root / ".git").exists():
        pytest.skip("not a git checkout")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, text=True, check=True).stdout
    sizes = {name: (root / name).stat().st_size for name in listed.split("\0") if (root / name).is_file()}
    assert sum(sizes.values()) <= MOST_BYTES, sorted(sizes, key=lambda name: sizes[name])[-5:]


def pinned(path: Path) -> dict[str, str]:
    """The version of each package that a file of requirements pins."""
    found = re.findall(r"^([A-Za-z0-9._-]+)==([^\s\\]+)", path.read_text(), re.MULTILINE)
    return {re.sub(r"[-_.]+", "-", name).lower(): version for name, version in found}


def test_the_lock_file_has_the_tested_versions_with_hashes(root: Path):
    tested, locked = pinned(root / "constraints.txt"), pinned(root / "requirements.lock")
    assert tested.pop("torch")  # its packages for the GPU depend on the machine
    assert locked == tested, "run `make lock`"
    blocks = re.split(r"^(?=[A-Za-z])", (root / "requirements.lock").read_text(), flags=re.MULTILINE)[1:]
    assert len(blocks) == len(locked)
    assert all("--hash=sha256:" in block for block in blocks)
    assert "--require-hashes --requirement requirements.lock" in (root / "Makefile").read_text()


def test_lerobots_loader_is_locked_with_hashes(root: Path):
    folder = root / "tests/dataset_export"
    locked = pinned(folder / "lerobot.lock")
    assert locked == pinned(folder / "lerobot.txt"), "run `make lock`"
    assert (folder / "lerobot.lock").read_text().count("--hash=sha256:") >= len(locked)


def test_what_the_project_depends_on_is_locked(root: Path):
    project = tomllib.loads((root / "pyproject.toml").read_text())
    wanted = [*project["project"]["dependencies"], *project["project"]["optional-dependencies"]["dev"]]
    wanted += project["build-system"]["requires"]
    names = {re.match(r"[A-Za-z0-9._-]+", each).group().lower().replace("_", "-") for each in wanted}
    assert names - {"torch"} <= set(pinned(root / "requirements.lock"))


def test_the_dockerfile_copies_what_is_there_and_leaves_results_out(root: Path):
    copied = re.findall(r"^COPY (.+) \S+$", (root / "Dockerfile").read_text(), re.MULTILINE)
    names = [name for line in copied for name in line.split()]
    assert "requirements.lock" in names and "." in names
    assert [name for name in names if not (root / name).exists()] == []
    ignored = set((root / ".gitignore").read_text().split())
    left_out = set((root / ".dockerignore").read_text().split())
    assert {f"/{name}/" for name in left_out if name.startswith("data/")} - ignored == {"/data/feedback/"}
