/* The vertical balance of many samples, as estimator/model/balance.py finds it with the stresses of
   estimator/terramechanics/original.py: Eqs. (2)-(4) and (6)-(10) under a wheel that points where it
   goes, with the mobilisation of Janosi and Hanamoto. */

#include "sources.h"

#include <math.h>

enum { COHESION, TAN_PHI, SHEAR, EXPONENT, MODULUS, PEAK, REAR, SPEED, LOAD, GUESS, STEEP, GIVEN };
enum { THETA_1, PULL, CARRIED, TORQUE, RESISTANCE, OVERLOADED, SLOPE, FOUND };
enum { X, MISS, FORCES, POINT = FORCES + 4 }; /* ln θ₁, ln(W/load), and DP, W, T, resistance */
enum { MOST = 32 };                           /* nodes of a zone */

typedef struct {
    double radius, width, shallowest, deepest, tolerance, fine; /* fine: 0 without a beginning */
    Py_ssize_t rounds, order;
    const double *node, *weight; /* on 0 to 1, from the free end of a zone to θₘ */
} Rule;

/* One zone: from its free end `from` towards θₘ over `width` [rad]; front finds σ, rear has it. */
static void zone(const Rule *rule, const double *s, const double *at, double from, double width,
                 int front, double *sigma, double *force) {
    const double theta_1 = at[0], sine_1 = at[1], cosine_1 = at[2], r = rule->radius;
    for (Py_ssize_t i = 0; i < rule->order; i++) {
        const double turned = theta_1 - (from + rule->node[i] * width);
        const double q = sin(turned), v = q * q / (1.0 + cos(turned)); /* v: 1 − cos(θ₁ − θ) */
        const double drop = q * sine_1 - v * cosine_1, advance = q * cosine_1 + v * sine_1;
        if (front) sigma[i] = s[MODULUS] * pow(r * fmax(drop, 0.0), s[EXPONENT]); /* Eq. (3) */

        const double x = r * (turned - s[SPEED] * advance) / s[SHEAR];          /* Eq. (6) */
        const double share = copysign(1.0 - exp(-fabs(x)), x);                  /* Eq. (2) */
        const double area = r * rule->width * rule->weight[i] * (front ? -width : width);
        const double normal = area * sigma[i];
        const double shear = area * (s[COHESION] + sigma[i] * s[TAN_PHI]) * share; /* Eq. (7) */
        const double sine = sine_1 - advance, cosine = cosine_1 + drop;
        force[3] += normal * sine;
        force[0] += shear * cosine;
        force[1] += shear * sine + normal * cosine;
        force[2] += r * shear;
    }
}

/* DP, W, T and resistance at θ₁, Eqs. (8)-(10). */
static void forces(const Rule *rule, const double *s, double theta_1, double *force) {
    double sigma[MOST];
    const double at[] = {theta_1, sin(theta_1), cos(theta_1)};
    const double peak = s[PEAK] * theta_1, rear = -s[REAR] * theta_1;
    for (int k = 0; k < 4; k++) force[k] = 0.0;
    zone(rule, s, at, theta_1, peak - theta_1, 1, sigma, force);
    zone(rule, s, at, rear, peak - rear, 0, sigma, force);
    force[0] -= force[3];
}

/* A secant's step on, where that is off by less than `fine`. */
static int foretold(double *here, const double *before, double slope, double fine) {
    const double change = here[X] - before[X], step = -here[MISS] / slope;
    if (!(fabs(step) < fabs(change) && fabs(step * change) < fine)) return 0;
    for (int k = 0; k < POINT; k++) here[k] += step / change * (here[k] - before[k]);
    return 1;
}

static void balance(const Rule *rule, const double *s, double *found) {
    const double top = log(rule->deepest);
    double here[POINT], before[POINT] = {NAN, NAN};
    double x = log(fmin(fmax(s[GUESS], 10.0 * rule->shallowest), rule->deepest));
    double low = log(rule->shallowest), high = INFINITY, slope = s[STEEP];
    int bogged = 0;

    for (Py_ssize_t round = 0; round < rule->rounds; round++) {
        here[X] = x;
        forces(rule, s, exp(x), here + FORCES);
        const double ratio = here[FORCES + 1] / s[LOAD]; /* what is no number stays none */
        here[MISS] = log(ratio < 1e-30 ? 1e-30 : ratio);
        const double secant = (here[MISS] - before[MISS]) / (x - before[X]);
        if (secant > 0.2 && secant < 20.0) slope = secant;
        if (here[MISS] < 0.0) low = x;
        if (here[MISS] > 0.0) high = x;
        bogged = low >= top;

        const double allowed = rule->fine > 0.0 ? rule->fine : rule->tolerance;
        const int done = fabs(here[MISS]) <= allowed;
        if (rule->fine > 0.0 && foretold(here, before, slope, rule->fine)) break;
        if (done || bogged || !(high - low > 1e-15)) break;

        for (int k = 0; k < POINT; k++) before[k] = here[k];
        const double beyond = x - here[MISS] / slope, step = beyond > top ? top : beyond;
        x = step > low && step < high ? step : 0.5 * (low + fmin(high, top));
    }

    found[THETA_1] = exp(here[X]);
    for (int k = 0; k < 4; k++) found[PULL + k] = here[FORCES + k];
    found[OVERLOADED] = bogged && here[MISS] < -rule->tolerance;
    found[SLOPE] = slope;
}

static PyObject *solve(PyObject *self, PyObject *arguments) {
    Py_buffer given, found, nodes;
    Rule rule;
    Py_ssize_t size;
    if (!PyArg_ParseTuple(arguments, "y*w*y*nnddddddn", &given, &found, &nodes, &size, &rule.order,
                          &rule.radius, &rule.width, &rule.shallowest, &rule.deepest,
                          &rule.tolerance, &rule.fine, &rule.rounds))
        return NULL;

    const Py_ssize_t one = sizeof(double);
    const int fits = size >= 0 && rule.order > 0 && rule.order <= MOST && rule.rounds > 0 &&
                     given.len == GIVEN * size * one && found.len == FOUND * size * one &&
                     nodes.len == 2 * rule.order * one;
    if (fits) {
        const double *const of = given.buf;
        double *const out = found.buf, sample[GIVEN], reached[FOUND];
        rule.node = nodes.buf;
        rule.weight = rule.node + rule.order;
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t n = 0; n < size; n++) {
            for (int k = 0; k < GIVEN; k++) sample[k] = of[k * size + n];
            balance(&rule, sample, reached);
            for (int k = 0; k < FOUND; k++) out[k * size + n] = reached[k];
        }
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&given);
    PyBuffer_Release(&found);
    PyBuffer_Release(&nodes);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "arrays do not fit their sizes");
        return NULL;
    }
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"solve", solve, METH_VARARGS,
     "solve(given, found, nodes, size, order, radius, width, shallowest, deepest, tolerance, fine, "
     "rounds)"},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "balance", "The vertical balance.", -1, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_balance(void) { return made_of_these_sources(&module); }
