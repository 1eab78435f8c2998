/* The Diagram omni_multirate, written by hand: the same operations in the same order as the blocks of the package.
 *
 * Sizes are constants (4 wheels, latency 0), states are updated in place, and every block is a static function with
 * its state and parameters in a struct. The packed vectors have the layout of a compiled Rollout. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define N 4           /* wheels */
#define FIX 5         /* tick of capture, seen, x, y, phi */
#define WAY_POINT 10  /* tick, pose, velocity, acceleration */
#define M (FIX + WAY_POINT)
#define ROWS 8        /* of the path's table: a square */
#define COLUMNS 6
#define VISION_TICKS 19
#define TICK_S 0.004999999997380655

typedef struct {
    double x, y, phi, vx, vy, wz, lag[3], theta[N];
} Motion;

typedef struct {
    double frame, ratio[3], gain[3], mu, lever, relaxation, cornering, patched, patch[4], patch_ratio[3], noise_std[3];
} Slip;

typedef struct {
    double coulomb, viscous, speed_scale, bristle, stiffness, damping;
} Friction;

typedef struct {
    double mass, inertia, centre_of_gravity[2], wheel_inertia, wheels[N][3];
    Friction friction;
    Slip slip;
    double stream[2], ground_force[3];
} Plant;

typedef struct {
    Plant plant;
    struct { double limit, resolution, memory, noise_std, stream[2]; } actuator;
    struct { double counts, mode, memory; } encoder;
    struct { double jacobian[3][N]; } odometry;
    struct {
        double table[ROWS][COLUMNS], start_s, speed, end, length, tangent, heading, first[2], pulse_end_s;
    } way_point;
    struct { double delay, loss, stream[2]; } link;
    struct { double jacobian[3][N]; } transpose;
    struct { double coulomb, viscous, dead_band, speed_scale; } compensator;
    struct { double rotate; } estimator;
    struct { double k_p[3][3], k_d[3][3], mass[3], velocity_share, acceleration_share; } controller;
    struct {
        double pixel_x, pixel_y, whole, noise_std, spacing, dropout, half_width, half_depth, latency, stream[2];
    } kinect;
} Parameters;

typedef struct {
    struct { double noise[3], anchor[N]; } plant;
    struct { double held[N], driven[N], torque[N]; } actuator;
    struct { double tick, theta[N], omega[N]; } encoder;
    struct { double tick, x, y, phi, path, theta[N]; } odometry;
    double way_point[WAY_POINT];
    struct { double clock, sent[M], delivered[M], departed, queued[M]; } link;
    struct { double tick, seen_tick, ev[3], lo[3], ring[4]; } estimator;
    struct { double delivered[FIX], captured[FIX]; } kinect;
} Memory;

int sizes(int which) {
    return (which == 0 ? sizeof(Motion) : which == 1 ? sizeof(Memory) : sizeof(Parameters)) / sizeof(double);
}

/* -- noise: SplitMix64 and AS 241 ------------------------------------------------------------------------------- */

