"""Settings under which several tests have one Diagram, which is compiled once."""

NOISE_AND_SLIP = [
    f"{robot}.{key}" for robot in ("omni", "pendulum") for key in (
        "plant.slip.ratio=[0.1, 0.05, 0.1]", "plant.slip.noise_std=[0.1, 0.1, 0.1]", "actuator.noise_std_n_m=1e-3",
        "plant.slip.traction_gain=[0.1, 0.1, 0.1]", "plant.slip.relaxation_length_m=0.05",
    )
]
