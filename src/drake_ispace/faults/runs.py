"""Faults of whole runs and of the model: hands, other runs, other robots, other dimensions."""

from drake_ispace.faults.card import Fault

FAULTS = (
    Fault(
        "robot_carried", "the robot is carried or pushed by hand",
        "the camera sees a motion that no wheel makes",
        "somebody puts the robot back to its start, or turns it, or its wheels slide",
        "camera and wheels tell of different motions for a while, or of another heading from then on",
        "cut the stretch out", same=("robot_lifted", "camera_jump", "channel_frozen"), harmless=True,
    ),
    Fault(
        "robot_lifted", "the robot is lifted or its wheels slide",
        "the wheels turn and the camera sees no motion, or a small part of it",
        "somebody holds the robot in the air, or its wheels slide",
        "camera and wheels tell of different motions for a while", "cut the stretch out", same=("robot_carried",),
        harmless=True,
    ),
    Fault(
        "command_overridden", "a command that is not the one in force",
        "the wheels follow another command than the logged one", "an emergency stop, a joystick, or a lost topic",
        "the wheels do something else than told for a while, and not a share of it", "cut the stretch out",
        same=("channel_frozen", "rows_missing"), harmless=True,
    ),
    Fault(
        "channel_of_another_run", "a channel of another run",
        "one channel tells of another motion than the others", "files were mixed up",
        "the channel goes with the others in no reading", "leave the channel out, or find its own",
    ),
    Fault(
        "another_robot", "a run of another robot",
        "wheels and camera go together, but not by the model's dimensions", "folders were mixed up",
        "free dimensions fit, the model's do not", "choose the model of that robot",
        same=("wheel_order", "gear", "channel_of_another_run"),
    ),
    Fault(
        "half_track", "the full track typed as the half",
        "the model turns half as far, or twice as far, as the robot", "the data sheet says track, the model half of it",
        "turns of wheels and camera differ by a factor of two", "correct the model's track", same=("effective_track",),
    ),
    Fault(
        "effective_track", "wheels that skid as the robot turns",
        "the robot turns less than its wheels say, as if its track were wider",
        "four tyres, tracks, or a caster that is dragged aside",
        "the camera sees the robot turn less than its wheels say, by a factor that is not two",
        "set the model's track to the width at which they agree",
    ),
    Fault(
        "tyres_hold", "a model that cannot turn",
        "the model goes straight on, whatever its wheels do, and the robot turns",
        "tyres one behind the other are listed at their true places: they skid as the robot turns, or are steered",
        "the model's tyres hold every turn, and camera, gyro or command turn as the wheels differ",
        "list the tyres in one line across the robot, so far apart that turns agree",
        same=("another_robot",),
    ),
    Fault(
        "wrong_track", "a track that is far too wide",
        "the robot turns several times as far as its wheels say",
        "the track of another robot was typed, or one in another unit",
        "the camera sees the robot turn more than twice as far as its wheels say, which no floor makes it do",
        "set the model's track to the width at which they agree", same=("half_track",),
    ),
    Fault(
        "diameter_for_radius", "the diameter typed as the radius",
        "the model goes twice as far as the robot", "the data sheet says diameter",
        "wheels and camera move by a factor of two differently", "correct the model's radius",
        same=("counts_per_turn", "gear"),
    ),
    Fault(
        "steering", "a wrong steering angle",
        "a tricycle turns the other way, or by a factor more or less",
        "a steering angle in another unit or of the other sense, a front wheel that is a rear wheel, another wheelbase",
        "the rear wheels, computed from it, seem to have changed places, or another track",
        "correct it in the mapping and import again", same=("wrong_track", "effective_track", "half_track"),
    ),
    Fault(
        "model_size", "a model of another size",
        "the model goes too far, or not far enough, by a factor, and turns as far as the robot",
        "radius and half the track typed where diameter and track are asked for, or both in another unit",
        "camera and command tell of ways that are longer or shorter than those of the wheels by one factor",
        "correct the model's wheels and track", same=("wrong_unit", "another_robot"),
    ),
    Fault(
        "wheel_order", "the model's wheels in another order",
        "the model's wheels are others than the log's", "another first wheel",
        "the wheels say a motion that the camera does not see", "put the model's wheels in order",
        same=("wheels_swapped",),
    ),
    Fault(
        "wheel_angles", "the model's wheels at other angles",
        "the motion that the wheels tell is turned by an angle",
        "the model's wheels are counted from another axis, or the robot's front is another one",
        "camera and command tell of ways that are turned by one angle against those of the wheels",
        "turn the model's wheels", same=("heading_offset", "camera_turned"),
    ),
    Fault(
        "gear", "another gear in the model",
        "the model goes by a factor too far", "the gear is counted twice or not at all",
        "wheels and camera move by a factor differently", "correct the model's gear",
        same=("counts_per_turn", "diameter_for_radius"),
    ),
)
