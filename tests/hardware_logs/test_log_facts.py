"""What a log says of itself: metadata with a checksum of its own, a sidecar, and what contradicts."""

import pytest

from pipeline.hardware_logs import OperatorEvent
from pipeline.hardware_logs.log_facts import FactsError, stated_facts, to_metadata
from tests.factories.robot_logs import POLICY, START_NS, facts

SIDECAR = f"""
robot: t1
policy_digest: {POLICY}
command_source: schedule
command:
  - {{time_s: 2, forward_m_s: 0.5, left_m_s: 0, yaw_rate_rad_s: 0}}
  - {{time_s: 0, forward_m_s: 0, left_m_s: 0, yaw_rate_rad_s: 0}}
events:
  - {{time_s: 12.5, kind: held}}
notes: {{floor: carpet}}
"""


def sidecar(tmp_path, text: str):
    path = tmp_path / "walk.yaml"
    path.write_text(text)
    return path


def test_facts_come_back_from_metadata():
    stated = stated_facts(to_metadata(facts(notes={"floor": "carpet"}), START_NS), None)
    assert stated.facts == facts(notes={"floor": "carpet"})
    assert stated.start_ns == START_NS
    assert stated.remarks == ()


@pytest.mark.parametrize("key", ["policy_digest", "command", "robot", "simulated", "start_ns", "events"])
def test_metadata_that_was_changed_is_left_out_as_a_whole(key):
    values = to_metadata(facts(), START_NS)
    values[key] = values[key].replace("0", "1").replace("a", "b").replace("t1", "k1").replace("yes", "no")
    stated = stated_facts(values, None)
    assert stated.damaged
    assert stated.facts.policy_digest is None
    assert stated.facts.command == ()
    assert "its metadata is damaged and left out." in stated.remarks


@pytest.mark.parametrize(
    "values",
    [
        {"command": "[[0, 1]]"},
        {"command": "[[0, 1, 2, NaN]]"},
        {"command": "{"},
        {"events": '[[0, "danced"]]'},
        {"command_source": "guess"},
        {"start_ns": "soon"},
        {"notes": "[" * 100_000},
        {"notes": '["carpet"]'},
        {"command": f"[[0, 1, 2, {10**400}]]"},
    ],
)
def test_metadata_of_others_that_makes_no_sense_is_left_out(values):
    stated = stated_facts(values, None)
    assert stated.damaged
    assert stated.facts.command == ()


def test_a_sidecar_says_what_a_recorder_does_not(tmp_path):
    stated = stated_facts(None, sidecar(tmp_path, SIDECAR))
    assert stated.facts.policy_digest == POLICY
    assert stated.facts.command == ((0.0, 0.0, 0.0, 0.0), (2.0, 0.5, 0.0, 0.0))
    assert stated.facts.events == (OperatorEvent(time_s=12.5, kind="held", source="sidecar"),)
    assert stated.facts.notes == {"floor": "carpet"}
    assert not stated.facts.simulated


def test_a_sidecar_corrects_what_it_may(tmp_path):
    stated = stated_facts(to_metadata(facts(), START_NS), sidecar(tmp_path, "command_source: remote\n"))
    assert stated.facts.command_source == "remote"
    assert stated.remarks == ("its sidecar states command_source.",)


@pytest.mark.parametrize("simulated", [True, False])
def test_a_sidecar_does_not_change_whether_a_log_is_simulated(tmp_path, simulated):
    beside = sidecar(tmp_path, f"simulated: {str(not simulated).lower()}\n")
    with pytest.raises(FactsError, match=r"its metadata states that it is (not )?simulated, its sidecar that it is"):
        stated_facts(to_metadata(facts(simulated=simulated), START_NS), beside)
    agreed = sidecar(tmp_path, f"simulated: {str(simulated).lower()}\n")
    assert stated_facts(to_metadata(facts(simulated=simulated), START_NS), agreed).facts.simulated is simulated


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (f"policy_digest: {'cd' * 32}", "states the policy_digest"),
        ("robot: k1", "states the robot"),
        ("policy: mine", "unknown key 'policy'"),
        ("events: [{time_s: 1, kind: danced}]", "there are: held, released, stop, pushed"),
        ("command_source: guess", "there are: schedule, remote, unknown"),
        ("robot: [", "walk.yaml"),
    ],
)
def test_a_sidecar_that_contradicts_or_is_none_is_an_error(tmp_path, text, says):
    with pytest.raises(FactsError, match=says.replace("[", r"\[")):
        stated_facts(to_metadata(facts(), START_NS), sidecar(tmp_path, text))


@pytest.mark.parametrize("digest", ["", "abc", "AB" * 32, "zz" * 32])
def test_what_is_no_digest_is_no_policy(digest):
    stated = stated_facts(to_metadata(facts(policy_digest=digest), START_NS), None)
    assert stated.facts.policy_digest is None
    assert stated.remarks[-1] == "no policy is stated: it can't be laid to one."


@pytest.mark.parametrize("word", ["true", "YES", "1", ""])
def test_simulated_is_yes_or_no_or_the_metadata_is_left_out(word):
    values = {key: text for key, text in to_metadata(facts(simulated=True), START_NS).items() if key != "sha256"}
    stated = stated_facts({**values, "simulated": word}, None)
    assert stated.damaged and stated.facts.policy_digest is None


def test_a_log_that_lost_whether_it_is_simulated_counts_for_no_policy(tmp_path):
    broken = {**to_metadata(facts(simulated=True), START_NS), "robot": "another"}
    stated = stated_facts(broken, sidecar(tmp_path, f"policy_digest: {POLICY}\n"))
    assert stated.damaged and stated.facts.policy_digest is None
    assert any("state `simulated`" in each for each in stated.remarks)
    complete = stated_facts(broken, sidecar(tmp_path, f"policy_digest: {POLICY}\nsimulated: false\n"))
    assert complete.facts.policy_digest == POLICY
