/* The Diagram omni_multirate, written by hand: the same operations in the same order as the blocks of the package. */
#define N 4
#define ORDER WAY_POINT
#include "parts.h"

typedef struct {
    double x, y, phi, vx, vy, wz, lag[3], theta[N];
} Motion;

typedef struct {
    double mass, inertia, centre_of_gravity[2], wheel_inertia, wheels[N][3];
    Friction friction;
    Slip slip;
    double stream[2], ground_force[3];
} Plant;

typedef struct {
    Plant plant;
    Driver actuator;
    Encoder encoder;
    struct { double jacobian[3][N]; } odometry;
    Path way_point;
    Link link;
    struct { double jacobian[3][N]; } transpose;
    Compensator compensator;
    struct { double rotate; } estimator;
    struct { double k_p[3][3], k_d[3][3], mass[3], velocity_share, acceleration_share; } controller;
    Kinect kinect;
} Parameters;

typedef struct {
    struct { double noise[3], anchor[N]; } plant;
    Driven actuator;
    Wheels encoder;
    struct { double tick, x, y, phi, path, theta[N]; } odometry;
    double way_point[WAY_POINT];
    Linked link;
    Estimator estimator;
    Fixes kinect;
} Memory;

/* -- the plant: (2.73)-(2.76) with slip (6.4) -------------------------------------------------------------------- */

static void derivatives(const Motion *m, const Memory *d, const double torque[N], const Plant *p, Motion *out) {
    const Slip *slip = &p->slip;
    double c = cos(m->phi), s = sin(m->phi);
    double wx = c * m->vx + s * m->vy, wy = -s * m->vx + c * m->vy, wz = m->wz;
    double fx = 0.0 * wx + p->ground_force[0], fy = 0.0 * wx + p->ground_force[1];
    double moment = 0.0 * wx + p->ground_force[2];
    double drive_x = 0.0 * wx, drive_y = 0.0 * wx, drive_moment = 0.0 * wx;
    double nxx = 0.0, nxy = 0.0, nyy = 0.0, nxz = 0.0, nyz = 0.0, nzz = 0.0;
    for (int i = 0; i < N; i++) {
        double gx = p->wheels[i][0], gy = p->wheels[i][1], gz = p->wheels[i][2];
        double rate = gx * wx + gy * wy + gz * wz;
        double net = torque[i] - friction_torque(rate, m->theta[i] - d->plant.anchor[i], &p->friction);
        fx += gx * net, fy += gy * net, moment += gz * net;
        drive_x += gx * torque[i], drive_y += gy * torque[i], drive_moment += gz * torque[i];
        nxx += gx * gx, nxy += gx * gy, nyy += gy * gy, nxz += gx * gz, nyz += gy * gz, nzz += gz * gz;
        out->theta[i] = rate;
    }
    double t[3] = {traction_slip(0, drive_x, p->mass, slip), traction_slip(1, drive_y, p->mass, slip),
                   traction_slip(2, drive_moment, p->mass, slip)};
    out->lag[0] = traction_rate(t[0], m->lag[0], wx, slip);
    out->lag[1] = traction_rate(t[1], m->lag[1], wy, slip);
    out->lag[2] = traction_rate(t[2], m->lag[2], wz, slip);
    if (slip->relaxation > 0.0)
        memcpy(t, m->lag, sizeof t);
    const double *noise = d->plant.noise;
    out->phi = axis_rate(2, wz, t[2], noise[2], m->x, m->y, slip);
    if (slip->frame == 0.0) {
        double vx = axis_rate(0, wx, t[0], noise[0], m->x, m->y, slip);
        double vy = axis_rate(1, wy, t[1], noise[1], m->x, m->y, slip);
        double slide = slip->cornering * out->phi, wide_x = vx + slide * vy, wide_y = vy - slide * vx;
        out->x = c * wide_x - s * wide_y;
        out->y = s * wide_x + c * wide_y;
    } else {
        out->x = axis_rate(0, c * wx - s * wy, 0.0, noise[0], m->x, m->y, slip);
        out->y = axis_rate(1, s * wx + c * wy, 0.0, noise[1], m->x, m->y, slip);
    }
    double turn = out->phi, cx = turn * wy, cy = -turn * wx, i_w = p->wheel_inertia;
    double away_x = p->mass * p->centre_of_gravity[0], away_y = p->mass * p->centre_of_gravity[1];
    double b0 = fx - i_w * (nxx * cx + nxy * cy) + away_x * wz * turn;
    double b1 = fy - i_w * (nxy * cx + nyy * cy) + away_y * wz * turn;
    double b2 = moment - i_w * (nxz * cx + nyz * cy);
    double m00 = p->mass + i_w * nxx, m01 = i_w * nxy, m02 = i_w * nxz - away_y;
    double m11 = p->mass + i_w * nyy, m12 = i_w * nyz + away_x;
    double m22 = p->inertia + away_x * p->centre_of_gravity[0] + away_y * p->centre_of_gravity[1] + i_w * nzz;
    double k00 = m11 * m22 - m12 * m12, k01 = m02 * m12 - m01 * m22, k02 = m01 * m12 - m02 * m11;
    double k11 = m00 * m22 - m02 * m02, k12 = m01 * m02 - m00 * m12, k22 = m00 * m11 - m01 * m01;
    double determinant = m00 * k00 + m01 * k01 + m02 * k02;
    double ax = (k00 * b0 + k01 * b1 + k02 * b2) / determinant;
    double ay = (k01 * b0 + k11 * b1 + k12 * b2) / determinant;
    out->vx = c * ax - s * ay;
    out->vy = s * ax + c * ay;
    out->wz = (k02 * b0 + k12 * b1 + k22 * b2) / determinant;
}

