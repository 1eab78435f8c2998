"""The pendulum balances at 5 ms and knows its position from vision alone, every 95 ms."""

from pathlib import Path

from shared import print_outcome, seconds_asked

from drake_ispace.drawing import draw
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate_diagram
from drake_ispace.wiring.catalog import build_diagram

scenario = load_scenario("pendulum_vision_feedback", [f"seconds={seconds_asked(__doc__)}"])
diagram = build_diagram(scenario)
draw(diagram, Path(__file__).with_suffix(".svg"))
print_outcome(simulate_diagram(diagram, scenario))
