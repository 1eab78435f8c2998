"""Named layouts of messages: in a compiled kernel as in plain Python, and part of what a kernel is hashed by."""

import numpy as np
import pytest

from drake_ispace.blocks import messages
from drake_ispace.blocks.kernels import kernel, plain
from drake_ispace.blocks.messages import FIX, WAY_POINT, encoder_size, layout, wheels_in


@kernel
def swap(fix, out):
    out[: len(FIX)] = fix
    out[FIX.x], out[FIX.y] = fix[FIX.y], fix[FIX.x]


@pytest.mark.parametrize("form", [swap, plain(swap)])
def test_a_kernel_reads_and_writes_by_name(form):
    out = np.zeros(5)
    form(np.array([19.0, 1.0, 0.2, 0.3, 0.4]), out)
    assert list(out) == [19.0, 1.0, 0.3, 0.2, 0.4]


def test_every_message_begins_with_its_tick():
    sampled = [m for m in vars(messages).values() if hasattr(m, "_fields") and "tick" in m._fields]
    assert sampled and all(m.tick == messages.TICK for m in sampled)


def test_rates_and_accelerations_lie_in_the_order_of_the_pose():
    """Kernels loop over the three axes from the first on."""
    at = [WAY_POINT.x, WAY_POINT.y, WAY_POINT.phi, WAY_POINT.vx, WAY_POINT.vy, WAY_POINT.wz]
    assert [*at, WAY_POINT.ax, WAY_POINT.ay, WAY_POINT.yaw_acceleration] == list(range(1, 10))


@pytest.mark.parametrize("wheels", [1, 2, 4])
def test_an_encoder_message_has_an_angle_and_a_speed_for_every_wheel(wheels):
    assert encoder_size(wheels) == 1 + 2 * wheels and wheels_in(encoder_size(wheels)) == wheels


def test_the_digest_follows_the_order_of_the_names():
    def digest(fields):
        namespace = {"__name__": __name__, "AT": layout("At", fields)}
        exec("def f(message, out):\n    out[0] = message[AT.x]\n", namespace)
        return kernel(namespace["f"]).digest

    assert digest("tick x y") == digest("tick x y") != digest("tick y x")