static uint64_t splitmix(uint64_t state) {
    uint64_t z = state + 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static double uniform(const double key[2], int64_t tick, int64_t channel) {
    uint64_t state = ((uint64_t)key[0] << 32) | (uint64_t)key[1];
    state = splitmix(state ^ ((uint64_t)tick * 0x9E3779B97F4A7C15u));
    state = splitmix(state ^ ((uint64_t)channel * 0xD1B54A32D192ED03u));
    return ((double)(state >> 12) + 0.5) * 0x1p-52;
}

static double normal(const double key[2], int64_t tick, int64_t channel) {
    double p = uniform(key, tick, channel), q = p - 0.5, r, numerator, denominator;
    if (fabs(q) <= 0.425) {
        r = 0.180625 - q * q;
        numerator = (((((((2.5090809287301226727e3 * r + 3.3430575583588128105e4) * r + 6.7265770927008700853e4) * r
            + 4.5921953931549871457e4) * r + 1.3731693765509461125e4) * r + 1.9715909503065514427e3) * r
            + 1.3314166789178437745e2) * r + 3.3871328727963666080e0);
        denominator = (((((((5.2264952788528545610e3 * r + 2.8729085735721942674e4) * r + 3.9307895800092710610e4) * r
            + 2.1213794301586595867e4) * r + 5.3941960214247511077e3) * r + 6.8718700749205790830e2) * r
            + 4.2313330701600911252e1) * r + 1.0);
        return q * numerator / denominator;
    }
    r = sqrt(-log(q < 0.0 ? p : 1.0 - p));
    if (r <= 5.0) {
        r -= 1.6;
        numerator = (((((((7.74545014278341407640e-4 * r + 2.27238449892691845833e-2) * r
            + 2.41780725177450611770e-1) * r
            + 1.27045825245236838258e0) * r + 3.64784832476320460504e0) * r + 5.76949722146069140550e0) * r
            + 4.63033784615654529590e0) * r + 1.42343711074968357734e0);
        denominator = (((((((1.05075007164441684324e-9 * r + 5.47593808499534494600e-4) * r
            + 1.51986665636164571966e-2) * r
            + 1.48103976427480074590e-1) * r + 6.89767334985100004550e-1) * r + 1.67638483018380384940e0) * r
            + 2.05319162663775882187e0) * r + 1.0);
    } else {
        r -= 5.0;
        numerator = (((((((2.01033439929228813265e-7 * r + 2.71155556874348757815e-5) * r
            + 1.24266094738807843860e-3) * r
            + 2.65321895265761230930e-2) * r + 2.96560571828504891230e-1) * r + 1.78482653991729133580e0) * r
            + 5.46378491116411436990e0) * r + 6.65790464350110377720e0);
        denominator = (((((((2.04426310338993978564e-15 * r + 1.42151175831644588870e-7) * r
            + 1.84631831751005468180e-5) * r
            + 7.86869131145613259100e-4) * r + 1.48753612908506148525e-2) * r + 1.36929880922735805310e-1) * r
            + 5.99832206555887937690e-1) * r + 1.0);
    }
    return (q < 0.0 ? -1.0 : 1.0) * numerator / denominator;
}

static double least(double a, double b) { return b < a ? b : a; }
static double greatest(double a, double b) { return b > a ? b : a; }
static double clip(double value, double low, double high) { return least(greatest(value, low), high); }
static double wrap(double angle) { return angle - 2.0 * M_PI * floor((angle + M_PI) / (2.0 * M_PI)); }

/* -- the plant: (2.73)-(2.76) with slip (6.4) -------------------------------------------------------------------- */

static double friction_torque(double rate, double deflection, const Friction *f) {
    double dry;
    if (f->bristle > 0.0)
        dry = clip(f->stiffness * deflection + f->damping * rate, -f->coulomb, f->coulomb);
    else
        dry = f->coulomb > 0.0 ? f->coulomb * tanh(rate * (1.0 / f->speed_scale)) : 0.0 * rate;
    return dry + f->viscous * rate;
}

static double traction_slip(int axis, double force, double mass, const Slip *s) {
    if (s->gain[axis] == 0.0)
        return 0.0 * force;
    double normal = s->mu * mass * 9.80665;
    if (axis == 2)
        normal *= s->lever;
    double share = force / normal;
    return s->gain[axis] * clip(share, -1.0, 1.0);
}

static double traction_rate(double target, double state, double speed, const Slip *s) {
    return s->relaxation > 0.0 ? fabs(speed) / s->relaxation * (target - state) : 0.0;
}

static double place_ratio(int axis, double x, double y, const Slip *s) {
    if (s->patched > 0.0 && s->patch[0] <= x && x <= s->patch[1] && s->patch[2] <= y && y <= s->patch[3])
        return s->patch_ratio[axis];
    return s->ratio[axis];
}

static double axis_rate(int axis, double rate, double traction, double noise, double x, double y, const Slip *slip) {
    double s = place_ratio(axis, x, y, slip) + noise;
    if (slip->frame == 2.0)
        return (1.0 + s) * rate;
    return (1.0 - s) * rate - traction * fabs(rate);
}

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

static void remember(int64_t k, const Motion *m, Memory *d, const Plant *p) {
    double reach = p->friction.coulomb / p->friction.stiffness;
    for (int axis = 0; axis < 3; axis++) {
        double std = p->slip.noise_std[axis];
        d->plant.noise[axis] = std > 0.0 ? std * normal(p->stream, k, axis) : 0.0;
    }
    for (int i = 0; i < N; i++)
        d->plant.anchor[i] = clip(d->plant.anchor[i], m->theta[i] - reach, m->theta[i] + reach);
}

/* -- sensors and the room ---------------------------------------------------------------------------------------- */

static void sample_encoder(int64_t k, const Motion *m, Memory *d, const Parameters *p) {
    double c = cos(m->phi), s = sin(m->phi);
    double wx = c * m->vx + s * m->vy, wy = -s * m->vx + c * m->vy;
    for (int i = 0; i < N; i++) {
        const double *wheel = p->plant.wheels[i];
        double angle = m->theta[i];
        if (p->encoder.counts > 0.0) {
            double step = 2.0 * M_PI / p->encoder.counts;
            angle = step * floor(angle / step + 0.5);
        }
        double difference = d->encoder.tick < 0.0 ? 0.0 : (angle - d->encoder.theta[i]) / TICK_S;
        d->encoder.theta[i] = angle;
        if (p->encoder.mode == 0.0)
            d->encoder.omega[i] = p->encoder.memory * d->encoder.omega[i] + (1.0 - p->encoder.memory) * difference;
        else if (p->encoder.mode == 1.0)
            d->encoder.omega[i] = difference;
        else
            d->encoder.omega[i] = wheel[0] * wx + wheel[1] * wy + wheel[2] * m->wz;
    }
    d->encoder.tick = (double)k;
}

static void slide_way_point(int64_t k, Memory *d, const Parameters *p) {
    double *out = d->way_point, time = (double)k * TICK_S, speed = p->way_point.speed;
    memset(out, 0, sizeof d->way_point);
    out[0] = (double)k;
    double travelled = clip(speed * (time - p->way_point.start_s), 0.0, p->way_point.end);
    int moving = p->way_point.start_s <= time && travelled < p->way_point.end;
    double arc = least(travelled, p->way_point.length);
    if (moving && p->way_point.end > p->way_point.length)
        arc = travelled - p->way_point.length * floor(travelled / p->way_point.length);
    int low = 0, high = ROWS - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (p->way_point.table[middle][0] <= arc)
            low = middle;
        else
            high = middle;
    }
    const double *a = p->way_point.table[low], *b = p->way_point.table[high];
    double gap = b[0] - a[0], share = gap > 0.0 ? (arc - a[0]) / gap : 0.0;
    out[1] = a[1] + share * (b[1] - a[1]);
    out[2] = a[2] + share * (b[2] - a[2]);
    double tx = a[3] + share * (b[3] - a[3]), ty = a[4] + share * (b[4] - a[4]);
    double curvature = a[5] + share * (b[5] - a[5]);
    out[3] = p->way_point.tangent > 0.0 ? atan2(ty, tx) : p->way_point.heading;
    if (moving) {
        out[4] = speed * tx, out[5] = speed * ty;
        out[7] = -(speed * speed) * curvature * ty, out[8] = speed * speed * curvature * tx;
        if (p->way_point.tangent > 0.0)
            out[6] = speed * curvature;
    }
}

