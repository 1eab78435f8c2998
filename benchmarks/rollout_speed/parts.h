/* What both robots have, in C: noise, friction, slip, encoders, drivers, way point, camera, link and estimator.
 *
 * Include it after N, the number of wheels, and ORDER, the length of what the room sends beside the fix. Sizes are
 * constants (latency 0), states are updated in place, and every block is a static function with its state and
 * parameters in a struct. The structs have the layout of a compiled Rollout. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#define FIX 5         /* tick of capture, seen, x, y, phi */
#define WAY_POINT 10  /* tick, pose, velocity, acceleration */
#define M (FIX + ORDER)
#define ROWS 8        /* of the path's table: a square */
#define COLUMNS 6
#define VISION_TICKS 19
#define TICK_S 0.004999999997380655

typedef struct {
    double frame, ratio[3], gain[3], mu, lever, relaxation, cornering, patched, patch[4], patch_ratio[3], noise_std[3];
} Slip;

typedef struct {
    double coulomb, viscous, speed_scale, bristle, stiffness, damping;
} Friction;

typedef struct {
    double limit, resolution, memory, noise_std, stream[2];
} Driver;

typedef struct {
    double held[N], driven[N], torque[N];
} Driven;

typedef struct {
    double counts, mode, memory;
} Encoder;

typedef struct {
    double tick, theta[N], omega[N];
} Wheels;

typedef struct {
    double table[ROWS][COLUMNS], start_s, speed, end, length, tangent, heading, first[2], pulse_end_s;
} Path;

typedef struct {
    double delay, loss, stream[2];
} Link;

typedef struct {
    double clock, sent[M], delivered[M], departed, queued[M];
} Linked;

typedef struct {
    double tick, seen_tick, ev[3], lo[3], ring[4];
} Estimator;

typedef struct {
    double coulomb, viscous, dead_band, speed_scale;
} Compensator;

typedef struct {
    double pixel_x, pixel_y, whole, noise_std, spacing, dropout, half_width, half_depth, latency, stream[2];
} Kinect;

typedef struct {
    double delivered[FIX], captured[FIX];
} Fixes;

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

/* -- friction and slip ------------------------------------------------------------------------------------------- */

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

static void remember(int64_t k, const double theta[N], double noise[3], double anchor[N], const double stream[2],
                     const Friction *friction, const Slip *slip) {
    double reach = friction->coulomb / friction->stiffness;
    for (int axis = 0; axis < 3; axis++) {
        double std = slip->noise_std[axis];
        noise[axis] = std > 0.0 ? std * normal(stream, k, axis) : 0.0;
    }
    for (int i = 0; i < N; i++)
        anchor[i] = clip(anchor[i], theta[i] - reach, theta[i] + reach);
}

/* -- sensors and the room ---------------------------------------------------------------------------------------- */

static void sample_encoder(int64_t k, const double theta[N], const double rate[N], Wheels *d, const Encoder *p) {
    for (int i = 0; i < N; i++) {
        double angle = theta[i];
        if (p->counts > 0.0) {
            double step = 2.0 * M_PI / p->counts;
            angle = step * floor(angle / step + 0.5);
        }
        double difference = d->tick < 0.0 ? 0.0 : (angle - d->theta[i]) / TICK_S;
        d->theta[i] = angle;
        if (p->mode == 0.0)
            d->omega[i] = p->memory * d->omega[i] + (1.0 - p->memory) * difference;
        else if (p->mode == 1.0)
            d->omega[i] = difference;
        else
            d->omega[i] = rate[i];
    }
    d->tick = (double)k;
}

static void slide_way_point(int64_t k, double out[WAY_POINT], const Path *p) {
    double time = (double)k * TICK_S, speed = p->speed;
    memset(out, 0, WAY_POINT * sizeof(double));
    out[0] = (double)k;
    double travelled = clip(speed * (time - p->start_s), 0.0, p->end);
    int moving = p->start_s <= time && travelled < p->end;
    double arc = least(travelled, p->length);
    if (moving && p->end > p->length)
        arc = travelled - p->length * floor(travelled / p->length);
    int low = 0, high = ROWS - 1;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (p->table[middle][0] <= arc)
            low = middle;
        else
            high = middle;
    }
    const double *a = p->table[low], *b = p->table[high];
    double gap = b[0] - a[0], share = gap > 0.0 ? (arc - a[0]) / gap : 0.0;
    out[1] = a[1] + share * (b[1] - a[1]);
    out[2] = a[2] + share * (b[2] - a[2]);
    double tx = a[3] + share * (b[3] - a[3]), ty = a[4] + share * (b[4] - a[4]);
    double curvature = a[5] + share * (b[5] - a[5]);
    out[3] = p->tangent > 0.0 ? atan2(ty, tx) : p->heading;
    if (moving) {
        out[4] = speed * tx, out[5] = speed * ty;
        out[7] = -(speed * speed) * curvature * ty, out[8] = speed * speed * curvature * tx;
        if (p->tangent > 0.0)
            out[6] = speed * curvature;
    }
}

