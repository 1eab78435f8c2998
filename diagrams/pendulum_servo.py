"""Fig. 3.9: servo control of position on the printed linear plant, with fast noise on position and tilt."""

from pathlib import Path

from shared import print_outcome, seconds_asked

from drake_ispace.drawing import draw
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate_diagram
from drake_ispace.wiring.catalog import build_diagram

scenario = load_scenario("pendulum_servo", [f"seconds={seconds_asked(__doc__)}"])
diagram = build_diagram(scenario)
draw(diagram, Path(__file__).with_suffix(".svg"))
print_outcome(simulate_diagram(diagram, scenario))
