"""The knee of a torque-speed curve: two straight lines that meet, with confidence intervals.

    torque(speed) = T + s min(speed - k, 0) + m max(speed - k, 0)

k is the knee speed, T the knee torque, s <= 0 the slope of the plateau, m the slope of the fall. For a given k the
model is linear, so the best k is found by a grid search, without initial values. Outliers are detected by a fit of
least absolute deviations and left out.

The 95 % intervals are those of the profile likelihood: all values with which the other parameters can still be
chosen so that the sum of squares stays below min (1 + t^2 / (n - 4)), t of Student's distribution with n - 4 degrees
of freedom.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtr, stdtrit

PARAMETERS = 4
CONFIDENCE = 0.95
GRID = 240
"""Number of knee speeds in the search grid."""
REFINEMENTS = 5
"""Grid refinements around the best knee; 5 reach 1e-9 of the range."""
FLOOR = 1e-7
"""Least assumed noise over the largest torque, so that noise-free curves have an interval."""
OUTLIER_FLOOR = 1e-3
"""Sensor resolution over the largest torque; points within a few times this are never outliers."""
MAD_TO_SIGMA = 1.4826


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A value and its 95 % interval."""

    value: float
    low: float
    high: float

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    @property
    def width(self) -> float:
        """Width of the interval relative to the value."""
        return (self.high - self.low) / abs(self.value)

    def times(self, factor: float) -> "Interval":
        return Interval(value=self.value * factor, low=self.low * factor, high=self.high * factor)


