/* The Diagram pendulum_multirate, written by hand: the same operations in the same order as the blocks of the package;
 * the room's tracker only when a fix is due, as its inputs change only then. */
#define N 2
#define ORDER 5  /* tick of the fix, tick of the way point, error, bearing error, speed to feed forward */
#include "parts.h"

#define GRAVITY 9.80665

typedef struct {
    double x, y, phi, tilt, s_rate, yaw_rate, tilt_rate, lag[2], theta[N];
} Motion;

typedef struct {
    double m11, lifted, m13_rotors, m33, yaw_lying, yaw_upright, yaw_wheels, m12, m23, kappa, mass;
} Body;

typedef struct {
    double slope[2], radius[N], half_track;
    Body body;
    double contact[5];
    Friction friction;
    Slip slip;
    double imu_height, stream[2], ground_force[3];
} Plant;

typedef struct {
    Plant plant;
    Driver actuator;
    Encoder encoder;
    struct { double bias[6], noise_std[6], stream[2]; } imu;
    struct { double rate, bias, gyro, accelerometer; } tilt_filter;
    struct { double radius, half_track, body_share; } odometry;
    Path way_point;
    Link link;
    struct { double rotate; } estimator;
    struct { double mode, look_ahead, feed_forward, hold_radius, longest_error; } tracker;
    struct { double gain[N][6]; } controller;
    Compensator compensator;
    Kinect kinect;
} Parameters;

typedef struct {
    struct { double noise[3], anchor[N]; } plant;
    Driven actuator;
    Wheels encoder;
    struct { double tick, reading[6]; } imu;
    struct { double tick, tilt, rate, bias, p00, p01, p02, p11, p12, p22; } tilt_filter;
    struct { double tick, x, y, phi, path, theta[N], tilt; } odometry;
    double way_point[WAY_POINT];
    Linked link;
    Estimator estimator;
    double tracker[FIX];
    struct { double tick, order[ORDER], fixed_s, fixed_phi, ring[3]; } error;
    Fixes kinect;
} Memory;

/* -- the plant: (2.48) with slip (6.4) ---------------------------------------------------------------------------- */

static void accelerations(const Motion *m, const double net[N], const Plant *p, double out[3]) {
    const Body *b = &p->body;
    double c = cos(m->tilt), s = sin(m->tilt), right = net[0] / p->radius[0], left = net[1] / p->radius[1];
    double m11 = b->m11, m12 = b->m12, m23 = b->m23, m33 = b->m33, m13 = b->lifted * c + b->m13_rotors;
    double m22 = b->yaw_lying * s * s + b->yaw_upright * c * c + b->yaw_wheels;
    double shape = s * c * (b->yaw_lying - b->yaw_upright), yaw_rate = m->yaw_rate;
    double push = right + left + b->lifted * s * (m->tilt_rate * m->tilt_rate + yaw_rate * yaw_rate)
        + p->ground_force[0];
    double lean = -b->kappa * (net[0] + net[1]) + shape * yaw_rate * yaw_rate + b->lifted * GRAVITY * s
        + p->ground_force[2];
    double turn = p->half_track * (right - left) - (2.0 * shape * m->tilt_rate + b->lifted * s * m->s_rate) * yaw_rate;
    turn += p->ground_force[1];
    double k11 = m22 * m33 - m23 * m23, k12 = m13 * m23 - m12 * m33, k13 = m12 * m23 - m13 * m22;
    double k22 = m11 * m33 - m13 * m13, k23 = m12 * m13 - m11 * m23, k33 = m11 * m22 - m12 * m12;
    double determinant = m11 * k11 + m12 * k12 + m13 * k13;
    out[0] = (k11 * push + k12 * turn + k13 * lean) / determinant;
    out[1] = (k12 * push + k22 * turn + k23 * lean) / determinant;
    out[2] = (k13 * push + k23 * turn + k33 * lean) / determinant;
}

static void wheel_rates(const Motion *m, const Plant *p, double rate[N]) {
    double turn = p->half_track * m->yaw_rate, lean = p->body.kappa * m->tilt_rate;
    rate[0] = (m->s_rate + turn) / p->radius[0] - lean, rate[1] = (m->s_rate - turn) / p->radius[1] - lean;
}

static void net_torques(const Motion *m, const Memory *d, const double rate[N], const Plant *p, double net[N]) {
    for (int i = 0; i < N; i++) {
        double deflection = m->theta[i] - d->plant.anchor[i];
        net[i] = d->actuator.torque[i] - friction_torque(rate[i], deflection, &p->friction);
    }
}

