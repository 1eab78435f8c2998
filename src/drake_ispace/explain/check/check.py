"""Is it the data? Every mistake that a log may have is tried, by comparing its channels with each other.

The wheels are compared with the camera, then torque, command and IMU with the wheels. What is found is repaired in a
copy before the next comparison, so that one mistake is not found twice.
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from drake_ispace.effects.library import library
from drake_ispace.explain.check.camera.fixes import course_findings, outlier_findings, turned_findings
from drake_ispace.explain.check.camera.odometry import odometry_findings
from drake_ispace.explain.check.camera.smoothed import smoothed_fixes
from drake_ispace.explain.check.checked import Checked
from drake_ispace.explain.check.compare.agreement import RELATED, Agreement
from drake_ispace.explain.check.compare.clocks.clocks import clocks, late_since
from drake_ispace.explain.check.compare.clocks.paths import LATEST_S
from drake_ispace.explain.check.compare.clocks.whose import OTHERS, SENSORS, encoder_clock, told_apart
from drake_ispace.explain.check.compare.command.drive import drive_of
from drake_ispace.explain.check.compare.command.followed import followed_findings
from drake_ispace.explain.check.compare.command.moments import moment_findings
from drake_ispace.explain.check.compare.command.setpoints import setpoint_findings
from drake_ispace.explain.check.compare.drive_and_imu import command_columns_of, imu_columns_of, torque_columns_of
from drake_ispace.explain.check.compare.foreign import another_robot, foreign
from drake_ispace.explain.check.compare.frames import frame_findings
from drake_ispace.explain.check.compare.links import FEWEST, LATENCY_S, base_of, lags, link_of, links
from drake_ispace.explain.check.compare.motion import WINDOW_S
from drake_ispace.explain.check.compare.wheels_and_camera import wheels_or_camera
from drake_ispace.explain.check.finding import Finding, joined, named
from drake_ispace.explain.check.gyro import gyro_findings
from drake_ispace.explain.check.runs import Runs, at_least_one, check_given, loaded, name_of, robot_of, solvable
from drake_ispace.explain.check.sampling.held import held_samples
from drake_ispace.explain.check.sampling.interpolated import interpolated_fixes
from drake_ispace.explain.check.sampling.samples import quantised_findings, sample_findings, wrap_findings
from drake_ispace.explain.check.sampling.stamps import stamp_findings
from drake_ispace.explain.check.sampling.undersampled import tick_findings
from drake_ispace.explain.check.steering import of_steering
from drake_ispace.explain.check.steps import apart_in, dead_findings, frozen_camera, step_findings
from drake_ispace.explain.check.turns import turn_findings
from drake_ispace.explain.check.tyres import turning_findings
from drake_ispace.explain.check.unseen_wheels import mistaken_wheels, with_rivals
from drake_ispace.explain.own_model import OwnModel
from drake_ispace.faults.library import FAULTS
from drake_ispace.faults.repair import Clock, CutOut, repaired, time_text
from drake_ispace.robots.recordings import by_wheel
from drake_ispace.robots.robot import COMMAND, TORQUE
from drake_ispace.scenario import Scenario, as_scenario

_UNEVEN = ("stamp_jitter", "bursts")  # after which no clock is told
_LEAP = "counter_reset"  # of angles, by themselves
_MOVED = (_LEAP, "rows_duplicated")  # where later stamps may have been moved


def check(
    model: Scenario | OwnModel | str | Path, runs: Runs,
    tell: Callable[[str], None] = lambda text: None,
) -> Checked:
    """Find the faults of recordings of one robot.

    Args:
        model: that describes the robot. Of a plant of your own torque and wheels are compared.
        runs: one or several, or by name. tell: called with the name of each step.

    Raises:
        InputError: no run, or one that cannot be read, is of another robot, or holds impossible numbers.
    """
    recordings = [loaded(run) for run in at_least_one(runs)]
    names = [name_of(run, i) for i, run in enumerate(recordings)]
    for name, run in zip(names, recordings, strict=True):
        check_given(run, name)
    if isinstance(model, OwnModel):
        robot, settings = model.robot, model.settings
    else:
        scenario = as_scenario(model)
        robot = robot_of(scenario, recordings, names)
        settings = getattr(scenario, robot.name)
    ordered = [by_wheel(run, robot, settings.plant, name) for run, name in zip(recordings, names, strict=True)]
    with solvable():
        return _Search(ordered, names, robot, settings).run(tell)


class _Search:
    """The runs as far as they are repaired, and what was found so far."""

    def __init__(self, runs, names, robot, settings):
        self.recorded, self.runs, self.names, self.robot, self.settings = runs, list(runs), names, robot, settings
        self.findings: list[Finding] = []
        self._times: dict[str, list[Finding]] = {}

    def run(self, tell) -> Checked:
        """All checks, in order."""
        tell("checking the recordings")
        counts = float(self.settings.encoder.counts_per_turn)
        self._each(stamp_findings)
        self._each(lambda run: wrap_findings(run, counts))
        self._each(held_samples)  # by the numbers of samples, therefore before others are left out
        self._each(interpolated_fixes)
        self._each(lambda run: sample_findings(run, not self.robot.in_si))
        self._each(lambda run: tick_findings(run, self.robot))
        self._each(course_findings)
        self._each(odometry_findings, self._bases())
        self._each(outlier_findings)
        self._each(turned_findings, self._bases())
        self._each(dead_findings, self._bases())
        self._each(frozen_camera, self._bases())
        tell("comparing wheels and camera")
        self._lost_angles()
        self._encoder_clock()
        recorded = list(self.runs), self._bases()
        earlier = len(self.findings)
        self._agreed("kinect", wheels_or_camera)
        self._of_another_robot(recorded[0], self.findings[earlier:])
        self._add(joined(turning_findings(self.runs, self._bases())))
        of_wheels = any(finding.channel in ("encoder", "model") and not finding.limited for finding in self.findings)
        self._each(frame_findings, self._bases())
        self._each(smoothed_fixes, self._bases())
        tell("comparing torque, command and IMU with the wheels")
        of_encoders = self._unseen_wheels()
        earlier = len(self.findings)
        self._agreed("imu", imu_columns_of)
        unknown_arms = {i for finding in self.findings if finding.channel == "model" for i in finding.runs}
        self._agreed(TORQUE, _not_compared if unknown_arms else torque_columns_of)
        follows = of_wheels and not command_columns_of(*recorded).findings  # such a drive makes the wheels' mistake
        self._agreed(COMMAND, _not_compared if follows else command_columns_of)
        self.findings[earlier:] = with_rivals(self.findings[earlier:], of_encoders)
        if not follows:
            self._add(joined(followed_findings(self._drives(), self._bases())))
        drives = self._drives()
        self._add(setpoint_findings(drives))
        self._add(moment_findings(drives))
        tell("looking for strangers and for stretches that do not fit")
        another = {i for finding in self.findings if finding.fault == "another_robot" for i in finding.runs}
        if not another and not any(finding.channel == "encoder" and not finding.limited for finding in self.findings):
            self._each(lambda run: quantised_findings(run, counts))
        coarse = {(i, f.channel) for f in self.findings if f.fault == "channel_quantised" for i in f.runs}
        steps = [list(step_findings(run, base)) for run, base in zip(self.runs, self._bases(), strict=True)]
        spoilt = [self._spoilt([i]) for i in range(len(self.runs))]
        apart = [apart_in(run, found) for run, found in zip(self.runs, steps, strict=True)]
        known = coarse | {(i, TORQUE) for i in unknown_arms}
        strangers = [
            finding for finding in foreign(self.runs, self._bases(), spoilt, apart)
            if finding.runs[0] not in another and (finding.runs[0], finding.channel) not in known
        ]
        self._add(with_rivals(strangers, of_encoders))
        odd = another | {i for finding in strangers for i in finding.runs}
        fits = [i not in odd for i in range(len(self.runs))]
        self._each(lambda run, found, fits: found if fits else (), steps, fits)
        self._each(lambda run, base, fits: turn_findings(run, base) if fits else (), self._bases(), fits)
        self._each(lambda run, fits: gyro_findings(run, self.robot) if fits else (), fits)
        made = [_complete(finding, self.names) for finding in of_steering(self.findings, self.recorded)]
        findings = sorted(made, key=lambda finding: (
            finding.limited, finding.is_bearable,
            -np.inf if finding.drop_in_deviance is None else -finding.drop_in_deviance,
        ))
        undone = [
            repaired(run, (repair for finding in made if i in finding.runs for repair in finding.repairs))
            for i, run in enumerate(self.recorded)
        ]
        both = zip(self.runs, self._bases(), strict=True)
        compared = any(base is not None and links(run, base) for run, base in both)
        return Checked(self.names, findings, undone, made, compared)

    def _bases(self, runs=None):
        runs = self.runs if runs is None else runs
        return [base_of(run, self.robot, self.settings, self._cut(i)) for i, run in enumerate(runs)]

    def _unseen_wheels(self):
        """Faults of the encoders that explain as much as one of another channel, of robots that no camera sees."""
        driven = COMMAND if self.robot.driven == COMMAND else TORQUE
        there = [name for name in ("imu", driven) if any(name in run.channels for run in self.runs)]
        sees = any(len(link.since_s) >= FEWEST for _, link, _ in self._links("kinect"))
        if sees or len(there) < (1 if driven == COMMAND else 2):  # a single torque has rivals of its own
            return ()
        found, faults = mistaken_wheels(self.runs, self._bases, there)
        self._add(joined(found))
        return faults

    def _cut(self, i):
        """Stretches [s] that are cut out of a run because of its encoder, by the encoder's clock as it is now."""
        cut = []
        for repair in (r for f in self.findings if i in f.runs and f.channel == "encoder" for r in f.repairs):
            if isinstance(repair, CutOut):
                cut.append((repair.from_s, repair.to_s))
            elif isinstance(repair, Clock):
                cut = [tuple(repair.moved(np.array(stretch))) for stretch in cut]
        return cut

    def _drives(self):
        """Number of each run with a commanded velocity -> the command and the wheels."""
        drives = {
            i: drive_of(run.channels[COMMAND], base)
            for i, (run, base) in enumerate(zip(self.runs, self._bases(), strict=True))
            if base is not None and COMMAND in run.channels and self.robot.driven == COMMAND
        }
        return {i: drive for i, drive in drives.items() if drive is not None}

    def _each(self, find: Callable[..., Iterable[Finding]], *besides: Sequence):
        """Add what is found in each run; besides: what `find` takes besides the run, for each run."""
        self._add(joined([
            replace(finding, runs=(i,)) for i, of_run in enumerate(zip(self.runs, *besides, strict=True))
            for finding in find(*of_run)
        ]))

    def _agreed(self, channel, find):
        """Repair a channel's columns or its clock, whichever explains more, until it agrees with the wheels.

        What is found a second time was not repaired.
        """
        known = set()
        while True:
            agreement, times = find(self.runs, self._bases()), self._clocks(channel)
            columns, late = agreement.findings, sum(finding.drop_in_deviance for finding in times)
            found = columns if columns and columns[0].drop_in_deviance >= late else times
            having = {i for i, run in enumerate(self.runs) if channel in run.channels}
            if not agreement.explained and not any(set(finding.runs) >= having for finding in found):
                found = self._late(channel, find) or found
            if not {(finding.fault, finding.runs) for finding in found} - known:
                return
            known |= {(finding.fault, finding.runs) for finding in found}
            self._add(told_apart(found, self._witnesses) if found is times else found)

    def _late(self, channel, find):
        """The mistakes of a channel whose clock is off as well, by the same in all runs; empty: that explains nothing.

        What the clock is off by is found once they are repaired.
        """
        bases, tried = self._bases(), []
        window_s = LATENCY_S if channel in (TORQUE, "imu") else WINDOW_S
        for lag_s in lags(LATEST_S, 0.5 * window_s).tolist():
            clock = Clock(channel, 1.0, lag_s)
            runs = [clock.apply(run) for run in self.runs]
            agreement = find(runs, bases, True)
            if agreement.findings and agreement.follows >= RELATED:  # there is always some lag at which some would do
                tried.append(agreement.findings)
        return max(tried, key=lambda findings: findings[0].drop_in_deviance, default=[])

    def _encoder_clock(self):
        """The wheels' own clock, where other channels are off against it by the same; what is left, once it is set."""
        known = set()
        while True:
            found = [finding for channel in OTHERS for finding in self._clocks(channel)]
            own = joined(encoder_clock(found, self._links))
            if not {(finding.fault, finding.runs) for finding in own} - known:
                return
            known |= {(finding.fault, finding.runs) for finding in own}
            for jump in (finding for finding in own if finding.limited):  # no rows are missing there
                gap = "rows_missing", "encoder", jump.from_s
                self._take_back(lambda one, gap=gap: (one.fault, one.channel, one.from_s) == gap, jump.runs)
            self._add(own)

    def _lost_angles(self):
        """Wheels that leap because rows are lost there, or rows that come twice, and later stamps were moved.

        All else is late, or early, since then.
        """
        leaps = [
            (i, finding.to_s) for finding in self.findings if finding.channel == "encoder" and finding.fault in _MOVED
            for i in finding.runs
        ]
        found = []
        for i, at_s in leaps:
            if [run for run, _ in leaps].count(i) > 1:
                continue
            camera, imu, torque = (
                [one for one in self._links(name) if one[0] == i] for name in SENSORS
            )
            late_s, drop = late_since([*camera, *imu] or torque, at_s)  # friction hides when a torque acts
            if late_s:
                found.append(Finding(
                    "clock_jump", f"clock jumps by {-late_s:.3g} s at {time_text(at_s, 3)} s", "encoder", at_s,
                    float(self.runs[i].channels["encoder"].t[-1]), drop, runs=(i,),
                    repairs=(Clock("encoder", 1.0, late_s, at_s),),
                ))
        self._take_back(lambda finding: finding.fault == _LEAP, {i for finding in found for i in finding.runs})
        self._add(found)

    def _take_back(self, which: Callable[[Finding], bool], runs: Collection[int]):
        """Say some findings no longer of these runs."""
        kept = [
            replace(finding, runs=tuple(i for i in finding.runs if i not in runs)) if which(finding) else finding
            for finding in self.findings
        ]
        self.findings = [finding for finding in kept if finding.runs]
        self._times.clear()

    def _clocks(self, channel):
        """The mistakes of a channel's clock, in the runs as they are now.

        A camera's clock that runs at another rate does so in the whole run, and not in a few stretches in which wheels
        slip: the rate is that of the rest.
        """
        if channel not in self._times:
            links = self._links(channel)
            found = clocks(links)
            drifting = {i for finding in found if finding.fault == "clock_drift" for i in finding.runs}
            apart = {
                i: apart_in(self.runs[i], list(step_findings(self.runs[i], base)))
                for i, _, base in links if i in drifting and channel == "kinect"
            }
            if any(apart.values()):
                again = clocks([(i, link.only(link.outside(apart.get(i, ()))), base) for i, link, base in links])
                found = [finding for finding in found if finding.fault != "clock_drift"] + [
                    finding for finding in again if finding.fault == "clock_drift" and drifting >= set(finding.runs)
                ]
            self._times[channel] = found
        return self._times[channel]

    def _links(self, channel):
        """Number, link and base of every run that has the channel, with stamps by which time can be told."""
        found = []
        for i, (run, base) in enumerate(zip(self.runs, self._bases(), strict=True)):
            uneven = {f.channel for f in self.findings if f.fault in _UNEVEN and i in f.runs}
            there = base is not None and channel in run.channels and not uneven & {channel, "encoder"}
            link = link_of(run, base, channel) if there else None
            if link is not None:
                found.append((i, link, base))
        return found

    def _witnesses(self, channel):
        """As `_links`, without runs in which the channel's clock was set, as it says nothing of others then."""
        clocks_set = [(f.runs, one.channel) for f in self.findings for one in f.repairs if isinstance(one, Clock)]
        was_set = {i for runs, name in clocks_set if name == channel for i in runs}
        return [one for one in self._links(channel) if one[0] not in was_set]

    def _of_another_robot(self, recorded, found):
        """Make one finding of three mistakes or more of wheels and model in one run, and take their repairs back.

        A room that is mirrored to the data as wheels are that are swapped may be theirs.

        recorded: the runs before wheels and camera were compared. found: the findings of that.
        """
        wrong = [f for f in found if f.channel in ("encoder", "model") or "wheels_swapped" in f.rivals]
        another = [i for i in range(len(self.runs)) if sum(i in finding.runs for finding in wrong) > 2]
        if not another:
            return
        there = [finding for finding in wrong if set(finding.runs) & set(another)]
        self._take_back(wrong.__contains__, another)
        for i in another:
            kept = (repair for f in found if f not in wrong and i in f.runs for repair in f.repairs)
            self.runs[i] = repaired(recorded[i], kept)
        drop, rivals = sum({f.drop_in_deviance for f in there}), dict.fromkeys(f.fault for f in there)
        self._add([another_robot(tuple(another), drop, tuple(rivals), "choose the model of that robot")])

    def _add(self, findings: list[Finding]):
        for finding in findings:
            having = tuple(i for i in finding.runs if finding.channel in self.runs[i].channels)
            finding = replace(finding, runs=having or finding.runs)
            if self._echo(finding):
                continue
            self.findings.append(finding)
            repairs = finding.repairs + finding.for_now
            self._forget_clocks({finding.channel, *(one.channel for one in repairs if not isinstance(one, CutOut))})
            for i in finding.runs:
                self.runs[i] = repaired(self.runs[i], repairs)

    def _forget_clocks(self, changed):
        """Compare clocks anew, if asked for again, of the channels that are compared with changed ones."""
        for channel in list(self._times):
            if changed & {channel, "encoder", *(("imu",) if channel == TORQUE else ())}:
                del self._times[channel]

    def _spoilt(self, runs):
        """Stretches [s] of these runs at which something is at fault."""
        return [
            stretch for finding in self.findings if finding.limited and set(finding.runs) & set(runs)
            for stretch in finding.stretches
        ]

    def _echo(self, finding):
        """Whether its stretches are only what earlier findings on the same stretches leave in the windows around.

        A clock that jumps there is off from then on.
        """
        known, goes_on = self._spoilt(finding.runs), any(isinstance(one, Clock) for one in finding.repairs)
        return finding.limited and not goes_on and all(
            any(begin - WINDOW_S <= since and until <= end + WINDOW_S for begin, end in known)
            for since, until in finding.stretches
        )


def _not_compared(*runs) -> Agreement:
    """In place of a search for mistakes of columns that cannot be compared with the wheels."""
    return Agreement([])


def _complete(finding, names):
    """The finding with its run's name, and with all that cannot be told from its fault.

    An effect of the camera shows in what wheels and camera say of each other only.
    """
    fault, sees = FAULTS[finding.fault], finding.channel in ("kinect", "encoder")
    alike = [name for name in fault.effects if sees or library()[name].card.home != "camera"]
    rivals = dict.fromkeys((*finding.rivals, *fault.same, *alike))
    return named(replace(finding, rivals=tuple(name for name in rivals if name != finding.fault)), names)