static double marker(double place, double pixel, double noise, double whole) {
    double at = place / pixel + noise;
    return whole > 0.0 ? pixel * (floor(at) + 0.5) : pixel * at;
}

static void capture(int64_t k, const Motion *m, Memory *d, const Parameters *p) {
    double *out = d->kinect.captured, n[4] = {0.0, 0.0, 0.0, 0.0}, x = m->x, y = m->y, phi = m->phi;
    out[0] = (double)k, out[1] = out[2] = out[3] = out[4] = 0.0;
    if (!(fabs(x) <= p->kinect.half_width && fabs(y) <= p->kinect.half_depth))
        return;
    if (p->kinect.dropout > 0.0 && uniform(p->kinect.stream, k, 4) < p->kinect.dropout)
        return;
    if (p->kinect.whole == 0.0 && p->kinect.noise_std == 0.0) {
        out[1] = 1.0, out[2] = x, out[3] = y, out[4] = phi;
        return;
    }
    if (p->kinect.noise_std > 0.0)
        for (int i = 0; i < 4; i++)
            n[i] = p->kinect.noise_std * normal(p->kinect.stream, k, i);
    double dx = 0.5 * p->kinect.spacing * cos(phi), dy = 0.5 * p->kinect.spacing * sin(phi), whole = p->kinect.whole;
    double pixel_x = p->kinect.pixel_x, pixel_y = p->kinect.pixel_y;
    double front_x = marker(x + dx, pixel_x, n[0], whole), front_y = marker(y + dy, pixel_y, n[1], whole);
    double rear_x = marker(x - dx, pixel_x, n[2], whole), rear_y = marker(y - dy, pixel_y, n[3], whole);
    out[1] = 1.0, out[2] = 0.5 * (front_x + rear_x), out[3] = 0.5 * (front_y + rear_y);
    out[4] = atan2(front_y - rear_y, front_x - rear_x);
}

static void deliver(int64_t k, Memory *d, const Parameters *p) {
    if (0.0 <= d->kinect.captured[0] && d->kinect.captured[0] <= (double)k - p->kinect.latency)
        memcpy(d->kinect.delivered, d->kinect.captured, sizeof d->kinect.delivered);
}

