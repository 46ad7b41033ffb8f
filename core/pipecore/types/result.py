"""What a detection found."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pipecore
from pipecore.display import Summarised
from pipecore.notes import Note
from pipecore.settings import LengthUnit, Settings
from pipecore.table import Table
from pipecore.types.arrays import Array
from pipecore.types.candidate import Candidate
from pipecore.types.cloud import PointCloud
from pipecore.types.deformation import Deformation
from pipecore.types.element import KIND_LABELS, Element
from pipecore.types.ids import find_by_id
from pipecore.types.profiles import Profiles
from pipecore.types.stack import Stack
from pipecore.types.stations import StationCheck
from pipecore.units import FileUnit


@dataclass(frozen=True, eq=False, repr=False)
class Result(Summarised):
    """What a detection found, with the settings that made it.

    Per-point arrays follow the order of the cloud's points.

    Parameters
    ----------
    settings : Settings
    origin : ndarray
        World coordinates of the local zero, shape (3,).
    source : Path, optional
    n_cloud_points : int
    stacks : tuple of Stack
        In the order of their ids.
    elements : tuple of Element
        In the order of their ids, 1, 2, … as detected. What is deleted afterwards leaves
        a gap, so that the others keep their ids.
    profiles : Profiles
    deformations : tuple of Deformation
        In the order of their ids, as for elements.
    segment_id, element_id : ndarray of int32, shape (n,)
        `NO_ID` for points of none. These three are empty in a result that was loaded from a
        report without ``segments.laz``.
    deviation : ndarray of float32, shape (n,)
        Signed radial distance from the element's reference contour, metres, outward
        positive; nan for points of none.
    seconds : dict
        Time spent per step.
    edits : tuple of str
        What was changed by hand since the detection, the first change first.
    run_names : mapping of int to str
        What a person calls runs, by their ids; the others go by number.
    own_settings : mapping of int to Settings
        Of elements that were detected again with other settings, by their ids.
    unit : FileUnit
        Unit of the file's coordinates, as the cloud was read; see `file_unit`.
    notes : tuple of Note
        What was noted when the cloud was read, and why nothing was found if nothing was.
    candidates : tuple of Candidate
        What was nearly accepted, in the order of their ids; those that a person accepts or
        dismisses leave it.
    n_more_candidates : int
        How many more there were, which are not kept.
    station_check : StationCheck, optional
        How the stations fit together; None where only one is known.
    """

    settings: Settings
    origin: Array
    source: Path | None
    n_cloud_points: int
    stacks: tuple[Stack, ...]
    elements: tuple[Element, ...]
    profiles: Profiles
    deformations: tuple[Deformation, ...]
    segment_id: NDArray[np.int32]
    element_id: NDArray[np.int32]
    deviation: NDArray[np.float32]
    seconds: dict[str, float]
    edits: tuple[str, ...] = ()
    run_names: Mapping[int, str] = field(default_factory=dict)
    own_settings: Mapping[int, Settings] = field(default_factory=dict)
    unit: FileUnit = FileUnit()
    notes: tuple[Note, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    n_more_candidates: int = 0
    station_check: StationCheck | None = None

    @property
    def file_unit(self) -> FileUnit:
        """Unit of the file's coordinates: the settings', or that of the cloud if automatic."""
        chosen = self.settings.input.length_unit
        return self.unit if chosen is LengthUnit.AUTO else FileUnit.of(chosen)

    def settings_of(self, element_id: int) -> Settings:
        """Return the settings with which an element was found.

        Parameters
        ----------
        element_id : int

        Returns
        -------
        Settings
        """
        return self.own_settings.get(element_id, self.settings)

    def run_label(self, run_id: int) -> str:
        """What people call a run: its own name, else such as "Run 3".

        Parameters
        ----------
        run_id : int

        Returns
        -------
        str
        """
        return self.run_names.get(run_id) or f"Run {run_id}"

    def element(self, element_id: int) -> Element:
        """Return the element with this id; `KeyError` if there is none.

        Parameters
        ----------
        element_id : int

        Returns
        -------
        Element
        """
        return find_by_id(self.elements, "element_id", element_id)

    def deformation(self, deformation_id: int) -> Deformation:
        """Return the deformation with this id; `KeyError` if there is none.

        Parameters
        ----------
        deformation_id : int

        Returns
        -------
        Deformation
        """
        return find_by_id(self.deformations, "deformation_id", deformation_id)

    def candidate(self, candidate_id: int) -> Candidate:
        """Return the candidate with this id; `KeyError` if there is none.

        Parameters
        ----------
        candidate_id : int

        Returns
        -------
        Candidate
        """
        return find_by_id(self.candidates, "candidate_id", candidate_id)

    def deformations_of(self, element_id: int) -> tuple[Deformation, ...]:
        """Return the deformations of one element.

        Parameters
        ----------
        element_id : int

        Returns
        -------
        tuple of Deformation
        """
        return tuple(d for d in self.deformations if d.element_id == element_id)

    # Tables and reports stand above the types in the library: they are reached through the
    # package itself, which imports them when they are first used.

    def elements_table(self) -> Table:
        """Return the elements as ``elements.csv`` has them; see `pipecore.report`.

        Returns
        -------
        Table
        """
        return pipecore.report.elements_table(self)

    def profiles_table(self) -> Table:
        """Return the profiles as ``profiles.csv`` has them.

        Returns
        -------
        Table
        """
        return pipecore.report.profiles_table(self)

    def deformations_table(self) -> Table:
        """Return the deformations as ``deformations.csv`` has them.

        Returns
        -------
        Table
        """
        return pipecore.report.deformations_table(self)

    def candidates_table(self) -> Table:
        """Return what was nearly accepted as ``candidates.csv`` has it.

        Returns
        -------
        Table
        """
        return pipecore.report.candidates_table(self)

    def stations_table(self) -> Table:
        """Return how the stations fit together as ``stations.csv`` has it.

        Returns
        -------
        Table
        """
        return pipecore.report.stations_table(self)

    def save(
        self,
        folder: str | PathLike[str],
        cloud: PointCloud | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        """Write a report folder, which `pipecore.load` reads back.

        Parameters
        ----------
        folder : path
            Made if it is not there; its parent must be.
        cloud : PointCloud, optional
            The cloud that this was detected in. Without it the folder has the tables,
            ``result.json`` and ``settings.toml``, but neither ``segments.laz`` nor figures.
        overwrite : bool
            Whether the folder may already hold files.

        Raises
        ------
        WriteError
            If the folder holds files and `overwrite` is not set, or cannot be written.
        ValueError
            If the cloud is not the one of this result.
        """
        pipecore.report.write_report(folder, cloud, self, overwrite=overwrite)

    def _title(self) -> str:
        return "Result"

    def _facts(self) -> dict[str, str]:
        kinds = Counter(KIND_LABELS[e.kind].lower() for e in self.elements)
        verdicts = Counter(str(d.verdict) for d in self.deformations)
        facts = {
            "elements": _counted(len(self.elements), kinds),
            "runs": str(len({e.run_id for e in self.elements})),
            "deformations": _counted(len(self.deformations), verdicts),
            "profiles": f"{len(self.profiles):,}",
            "points": f"{self.n_cloud_points:,}",
            "source": self.source.name if self.source else "",
        }
        return {name: text for name, text in facts.items() if text}

    def _repr_html_(self) -> str:
        tables = (self.elements_table(), self.deformations_table())
        shown = [table._repr_html_() for table in tables if table.n_rows]
        return "".join([super()._repr_html_(), *shown])


def _counted(total: int, parts: Counter[str]) -> str:
    """A number with what it is made of, such as "5 (3 review, 2 reject)"."""
    of = ", ".join(f"{n} {name}" for name, n in parts.most_common())
    return f"{total} ({of})" if of else str(total)
