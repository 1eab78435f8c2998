"""The plants of the robots as Drake blocks, and the models that they share: wheels, slip, friction and actuator."""