static void step_link(Memory *d, const Parameters *p) {
    double tick = d->encoder.tick;
    int is_new = 0;
    d->link.clock = tick;
    for (int i = 0; i < M; i++) {
        double value = i < FIX ? d->kinect.delivered[i] : d->way_point[i - FIX];
        is_new |= value != d->link.sent[i];
        d->link.sent[i] = value;
    }
    if (is_new && !(p->link.loss > 0.0 && uniform(p->link.stream, (int64_t)tick, 0) < p->link.loss)) {
        d->link.departed = tick;
        memcpy(d->link.queued, d->link.sent, sizeof d->link.sent);
    }
    if (0.0 <= d->link.departed && d->link.departed + p->link.delay <= tick)
        memcpy(d->link.delivered, d->link.queued, sizeof d->link.delivered);
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

static void step_estimator(Memory *d) {
    const double odometry[4] = {d->odometry.tick, d->odometry.x, d->odometry.y, d->odometry.phi};
    const double *fix = d->link.delivered;
    memcpy(d->estimator.ring, odometry, sizeof odometry);
    if (d->estimator.tick < 0.0 && d->estimator.seen_tick < 0.0) {
        memcpy(d->estimator.ev, odometry + 1, sizeof d->estimator.ev);
        memcpy(d->estimator.lo, odometry + 1, sizeof d->estimator.lo);
    }
    d->estimator.tick = odometry[0];
    if (fix[1] > 0.0 && fix[0] > d->estimator.seen_tick) {
        d->estimator.seen_tick = fix[0];
        if (d->estimator.ring[0] == fix[0]) {
            memcpy(d->estimator.ev, fix + 2, sizeof d->estimator.ev);
            memcpy(d->estimator.lo, d->estimator.ring + 1, sizeof d->estimator.lo);
        }
    }
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
    for (int i = 0; i < N; i++) {
        torque[i] = jacobian[0][i] * fx + jacobian[1][i] * fy + jacobian[2][i] * force[2];
        double rate = d->encoder.omega[i], beyond = greatest(fabs(rate) - p->compensator.dead_band, 0.0);
        double sign = rate > 0.0 ? 1.0 : rate < 0.0 ? -1.0 : 0.0;
        double direction = p->compensator.coulomb > 0.0 ? tanh(beyond * (1.0 / p->compensator.speed_scale)) * sign : 0.0;
        double moving = beyond > 0.0 ? rate : 0.0;
        torque[i] = torque[i] + p->compensator.coulomb * direction + p->compensator.viscous * moving;
    }
}

static void hold(int64_t k, Memory *d, const Parameters *p, const double command[N]) {
    for (int i = 0; i < N; i++) {
        double held = clip(command[i], -p->actuator.limit, p->actuator.limit);
        if (p->actuator.resolution > 0.0)
            held = p->actuator.resolution * floor(held / p->actuator.resolution + 0.5);
        double memory = p->actuator.memory;
        double driven = memory == 0.0 ? held : memory * d->actuator.driven[i] + (1.0 - memory) * held;
        d->actuator.held[i] = held, d->actuator.driven[i] = driven, d->actuator.torque[i] = driven;
        if (p->actuator.noise_std > 0.0)
            d->actuator.torque[i] += p->actuator.noise_std * normal(p->actuator.stream, k, i);
    }
}

/* -- one tick after the other ------------------------------------------------------------------------------------ */

#define EACH for (unsigned i = 0; i < sizeof(Motion) / sizeof(double); i++)

void rollout(int64_t ticks, double *x_packed, double *d_packed, const double *p_packed) {
    union { Motion of; double at[sizeof(Motion) / sizeof(double)]; } x, x0, k1, k2, k3;
    Memory d;
    Parameters p;
    memcpy(&x, x_packed, sizeof x), memcpy(&d, d_packed, sizeof d), memcpy(&p, p_packed, sizeof p);
    for (int64_t k = 0; k < ticks; k++) {
        double pose[3], torque[N];
        sample_encoder(k, &x.of, &d, &p);
        if (k % VISION_TICKS == 0) {
            slide_way_point(k, &d, &p);
            capture(k, &x.of, &d, &p);
            deliver(k, &d, &p);
        }
        remember(k, &x.of, &d, &p.plant);
        step_odometry(&d, &p);
        step_link(&d, &p);
        step_estimator(&d);
        estimate(&d, &p, pose);
        control(&d, &p, pose, torque);
        hold(k, &d, &p, torque);

        double h = (double)(k + 1) * TICK_S - (double)k * TICK_S, h6 = h / 6.0;
        x0 = x;
        derivatives(&x.of, &d, d.actuator.torque, &p.plant, &k1.of);
        EACH x.at[i] = x0.at[i] + (0.5 * h) * k1.at[i];
        derivatives(&x.of, &d, d.actuator.torque, &p.plant, &k2.of);
        EACH x.at[i] = x0.at[i] + (-h * k1.at[i] + (2.0 * h) * k2.at[i]);
        derivatives(&x.of, &d, d.actuator.torque, &p.plant, &k3.of);
        EACH x.at[i] = x0.at[i] + ((h6 * k1.at[i] + (4.0 * h6) * k2.at[i]) + h6 * k3.at[i]);
    }
    memcpy(x_packed, &x, sizeof x), memcpy(d_packed, &d, sizeof d);
}
