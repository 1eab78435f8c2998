"""Images: camera, markers, scenes, renderers, calibration, footage."""
