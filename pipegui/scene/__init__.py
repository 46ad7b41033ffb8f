"""The 3D view: points, axes, ellipses, surfaces, labels, camera and picking."""
