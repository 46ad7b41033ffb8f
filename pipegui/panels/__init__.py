"""The panels around the 3D view. Each applies its own state and knows no other."""
