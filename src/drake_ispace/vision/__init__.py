"""Images: camera, markers, scenes, renderers, calibration, footage."""

import os

#: OpenCV reads it once, when it is loaded: a file of a few bytes can announce an image of gigabytes.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**26))
