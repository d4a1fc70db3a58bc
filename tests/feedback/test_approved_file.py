"""The file of approved changes: read back whole, refused where it was tampered with, split so that parts stay apart."""

import re

import pytest

from pipeline.errors import SettingsError
from pipeline.feedback.approved import EMPTY, part_of, part_version, read_changes, write_changes
from pipeline.feedback.change import proposal_digest
from tests.factories.trial_reports import RULES, failure, proposal, report, saturated


@pytest.fixture
def changes():
    return proposal(*(report(number, failure(), saturated(36.0)) for number in range(2))).changes


def test_what_is_written_is_read_back(changes, tmp_path):
    path = tmp_path / "approved.yaml"
    assert write_changes(path, changes, by="a person") == proposal_digest(changes)
    assert read_changes(path, RULES) == changes
    assert "by: a person" in path.read_text()


def test_copying_the_proposal_is_approving_it(changes, tmp_path):
    write_changes(tmp_path / "proposed.yaml", changes)
    (tmp_path / "approved.yaml").write_text((tmp_path / "proposed.yaml").read_text())
    assert read_changes(tmp_path / "approved.yaml", RULES) == changes


def test_without_a_file_nothing_is_approved(tmp_path):
    assert read_changes(tmp_path / "approved.yaml", RULES) == ()
    assert part_version(part_of((), "weights", "t1")) == EMPTY


def test_no_changes_leave_no_file(changes, tmp_path):
    path = tmp_path / "proposed.yaml"
    write_changes(path, changes)
    assert write_changes(path, ()) == ""
    assert not path.exists()


def test_a_value_changed_by_hand_is_refused(changes, tmp_path):
    path = tmp_path / "approved.yaml"
    write_changes(path, changes, by="a person")
    path.write_text(re.sub(r"value: 1\.5625", "value: 1.6", path.read_text(), count=1))
    with pytest.raises(SettingsError, match="its changes are not those of proposal"):
        read_changes(path, RULES)


def test_a_file_with_a_digest_of_its_own_still_keeps_the_bounds(changes, tmp_path):
    path = tmp_path / "approved.yaml"
    write_changes(path, changes, by="a person")
    text = re.sub(r"value: 1\.5625", "value: 9.0", path.read_text(), count=1)
    path.write_text(text)
    with pytest.raises(SettingsError) as refused:
        read_changes(path, RULES)
    own = re.findall(r"but of '([0-9a-f]+)'", str(refused.value))[0]
    path.write_text(re.sub(r"proposal: \w+", f"proposal: {own}", text))
    with pytest.raises(SettingsError, match=r"is 9; by 2 logs allowed is 1 to 1.5625"):
        read_changes(path, RULES)


def test_a_change_of_weights_leaves_the_versions_of_the_other_parts(changes):
    without = tuple(each for each in changes if each.section != "weights")
    for section in ("selection", "augmentation", "motors", "randomization"):
        assert part_version(part_of(changes, section, "t1")) == part_version(part_of(without, section, "t1"))
    assert part_version(part_of(changes, "weights", "t1")) != part_version(part_of(without, "weights", "t1"))


def test_a_part_is_of_one_robot(changes):
    assert part_of(changes, "weights", "k1") == ()
    assert part_of(changes, "selection", None) == part_of(changes, "selection", "t1")


def test_an_unknown_section_is_named(changes, tmp_path):
    path = tmp_path / "approved.yaml"
    write_changes(path, changes, by="a person")
    path.write_text(path.read_text().replace("section: motors", "section: moters"))
    with pytest.raises(SettingsError, match="unknown section 'moters'"):
        read_changes(path, RULES)
