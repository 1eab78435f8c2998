"""The second renderer: the same scene through Drake's RgbdSensor, SceneGraph and VTK. Needs libEGL."""

import ctypes.util
from dataclasses import replace

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (
    Box as BoxShape,
)
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
    MakePhongIllustrationProperties,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, RgbdSensor

from drake_ispace.blocks.errors import InputError
from drake_ispace.room.room import Scenery
from drake_ispace.vision.drawing.renderer import Picture, with_noise
from drake_ispace.vision.drawing.scene import CARPET, Box
from drake_ispace.vision.optics.camera import R_CS, View

_THIN_M = 1e-3  # of a marker, which is painted in the other renderer
_FLOOR_SIDE_M = 20.0


class VtkRenderer:
    """Draws boxes as `renderer.Renderer` does, without carpet texture, light gradient, shadows and motion blur.

    Args:
        view: a camera without distortion; scenery: its noise; static: boxes that do not move; seed: of the noise.

    Raises:
        InputError: no libEGL on this machine, or a lens with distortion.
    """

    def __init__(self, view: View, scenery: Scenery, static: tuple[Box, ...] = (), *, seed: int = 0):
        if ctypes.util.find_library("EGL") is None:
            raise InputError(
                "space.scenery.renderer: vtk needs the system library libEGL (Debian: libegl1), which is not here; "
                "expected opencv"
            )
        if view.distortion.any():
            raise InputError(
                "space.camera.distortion: the vtk renderer knows no lens distortion, expected zeros or opencv"
            )
        self.view, self.static, self._scenery, self._seed = view, tuple(static), scenery, seed
        self._scenes: dict[tuple, tuple] = {}

    def draw(self, moving=(), moved=()) -> Picture:
        """A picture without noise; `moved` is not shown."""
        moving = tuple(moving)
        # What does not change from picture to picture: the shapes, wherever they are.
        shapes = tuple(replace(box.at(0.0, 0.0, 0.0), pitch_rad=0.0) for box in moving)
        if shapes not in self._scenes:
            self._scenes[shapes] = self._build(shapes)
        _, context, port, sensor, frames = self._scenes[shapes]
        poses = FramePoseVector()
        for frame, box in zip(frames, moving, strict=True):
            poses.set_value(frame, _pose(box))
        if port is not None:
            port.FixValue(context, Value(poses))
        own = sensor.GetMyContextFromRoot(context)
        colour = sensor.color_image_output_port().Eval(own).data[..., 2::-1].copy()
        depth = sensor.depth_image_32F_output_port().Eval(own).data[..., 0].copy()
        return Picture(colour.astype(np.float32), np.where(np.isfinite(depth), depth, 0.0))

    def render(self, moving=(), moved=(), tick: int = 0) -> Picture:
        """A picture with the noise of `tick`."""
        return with_noise(self.draw(moving, moved), self._scenery, self._seed, tick)

    def _build(self, shapes):
        builder = DiagramBuilder()
        graph = builder.AddSystem(SceneGraph())
        # Lit from straight above, without shadows, so that floor and tops show their paint; upright faces are black.
        light = LightParameter(type="directional", direction=[0.0, 0.0, -1.0], frame="world")
        graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams(lights=[light])))
        source = graph.RegisterSource("room")
        floor = BoxShape(_FLOOR_SIDE_M, _FLOOR_SIDE_M, 1.0)
        graph.RegisterAnchoredGeometry(source, _instance(floor, RigidTransform([0.0, 0.0, -0.5]), CARPET, "floor"))
        for i, box in enumerate(self.static):
            for instance in _instances(box, _pose(box), f"static{i}"):
                graph.RegisterAnchoredGeometry(source, instance)
        frames: list[FrameId] = []
        for i, box in enumerate(shapes):
            frames.append(graph.RegisterFrame(source, GeometryFrame(f"box{i}")))
            for instance in _instances(box, RigidTransform(), f"box{i}"):
                graph.RegisterGeometry(source, frames[-1], instance)
        columns, rows = self.view.size
        k = self.view.matrix
        core = RenderCameraCore(
            "vtk", CameraInfo(columns, rows, k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5), ClippingRange(0.1, 30.0),
            RigidTransform(),
        )  # half a pixel: Drake counts from the corner of the first pixel
        x_wc = RigidTransform(RotationMatrix(self.view.r_ws @ R_CS.T), self.view.p_ws)
        sensor = builder.AddSystem(
            RgbdSensor(
                SceneGraph.world_frame_id(),
                x_wc,
                ColorRenderCamera(core, False),
                DepthRenderCamera(core, DepthRange(0.2, 25.0)),
            )
        )
        builder.Connect(graph.get_query_output_port(), sensor.query_object_input_port())
        if frames:
            builder.ExportInput(graph.get_source_pose_port(source), "poses")
        diagram = builder.Build()
        context = diagram.CreateDefaultContext()
        return diagram, context, diagram.GetInputPort("poses") if frames else None, sensor, frames


def _pose(box):
    at_axle = RigidTransform(RollPitchYaw(0.0, box.pitch_rad, box.yaw_rad), [box.x_m, box.y_m, box.axle_m])
    return at_axle @ RigidTransform([0.0, 0.0, -box.axle_m])


def _instances(box, x_wb, name):
    height = box.top_m - box.bottom_m
    shape = BoxShape(box.length_m, box.width_m, height)
    yield _instance(shape, x_wb @ RigidTransform([0.0, 0.0, box.bottom_m + height / 2.0]), box.colour, name)
    for i, patch in enumerate(box.patches):
        place = x_wb @ RigidTransform([patch.x_m, patch.y_m, box.top_m + _THIN_M / 2.0])
        yield _instance(BoxShape(patch.length_m, patch.width_m, _THIN_M), place, patch.colour, f"{name}_patch{i}")


def _instance(shape, pose, bgr, name):
    instance = GeometryInstance(pose, shape, name)
    colour = np.array(bgr[::-1]) / 255.0
    instance.set_illustration_properties(MakePhongIllustrationProperties([*colour, 1.0]))
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(*colour, 1.0))
    properties.AddProperty("label", "id", RenderLabel(1))
    instance.set_perception_properties(properties)
    return instance
