/*
 * Reference values for the spring's variant `thesis` in single precision.
 *
 * The spring law of the thesis's appendix A, typed anew from its equations and branches: every quantity the
 * appendix declares `float` is `float` here, and every expression has its operands in its order, so that C's own
 * conversions decide what is rounded where. Left out as in the plugin: calibration, feed-forward, damping, yaw,
 * boundary and angle limits. Prints CSV; README.md says how it is built.
 */
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#if FLT_EVAL_METHOD != 0
#error "expressions of floats must be evaluated in float"
#endif

struct spring {
    float free_length, wire, coil, turns;  /* mm, mm, mm, 1 */
    float alpha, beta, gamma;              /* N mm^2, N, N: whichever rules */
};

static const float young = 203395, shear_modulus = 75842; /* MPa */

static const struct spring springs[3] = {
    {25, 0.63, 6.07, 11.8, 179.1, 45.5, 16.97},
    {37.49, 0.84, 11.6, 9, 482.9, 33.6, 12.53},
    {27, 0.51, 4.81, 15, 68.4, 27.7, 10.32},
};

/* Rigidities of one mode of `change`, and the length at which the code declares the spring buckled. */
struct constants {
    float alpha, beta, gamma, buckling_length;
};

static struct constants derive(const struct spring *s, int change)
{
    const float L0 = s->free_length, d = s->wire, D = s->coil, n = s->turns, E = young, G = shear_modulus;
    const float PI = 3.14159265;
    float alpha = s->alpha, beta = s->beta, gamma_ = s->gamma;
    float buckling_P;
    struct constants c;

    switch (change) {
    case 0:
        beta = gamma_ * E / G;
        alpha = gamma_ * pow(D, 2) / (4 * G / E + 2);
        break;
    case 1:
        beta = alpha * (4 + 2 * E / G) / pow(D, 2);
        gamma_ = alpha * (4 * G / E + 2) / pow(D, 2);
        break;
    case 2:
        alpha = beta * pow(D, 2) / (4 + 2 * E / G);
        gamma_ = beta * G / E;
        break;
    default:
        alpha = L0 * pow(d, 4) * E / (32 * n * D * (1 + E / (2 * G)));
        beta = L0 * pow(d, 4) * E / (8 * n * pow(D, 3));
        gamma_ = L0 * pow(d, 4) * G / (8 * n * pow(D, 3));
        break;
    }
    buckling_P = (-beta + sqrt(pow(beta, 2) + 16 * pow(PI, 2) * alpha * beta / pow(L0, 2))) / 2;
    c.alpha = alpha;
    c.beta = beta;
    c.gamma = gamma_;
    c.buckling_length = L0 - buckling_P * L0 / gamma_;
    return c;
}

/* Simulation displacements (mm) and plate angles (rad) in the source's axes. */
struct handle {
    float shear_x, shear_z, compress_y, si_xu, si_zu;
};

/* Forces (N) and the sums of the moments (N mm) as the source assigns them. */
struct outputs {
    float force_x, force_y, force_z, moment_3, moment_4;
};

static struct outputs control(float L0, const struct constants *c, const struct handle *h)
{
    const float alpha = c->alpha, beta = c->beta, gamma_ = c->gamma;
    const float lvertical = L0 + h->compress_y;
    const float L = sqrt(pow((L0 + h->compress_y), 2) + pow(h->shear_x, 2) + pow(h->shear_z, 2));
    const float si2z = atan(h->shear_x / lvertical), si1z = si2z - h->si_zu;
    const float si2x = atan(h->shear_z / lvertical), si1x = si2x - h->si_xu;
    float P, q, Hx, Hz, M1z, M1x, M2z, M2x, inter_y;
    struct outputs out = {NAN, NAN, NAN, NAN, NAN};

