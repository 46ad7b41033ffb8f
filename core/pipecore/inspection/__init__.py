"""A closer look at one element of a result: what window, report and scripts show of it.

- `points`: the points of an element or of one of its profiles
- `section`: a profile in its own plane, with its contours and its smooth curve
- `dimensions`: diameters and depth of a section, with their standard deviations
- `radius_pattern`: radius against profile, with the robust scatter about the fitted pattern
- `deviation_grid`: the deviation averaged in cells of chainage and clock
"""
