/* The Diagram plain_loop, written by hand: the same operations in the same order, states in place. The packed vectors
 * have the layout of a compiled Rollout. */
#include <stdint.h>
#include <string.h>

#define VISION_TICKS 19
#define TICK_S 0.004999999997380655
#define AXES for (int i = 0; i < 3; i++)

typedef struct { double position[3], velocity[3]; } Motion;
typedef struct {
    struct { double tick, place[3], speed[3]; } encoder;
    struct { double tick, place[3]; } camera;
    struct { double tick, fix[3], captured[3]; } estimator;
    double force[3];
} Memory;
typedef struct { double mass[3], scale[3], memory, bias[3], drift[3], goal[3], k_p[3], k_d[3]; } Parameters;

int sizes(int which) {
    return (which == 0 ? sizeof(Motion) : which == 1 ? sizeof(Memory) : sizeof(Parameters)) / sizeof(double);
}

static void derivatives(const Motion *x, const Memory *d, const Parameters *p, Motion *out) {
    AXES out->position[i] = x->velocity[i];
    AXES out->velocity[i] = d->force[i] / p->mass[i];
}

void rollout(int64_t ticks, double *x_packed, double *d_packed, const double *p_packed) {
    Motion x, x0, k1, k2, k3;
    Memory d;
    Parameters p;
    memcpy(&x, x_packed, sizeof x), memcpy(&d, d_packed, sizeof d), memcpy(&p, p_packed, sizeof p);
    for (int64_t k = 0; k < ticks; k++) {
        AXES {
            double place = p.scale[i] * x.position[i];
            double difference = d.encoder.tick < 0.0 ? 0.0 : (place - d.encoder.place[i]) / TICK_S;
            d.encoder.place[i] = place;
            d.encoder.speed[i] = p.memory * d.encoder.speed[i] + (1.0 - p.memory) * difference;
        }
        d.encoder.tick = (double)k;
        if (k % VISION_TICKS == 0) {
            d.camera.tick = (double)k;
            AXES d.camera.place[i] = x.position[i] + p.bias[i] + p.drift[i] * (double)k;
        }
        if (d.camera.tick > d.estimator.tick) {
            d.estimator.tick = d.camera.tick;
            AXES d.estimator.fix[i] = d.camera.place[i];
            AXES d.estimator.captured[i] = d.encoder.place[i];
        }
        AXES {
            double estimate = d.estimator.fix[i] + (d.encoder.place[i] - d.estimator.captured[i]);
            d.force[i] = p.k_p[i] * (p.goal[i] - estimate) - p.k_d[i] * d.encoder.speed[i];
        }
        double h = (double)(k + 1) * TICK_S - (double)k * TICK_S, h6 = h / 6.0;
        x0 = x;
        derivatives(&x, &d, &p, &k1);
        AXES x.position[i] = x0.position[i] + (0.5 * h) * k1.position[i];
        AXES x.velocity[i] = x0.velocity[i] + (0.5 * h) * k1.velocity[i];
        derivatives(&x, &d, &p, &k2);
        AXES x.position[i] = x0.position[i] + (-h * k1.position[i] + (2.0 * h) * k2.position[i]);
        AXES x.velocity[i] = x0.velocity[i] + (-h * k1.velocity[i] + (2.0 * h) * k2.velocity[i]);
        derivatives(&x, &d, &p, &k3);
        double h46 = 4.0 * h6;
        AXES x.position[i] = x0.position[i] + ((h6 * k1.position[i] + h46 * k2.position[i]) + h6 * k3.position[i]);
        AXES x.velocity[i] = x0.velocity[i] + ((h6 * k1.velocity[i] + h46 * k2.velocity[i]) + h6 * k3.velocity[i]);
    }
    memcpy(x_packed, &x, sizeof x), memcpy(d_packed, &d, sizeof d);
}
