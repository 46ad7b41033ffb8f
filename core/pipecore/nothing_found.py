"""Why nothing was found: the likeliest reason that the data show, and what to change."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from pipecore.elements.gates import refusals
from pipecore.notes import Note
from pipecore.settings import ElementSettings, Settings
from pipecore.surface import Surface
from pipecore.types import Candidate

FAR_APART = 0.5
"""Points of a scan of pipes in metres lie nearer together than this, metres."""
TINY_EXTENT = 0.05
"""A scan of pipes is wider than this, metres: thinner things are read in too small a unit."""
MIN_STEPS_AROUND = 12.0
"""Fewer points around a section do not tell a circle from a corner."""
USUAL_RADIUS = 0.05
"""Pipes of a plant are mostly wider than this, metres."""
NOISY = 0.10
"""Noise above this share of a radius hides that a surface is round."""

ADVICE = {
    refusals.TOO_THIN: "No pipes found. What is round here has radii of about {radius} mm, below "
    "the smallest radius of {limit} mm: set the smallest radius lower.",
    refusals.TOO_WIDE: "No pipes found. What is round here has radii of about {radius} mm, above "
    "the largest radius of {limit} mm: set the largest radius higher.",
    refusals.TOO_SHORT: "No pipes found. What is round here is only {value} mm long: set the "
    "shortest pipe below {limit} mm.",
    refusals.SCATTERS: "No pipes found. The points scatter by {value} mm about what is round: see "
    "what was not accepted in the report, and whether the stations fit together.",
}
"""What to say where most candidates were refused for a reason."""
OTHERWISE = (
    "No pipes found. {n} surfaces were nearly accepted: the report says what they are and why not."
)


def nothing_found_notes(
    surface: Surface, candidates: Sequence[Candidate], settings: Settings
) -> tuple[Note, ...]:
    """Return a note that says why nothing was found, as far as the data show it.

    Parameters
    ----------
    surface : Surface
        The downsampled points.
    candidates : sequence of Candidate
        What was nearly accepted.
    settings : Settings

    Returns
    -------
    tuple of Note
        One.
    """
    spacing = float(np.median(surface.spacing)) if len(surface.spacing) else np.nan
    extent = float(np.ptp(surface.xyz, axis=0).max()) if len(surface.xyz) else np.nan
    sizes = settings.elements
    return (
        _of_unit(spacing, extent)
        or _of_candidates(candidates)
        or _of_limits(sizes)
        or _of_points(spacing, surface.noise, sizes),
    )


def _of_unit(spacing: float, extent: float) -> Note | None:
    if spacing > FAR_APART:
        return Note(
            "No pipes found: the points lie {spacing} m apart, as if a scan in millimetres had "
            "been read as metres: set the length unit to mm.",
            spacing=round(spacing, 1),
        )
    if extent < TINY_EXTENT:
        return Note(
            "No pipes found: the whole scan is {extent} mm wide, as if a scan in metres had been "
            "read as millimetres: set the length unit to m.",
            extent=round(1e3 * extent, 1),
        )
    return None


def _of_candidates(candidates: Sequence[Candidate]) -> Note | None:
    if not candidates:
        return None
    template, _ = Counter(c.reason.template for c in candidates).most_common(1)[0]
    alike = [c for c in candidates if c.reason.template == template]
    advice = ADVICE.get(template, OTHERWISE)
    values = {
        "radius": round(1e3 * float(np.median([c.radius for c in alike])), 1),
        "value": round(float(np.median([c.value for c in alike])), 1),
        "limit": round(float(np.median([c.limit for c in alike])), 1),
        "n": len(candidates),
    }
    return Note(advice, **{k: v for k, v in values.items() if f"{{{k}}}" in advice})


def _of_limits(sizes: ElementSettings) -> Note | None:
    default = ElementSettings()
    if sizes.min_radius_mm > default.min_radius_mm or sizes.max_radius_mm < default.max_radius_mm:
        return Note(
            "No pipes found with radii between {low} and {high} mm: set the smallest and the "
            "largest radius wider.",
            low=sizes.min_radius_mm,
            high=sizes.max_radius_mm,
        )
    return None


def _of_points(spacing: float, noise: float, sizes: ElementSettings) -> Note:
    least = max(USUAL_RADIUS, sizes.min_radius_mm / 1e3)
    # Points far apart seem noisy: their planes cut off what is curved.
    if 2 * np.pi * least < MIN_STEPS_AROUND * spacing:
        return Note(
            "No pipes found: the points lie {spacing} mm apart, too far for pipes below a "
            "radius of {radius} mm. Use a denser scan.",
            spacing=round(1e3 * spacing, 1),
            radius=round(1e3 * MIN_STEPS_AROUND * spacing / (2 * np.pi)),
        )
    if noise > NOISY * least:
        return Note(
            "No pipes found: the points scatter by {noise} mm, too much for pipes below a "
            "radius of {radius} mm. Check whether the stations fit together, or filter the noise.",
            noise=round(1e3 * noise, 1),
            radius=round(1e3 * noise / NOISY),
        )
    return Note(
        "No pipes found: nothing in the scan is round over enough of its circumference and length. "
        "Check that the pipes are in the part that was read."
    )
