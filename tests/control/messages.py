"""Messages of the room and of way points, as blocks meet them."""


def fix(x=0.0, y=0.0, phi=0.0, tick=0, seen=1.0):
    return [tick, seen, x, y, phi]


def way_point(x=0.0, y=0.0, phi=0.0, rates=(0.0, 0.0, 0.0), accelerations=(0.0, 0.0, 0.0), tick=0):
    return [tick, x, y, phi, *rates, *accelerations]
