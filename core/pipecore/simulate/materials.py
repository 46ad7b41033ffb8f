"""What surfaces are made of: their colour and how much light they return."""

from dataclasses import dataclass

from pipecore.errors import SceneError


@dataclass(frozen=True)
class Material:
    """How a surface looks and reflects."""

    rgb: tuple[int, int, int]
    reflectance: float
    mottle: float = 0.06
    """Standard deviation of its brightness from place to place."""


MATERIALS = {
    "galvanised": Material((158, 163, 166), 0.55),
    "steel": Material((120, 122, 124), 0.40, 0.10),
    "stainless": Material((196, 199, 201), 0.65, 0.04),
    "cladding": Material((205, 208, 210), 0.70, 0.04),
    "blue": Material((38, 92, 158), 0.35),
    "green": Material((46, 120, 74), 0.35),
    "yellow": Material((226, 178, 34), 0.60),
    "red": Material((170, 42, 36), 0.40),
    "orange": Material((232, 116, 32), 0.55),
    "grey": Material((132, 138, 142), 0.45),
    "cream": Material((214, 205, 178), 0.60),
    "red oxide": Material((124, 62, 48), 0.30, 0.10),
    "concrete": Material((156, 152, 145), 0.45, 0.08),
    "plaster": Material((222, 219, 210), 0.75, 0.03),
    "rubber": Material((34, 34, 36), 0.10),
}


def check_material(name: str, where: str) -> None:
    """Raise `SceneError` if there is no material of this name."""
    if name not in MATERIALS:
        raise SceneError(f"{where}: no material “{name}” (there are {', '.join(MATERIALS)}).")
