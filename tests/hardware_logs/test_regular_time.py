"""Messages come late, twice, out of order or not at all; samples come every two milliseconds."""

import numpy as np
import pytest

from pipeline.hardware_logs.columns import LINEAR, PREVIOUS
from pipeline.hardware_logs.log_report import TimeSettings, stretches
from pipeline.hardware_logs.regular import LOST, SILENT, Block, Regular, Stretched
from pipeline.hardware_logs.trial import Gap

SETTINGS = TimeSettings(rate_hz=500.0, bridge_s=0.02, split_s=1.0, disorder_s=0.05, min_s=0.2)
START_NS = 1_750_000_000_000_000_000
MS = 1_000_000


def columns(time_ns: np.ndarray) -> dict[str, np.ndarray]:
    """Every column tells the time since the start in ms, each joint a thousand more."""
    ms = ((time_ns - START_NS) / MS).astype(np.float32)[:, None]
    found = {name: ms + 1_000.0 * np.arange(2, dtype=np.float32) for name in LINEAR}
    found["rpy"] = np.zeros((len(ms), 3), dtype=np.float32)
    return found | {
        name: np.repeat(ms.astype(np.int64 if name == "lost" else np.float32), 2, axis=1) for name in PREVIOUS
    }


def run(pieces: list[np.ndarray], lost_before: int | None = None) -> tuple[list[list[Block]], list[Stretched]]:
    """Blocks of each trial, and the trials."""
    regular, trials, made = Regular(SETTINGS, 2), [[]], []

    def take(found):
        for each in found:
            if isinstance(each, Stretched):
                made.append(each)
                trials.append([])
            else:
                trials[-1].append(each)

    for number, time_ns in enumerate(pieces):
        if number == lost_before:
            regular.lose()
        regular.add(time_ns, columns(time_ns))
        take(regular.ready())
    take(regular.finish())
    return [trial for trial in trials if trial], made


def joined(blocks: list[Block], name: str) -> np.ndarray:
    return np.concatenate([each.columns[name] for each in blocks])


def stamps(*ms: float) -> np.ndarray:
    return START_NS + np.round(np.array(ms) * MS).astype(np.int64)


@pytest.mark.parametrize("seed", range(5))
def test_jitter_disorder_and_duplicates_do_not_move_a_linear_signal(seed):
    rng = np.random.default_rng(seed)
    ms = np.sort(np.arange(500) * 2.0 + rng.uniform(0.0, 1.9, size=500))
    order = np.argsort(np.arange(500) + rng.uniform(0.0, 5.0, size=500), kind="stable")
    ms = np.insert(ms[order], 100, ms[order][99])
    pieces = np.array_split(stamps(*ms), rng.integers(1, 20))
    (blocks,), (trial,) = run(pieces)
    grid = np.concatenate([each.grid_ns for each in blocks])
    np.testing.assert_array_equal(np.diff(grid), 2 * MS)
    assert (grid % (2 * MS) == 0).all()
    np.testing.assert_allclose(joined(blocks, "joint_pos")[:, 1], (grid - START_NS) / MS + 1_000.0, atol=1e-3)
    assert trial.gaps == []
    assert trial.messages == 500


def test_pieces_do_not_change_samples():
    ms = np.arange(300) * 2.0 + np.random.default_rng(1).uniform(0.0, 1.0, size=300)
    whole, _ = run([stamps(*ms)])
    parts, _ = run(list(np.array_split(stamps(*ms), 13)))
    for name in LINEAR + PREVIOUS:
        np.testing.assert_array_equal(joined(whole[0], name), joined(parts[0], name))


def test_a_silence_is_a_gap_and_a_long_one_ends_the_trial():
    ms = [*np.arange(0, 200, 2), *np.arange(300, 500, 2), *np.arange(1600, 1900, 2)]
    trials, made = run([stamps(*ms)])
    assert len(trials) == len(made) == 2
    (gap,) = made[0].gaps
    assert (gap.start_s, gap.stop_s, gap.reason) == (pytest.approx(0.198), pytest.approx(0.3), SILENT)
    values = joined(trials[0], "joint_pos")[:, 0]
    np.testing.assert_array_equal(np.isnan(values), [198 < 2 * n < 300 for n in range(len(values))])
    assert made[1].start_ns == START_NS + 1600 * MS


