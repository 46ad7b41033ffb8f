"""Plot the radius of an element against its chainage, with twice its standard deviation.

    python examples/first_detection.py resources/demo/demo.laz out/report
    python examples/plot_radius_profile.py out/report 3 out/radius.png

The paper's figure 7: a pipe is level, a reducer slopes, a sphere is a half circle; where a
pipe is dented or bulged, its radius leaves the level.
"""

import sys

import matplotlib as mpl
from matplotlib.figure import Figure

import pipecore
from pipecore.types import OWN_STACK


def main(folder: str, element_id: str, picture: str) -> None:
    """Draw the profiles cut across one element's own axis, and where it is deformed."""
    result = pipecore.load(folder)
    element = result.element(int(element_id))
    own = result.profiles.of_element(element.element_id, OWN_STACK)

    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(8, 3), layout="constrained")
        axes = figure.subplots()
        axes.errorbar(own.chainage, 1000 * own.radius, 2000 * own.radius_sd, fmt=".", ms=3, lw=0.6)
        axes.plot(own.chainage, 1000 * element.radius_at(own.chainage), lw=1)
        for d in result.deformations_of(element.element_id):
            axes.axvspan(d.chainage_start, d.chainage_end, alpha=0.15, color="C3")
        axes.set(xlabel="chainage (m)", ylabel="radius (mm)", title=element.label)
        figure.savefig(picture, dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:])
