schema = 1
name = "film"

[actuator]
relative_permittivity = 4.7
length_m = 0.04
width_m = 0.06
thickness_m = 160e-6
mass_kg = 0.316
stretch_coupling = 0.0

[model]
topology = "eq11"
main = { c = 62740.0, alpha = 0.2 }
branches = [
 [{ c = 47958.0, alpha = 1.0 }, { c = 173210.0, alpha = 1.0 }],
]
