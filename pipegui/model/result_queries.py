"""Parts of a result: the profiles, points and deformations of one element.

Computed once for each result, because view states compare them by identity.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipecore import rules
from pipecore.errors import SettingsError
from pipecore.geometry import Array, surface_points
from pipecore.inspection.points import ElementPoints, element_points, profile_points
from pipecore.rules import DentLimit, Rule, load_rules
from pipecore.types import (
    OWN_STACK,
    Deformation,
    PointCloud,
    Profiles,
    Result,
)
from pipegui.i18n.texts import tr
from pipegui.model.cache import cached_with_owner
from pipegui.model.document import ProfileKey


@cached_with_owner(maxsize=8)
def count_profiles(result: Result) -> tuple[int, ...]:
    """Return the number of profiles with an accepted ellipse, per stack."""
    return tuple(int((result.profiles.stack_id == s.stack_id).sum()) for s in result.stacks)


@cached_with_owner(maxsize=8)
def profile_indices(result: Result, stack_id: int) -> NDArray[np.int32]:
    """Return the profiles of a stack that have an accepted ellipse, in their order."""
    profiles = result.profiles
    return np.unique(profiles.profile_index[profiles.stack_id == stack_id])


@cached_with_owner(maxsize=32)
def deformations_of(result: Result, element_id: int) -> tuple[Deformation, ...]:
    """Return the deformations of one element."""
    return result.deformations_of(element_id)


@cached_with_owner(maxsize=32)
def profiles_of(result: Result, element_id: int) -> Profiles:
    """Return the profiles of one element, of every stack."""
    return result.profiles.of_element(element_id)


@cached_with_owner(maxsize=32)
def profile_at(result: Result, element_id: int, key: ProfileKey) -> Profiles | None:
    """Return one profile as a table of one row, None if it is not there.

    Parameters
    ----------
    result : Result
        The result to look in.
    element_id : int
        The profile's element.
    key : ProfileKey
        Stack and index of the profile.

    Returns
    -------
    Profiles or None
    """
    rows = profiles_of(result, element_id)
    row = (rows.stack_id == key.stack_id) & (rows.profile_index == key.profile_index)
    return rows[np.flatnonzero(row)[:1]] if row.any() else None


@cached_with_owner(maxsize=32)
def stack_choices(result: Result, element_id: int) -> tuple[tuple[int, str, int], ...]:
    """Return stacks with profiles of an element: the normal stack first, then by number.

    Parameters
    ----------
    result : Result
        The result to look in.
    element_id : int
        The element.

    Returns
    -------
    tuple of (int, str, int)
        Id and name of each stack, and its number of profiles of the element.
    """
    ids, counts = np.unique(profiles_of(result, element_id).stack_id, return_counts=True)
    choices = [
        (int(i), stack_name(result, int(i)), int(n)) for i, n in zip(ids, counts, strict=True)
    ]
    return tuple(sorted(choices, key=lambda c: (c[0] != OWN_STACK, -c[2], c[0])))


@cached_with_owner(maxsize=32)
def plotted_profiles(result: Result, element_id: int) -> Profiles:
    """Return the profiles of an element's normal stack, else of the stack with most of them."""
    rows, choices = profiles_of(result, element_id), stack_choices(result, element_id)
    return rows[rows.stack_id == choices[0][0]] if choices else rows


@lru_cache(maxsize=4)
def _rules(names: str) -> tuple[Rule, ...]:
    try:
        return load_rules(names)
    except SettingsError:  # the user's own file may be gone since
        return ()


def rules_of(result: Result, element_id: int) -> tuple[Rule, ...]:
    """Return the rules that judge an element's deformations; none if a file of one is gone."""
    return _rules(result.settings_of(element_id).deformation.rule)


@cached_with_owner(maxsize=32)
def dent_limit(result: Result, element_id: int) -> DentLimit | None:
    """Return the strictest limit that the result's rules set on an element's dents."""
    return rules.dent_limit(result.element(element_id), rules_of(result, element_id))


def stack_name(result: Result, stack_id: int) -> str:
    """Return the name of a stack."""
    if stack_id == OWN_STACK:
        return tr("Across the axis")
    stack = next((s for s in result.stacks if s.stack_id == stack_id), None)
    return (
        stack.name
        if stack is not None and stack.name
        else tr("Stack {stack_id}").format(stack_id=stack_id)
    )


@cached_with_owner(maxsize=4)
def points_of(result: Result, cloud: PointCloud, element_id: int) -> ElementPoints:
    """Return the points of one element in its pipe coordinates.

    Parameters
    ----------
    result : Result
        A result of `cloud`.
    cloud : PointCloud
        All points.
    element_id : int
        The element.

    Returns
    -------
    ElementPoints
        Chainage and distance from the axis in metres, clock angle in radians.
    """
    return element_points(cloud, result, element_id)


@cached_with_owner(maxsize=8)
def points_of_profile(result: Result, cloud: PointCloud, element_id: int, key: ProfileKey) -> Array:
    """Return the points of an element that lie in one profile, shape (n, 3), float64."""
    profile = profile_at(result, element_id, key)
    assert profile is not None
    index = profile_points(cloud, result, profile, points_of(result, cloud, element_id))
    return cloud.xyz[index].astype(np.float64)


def spot_on_surface(result: Result, element_id: int, chainage: float, clock: float) -> Array:
    """Local coordinates of a spot of an element's undeformed surface, shape (3,).

    Parameters
    ----------
    result : Result
        The result to look in.
    element_id : int
        The element.
    chainage : float
        Along the element's axis, metres.
    clock : float
        Angle around the axis, radians.

    Returns
    -------
    ndarray
        Local coordinates in metres, shape (3,).
    """
    element = result.element(element_id)
    radius = float(element.radius_at(chainage))
    return np.asarray(surface_points(element.axis, [chainage], [radius], [clock])[0])


def spot_of_point(
    cloud: PointCloud, result: Result, element_id: int, point_index: int
) -> tuple[float, float] | None:
    """Chainage and clock of a point of the cloud on an element, None if it is not on it.

    Parameters
    ----------
    cloud : PointCloud
        All points.
    result : Result
        A result of `cloud`.
    element_id : int
        The element.
    point_index : int
        Which point of the cloud, -1 for none.

    Returns
    -------
    (float, float) or None
        Chainage in metres and clock angle in radians.
    """
    if not element_id or point_index < 0 or int(result.element_id[point_index]) != element_id:
        return None
    xyz = cloud.xyz[point_index : point_index + 1].astype(np.float64)
    chainage, _, clock = result.element(element_id).axis.pipe_coordinates(xyz)
    return float(chainage[0]), float(clock[0])