static void wheel_rates(const Motion *m, const Plant *p, double rate[N]) {
    double c = cos(m->phi), s = sin(m->phi);
    double wx = c * m->vx + s * m->vy, wy = -s * m->vx + c * m->vy;
    for (int i = 0; i < N; i++)
        rate[i] = p->wheels[i][0] * wx + p->wheels[i][1] * wy + p->wheels[i][2] * m->wz;
}

/* -- the robot's computer ---------------------------------------------------------------------------------------- */

static void step_odometry(Memory *d, const Parameters *p) {
    double dx = 0.0, dy = 0.0, turn = 0.0;
    if (d->odometry.tick >= 0.0)
        for (int i = 0; i < N; i++) {
            double change = d->encoder.theta[i] - d->odometry.theta[i];
            dx += p->odometry.jacobian[0][i] * change;
            dy += p->odometry.jacobian[1][i] * change;
            turn += p->odometry.jacobian[2][i] * change;
        }
    double heading = d->odometry.phi + 0.5 * turn, c = cos(heading), s = sin(heading);
    d->odometry.x = d->odometry.x + c * dx - s * dy;
    d->odometry.y = d->odometry.y + s * dx + c * dy;
    d->odometry.phi += turn;
    d->odometry.path += dx;
    d->odometry.tick = d->encoder.tick;
    memcpy(d->odometry.theta, d->encoder.theta, sizeof d->odometry.theta);
}

static void estimate(const Memory *d, const Parameters *p, double out[3]) {
    const double *ev = d->estimator.ev, *lo = d->estimator.lo;
    double turn = p->estimator.rotate > 0.0 ? ev[2] - lo[2] : 0.0, c = cos(turn), s = sin(turn);
    double dx = d->odometry.x - lo[0], dy = d->odometry.y - lo[1];
    out[0] = ev[0] + c * dx - s * dy;
    out[1] = ev[1] + s * dx + c * dy;
    out[2] = wrap(ev[2] + d->odometry.phi - lo[2]);
}

static void control(const Memory *d, const Parameters *p, const double pose[3], double torque[N]) {
    const double *way = d->link.delivered + FIX;
    double v[3], force[3] = {0.0, 0.0, 0.0}, c = cos(pose[2]), s = sin(pose[2]);
    for (int axis = 0; axis < 3; axis++) {
        v[axis] = 0.0;
        for (int i = 0; i < N; i++)
            v[axis] += p->odometry.jacobian[axis][i] * d->encoder.omega[i];
    }
    if (!(way[0] < 0.0)) {
        double share = p->controller.velocity_share;
        double e0 = way[1] - pose[0], e1 = way[2] - pose[1], e2 = wrap(way[3] - pose[2]);
        double v0 = share * way[4] - (c * v[0] - s * v[1]), v1 = share * way[5] - (s * v[0] + c * v[1]);
        double v2 = share * way[6] - v[2];
        for (int i = 0; i < 3; i++) {
            const double *k_p = p->controller.k_p[i], *k_d = p->controller.k_d[i];
            force[i] = k_p[0] * e0 + k_p[1] * e1 + k_p[2] * e2 + k_d[0] * v0 + k_d[1] * v1 + k_d[2] * v2
                + p->controller.acceleration_share * p->controller.mass[i] * way[7 + i];
        }
    }
    double fx = c * force[0] + s * force[1], fy = -s * force[0] + c * force[1];
    const double(*jacobian)[N] = p->transpose.jacobian;
    for (int i = 0; i < N; i++)
        torque[i] = jacobian[0][i] * fx + jacobian[1][i] * fy + jacobian[2][i] * force[2];
    compensate(torque, d->encoder.omega, &p->compensator);
}

static void step(int64_t k, const Motion *m, Memory *d, const Parameters *p) {
    double pose[3], torque[N], rate[N];
    wheel_rates(m, &p->plant, rate);
    sample_encoder(k, m->theta, rate, &d->encoder, &p->encoder);
    if (k % VISION_TICKS == 0) {
        slide_way_point(k, d->way_point, &p->way_point);
        capture(k, m->x, m->y, m->phi, &d->kinect, &p->kinect);
        deliver(k, &d->kinect, &p->kinect);
    }
    remember(k, m->theta, d->plant.noise, d->plant.anchor, p->plant.stream, &p->plant.friction, &p->plant.slip);
    step_odometry(d, p);
    step_link(d->encoder.tick, d->kinect.delivered, d->way_point, &d->link, &p->link);
    const double odometry[4] = {d->odometry.tick, d->odometry.x, d->odometry.y, d->odometry.phi};
    step_estimator(odometry, d->link.delivered, &d->estimator);
    estimate(d, p, pose);
    control(d, p, pose, torque);
    hold(k, torque, &d->actuator, &p->actuator);
}

#include "steps.h"