    if (L <= c->buckling_length) {
        out.force_y = gamma_ * (L0 - L) / (10 * L0);
        out.force_x = out.force_z = out.moment_3 = out.moment_4 = 0;
        return out;
    }
    if (L > L0 && L > 0) {
        P = gamma_ * (L0 - L) / L0;
        q = sqrt(-(P / alpha) * (1 + P / beta));
        Hx = P * (si1z + si2z) / ((-L * P / (tanh(q * L / 2) * alpha * q)) - 2);
        Hz = P * (si1x + si2x) / ((-L * P / (alpha * q * tanh(q * L / 2))) - 2);
        if (L < L0 + 1e-4) {
            Hx = -beta * (si1z + si2z) / (2 * (1 + beta * pow(L, 2) / (12 * alpha)));
            Hz = -beta * (si1x + si2x) / (2 * (1 + beta * pow(L, 2) / (12 * alpha)));
        }
        M1z = ((Hx / P + si1z) * alpha * q + Hx * L / sinh(q * L)) / tanh(q * L / 2);
        M1x = ((Hz / P + si1x) * alpha * q + Hz * L / sinh(q * L)) / tanh(q * L / 2);
    } else if (L <= L0 && L > 0) {
        P = gamma_ * (L0 - L) / L0;
        q = sqrt((P / alpha) * (1 + P / beta));
        Hx = P * (si1z + si2z) / (L * P / (tan(q * L / 2) * alpha * q) - 2);
        Hz = P * (si1x + si2x) / (L * P / (tan(q * L / 2) * alpha * q) - 2);
        if (L > L0 - 1e-4) {
            Hx = -beta * (si1z + si2z) / (2 * (1 + beta * pow(L, 2) / (12 * alpha)));
            Hz = -beta * (si1x + si2x) / (2 * (1 + beta * pow(L, 2) / (12 * alpha)));
        }
        M1z = (alpha * q * (Hx / P + si1z) - Hx * L / sin(q * L)) / tan(q * L / 2);
        M1x = (alpha * q * (Hz / P + si1x) - Hz * L / sin(q * L)) / tan(q * L / 2);
    } else {
        return out;
    }
    out.force_x = Hx * cos(si2z) + P * sin(si2z);
    inter_y = P * cos(si2z) - Hx * sin(si2z);
    out.force_z = Hz * cos(si2x) + inter_y * sin(si2x);
    out.force_y = inter_y * cos(si2x) - Hz * sin(si2x);
    M2z = M1z + Hx * L;
    M2x = M1x + Hz * L;
    out.moment_3 = M1x + M2x;
    out.moment_4 = -M1z - M2z;
    return out;
}

/* SplitMix64 (Steele, Lea and Flood 2014), uniform in -1..1. */
static uint64_t state = 2007;

static double uniform(void)
{
    uint64_t bits = (state += 0x9e3779b97f4a7c15u);
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
    bits ^= bits >> 31;
    return (double)(bits >> 32) / 2147483648.0 - 1.0;
}

/* A pose whose plates are `length` apart, sheared by up to a tenth of that. */
static struct handle at_length(float L0, double length)
{
    struct handle h;
    h.shear_x = 0.1 * length * uniform();
    h.shear_z = 0.1 * length * uniform();
    h.compress_y = sqrt(length * length - (double)h.shear_x * h.shear_x - (double)h.shear_z * h.shear_z) - L0;
    h.si_xu = 0.12 * uniform();
    h.si_zu = 0.12 * uniform();
    return h;
}

/* The device's cube of +-12 mm, its 15 mm standing for the free length, and +-7 degrees. */
static struct handle in_workspace(float L0)
{
    struct handle h;
    h.shear_x = 0.8 * L0 * uniform();
    h.shear_z = 0.8 * L0 * uniform();
    h.compress_y = 0.8 * L0 * uniform();
    h.si_xu = 0.122 * uniform();
    h.si_zu = 0.122 * uniform();
    return h;
}

/* Poses where the code changes its mind, and the whole workspace. */
static struct handle choose(int index, float L0, float buckling_length)
{
    const double near = buckling_length > 0 ? buckling_length : 0.5 * L0;
    struct handle h = {0, 0, 0, 0, 0};
    if (index == 0)
        return h; /* rest: 0/0 */
    if (index == 1) { /* the plates in one point */
        h.compress_y = -L0;
        return h;
    }
    if (index == 2) { /* beyond L0 (1 + E/G): the root of a negative number */
        h.compress_y = 3 * L0;
        return h;
    }
    if (index < 100)
        return at_length(L0, L0 + 2e-4 * uniform()); /* the window and its edges */
    if (index < 160)
        return at_length(L0, L0 + 0.05 * uniform()); /* cancellation beside it */
    if (index < 260)
        return at_length(L0, near + 0.01 * uniform()); /* the jump */
    if (index == 260) { /* upper plate below the lower one */
        h = at_length(L0, 0.3 * L0);
        h.compress_y = -1.3 * L0;
        return h;
    }
    return in_workspace(L0);
}

int main(void)
{
    puts("spring,change,x_mm,y_mm,z_mm,rx_rad,ry_rad,fx_n,fy_n,fz_n,tx_nmm,ty_nmm");
    for (int spring = 0; spring < 3; ++spring) {
        const float L0 = springs[spring].free_length;
        for (int change = 0; change < 4; ++change) {
            const struct constants c = derive(&springs[spring], change);
            for (int index = 0; index < 500; ++index) {
                const struct handle h = choose(index, L0, c.buckling_length);
                const struct outputs o = control(L0, &c, &h);
                /* To the model frame: rx = -pitch, ry = roll, torques on the hand with opposite sign. */
                printf("%d,%d,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", spring + 1, change,
                       h.shear_x, h.shear_z, h.compress_y, -h.si_xu, h.si_zu, o.force_x, o.force_z,
                       o.force_y, -o.moment_3, -o.moment_4);
            }
        }
    }
    return 0;
}