static void tractions(const Motion *m, const double torque[N], const Plant *p, double t[2]) {
    double right = torque[0] / p->radius[0], left = torque[1] / p->radius[1];
    t[0] = traction_slip(0, right + left, p->body.mass, &p->slip);
    t[1] = traction_slip(2, p->half_track * (right - left), p->body.mass, &p->slip);
}

static void pose_rates(double vx, double vy, double wz, const Motion *m, const double traction[3],
                       const double noise[3], const Slip *slip, double out[3]) {
    double c = cos(m->phi), s = sin(m->phi);
    out[2] = axis_rate(2, wz, traction[2], noise[2], m->x, m->y, slip);
    if (slip->frame == 0.0) {
        vx = axis_rate(0, vx, traction[0], noise[0], m->x, m->y, slip);
        vy = axis_rate(1, vy, traction[1], noise[1], m->x, m->y, slip);
        double slide = slip->cornering * out[2], wide_x = vx + slide * vy, wide_y = vy - slide * vx;
        out[0] = c * wide_x - s * wide_y, out[1] = s * wide_x + c * wide_y;
    } else {
        out[0] = axis_rate(0, c * vx - s * vy, 0.0, noise[0], m->x, m->y, slip);
        out[1] = axis_rate(1, s * vx + c * vy, 0.0, noise[1], m->x, m->y, slip);
    }
}

static void derivatives(const Motion *m, const Memory *d, const double torque[N], const Plant *p, Motion *out) {
    const Slip *slip = &p->slip;
    double net[N], rate[N], acceleration[3], pose[3], t[2];
    wheel_rates(m, p, rate);
    net_torques(m, d, rate, p, net);
    accelerations(m, net, p, acceleration);
    out->s_rate = acceleration[0], out->yaw_rate = acceleration[1], out->tilt_rate = acceleration[2];
    out->tilt = m->tilt_rate;
    out->theta[0] = rate[0], out->theta[1] = rate[1];
    tractions(m, torque, p, t);
    out->lag[0] = traction_rate(t[0], m->lag[0], m->s_rate, slip);
    out->lag[1] = traction_rate(t[1], m->lag[1], p->half_track * m->yaw_rate, slip);
    if (slip->relaxation > 0.0)
        memcpy(t, m->lag, sizeof t);
    const double traction[3] = {t[0], 0.0, t[1]};
    pose_rates(m->s_rate, 0.0, m->yaw_rate, m, traction, d->plant.noise, slip, pose);
    out->x = pose[0], out->y = pose[1], out->phi = pose[2];
}

/* -- the IMU ------------------------------------------------------------------------------------------------------ */

static double axis_acceleration(int axis, double rate, double acceleration, double traction, double noise,
                                const Motion *m, const Slip *slip) {
    double sign = rate > 0.0 ? 1.0 : rate < 0.0 ? -1.0 : 0.0;
    return axis_rate(axis, acceleration, 0.0, noise, m->x, m->y, slip) - traction * sign * acceleration;
}

static void body_motion(const Motion *m, const Memory *d, const double wheel_rate[N], const Plant *p, double out[6]) {
    const Slip *slip = &p->slip;
    double net[N], acceleration[3], t[2], forward, sideways;
    const double *n = d->plant.noise;
    net_torques(m, d, wheel_rate, p, net);
    accelerations(m, net, p, acceleration);
    tractions(m, d->actuator.torque, p, t);
    if (slip->relaxation > 0.0)
        memcpy(t, m->lag, sizeof t);
    double yaw_rate = axis_rate(2, m->yaw_rate, t[1], n[2], m->x, m->y, slip);
    double yaw_acc = axis_acceleration(2, m->yaw_rate, acceleration[1], t[1], n[2], m, slip);
    double c_phi = cos(m->phi), s_phi = sin(m->phi);
    if (slip->frame == 0.0) {
        forward = axis_acceleration(0, m->s_rate, acceleration[0], t[0], n[0], m, slip);
        double speed = axis_rate(0, m->s_rate, t[0], n[0], m->x, m->y, slip);
        sideways = speed * yaw_rate - slip->cornering * (forward * yaw_rate + speed * yaw_acc);
        forward = forward + slip->cornering * speed * yaw_rate * yaw_rate;
    } else {
        const double none[3] = {0.0, 0.0, 0.0};
        double rates[3];
        pose_rates(acceleration[0], m->s_rate * yaw_rate, 0.0, m, none, n, slip, rates);
        forward = c_phi * rates[0] + s_phi * rates[1], sideways = -s_phi * rates[0] + c_phi * rates[1];
    }
    double c = cos(m->tilt), s = sin(m->tilt), rate = m->tilt_rate, l = p->imu_height, tilt_acc = acceleration[2];
    forward = forward + GRAVITY * (c_phi * p->slope[0] + s_phi * p->slope[1]);
    sideways = sideways + GRAVITY * (c_phi * p->slope[1] - s_phi * p->slope[0]);
    double ax = forward + l * (tilt_acc * c - rate * rate * s) - yaw_rate * yaw_rate * l * s;
    double ay = sideways + yaw_acc * l * s + 2.0 * yaw_rate * l * c * rate;
    double az = -l * (tilt_acc * s + rate * rate * c) + GRAVITY;
    out[0] = c * ax - s * az, out[1] = ay, out[2] = s * ax + c * az;
    out[3] = -s * yaw_rate, out[4] = rate, out[5] = c * yaw_rate;
}

