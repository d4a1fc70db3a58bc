"""Human gait figures as functions of the commanded speed, each with its source.

Speeds are arrays over time: forward and lateral [m/s], yaw rate [rad/s]. Changes for a
small robot (shorter slow steps, wider step) are stated in the docstrings.
"""

import numpy as np

WALK, RUN = "walk", "run"

WALK_RATIO = 0.39
"""Step length over step rate when walking [m s]: .0065 m/(steps/min), the invariant of adult gait
(Sekiya and Nagasaki, Gait & Posture 7, 1998; Hirasaki et al., Exp. Brain Res. 127, 1999)."""
SIDE_RATIO = 0.085
"""`WALK_RATIO` for lateral steps [m s]. [judgement: short quick steps keep the feet from crossing]"""
TURN_RATIO = 0.24
"""`WALK_RATIO` for turning in place [rad s]: about 40 degrees per step at 1.6 rad/s. [judgement]"""
SLOWEST_STEP_RATE = 1.35
"""Least step rate of slow walking [1/s]. [judgement: people take 1.0 to 1.2 steps/s at 0.4 m/s; the long single support
at this rate is hard for a small robot]"""


def step_rate(gait: str, forward: np.ndarray, lateral: np.ndarray, yaw_rate: np.ndarray) -> np.ndarray:
    """Step rate [Hz], counting both feet.

    Running: 2.55 /s at 2 m/s to 2.75 /s at 3.4 m/s (Nilsson and Thorstensson, Acta Physiol. Scand. 129,
    1987: stride rate 1.3 to 1.4 /s at 2 to 4 m/s). Walking: speed = step length x step rate with a constant ratio of
    the two, so step rate = sqrt(speed / ratio); directions combine by a 6-norm, a smooth maximum.
    """
    if gait == RUN:
        return 2.50 + 0.12 * forward
    parts = [
        np.sqrt(np.abs(forward) / WALK_RATIO),
        np.sqrt(np.abs(lateral) / SIDE_RATIO),
        np.sqrt(np.abs(yaw_rate) / TURN_RATIO),
    ]
    return (SLOWEST_STEP_RATE**6 + sum(part**6 for part in parts)) ** (1.0 / 6.0)


def duty(gait: str, forward: np.ndarray, lateral: np.ndarray, yaw_rate: np.ndarray) -> np.ndarray:
    """Duty factor: share of a stride in which a foot is on the ground [-].

    Walking: .66 slow to .57 at 2 m/s, .62 at the free speed, so double support falls from 32 to 14 %
    (Murray 1967; Perry and Burnfield, Gait Analysis, 2010). Running: contact .29 s at 2 m/s to .23 s at
    3.4 m/s, flight .10 to .13 s (Nilsson and Thorstensson 1989: duty .35 at 3 m/s).
    """
    if gait == RUN:
        return 0.44 - 0.037 * forward
    speed = np.sqrt(forward**2 + (2.2 * lateral) ** 2 + (0.4 * yaw_rate) ** 2)
    return 0.67 - 0.05 * speed


def step_width(gait: str, forward: np.ndarray, lateral: np.ndarray, yaw_rate: np.ndarray) -> np.ndarray:
    """Step width: lateral distance between the tracks of both feet [m].

    People walk .10 to .13 m wide and run on nearly one line; .17 and .14 m are used so that feet and
    shanks never touch, also on a robot. In lateral steps the least distance is .19 m, the largest
    larger by twice the step; turning needs room for the toes.
    """
    if gait == RUN:
        return np.full_like(forward, 0.14)
    side_step = np.abs(lateral) / step_rate(gait, forward, lateral, yaw_rate)
    return 0.17 + 0.01 * np.tanh(4.0 * np.abs(lateral)) + side_step + 0.06 * np.tanh(np.abs(yaw_rate))


def bob(forward: np.ndarray) -> np.ndarray:
    """Amplitude of the pelvis up and down in a walk [m], half the excursion.

    Excursion 2.7 cm at .7 m/s, 4.8 cm at 1.6 m/s (Orendurff et al., J. Rehabil. Res. Dev. 41, 2004).
    """
    return 0.5 * (0.0111 + 0.0233 * np.abs(forward))


