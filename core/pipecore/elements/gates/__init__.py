"""Gates: what a refined piece must show before it counts as an element."""