static double marker(double place, double pixel, double noise, double whole) {
    double at = place / pixel + noise;
    return whole > 0.0 ? pixel * (floor(at) + 0.5) : pixel * at;
}

static void capture(int64_t k, double x, double y, double phi, Fixes *d, const Kinect *p) {
    double *out = d->captured, n[4] = {0.0, 0.0, 0.0, 0.0};
    out[0] = (double)k, out[1] = out[2] = out[3] = out[4] = 0.0;
    if (!(fabs(x) <= p->half_width && fabs(y) <= p->half_depth))
        return;
    if (p->dropout > 0.0 && uniform(p->stream, k, 4) < p->dropout)
        return;
    if (p->whole == 0.0 && p->noise_std == 0.0) {
        out[1] = 1.0, out[2] = x, out[3] = y, out[4] = phi;
        return;
    }
    if (p->noise_std > 0.0)
        for (int i = 0; i < 4; i++)
            n[i] = p->noise_std * normal(p->stream, k, i);
    double dx = 0.5 * p->spacing * cos(phi), dy = 0.5 * p->spacing * sin(phi), whole = p->whole;
    double pixel_x = p->pixel_x, pixel_y = p->pixel_y;
    double front_x = marker(x + dx, pixel_x, n[0], whole), front_y = marker(y + dy, pixel_y, n[1], whole);
    double rear_x = marker(x - dx, pixel_x, n[2], whole), rear_y = marker(y - dy, pixel_y, n[3], whole);
    out[1] = 1.0, out[2] = 0.5 * (front_x + rear_x), out[3] = 0.5 * (front_y + rear_y);
    out[4] = atan2(front_y - rear_y, front_x - rear_x);
}

static void deliver(int64_t k, Fixes *d, const Kinect *p) {
    if (0.0 <= d->captured[0] && d->captured[0] <= (double)k - p->latency)
        memcpy(d->delivered, d->captured, sizeof d->delivered);
}

static void step_link(double tick, const double fix[FIX], const double order[ORDER], Linked *d, const Link *p) {
    int is_new = 0;
    d->clock = tick;
    for (int i = 0; i < M; i++) {
        double value = i < FIX ? fix[i] : order[i - FIX];
        is_new |= value != d->sent[i];
        d->sent[i] = value;
    }
    if (is_new && !(p->loss > 0.0 && uniform(p->stream, (int64_t)tick, 0) < p->loss)) {
        d->departed = tick;
        memcpy(d->queued, d->sent, sizeof d->sent);
    }
    if (0.0 <= d->departed && d->departed + p->delay <= tick)
        memcpy(d->delivered, d->queued, sizeof d->delivered);
}

/* -- the robot's computer ---------------------------------------------------------------------------------------- */

static void step_estimator(const double odometry[4], const double fix[FIX], Estimator *d) {
    memcpy(d->ring, odometry, sizeof d->ring);
    if (d->tick < 0.0 && d->seen_tick < 0.0) {
        memcpy(d->ev, odometry + 1, sizeof d->ev);
        memcpy(d->lo, odometry + 1, sizeof d->lo);
    }
    d->tick = odometry[0];
    if (fix[1] > 0.0 && fix[0] > d->seen_tick) {
        d->seen_tick = fix[0];
        if (d->ring[0] == fix[0]) {
            memcpy(d->ev, fix + 2, sizeof d->ev);
            memcpy(d->lo, d->ring + 1, sizeof d->lo);
        }
    }
}

static void compensate(double torque[N], const double omega[N], const Compensator *p) {
    for (int i = 0; i < N; i++) {
        double rate = omega[i], beyond = greatest(fabs(rate) - p->dead_band, 0.0);
        double sign = rate > 0.0 ? 1.0 : rate < 0.0 ? -1.0 : 0.0;
        double direction = p->coulomb > 0.0 ? tanh(beyond * (1.0 / p->speed_scale)) * sign : 0.0;
        double moving = beyond > 0.0 ? rate : 0.0;
        torque[i] = torque[i] + p->coulomb * direction + p->viscous * moving;
    }
}

static void hold(int64_t k, const double command[N], Driven *d, const Driver *p) {
    for (int i = 0; i < N; i++) {
        double held = command[i];
        if (p->resolution > 0.0)
            held = p->resolution * floor(held / p->resolution + 0.5);
        held = clip(held, -p->limit, p->limit);
        double driven = p->memory == 0.0 ? held : p->memory * d->driven[i] + (1.0 - p->memory) * held;
        d->held[i] = held, d->driven[i] = driven, d->torque[i] = driven;
        if (p->noise_std > 0.0)
            d->torque[i] += p->noise_std * normal(p->stream, k, i);
    }
}
