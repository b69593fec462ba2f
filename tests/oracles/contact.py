"""The paper's equation 5, repaired, in float64 NumPy: once as written, once where 1 − f would cancel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

RIM = np.sqrt(1 - 0.5 ** (1 / 3))


def falloff(distance: NDArray[Any]) -> Any:
    """g(d), eq. 2."""
    return np.where(distance <= 1, (1 - np.minimum(distance, 1) ** 2) ** 3, 0.0)


def inverse_falloff(field: Any) -> Any:
    """g⁻¹(F), eq. 3."""
    return np.sqrt(1 - np.cbrt(field))


def contact_field(fields: Any) -> Any:
    """F of rows of field values, literally: owner = highest field; NaN where the owner's field is below ½."""
    fields = np.asarray(fields, np.float64)
    owner = fields.argmax(axis=1)
    highest = fields[np.arange(len(fields)), owner][:, None]
    with np.errstate(all="ignore"):
        u = (fields + highest - 1) / (2 * highest - 1)
        h = np.where(fields + highest <= 1, 1.0, 1 - np.abs(u) ** (1 / (1 - highest)))
    h[fields == highest] = 0.0  # u = 1, also where 1/(1 - f) is infinite
    h[np.arange(len(fields)), owner] = 1.0
    deformed = 0.5 + (highest[:, 0] - 0.5) * h.prod(axis=1)
    return np.where(highest[:, 0] >= 0.5, deformed, np.nan)


def complements(squared: Any) -> Any:
    """e = 1 − g of squared relative distances, without cancellation."""
    t = np.minimum(squared, 1.0)
    return t * (3 - 3 * t + t * t)


def log_factor(e: Any, least: Any) -> Any:
    """log h_i of neighbours with complement e against owners with complement least; −∞ on a tie."""
    with np.errstate(all="ignore"):
        w = np.minimum((e - least) / (1 - 2 * least), 1)
        log_h = np.log1p(-np.exp(np.log1p(-w) / least))
    return np.where(e == least, -np.inf, np.where(w < 1, log_h, 0.0))


def contact_complement(e: Any, *, strongest: bool = False) -> Any:
    """(owner, E = 1 − F) of rows of complements, to full relative precision; owner −1 outside all rims.

    strongest: the least of the factors h in place of their product.
    """
    e = np.asarray(e, np.float64)
    rows, owner = np.arange(len(e)), e.argmin(axis=1)
    least = e[rows, owner][:, None]
    log_h = log_factor(e, least)
    log_h[rows, owner] = 0.0
    together = log_h.min(axis=1) if strongest else log_h.sum(axis=1)
    result = least[:, 0] + (0.5 - least[:, 0]) * -np.expm1(together)
    return np.where(least[:, 0] <= 0.5, owner, -1), result


def rim_distance(complement: Any) -> Any:
    """r / r_h = g⁻¹(1 − E) / r_h, without cancellation."""
    c = np.cbrt(1 - complement)
    return np.sqrt(complement / (1 + c + c * c)) / RIM


def pressed_away(first: float = 0.6, second: float = 0.4, distance: float = 0.8) -> float:
    """What a rim without contact has beyond the image of the first of two decals, in % of that image."""
    x, y = np.meshgrid(np.linspace(-1, 1, 2001), np.linspace(-1, 1, 2001))
    own, other = falloff(np.hypot(x, y) * RIM / first), falloff(np.hypot(x - distance, y) * RIM / second)
    return float(100.0 * ((own >= 0.5).sum() / ((own >= 0.5) & (own > other)).sum() - 1.0))
