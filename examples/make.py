"""Write this folder's recording, video and picture with the project's own simulation and renderer.

    python examples/make.py [--out FOLDER]

friction_run/  12 s of the pendulum driving forth and back without friction compensation, for `identify`
room.mp4       2 s of the ceiling camera: both robots, white tape at the corners of the space, for `locate`, `calibrate`
board.jpg      a chessboard on the floor under the same camera, for `calibrate --board`
cart/          logs of somebody else's robot, three CSV files a run, for `import`; made by somebodys_robot.py
"""

import argparse
from pathlib import Path

import cv2
import somebodys_robot

from drake_ispace.alignment import to_recording
from drake_ispace.blocks.rates import ticks_in
from drake_ispace.rollout.engine import simulate_compiled
from drake_ispace.room.room import Space
from drake_ispace.scenario import load_scenario
from drake_ispace.simulation import simulate
from drake_ispace.vision.drawing.renderer import Renderer
from drake_ispace.vision.drawing.scene import Box, Patch, robot_box
from drake_ispace.vision.optics.camera import view_of
from drake_ispace.wiring.catalog import build_diagram

WHITE, BLACK = (235.0, 235.0, 235.0), (25.0, 25.0, 25.0)
TAPE_M, PAPER_M = 0.04, 0.001  # side of a piece of tape, thickness of whatever lies on the floor
COLUMNS, ROWS, SQUARE_M = 7, 6, 0.15  # inner corners of the chessboard
FIRST_CORNER_M = (-0.45, 0.45)  # of the chessboard, in W; its rows run along x
FRAMES_PER_S = 10


def friction_run(folder: Path) -> None:
    """Record one lap of the excitation with which friction is identified."""
    scenario = load_scenario("pendulum_friction_excitation", ["seconds=12"])
    recording = to_recording(simulate_compiled(scenario, build_diagram(scenario)), "pendulum")
    recording.channels = {name: recording.channels[name] for name in ("reference", "torque", "encoder", "imu")}
    recording.save(folder, format="parquet")


def room_video(file: Path) -> None:
    """Film both robots for 2 s."""
    run, space = simulate(load_scenario("shared_space", ["seconds=6"])), Space()
    tape = tuple(
        Box(x, y, 0.0, TAPE_M, TAPE_M, PAPER_M, WHITE)
        for x in (-space.width_m / 2, space.width_m / 2) for y in (-space.depth_m / 2, space.depth_m / 2)
    )
    view = view_of(space.camera)
    renderer = Renderer(view, space.scenery, tape, space.width_m)
    video = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"mp4v"), FRAMES_PER_S, view.size)
    for frame in range(2 * FRAMES_PER_S):
        tick = ticks_in(4.0 + frame / FRAMES_PER_S)
        boxes = [robot_box(robot, space, run.signals[f"{robot}_pose"][tick]) for robot in run.robots]
        video.write(renderer.render(boxes, tick=tick).colour)
    video.release()


def board_picture(file: Path) -> None:
    """Photograph a chessboard on the floor."""
    space = Space()
    length, width = (COLUMNS + 3) * SQUARE_M, (ROWS + 3) * SQUARE_M  # with a white margin of one square
    middle = FIRST_CORNER_M[0] + (COLUMNS - 1) / 2 * SQUARE_M, FIRST_CORNER_M[1] - (ROWS - 1) / 2 * SQUARE_M
    squares = tuple(
        Patch((i - COLUMNS / 2) * SQUARE_M, (ROWS / 2 - j) * SQUARE_M, SQUARE_M, SQUARE_M, BLACK)
        for i in range(COLUMNS + 1) for j in range(ROWS + 1) if (i + j) % 2 == 0
    )
    board = Box(*middle, 0.0, length, width, PAPER_M, WHITE, patches=squares)
    picture = Renderer(view_of(space.camera), space.scenery, (board,), space.width_m).render()
    cv2.imwrite(str(file), picture.colour, [cv2.IMWRITE_JPEG_QUALITY, 85])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder to write, default this one")
    out = parser.parse_args().out
    friction_run(out / "friction_run")
    room_video(out / "room.mp4")
    board_picture(out / "board.jpg")
    for run in range(4):
        somebodys_robot.write_csv(out / "cart" / f"run{run}", run, seconds=25.0)


if __name__ == "__main__":
    main()
