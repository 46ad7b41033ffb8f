"""The plots of the selected element: radius, section, deviation map."""
