"""The nouns of the pipeline: cloud, stack, profile, element, deformation, result.

All lengths are metres and all angles radians unless a name says otherwise. Geometry
is in *local* coordinates: world coordinates less the cloud's `origin`. Quantities
that the scan cannot carry are nan, never a guess.
"""

from pipecore.types.arrays import Array, Floats
from pipecore.types.candidate import Candidate
from pipecore.types.cloud import Field, PointCloud, Reading, Storage
from pipecore.types.deformation import (
    Deformation,
    DeformationKind,
    Review,
    ReviewState,
    SeenBy,
)
from pipecore.types.element import (
    KIND_LABELS,
    Element,
    ElementKind,
    NominalSize,
    SurfaceOfRevolution,
)
from pipecore.types.ids import NO_ID
from pipecore.types.judgement import Answers, Condition, Question, Verdict
from pipecore.types.profiles import Profiles
from pipecore.types.result import Result
from pipecore.types.stack import OWN_STACK, Stack
from pipecore.types.stations import (
    Correction,
    Disagreement,
    Station,
    StationCheck,
    StationPair,
    StationVerdict,
)

__all__ = [
    "KIND_LABELS",
    "NO_ID",
    "OWN_STACK",
    "Answers",
    "Array",
    "Candidate",
    "Condition",
    "Correction",
    "Deformation",
    "DeformationKind",
    "Disagreement",
    "Element",
    "ElementKind",
    "Field",
    "Floats",
    "NominalSize",
    "PointCloud",
    "Profiles",
    "Question",
    "Reading",
    "Result",
    "Review",
    "ReviewState",
    "SeenBy",
    "Stack",
    "Station",
    "StationCheck",
    "StationPair",
    "StationVerdict",
    "Storage",
    "SurfaceOfRevolution",
    "Verdict",
]
