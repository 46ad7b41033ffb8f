"""The table of profiles with their ellipses."""

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipecore.display import Summarised
from pipecore.types.arrays import Array
from pipecore.types.stack import OWN_STACK


@dataclass(frozen=True, eq=False, repr=False)
class Profiles(Summarised):
    """The profiles of all elements with their ellipses: a table, one array per column.

    Rows of one element and stack are in order of `chainage`.

    Parameters
    ----------
    element_id, stack_id, profile_index : ndarray of int32, shape (m,)
        `stack_id` is `OWN_STACK` for profiles cut across the element's own axis; the
        index then counts from the start of the element.
    chainage : ndarray, shape (m,)
    centre : ndarray, shape (m, 3)
        Centre of the ellipse.
    normal, major_direction : ndarray, shape (m, 3)
        Unit normal of the profile's plane; unit vector along the major axis, in the plane.
    semi_minor, semi_major : ndarray, shape (m,)
        Of the ellipse fitted freely where the arc carries it, else of the constrained one:
        about the element's axis in its own stack, along the points' axis in the others.
    semi_minor_sd : ndarray, shape (m,)
        Standard deviation of the semi-minor axis.
    radius, radius_sd : ndarray, shape (m,)
        Of the free circle seen along the axis, and its standard deviation.
    ovality : ndarray, shape (m,)
        (Dmax - Dmin) / Dnom of this profile as a ratio, nan where not measurable.
    centre_deviation, radius_deviation : ndarray, shape (m,)
        Distance of the centre from the element's axis; radius less the element's radius.
    arc : ndarray, shape (m,)
        Arc that the points cover, radians.
    n_points : ndarray of int32, shape (m,)
    rms : ndarray, shape (m,)
    aic_line, aic_ellipse : ndarray, shape (m,)
        Equation 4 of the paper for either model.
    curvature_variation : ndarray, shape (m,)
        Of the smooth curve fitted to the profile (paper, figures 14 and 15): 0 where it is
        round; see `SectionCurve.curvature_variation`. nan where none was fitted.
    """

    element_id: NDArray[np.int32]
    stack_id: NDArray[np.int32]
    profile_index: NDArray[np.int32]
    chainage: Array
    centre: Array
    normal: Array
    major_direction: Array
    semi_minor: Array
    semi_major: Array
    semi_minor_sd: Array
    radius: Array
    radius_sd: Array
    ovality: Array
    centre_deviation: Array
    radius_deviation: Array
    arc: Array
    n_points: NDArray[np.int32]
    rms: Array
    aic_line: Array
    aic_ellipse: Array
    curvature_variation: Array = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Leave nan where no curves were fitted."""
        if len(self.curvature_variation) != len(self.element_id):
            unknown = np.full(len(self.element_id), np.nan)
            object.__setattr__(self, "curvature_variation", unknown)

    def __len__(self) -> int:
        """Return the number of profiles."""
        return len(self.element_id)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.intp] | slice) -> "Profiles":
        """Return the given rows as a table."""
        return Profiles(*(getattr(self, f.name)[rows] for f in fields(self)))

    def _title(self) -> str:
        return "Profiles"

    def _facts(self) -> dict[str, str]:
        return {
            "rows": f"{len(self):,}",
            "elements": f"{len(np.unique(self.element_id)):,}",
            "across elements' own axes": f"{np.count_nonzero(self.stack_id == OWN_STACK):,}",
        }

    @property
    def flattening(self) -> Array:
        """1 - semi-minor / semi-major (paper, section 3.3.1)."""
        return 1.0 - self.semi_minor / self.semi_major

    @property
    def minor_drop(self) -> Array:
        """How much the semi-minor axis lies below the element's radius (paper, figure 13)."""
        return np.asarray(self.radius - self.radius_deviation - self.semi_minor)

    def of_element(self, element_id: int, stack_id: int | None = None) -> "Profiles":
        """Return the rows of one element, of one stack if given.

        Parameters
        ----------
        element_id : int
        stack_id : int, optional

        Returns
        -------
        Profiles
        """
        rows = self.element_id == element_id
        if stack_id is not None:
            rows &= self.stack_id == stack_id
        return self[rows]

    @classmethod
    def concatenate(cls, tables: "list[Profiles]") -> "Profiles":
        """Return one table with the rows of all.

        Parameters
        ----------
        tables : list of Profiles

        Returns
        -------
        Profiles
        """
        if not tables:
            return cls.empty()
        return cls(*(np.concatenate([getattr(t, f.name) for t in tables]) for f in fields(cls)))

    @classmethod
    def empty(cls) -> "Profiles":
        """Return a table without rows."""
        shapes: dict[str, Any] = {f.name: np.empty(0) for f in fields(cls)}
        shapes |= {name: np.empty((0, 3)) for name in ("centre", "normal", "major_direction")}
        for name in ("element_id", "stack_id", "profile_index", "n_points"):
            shapes[name] = np.empty(0, np.int32)
        return cls(**shapes)
