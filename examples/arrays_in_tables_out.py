"""Points as a numpy array in, tables as columns out: no files.

    python examples/arrays_in_tables_out.py

The points come from a formula here; they may come from anywhere. Coordinates are metres.
"""

import numpy as np

import pipecore


def dented_pipe(n_points: int = 60_000, noise: float = 0.001) -> np.ndarray:
    """A pipe of radius 100 mm and length 2 m with a dent of 12 mm on top, shape (n, 3)."""
    rng = np.random.default_rng(1)
    along = rng.uniform(0.0, 2.0, n_points)
    around = rng.uniform(-np.pi, np.pi, n_points)  # from the top
    fade_along = np.cos(np.clip((along - 1.2) / 0.15, -1, 1) * np.pi / 2) ** 2
    fade_around = np.cos(np.clip(around / 0.9, -1, 1) * np.pi / 2) ** 2
    radius = 0.1 - 0.012 * fade_along * fade_around + rng.normal(0.0, noise, n_points)
    return np.column_stack([along, radius * np.sin(around), 1.0 + radius * np.cos(around)])


def main() -> pipecore.Result:
    """Detect the array and print what the tables hold."""
    result = pipecore.detect(dented_pipe())

    for row in result.elements_table().rows():
        radius = f"{row['radius_mm']} ± {row['radius_sd_mm']} mm"
        print(f"element {row['element_id']}: {row['kind']}, radius {radius}")

    deformations = result.deformations_table()
    print("depths in mm:", deformations["depth_mm"])
    print("deepest:", deformations["depth_mm"].max(initial=0.0), "mm")

    own = result.profiles.of_element(1, pipecore.types.OWN_STACK)
    print("radius along the pipe, mm:", np.round(1000 * own.radius[::10], 2))

    # With pandas installed: result.deformations_table().to_pandas()
    return result


if __name__ == "__main__":
    main()
