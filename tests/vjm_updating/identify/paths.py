"""Beam paths with compliances in closed form."""

HEAD = """format = 1
name = "{name}"
title = "made up"
source = "made up"
[units]
length = "mm"
force = "N"
angle = "rad"
"""

L_FRAME = (
    HEAD.format(name="l-frame")
    + """
[[pieces]]
length_mm = 200.0
[pieces.section]
EA_N = 1e7
GJ_Nmm2 = 3e8
EIy_Nmm2 = 4e8
EIz_Nmm2 = 4e8
GAy_N = 3e6
GAz_N = 3e6
[[pieces]]
length_mm = 150.0
turns = [{ turn_about = "z", angle_deg = 90.0 }]
[pieces.section]
EA_N = 5e6
GJ_Nmm2 = 1e8
EIy_Nmm2 = 2e8
EIz_Nmm2 = 2e8
GAy_N = 2e6
GAz_N = 2e6
"""
)

TAPER = (
    HEAD.format(name="taper")
    + """
[[pieces]]
length_mm = 240.0
[pieces.section]
shape = "rectangle"
width_mm = 60.0
thickness_mm = 12.0
youngs_modulus_MPa = 70000.0
poissons_ratio = 0.33
[pieces.end_section]
shape = "rectangle"
width_mm = 20.0
thickness_mm = 12.0
youngs_modulus_MPa = 70000.0
poissons_ratio = 0.33
"""
)