def test_temperatures_and_lost_packets_keep_the_last_value_between_messages():
    ((block,),), _ = run([stamps(1.0, 5.0, 9.0)])
    assert ((block.grid_ns - START_NS) / MS).tolist() == [2.0, 4.0, 6.0, 8.0]
    for name in PREVIOUS:
        assert block.columns[name][:, 0].tolist() == [1.0, 1.0, 5.0, 5.0], name


def test_the_rate_of_messages_is_that_of_the_time_that_damage_left():
    """Ten seconds, one of them damaged: 4,500 messages are 500 a second. A silence without damage counts as time."""
    gaps = [Gap(start_s=1.0, stop_s=2.0, reason=LOST), Gap(start_s=5.0, stop_s=6.0, reason=SILENT)]
    trial = Stretched(start_ns=START_NS, gaps=gaps, samples=5000, messages=4500)
    assert trial.message_hz(500.0) == pytest.approx(500.0)
    assert Stretched(start_ns=START_NS, samples=5000, messages=4500).message_hz(500.0) == pytest.approx(450.0)


def test_where_messages_were_lost_even_a_short_span_is_not_joined():
    first, second = np.arange(0, 100, 2), np.arange(108, 200, 2)
    _, (trial,) = run([stamps(*first), stamps(*second)])
    assert trial.gaps == []
    _, (trial,) = run([stamps(*first), stamps(*second)], lost_before=1)
    assert [gap.reason for gap in trial.gaps] == [LOST]


def test_what_is_held_is_forgotten_where_messages_were_lost():
    regular = Regular(SETTINGS, 2)
    state = np.ones(1, dtype=np.int64)
    regular.hold("/fall_down", stamps(0.0), {"fall_state": state})
    regular.add(stamps(*np.arange(0, 100, 2)), columns(stamps(*np.arange(0, 100, 2))))
    regular.lose()
    regular.add(stamps(*np.arange(100, 200, 2)), columns(stamps(*np.arange(100, 200, 2))))
    regular.hold("/fall_down", stamps(150.0), {"fall_state": 2 * state})
    blocks = [each for each in regular.finish() if isinstance(each, Block)]
    expected = np.repeat([1, -1, 2], [49, 26, 25])
    np.testing.assert_array_equal(joined(blocks, "fall_state"), expected)


def test_angles_go_the_short_way_round():
    regular, times = Regular(SETTINGS, 2), stamps(1.0, 3.0)
    turned = {**columns(times), "rpy": np.array([[0.0, 0.5, 3.1], [0.0, 0.5, -3.1]], dtype=np.float32)}
    regular.add(times, turned)
    (block,) = [each for each in regular.finish() if isinstance(each, Block)]
    np.testing.assert_allclose(np.abs(block.columns["rpy"][0, 2]), np.pi, atol=1e-5)


@pytest.mark.parametrize("step_s", [-3600.0, -1.0, 5.0])
def test_a_jump_of_the_clock_cuts(step_s):
    time_ns = START_NS + np.arange(100) * 2 * MS
    time_ns[60:] += int(step_s * 1e9)
    one, other = stretches(time_ns, None, back_ns=50 * MS, ahead_ns=1_000 * MS)
    assert (one[1], other[1]) == (False, True)
    np.testing.assert_array_equal(one[0], np.arange(60))
    np.testing.assert_array_equal(other[0], np.arange(60, 100))


@pytest.mark.parametrize("stray", [0, 50, 99])
@pytest.mark.parametrize("stamp", [0, -5, 1 << 62, START_NS - 10**12, START_NS + 10**12])
def test_a_message_with_a_stamp_of_its_own_is_left_out(stray, stamp):
    time_ns = START_NS + np.arange(100) * 2 * MS
    time_ns[stray] = stamp
    (only,) = stretches(time_ns, None, back_ns=50 * MS, ahead_ns=1_000 * MS)
    assert not only[1]
    np.testing.assert_array_equal(only[0], np.delete(np.arange(100), stray))


def test_small_disorder_is_no_jump():
    time_ns = START_NS + np.arange(100) * 2 * MS
    time_ns[[50, 51]] = time_ns[[51, 50]]
    (only,) = stretches(time_ns, START_NS - 2 * MS, back_ns=50 * MS, ahead_ns=1_000 * MS)
    assert len(only[0]) == 100