@dataclass(frozen=True, kw_only=True)
class KneeFit:
    """Two lines through n points. Speed in rad/s, torque in N m, slopes in N m s/rad."""

    knee_speed: Interval
    knee_torque: Interval
    plateau_slope: float
    fall_slope: float
    noise: float
    """Standard deviation of the points around the lines, without outliers [N m]."""
    outlier: Bool[np.ndarray, " n"]

    @property
    def stall_torque(self) -> float:
        """Torque of the plateau's line at speed 0 [N m]."""
        return self.knee_torque.value - self.plateau_slope * self.knee_speed.value

    @property
    def no_load_speed(self) -> float:
        """Speed of the falling line at torque 0 [rad/s]; infinite if it does not fall."""
        if self.fall_slope >= 0.0:
            return float("inf")
        return self.knee_speed.value - self.knee_torque.value / self.fall_slope

    def torque(self, speed: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Torque [N m] of the two lines at speeds [rad/s]."""
        beyond = speed - self.knee_speed.value
        slopes = np.where(beyond < 0.0, self.plateau_slope, self.fall_slope)
        return self.knee_torque.value + slopes * beyond


@dataclass(frozen=True, kw_only=True)
class _Lines:
    """Least squares for each of g knees. Variances are for noise of variance 1."""

    torque: Float[np.ndarray, " g"]
    """Torque at the knee."""
    slope: Float[np.ndarray, " g"]
    """Slope of the plateau."""
    fall: Float[np.ndarray, " g"]
    """Slope of the fall."""
    square_sum: Float[np.ndarray, " g"]
    variance: Float[np.ndarray, " g"]
    """Variance of the knee torque."""
    covariance: Float[np.ndarray, " g"]
    """Covariance of knee torque and slope of the plateau."""


class _Profile:
    """Best lines through points for each of g knees, with a level plateau if it would rise otherwise."""

    def __init__(self, x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"], knees: Float[np.ndarray, " g"]):
        self.knees = knees
        self.sagging, self.level = _lines(x, y, knees, level=False), _lines(x, y, knees, level=True)
        self._rises = self.sagging.slope > 0.0
        self.square_sum = self._best("square_sum")

    def _best(self, name: str) -> Float[np.ndarray, " g"]:
        return np.where(self._rises, getattr(self.level, name), getattr(self.sagging, name))

    @property
    def coefficients(self) -> Float[np.ndarray, "g 3"]:
        """Knee torque, slope of plateau (at most 0), slope of fall."""
        return np.stack([self._best(name) for name in ("torque", "slope", "fall")], axis=1)

    def torque_range(self, bound: float) -> tuple[float, float]:
        """Lowest and highest knee torque of all lines with a sum of squares of at most `bound`.

        With a given knee torque the best slope of the plateau is linear in it, so those with a slope below 0 end at
        a highest torque; beyond it the level lines count.
        """
        level, sagging = self.level, self.sagging
        reach = np.sqrt(np.maximum(bound - level.square_sum, 0.0) * level.variance)
        inside = level.square_sum <= bound
        low, high = (level.torque - reach)[inside], (level.torque + reach)[inside]
        reach = np.sqrt(np.maximum(bound - sagging.square_sum, 0.0) * sagging.variance)
        top = np.minimum(sagging.torque + reach, sagging.torque - sagging.slope * sagging.variance / sagging.covariance)
        bottom = sagging.torque - reach
        inside = (sagging.square_sum <= bound) & (bottom <= top)
        return float(np.append(low, bottom[inside]).min()), float(np.append(high, top[inside]).max())


def fit_knee(speed: Float[np.ndarray, " n"], torque: Float[np.ndarray, " n"], outlier_sigma: float) -> KneeFit:
    """Fit the two lines.

    Args:
        speed: at least 5 different speeds [rad/s], in any order
        torque: [N m]
        outlier_sigma: distance in standard deviations above which a point is an outlier
    Raises ValueError for fewer than 5 different speeds.
    """
    if len(np.unique(speed)) <= PARAMETERS:
        raise ValueError(f"{len(np.unique(speed))} different speeds are too few for two lines.")
    x_scale, y_scale = float(np.abs(speed).max()), float(np.abs(torque).max()) or 1.0
    x, y = speed / x_scale, torque / y_scale
    outlier = _outliers(x, y, outlier_sigma)
    kept = ~outlier
    best = _best(x[kept], y[kept])
    freedom = int(kept.sum()) - PARAMETERS
    variance = max(float(best.square_sum[0]) / max(freedom, 1), FLOOR**2)
    knee, knee_torque = _intervals(x[kept], y[kept], best, variance, freedom)
    _, plateau, fall = best.coefficients[0]
    return KneeFit(
        knee_speed=knee.times(x_scale),
        knee_torque=knee_torque.times(y_scale),
        plateau_slope=float(plateau) * y_scale / x_scale,
        fall_slope=float(fall) * y_scale / x_scale,
        noise=float(np.sqrt(variance)) * y_scale,
        outlier=outlier,
    )


def _outliers(x: np.ndarray, y: np.ndarray, sigma: float) -> Bool[np.ndarray, " n"]:
    """Points far from the lines of least absolute deviation, then from the lines through the others.

    "Far" has the same tail of the distribution whatever the number of points: few points need a larger distance.
    """
    tail = float(ndtr(-sigma))
    residual = _least_absolute(x, y)
    correction = np.sqrt(len(x) / (len(x) - PARAMETERS))
    scale = max(MAD_TO_SIGMA * float(np.median(np.abs(residual))) * correction, OUTLIER_FLOOR)
    outlier = np.abs(residual) > float(-stdtrit(len(x) - PARAMETERS, tail)) * scale
    for _ in range(5):
        kept = ~outlier
        if kept.sum() <= PARAMETERS + 1 or len(np.unique(x[kept])) <= PARAMETERS:
            return np.zeros(len(x), dtype=bool)
        best = _best(x[kept], y[kept], refinements=1)
        residual = y - _design(x, best.knees)[0] @ best.coefficients[0]
        freedom = int(kept.sum()) - PARAMETERS
        scale = max(float(np.sqrt(best.square_sum[0] / freedom)), OUTLIER_FLOOR)
        found = np.abs(residual) > float(-stdtrit(freedom, tail)) * scale
        if np.array_equal(found, outlier):
            break
        outlier = found
    return outlier


def _least_absolute(x: np.ndarray, y: np.ndarray) -> Float[np.ndarray, " n"]:
    """Residuals of the two lines with the least sum of absolute residuals (iteratively reweighted squares)."""
    limits, knees = _knees(x, 2), _knees(x, GRID // 4)
    residual = np.zeros((1, len(x)))
    for _ in range(3):
        design = _design(x, knees)
        weights = np.ones((len(design), len(x)))
        for _ in range(10):
            residual = y - np.einsum("gni,gi->gn", design, _solve(design, y, weights)[0])
            weights = 1.0 / np.maximum(np.abs(residual), 1e-4)
        at = int(np.argmin(np.abs(residual).sum(axis=1)))
        residual = residual[at : at + 1]
        knees = _around(knees, at, limits, 17)
    return residual[0]


def _around(knees: np.ndarray, at: int, limits: np.ndarray, count: int) -> Float[np.ndarray, " g"]:
    """A finer grid around one knee of an even grid, within limits."""
    reach = 1.5 * (knees[1] - knees[0])
    return np.linspace(max(knees[at] - reach, limits[0]), min(knees[at] + reach, limits[1]), count)


def _knees(x: np.ndarray, count: int) -> Float[np.ndarray, " g"]:
    """Knees with a point or more inside each line."""
    places = np.unique(x)
    return np.linspace(places[1], places[-2], count)


def _design(x: np.ndarray, knees: np.ndarray) -> Float[np.ndarray, "g n 3"]:
    beyond = x[None, :] - knees[:, None]
    return np.stack([np.ones_like(beyond), np.minimum(beyond, 0.0), np.maximum(beyond, 0.0)], axis=-1)


def _solve(design: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted least squares for each knee: coefficients (g, 3) and inverse normal matrices (g, 3, 3)."""
    weighted = design * weights[..., None]
    inverse = np.linalg.inv(np.einsum("gni,gnj->gij", weighted, design))
    return np.einsum("gij,gj->gi", inverse, np.einsum("gni,n->gi", weighted, y)), inverse


def _lines(x: np.ndarray, y: np.ndarray, knees: np.ndarray, level: bool) -> _Lines:
    design = _design(x, knees)
    design = design[..., [0, 2]] if level else design
    coefficients, inverse = _solve(design, y, np.ones((len(knees), len(x))))
    residual = y - np.einsum("gni,gi->gn", design, coefficients)
    return _Lines(
        torque=coefficients[:, 0],
        slope=np.zeros(len(knees)) if level else coefficients[:, 1],
        fall=coefficients[:, -1],
        square_sum=np.sum(residual**2, axis=1),
        variance=inverse[:, 0, 0],
        covariance=np.zeros(len(knees)) if level else inverse[:, 0, 1],
    )


def _best(x: np.ndarray, y: np.ndarray, refinements: int = REFINEMENTS) -> _Profile:
    """The profile at the best knee alone."""
    limits = _knees(x, 2)
    knees = _knees(x, GRID)
    for _ in range(refinements + 1):
        square_sum = _Profile(x, y, knees).square_sum
        at = int(np.argmin(square_sum))
        middle = knees[at]
        knees = _around(knees, at, limits, 49)
    return _Profile(x, y, np.array([middle]))


def _intervals(
    x: np.ndarray, y: np.ndarray, best: _Profile, variance: float, freedom: int
) -> tuple[Interval, Interval]:
    """Profile intervals of knee speed and knee torque."""
    room = variance * float(stdtrit(max(freedom, 1), 0.5 + CONFIDENCE / 2.0)) ** 2
    bound = float(best.square_sum[0]) + room
    knee, knee_torque = float(best.knees[0]), float(best.coefficients[0, 0])
    limits = _knees(x, 2)
    spread = _knees(x, GRID)
    for _ in range(6):  # refine the grid to the accepted range plus one step until it fills it
        inside = np.flatnonzero(_Profile(x, y, spread).square_sum <= bound)
        step = spread[1] - spread[0]
        first, last = (spread[inside[0]], spread[inside[-1]]) if len(inside) else (knee, knee)
        low, high = max(min(first, knee) - step, limits[0]), min(max(last, knee) + step, limits[1])
        filled = len(inside) > GRID // 2
        spread = np.linspace(low, high, GRID)
        if filled:
            break
    found = _Profile(x, y, np.append(spread, knee))
    inside = found.square_sum <= bound
    step = spread[1] - spread[0]
    lowest, highest = found.torque_range(bound)
    return (
        Interval(value=knee, low=float(found.knees[inside].min() - step), high=float(found.knees[inside].max() + step)),
        Interval(value=knee_torque, low=lowest, high=highest),
    )