def sway(gait: str, forward: np.ndarray, lateral: np.ndarray, yaw_rate: np.ndarray) -> np.ndarray:
    """Amplitude of the pelvis to the standing foot's side [m], half the excursion.

    Excursion 7.0 cm at .7 m/s, 3.9 cm at 1.6 m/s (Orendurff et al. 2004); written as a power of the stride rate, so
    that quick steps to the side or in place sway little too. A run has less.
    """
    if gait == RUN:
        return np.full_like(forward, 0.008)
    return 0.0178 * (step_rate(gait, forward, lateral, yaw_rate) / 2.0) ** -1.7


def body_ahead(gait: str, forward: np.ndarray) -> np.ndarray:
    """Forward position of the pelvis relative to the middle of the stance foot at midstance [m].

    Touchdown is less far in front of the hips than lift-off is behind them, increasingly with speed: at an easy run
    about .3 m in front and .4 m behind (Novacheck 1998). In standing the weight is over the arch.
    """
    return np.full_like(forward, 0.04) if gait == RUN else -0.02 + 0.022 * forward


def trunk_lean(gait: str, forward: np.ndarray) -> np.ndarray:
    """Forward lean of the trunk [rad]: 2 to 6 degrees walking (Thorstensson et al. 1984), 7 to 9
    degrees at an easy run (Novacheck, Gait & Posture 7, 1998)."""
    return np.deg2rad(4.0 + 1.4 * forward) if gait == RUN else np.deg2rad(2.0 + 1.6 * forward)


def pelvis_turn(forward: np.ndarray) -> np.ndarray:
    """Amplitude of the pelvis about the vertical [rad]: about 5 degrees at the free walking speed
    (Perry and Burnfield 2010: 10 degrees in total); reversed for walking backwards."""
    return np.deg2rad(6.5) * np.tanh(forward / 1.3)


def pelvis_list(gait: str, forward: np.ndarray) -> np.ndarray:
    """Amplitude of the pelvis about the forward axis [rad]: up to 4 degrees to the swing side (Perry and Burnfield
    2010); half of it is used, since a robot without a waist roll has to do it with its hips."""
    return np.deg2rad(1.0 + 0.6 * np.abs(forward)) if gait == WALK else np.full_like(forward, np.deg2rad(1.5))


def arm_swing(gait: str, forward: np.ndarray) -> np.ndarray:
    """Amplitude of the upper arm fore and aft [rad]: 30 to 40 degrees in all at the free walking speed
    (Murray et al., Am. J. Phys. Med. 46, 1967), 50 to 60 degrees at an easy run."""
    return (
        np.deg2rad(26.0) * np.tanh(forward / 3.0) / np.tanh(1.0)
        if gait == RUN
        else np.deg2rad(22.0) * np.tanh(forward / 1.3)
    )


def elbow_flexion(gait: str, forward: np.ndarray) -> np.ndarray:
    """Mean bend of the elbow [rad]: 15 to 40 degrees walking (Murray et al. 1967), about 80 running."""
    return np.full_like(forward, np.deg2rad(80.0)) if gait == RUN else np.deg2rad(18.0 + 9.0 * np.abs(forward))


def landing_pitch(gait: str, forward: np.ndarray) -> np.ndarray:
    """Pitch of the foot as it lands [rad], heel up positive.

    Walking: toes up by 15 to 20 degrees at the free speed (Perry and Burnfield 2010), here up to 12, which
    leaves a robot's ankle room; backwards the ball lands first. Running: nearly flat.
    """
    if gait == RUN:
        return np.full_like(forward, -0.12)
    return np.where(forward >= 0.0, -0.21 * np.tanh(forward / 0.9), -0.25 * np.tanh(forward / 0.6))


def leaving_pitch(gait: str, forward: np.ndarray) -> np.ndarray:
    """Pitch of the foot as it leaves the ground [rad], heel up positive.

    People: 35 degrees slow to 60 degrees fast (Perry and Burnfield 2010; Winter 2009); backwards the toes leave
    first, the heel last.
    """
    if gait == RUN:
        return 0.50 + 0.09 * (forward - 2.0)
    return np.where(forward >= 0.0, 0.10 + 0.62 * np.tanh(forward / 0.9), 0.10 + 0.2 * np.tanh(forward / 0.6))