static void sample_imu(int64_t k, const Motion *m, const double wheel_rate[N], Memory *d, const Parameters *p) {
    body_motion(m, d, wheel_rate, &p->plant, d->imu.reading);
    d->imu.tick = (double)k;
    for (int i = 0; i < 6; i++) {
        d->imu.reading[i] = d->imu.reading[i] + p->imu.bias[i];
        if (p->imu.noise_std[i] > 0.0)
            d->imu.reading[i] += p->imu.noise_std[i] * normal(p->imu.stream, k, i);
    }
}

static void filter_tilt(Memory *d, const Parameters *p) {
    const double *imu = d->imu.reading, h = TICK_S;
    double tilt = d->tilt_filter.tilt, rate = d->tilt_filter.rate, bias = d->tilt_filter.bias;
    double p00 = d->tilt_filter.p00, p01 = d->tilt_filter.p01, p02 = d->tilt_filter.p02;
    double p11 = d->tilt_filter.p11, p12 = d->tilt_filter.p12, p22 = d->tilt_filter.p22;
    if (d->tilt_filter.tick >= 0.0) {
        tilt = tilt + h * rate;
        p00 = p00 + 2.0 * h * p01 + h * h * p11, p01 = p01 + h * p11, p02 = p02 + h * p12;
        p11 = p11 + p->tilt_filter.rate, p22 = p22 + p->tilt_filter.bias;
    }
    double c0 = p01 + p02, c1 = p11 + p12, c2 = p12 + p22, spread = c1 + c2 + p->tilt_filter.gyro;
    double innovation = imu[4] - rate - bias;
    tilt += c0 / spread * innovation, rate += c1 / spread * innovation, bias += c2 / spread * innovation;
    p00 -= c0 * c0 / spread, p01 -= c0 * c1 / spread, p02 -= c0 * c2 / spread;
    p11 -= c1 * c1 / spread, p12 -= c1 * c2 / spread, p22 -= c2 * c2 / spread;
    spread = p00 + p->tilt_filter.accelerometer;
    innovation = atan2(-imu[0], imu[2]) - tilt;
    double k0 = p00 / spread, k1 = p01 / spread, k2 = p02 / spread;
    d->tilt_filter.tick = d->imu.tick;
    d->tilt_filter.tilt = tilt + k0 * innovation, d->tilt_filter.rate = rate + k1 * innovation;
    d->tilt_filter.bias = bias + k2 * innovation;
    d->tilt_filter.p00 = p00 - k0 * p00, d->tilt_filter.p01 = p01 - k0 * p01, d->tilt_filter.p02 = p02 - k0 * p02;
    d->tilt_filter.p11 = p11 - k1 * p01, d->tilt_filter.p12 = p12 - k1 * p02, d->tilt_filter.p22 = p22 - k2 * p02;
}

/* -- the room's tracker (6.28)-(6.31) and the robot's computer ---------------------------------------------------- */

static void track(Memory *d, const Parameters *p, double out[ORDER]) {
    const double *way = d->way_point, *fix = d->tracker;
    if (d->kinect.delivered[1] > 0.0)
        memcpy(d->tracker, d->kinect.delivered, sizeof d->tracker);
    out[0] = fix[0], out[1] = way[0], out[2] = out[3] = out[4] = 0.0;
    if (fix[0] < 0.0 || way[0] < 0.0)
        return;
    double dx = way[1] - fix[2], dy = way[2] - fix[3], distance = sqrt(dx * dx + dy * dy);
    double bearing = atan2(dy, dx) - fix[4];
    if (p->tracker.mode == 1.0) {
        double c = cos(bearing), s = sin(bearing);
        out[2] = c * sqrt(dx * c * (dx * c) + dy * s * (dy * s)), out[3] = bearing;
        return;
    }
    bearing = wrap(bearing);
    if (p->tracker.mode == 2.0) {
        out[2] = distance, out[3] = bearing;
        return;
    }
    double speed = sqrt(way[4] * way[4] + way[5] * way[5]), side = 1.0, folded = bearing;
    if (bearing > 0.5 * M_PI)
        side = -1.0, folded = bearing - M_PI;
    else if (bearing < -0.5 * M_PI)
        side = -1.0, folded = bearing + M_PI;
    double ahead = speed > 0.0 ? side * p->tracker.look_ahead : 0.0;
    out[2] = clip(distance * cos(bearing) - ahead, -p->tracker.longest_error, p->tracker.longest_error);
    out[3] = folded * least(1.0, distance / p->tracker.hold_radius);
    out[4] = p->tracker.feed_forward > 0.0 && ahead != 0.0 ? side * speed : 0.0;
}

