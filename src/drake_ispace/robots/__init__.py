"""The two robots of the thesis: geometry, plants, slip, friction, actuators."""
