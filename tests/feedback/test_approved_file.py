"""The file of approved changes: read back whole, refused where it was tampered with, split so that parts stay apart."""

import dataclasses
import re

import pytest

from pipeline.feedback.approved import (
    EMPTY,
    applied_versions,
    entries_of,
    lineage,
    merged,
    part_of,
    part_version,
    read_approvals,
    write_entries,
)
from pipeline.feedback.change import SECTIONS, proposal_digest
from tests.factories.trial_reports import RULES, failure, proposal, report, saturated


@pytest.fixture
def changes():
    return proposal(*(report(number, failure(), saturated(36.0)) for number in range(2))).changes


@pytest.fixture
def path(changes, tmp_path):
    """A file in which all of them are approved."""
    write_entries(tmp_path / "approved.yaml", entries_of(changes, proposal_digest(changes), "a person"))
    return tmp_path / "approved.yaml"


def faults(path) -> dict[str, str]:
    return {section: str(fault) for section, fault in read_approvals(path, RULES).faults.items()}


def test_what_is_written_is_read_back(changes, path):
    found = read_approvals(path, RULES)
    assert sorted(found.changes, key=str) == sorted(changes, key=str)
    assert found.entries == entries_of(changes, proposal_digest(changes), "a person")
    assert found.readable and not found.faults


def test_copying_the_proposal_is_approving_it(changes, tmp_path):
    write_entries(tmp_path / "proposed.yaml", entries_of(changes, proposal_digest(changes)), head="proposed")
    (tmp_path / "approved.yaml").write_text((tmp_path / "proposed.yaml").read_text())
    assert len(read_approvals(tmp_path / "approved.yaml", RULES).changes) == len(changes)
    assert "by:" not in (tmp_path / "approved.yaml").read_text()


def test_without_a_file_nothing_is_approved(tmp_path):
    assert read_approvals(tmp_path / "approved.yaml", RULES).changes == ()
    assert part_version(part_of((), "weights", "t1")) == EMPTY


def test_no_changes_leave_no_file(path):
    write_entries(path, ())
    assert not path.exists()


def test_a_value_changed_by_hand_is_refused_and_the_other_sections_are_not(path):
    path.write_text(re.sub(r"value: 1\.5625", "value: 1.5", path.read_text(), count=1))
    assert list(faults(path)) == ["weights"]
    assert "approvals[2], 'weights': its changes do not have the digest" in faults(path)["weights"]
    assert len(read_approvals(path, RULES).changes) == 4


def test_a_section_with_a_digest_of_its_own_still_keeps_the_bounds(path):
    text = re.sub(r"value: 1\.5625", "value: 9.0", path.read_text(), count=1)
    path.write_text(text)
    stated, own = re.findall(r"digest '([0-9a-f]+)' but '([0-9a-f]+)'", faults(path)["weights"])[0]
    path.write_text(text.replace(f"digest: {stated}", f"digest: {own}"))
    assert list(faults(path)) == ["weights"]
    assert re.search(r"approvals\[2\]: .*is 9; with 2 logs, 1 to 1.5625 is allowed\. Approve", faults(path)["weights"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("approvals: [\n", "line 2: "),
        ("proposal: x\nchanges: 3\n", "unknown key 'changes'"),
        ("approvals: 3\n", "'approvals' is 3, expected a list"),
        ("", "'the file' is None"),
        ("approvals:\n- {section: weights, proposal: x, digest: y}\n", r"'approvals\[0\].changes' is missing"),
        (
            "approvals:\n- {section: moters, proposal: x, digest: y, changes: []}\n",
            r"approvals\[0\].* section 'moters'",
        ),
        ("\x00", "approved.yaml: "),
    ],
)
def test_a_file_that_cannot_be_read_faults_all_sections_with_place_and_way_on(path, text, says):
    path.write_text(text)
    found = read_approvals(path, RULES)
    assert set(found.faults) == set(SECTIONS) and not found.readable and found.changes == ()
    (sentence,) = set(faults(path).values())
    assert re.search(says, sentence) and sentence.startswith(str(path))
    assert sentence.endswith("Mend it, or delete it and approve again: without it nothing is approved.")


def test_a_file_that_nobody_lets_us_read_is_told(path, monkeypatch):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(type(path), "read_text", refused)
    assert set(faults(path)) == set(SECTIONS)
    assert "Permission denied" in faults(path)["motors"]


@pytest.mark.parametrize(
    ("section", "what"), [("selection", "wlak"), ("augmentation", "wlak"), ("augmentation", "time_scale of wlak")]
)
def test_a_skill_that_there_is_not_is_refused(changes, path, section, what):
    misspelt = [dataclasses.replace(next(each for each in changes if each.section == section), what=what)]
    write_entries(path, entries_of(misspelt, "x", "a person"))
    assert list(faults(path)) == [section]
    assert f"{section} '{what}' names no skill; skills are: stand, " in faults(path)[section]


def test_a_change_under_another_sections_name_is_refused(path):
    path.write_text(path.read_text().replace("  - section: motors", "  - section: weights"))
    assert "has the section 'weights'" in faults(path)["motors"]


def test_the_same_number_approved_twice_in_a_file_is_refused(changes, path):
    weights = [each for each in changes if each.section == "weights"]
    write_entries(path, (*entries_of(weights, "x", "a"), *entries_of(weights, "y", "b")))
    assert "occurs twice" in faults(path)["weights"]


def test_newer_approvals_replace_their_sections_or_only_the_same_numbers(changes):
    earlier = entries_of(changes, "x", "a")
    (weights,) = [entry for entry in earlier if entry.section == "weights"]
    (newer,) = entries_of(weights.changes, "y", "b")
    assert [entry.proposal for entry in merged(earlier, [newer], whole=True)] == ["x", "x", "y", "x", "x"]
    assert merged(earlier, [newer], whole=False) == merged(earlier, [newer], whole=True), "nothing is left of it"
    assert merged((), earlier, whole=True) == earlier


def test_a_change_of_weights_leaves_the_versions_of_the_other_parts(changes):
    without = tuple(each for each in changes if each.section != "weights")
    for section in ("selection", "augmentation", "motors", "randomization"):
        assert part_version(part_of(changes, section, "t1")) == part_version(part_of(without, section, "t1"))
    assert part_version(part_of(changes, "weights", "t1")) != part_version(part_of(without, "weights", "t1"))


def test_the_version_of_a_part_does_not_depend_on_the_order_of_approvals(changes):
    assert [part_version(part_of(changes, each, "t1")) for each in SECTIONS] == [
        part_version(part_of(changes[::-1], each, "t1")) for each in SECTIONS
    ]


def test_a_part_is_of_one_robot(changes):
    assert part_of(changes, "weights", "k1") == ()
    assert part_of(changes, "selection", None) == part_of(changes, "selection", "t1")


def test_a_manifest_tells_which_parts_it_heard(changes):
    parts = {section: part_of(changes, section, "t1") for section in ("weights", "motors")}
    stages = {"0": {"stage": "repaired_motions"}, "1": {"robot": "t1"}}
    for section, part in parts.items():
        stages |= lineage(part, section)
    assert applied_versions(stages) == {section: part_version(part) for section, part in parts.items()}