static void step_odometry(Memory *d, const Parameters *p) {
    const double *theta = d->encoder.theta, tilt = d->tilt_filter.tilt, radius = p->odometry.radius;
    if (d->odometry.tick >= 0.0) {
        double right = theta[0] - d->odometry.theta[0], left = theta[1] - d->odometry.theta[1];
        double leaned = p->odometry.body_share * (tilt - d->odometry.tilt);
        double forward = 0.5 * radius * (right + left + 2.0 * leaned);
        double turn = 0.5 * radius / p->odometry.half_track * (right - left), heading = d->odometry.phi + 0.5 * turn;
        d->odometry.x = d->odometry.x + cos(heading) * forward;
        d->odometry.y = d->odometry.y + sin(heading) * forward;
        d->odometry.phi += turn, d->odometry.path += forward;
    }
    d->odometry.tick = d->encoder.tick, d->odometry.tilt = tilt;
    memcpy(d->odometry.theta, theta, sizeof d->odometry.theta);
}

static void step_error(Memory *d) {
    const double *order = d->link.delivered + FIX, now = d->odometry.tick;
    double *kept = d->error.order, *ring = d->error.ring;
    ring[0] = now, ring[1] = d->odometry.path, ring[2] = d->odometry.phi;
    if (d->error.tick < 0.0)
        d->error.fixed_s = ring[1], d->error.fixed_phi = ring[2];
    d->error.tick = now;
    int is_known = order[0] == kept[0], is_new = !is_known || order[1] != kept[1];
    if (!is_new || order[0] < 0.0)
        return;
    int is_kept = ring[0] == least(order[0], now);
    if (is_kept && !is_known)
        d->error.fixed_s = ring[1], d->error.fixed_phi = ring[2];
    if (is_kept || is_known)
        memcpy(kept, order, sizeof d->error.order);
}

static void control(const Memory *d, const Parameters *p, double torque[N]) {
    const double *order = d->error.order, *omega = d->encoder.omega, radius = p->odometry.radius;
    double s_e = order[2] + d->error.fixed_s - d->odometry.path;
    double phi_h = order[3] + d->error.fixed_phi - d->odometry.phi, tilt_rate = d->tilt_filter.rate;
    double speed = 0.5 * radius * (omega[0] + omega[1] + 2.0 * p->odometry.body_share * tilt_rate);
    double turn = 0.5 * radius / p->odometry.half_track * (omega[0] - omega[1]);
    for (int i = 0; i < N; i++) {
        const double *gain = p->controller.gain[i];
        torque[i] = gain[0] * s_e + gain[1] * phi_h - gain[2] * d->tilt_filter.tilt - gain[3] * (speed - order[4])
            - gain[4] * turn - gain[5] * tilt_rate;
    }
    compensate(torque, omega, &p->compensator);
}

static void step(int64_t k, const Motion *m, Memory *d, const Parameters *p) {
    double torque[N], rate[N], tracked[ORDER];
    wheel_rates(m, &p->plant, rate);
    sample_encoder(k, m->theta, rate, &d->encoder, &p->encoder);
    sample_imu(k, m, rate, d, p);
    memcpy(tracked, d->link.sent + FIX, sizeof tracked);
    if (k % VISION_TICKS == 0) {
        slide_way_point(k, d->way_point, &p->way_point);
        capture(k, m->x, m->y, m->phi, &d->kinect, &p->kinect);
        deliver(k, &d->kinect, &p->kinect);
        track(d, p, tracked);
    }
    remember(k, m->theta, d->plant.noise, d->plant.anchor, p->plant.stream, &p->plant.friction, &p->plant.slip);
    filter_tilt(d, p);
    step_odometry(d, p);
    step_link(d->encoder.tick, d->kinect.delivered, tracked, &d->link, &p->link);
    step_error(d);
    control(d, p, torque);
    hold(k, torque, &d->actuator, &p->actuator);
    const double odometry[4] = {d->odometry.tick, d->odometry.x, d->odometry.y, d->odometry.phi};
    step_estimator(odometry, d->link.delivered, &d->estimator);
}

#include "steps.h"
