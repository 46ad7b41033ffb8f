"""Elements: surfaces proposed from ellipses, fitted, gated, joined to runs (paper, 3.3.5).

In the order of the stages: `proposals`, `selection` (with `speculative_refinement`,
`refinement`, `fittings` and `gates`), `runs`, `assembly`.
"""

from pipecore.elements.assembly import build_elements
from pipecore.elements.proposals import propose_surfaces
from pipecore.elements.refinement.nearby_points import NearbyPoints

__all__ = ["NearbyPoints", "build_elements", "propose_surfaces"]
