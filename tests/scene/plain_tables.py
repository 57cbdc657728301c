"""Small scenes to test with, as plain tables."""

MATERIAL = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
SQUARE = {
    "dimension": 2,
    "end_time": 1.0,
    "method": {"kind": "tlsph"},
    "bodies": [
        {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 2.0]}}, "particles": [3, 5], "material": MATERIAL},
    ],
}
CUBE = {
    "dimension": 3,
    "end_time": 1.0,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "name": "cube",
            "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 2.0, 3.0]}},
            "particles": [3, 5, 7],
            "material": MATERIAL,
        },
    ],
}
