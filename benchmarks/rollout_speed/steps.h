/* The rollout of a robot, one tick after the other: include it after Motion, Memory, Parameters, derivatives and step. */

int sizes(int which) {
    return (which == 0 ? sizeof(Motion) : which == 1 ? sizeof(Memory) : sizeof(Parameters)) / sizeof(double);
}

#define EACH for (unsigned i = 0; i < sizeof(Motion) / sizeof(double); i++)

void rollout(int64_t ticks, double *x_packed, double *d_packed, const double *p_packed) {
    union { Motion of; double at[sizeof(Motion) / sizeof(double)]; } x, x0, k1, k2, k3;
    Memory d;
    Parameters p;
    memcpy(&x, x_packed, sizeof x), memcpy(&d, d_packed, sizeof d), memcpy(&p, p_packed, sizeof p);
    for (int64_t k = 0; k < ticks; k++) {
        step(k, &x.of, &d, &p);
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
