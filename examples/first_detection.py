"""Read a scan, find its pipes and their deformations, and save a report.

python examples/first_detection.py resources/demo/demo.laz out/report
"""

import sys

import pipecore


def main(scan: str, folder: str) -> None:
    """Detect one scan; the report goes into `folder`."""
    cloud = pipecore.read(scan)
    print(cloud)

    settings = pipecore.Settings(
        elements=pipecore.settings.ElementSettings(min_radius_mm=20),
        deformation=pipecore.settings.DeformationSettings(min_depth_mm=2),
    )
    result = pipecore.detect(cloud, settings)
    print(result)

    for d in result.deformations:
        element = result.element(d.element_id)
        size = f"{1000 * d.depth:.1f} ± {1000 * d.depth_sd:.1f} mm"
        print(f"{d.kind} on {element.label}, {size}, at {d.chainage:.2f} m: {d.verdict}")

    result.save(folder, cloud, overwrite=True)
    print(f"{folder}/report.html")


if __name__ == "__main__":
    main(*sys.argv[1:])
