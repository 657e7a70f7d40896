/* The closed forms (20)-(22) of one sample under a load, with gradients, and the shift of their
   integrals.

   This is terramechanics/scalar.py and the evaluation in filter/shift.py, operation for operation:
   the same bits, a tenth of the time. Complex numbers are multiplied, divided and raised as CPython
   does. No sum is reordered and no product fused with a sum (-ffp-contract=off). A test compares
   the two on drawn values. */

#include "sources.h"
#include <math.h>
#include <string.h>

#include "complex_numbers.h"

#define INTEGRALS 8               /* A1, A2, B1, B2, B3, C1, C2, C3 */
#define PARTS 15                  /* of the shift: see filter/shift.py */
#define FARTHEST 1.0              /* as in shift.py */
#define COLUMNS (PARTS * INTEGRALS)
#define ROWS 10                   /* powers of the polynomials in theta_1 … */
#define POWERS 14                 /* … and in slip */
#define SMALLEST 0.1              /* as in scalar.py */
#define NEAREST 0.02

/* A1, A2, B1 + iC3, C1 + iB2, C2 + iB3 */
typedef struct { double a1, a2; number bare, one, hat; } integrals;
typedef struct { double torque, pull, drag, load; } change;

typedef struct {
    PyObject_HEAD
    double radius, width, c1, c2, ln_k;
    double low[2], high[2];       /* range of theta_1 and of slip */
    int shifted;
    double theta_1, slip;         /* where `point` was taken last */
    double point[3][COLUMNS];
    double table[ROWS][POWERS][COLUMNS];
    PyObject *quantity;           /* the named tuple of a result */
    newfunc make;                 /* of a tuple */
} Closed;

/* --- the integrals and their derivatives by ln theta_1 and by ln f --- */

/* E, H, s dE/ds, s dH/ds of a complex s; end = e^-s, peak = e^-(alpha s). */
static void transforms(number s, number end, number peak, double lam, number out[4]) {
    const number one = over(minus(real(1.0), end), s);
    const number fall = over(minus(peak, end), real(lam));
    const number rise = over(minus(real(1.0), peak), real(1.0 - lam));
    const number hat = over(minus(rise, fall), times(s, s));
    out[0] = one;
    out[1] = hat;
    out[2] = minus(end, one);
    out[3] = minus(over(fall, s), times(real(2.0), hat));
}

static void transforms_real(double s, double end, double peak, double lam, double out[4]) {
    const double one = (1.0 - end) / s, fall = (peak - end) / lam;
    const double hat = ((1.0 - peak) / (1.0 - lam) - fall) / (s * s);
    out[0] = one;
    out[1] = hat;
    out[2] = end - one;
    out[3] = fall / s - 2.0 * hat;
}

static number opposite(number a) { return (number){-a.re, -a.im}; }

static void all_integrals(double theta_1, double eta, double lam, integrals *x,
                          integrals *by_theta_1, integrals *by_f) {
    const number turning = {0.0, theta_1}, both = {eta, theta_1};
    const double alpha = 1.0 - lam;
    const number ahead = turn(turning);
    double e0[4];
    number e1[4], e2[4];
    transforms_real(eta, exp(-eta), exp(-eta * alpha), lam, e0);
    transforms(turning, turn(opposite(turning)), turn(times(opposite(turning), real(alpha))), lam,
               e1);
    transforms(both, turn(opposite(both)), turn(times(opposite(both), real(alpha))), lam, e2);

    const number bare = times(ahead, e1[1]);
    const number one = times(ahead, minus(e1[0], e2[0])), hat = times(ahead, minus(e1[1], e2[1]));
    const number share = times(opposite(ahead), over(real(eta), both));

    *x = (integrals){1.0 - e0[0], 0.5 - e0[1], bare, one, hat};
    *by_theta_1 = (integrals){
        -e0[2], -e0[3],
        plus(times(turning, bare), times(ahead, e1[3])),
        plus(times(turning, one), times(ahead, minus(e1[2], e2[2]))),
        plus(times(turning, hat), times(ahead, minus(e1[3], e2[3])))};
    *by_f = (integrals){-e0[2], -e0[3], real(0.0), times(share, e2[2]), times(share, e2[3])};
}

static number by_ratio_of_hat(number s, double alpha, double lam) {
    const number peak = turn(times(opposite(s), real(alpha)));
    const number lost = minus(over(minus(real(1.0), peak), real(alpha)), times(s, peak));
    const number fallen = over(minus(peak, turn(opposite(s))), real(lam));
    const number rest = over(minus(fallen, times(s, peak)), real(lam));
    return over(plus(over(lost, real(alpha)), rest), times(s, s));
}

/* Derivatives by the ratio theta_m / theta_1. */
static integrals by_ratio(double theta_1, double eta, double lam) {
    const double alpha = 1.0 - lam;
    const number turning = {0.0, theta_1}, ahead = turn(turning);
    const number bare = times(ahead, by_ratio_of_hat(turning, alpha, lam));
    const number hat = times(ahead, by_ratio_of_hat((number){eta, theta_1}, alpha, lam));
    const number straight = by_ratio_of_hat(real(eta), alpha, lam);
    return (integrals){0.0, -straight.re, bare, real(0.0), minus(bare, hat)};
}

/* The integrals with a multiple of eight real ones added. */
static integrals added(integrals x, const double *change, double factor) {
    return (integrals){
        x.a1 + factor * change[0],
        x.a2 + factor * change[1],
        plus(x.bare, times(real(factor), (number){change[2], change[7]})),
        plus(x.one, times(real(factor), (number){change[5], change[3]})),
        plus(x.hat, times(real(factor), (number){change[6], change[4]}))};
}

/* --- the shift (filter/shift.py) --- */

/* T_0 .. at the place of x in its range, and their derivatives by x. */
static void polynomials(double x, double low, double high, int powers, double first[POWERS],
                        double slopes[POWERS]) {
    double slope = 2.0 / (high - low), u = (x - low) * slope - 1.0;
    if (!(low <= x && x <= high)) {
        u = x < low ? -1.0 : 1.0;
        slope = 0.0;
    }
    double second[POWERS] = {0.0, 1.0};
    first[0] = 1.0;
    first[1] = u;
    for (int n = 2; n < powers; n++) {
        first[n] = 2.0 * u * first[n - 1] - first[n - 2];
        second[n] = 2.0 * u * second[n - 1] - second[n - 2];
    }
    for (int n = 0; n < powers; n++) slopes[n] = slope * (n * second[n]);
}

/* self->point: the table at a point: values, derivatives by theta_1 and by slip. */
static void tabulated(Closed *self, double theta_1, double slip) {
    if (theta_1 == self->theta_1 && slip == self->slip) return;
    double rows[POWERS], by_rows[POWERS], across[POWERS], by_across[POWERS];
    polynomials(theta_1, self->low[0], self->high[0], ROWS, rows, by_rows);
    polynomials(slip, self->low[1], self->high[1], POWERS, across, by_across);

    for (int b = 0; b < POWERS; b++) {
        double value[COLUMNS], by_theta_1[COLUMNS];
        for (int q = 0; q < COLUMNS; q++) {
            value[q] = rows[0] * self->table[0][b][q];
            by_theta_1[q] = by_rows[0] * self->table[0][b][q];
        }
        for (int a = 1; a < ROWS; a++)
            for (int q = 0; q < COLUMNS; q++) {
                value[q] += rows[a] * self->table[a][b][q];
                by_theta_1[q] += by_rows[a] * self->table[a][b][q];
            }
        for (int q = 0; q < COLUMNS; q++) {
            const double parts[3] = {across[b] * value[q], across[b] * by_theta_1[q],
                                     by_across[b] * value[q]};
            for (int p = 0; p < 3; p++) self->point[p][q] = b ? self->point[p][q] + parts[p] : parts[p];
        }
    }
    self->theta_1 = theta_1;
    self->slip = slip;
}

/* What is added to the configured n, c1 and c2. */
typedef struct { double exponent, c1, c2; } form;

/* sum of terms[n] x^n by Horner's rule, and its slope; terms of one integral */
static double series(const double *terms, int powers, double x) {
    double total = terms[(powers - 1) * INTEGRALS];
    for (int n = powers - 2; n >= 0; n--) total = terms[n * INTEGRALS] + x * total;
    return total;
}

static double series_slope(const double *terms, int powers, double x) {
    double total = (powers - 1) * terms[(powers - 1) * INTEGRALS];
    for (int n = powers - 2; n >= 1; n--) total = n * terms[n * INTEGRALS] + x * total;
    return total;
}

/* The shift at k: value, by theta_1, by slip, by ln k, by n and by the place of the peak, each of
   eight integrals. */
static void shift_at(Closed *self, double k, double theta_1, double slip, form e,
                     double out[6][INTEGRALS]) {
    const double far = log(k) - self->ln_k, peak = e.c1 + e.c2 * slip;
    const double low = far > -FARTHEST ? far : -FARTHEST;
    const double ln_k = low < FARTHEST ? low : FARTHEST;
    tabulated(self, theta_1, slip);
    const double n = e.exponent;
    for (int q = 0; q < INTEGRALS; q++) {
        for (int p = 0; p < 3; p++) {
            const double *t = self->point[p] + q;
#define T(part) t[(part) * INTEGRALS]
            const double along_n = series(t + 6 * INTEGRALS, 3, ln_k);
            const double along_peak = series(t + 10 * INTEGRALS, 3, ln_k);
            out[p][q] = series(t, 6, ln_k) + n * (along_n + n * T(9)) +
                        peak * (along_peak + peak * T(13) + n * T(14));
            if (p == 0) {
                out[3][q] = series_slope(t, 6, ln_k) + n * series_slope(t + 6 * INTEGRALS, 3, ln_k) +
                            peak * series_slope(t + 10 * INTEGRALS, 3, ln_k);
                if (ln_k != far) out[3][q] = 0.0 * out[3][q];
                out[4][q] = along_n + (2.0 * n) * T(9) + peak * T(14);
                out[5][q] = along_peak + (2.0 * peak) * T(13) + n * T(14);
            }
#undef T
        }
        out[2][q] = out[2][q] + e.c2 * out[5][q];
    }
}

/* --- the forces --- */

typedef struct { double area, arm, cohesion, s, friction; } under;

/* Eqs. (20)-(22) at this s: linear in the integrals, so that changes of both follow the same
   formulas. */
static change forces(const under *u, integrals x) {
    const double drag = u->area * u->s * x.bare.im;
    return (change){
        u->arm * (u->cohesion * x.a1 + u->friction * x.a2),
        u->area * (u->cohesion * x.one.re + u->friction * x.hat.re) - drag,
        drag,
        u->area * (u->cohesion * x.one.im + u->s * x.bare.re + u->friction * x.hat.im)};
}

/* Whether the transforms lose digits here, or a number is none: then the general form answers. */
static int delicate(double theta_1, double f, double slip, double lam) {
    return !(slip >= 0.0 && theta_1 >= SMALLEST && f * theta_1 >= SMALLEST && NEAREST < lam &&
             lam < 1.0 - NEAREST);
}

#define GRADIENT 8

static PyObject *quantity(const Closed *self, double value, const double gradient[GRADIENT]) {
    PyObject *items = PyTuple_New(1 + GRADIENT), *arguments, *made;
    if (items == NULL) return NULL;
    for (int n = 0; n <= GRADIENT; n++) {
        PyObject *item = PyFloat_FromDouble(n ? gradient[n - 1] : value);
        if (item == NULL) { Py_DECREF(items); return NULL; }
        PyTuple_SetItem(items, n, item);
    }
    arguments = PyTuple_Pack(1, items);
    Py_DECREF(items);
    if (arguments == NULL) return NULL;
    made = self->make((PyTypeObject *)self->quantity, arguments, NULL);
    Py_DECREF(arguments);
    return made;
}

static int numbers(PyObject *const *arguments, Py_ssize_t given, Py_ssize_t wanted, double *out) {
    if (given != wanted) {
        PyErr_Format(PyExc_TypeError, "expected %zd numbers, got %zd", wanted, given);
        return 0;
    }
    for (Py_ssize_t n = 0; n < wanted; n++) {
        out[n] = PyFloat_AsDouble(arguments[n]);
        if (out[n] == -1.0 && PyErr_Occurred()) return 0;
    }
    return 1;
}

PyDoc_STRVAR(predict_doc,
"predict(c, tan_phi, k, theta_1, slip, load, exponent, c1, c2)\n--\n\n"
"T, DP and resistance with gradients, each a PredictedQuantity; None where the general form is to answer.");

static PyObject *predict(PyObject *object, PyObject *const *arguments, Py_ssize_t given) {
    Closed *self = (Closed *)object;
    double in[9], shift[6][INTEGRALS], gradients[3][GRADIENT];
    if (!numbers(arguments, given, 9, in)) return NULL;
    const double c = in[0], tan_phi = in[1], k = in[2], theta_1 = in[3], slip = in[4], load = in[5];
    const form e = {in[6], in[7], in[8]};

    const double c1 = self->c1 + e.c1, c2 = self->c2 + e.c2, lam = c1 + c2 * slip;
    const double half = sin(0.5 * theta_1), scale = self->radius / k, rise = half * half;
    const double f = scale * (slip + (1.0 - slip) * rise); /* Eq. (19) */
    if (!isfinite(c + tan_phi + load + in[6] + in[7] + in[8]) || delicate(theta_1, f, slip, lam)) Py_RETURN_NONE;

    integrals x, by_theta, by_f;
    all_integrals(theta_1, f * theta_1, lam, &x, &by_theta, &by_f);
    if (self->shifted) {
        shift_at(self, k, theta_1, slip, e, shift);
        x = added(x, shift[0], 1.0);
        by_theta = added(by_theta, shift[1], theta_1);
    }
    const double area = self->radius * self->width, arm = self->radius * self->radius * self->width;
    const double cohesion = c * theta_1, carry = x.bare.re + tan_phi * x.hat.im;
    if (carry == 0.0) Py_RETURN_NONE;
    const double s = (load / area - cohesion * x.one.im) / carry; /* sigma_m theta_1 by Eq. (21) */
    const under at = {area, arm, cohesion, s, s * tan_phi};

    const integrals nothing = {0.0, 0.0, {0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
    const change none = {0.0, 0.0, 0.0, 0.0};
    change columns[9] = {
        {arm * theta_1 * x.a1, area * theta_1 * x.one.re, 0.0, area * theta_1 * x.one.im},
        {arm * s * x.a2, area * s * x.hat.re, 0.0, area * s * x.hat.im},
        forces(&at, by_f),
        forces(&at, (integrals){x.a1 + by_theta.a1, by_theta.a2, by_theta.bare,
                                plus(x.one, by_theta.one), by_theta.hat}),
        forces(&at, by_ratio(theta_1, f * theta_1, lam)),
        self->shifted ? forces(&at, added(nothing, shift[2], 1.0)) : none,
        self->shifted ? forces(&at, added(nothing, shift[3], 1.0)) : none,
        self->shifted ? forces(&at, added(nothing, shift[4], 1.0)) : none,
        self->shifted ? forces(&at, added(nothing, shift[5], 1.0)) : none};

    /* s gives way to each of them so that W stays the same */
    const double ds = -1.0 / (area * carry);
    const double torque_s = arm * tan_phi * x.a2 * ds, drag_s = area * x.bare.im * ds;
    const double pull_s = area * tan_phi * x.hat.re * ds - drag_s;
    for (int n = 0; n < 9; n++) {
        columns[n].torque = columns[n].torque + torque_s * columns[n].load;
        columns[n].pull = columns[n].pull + pull_s * columns[n].load;
        columns[n].drag = columns[n].drag + drag_s * columns[n].load;
    }
    /* of ln f by theta_1 and by slip */
    const double f_theta_1 = 0.5 * scale * (1.0 - slip) * sin(theta_1) / f;
    const double f_slip = scale * (1.0 - rise) / f;
    const double by_w[3] = {torque_s, pull_s, drag_s};
    for (int q = 0; q < 3; q++) {
        double by[9];
        for (int n = 0; n < 9; n++)
            by[n] = q == 0 ? columns[n].torque : q == 1 ? columns[n].pull : columns[n].drag;
        gradients[q][0] = by[0];
        gradients[q][1] = by[1];
        gradients[q][2] = by[6] - by[2];
        gradients[q][3] = by[3] / theta_1 + f_theta_1 * by[2];
        gradients[q][4] = by[5] + f_slip * by[2] + c2 * by[4];
        gradients[q][5] = -by_w[q];
        gradients[q][6] = by[7];
        gradients[q][7] = by[4] + by[8];
    }
    const change now = forces(&at, x);
    PyObject *torque = quantity(self, now.torque, gradients[0]);
    PyObject *pull = quantity(self, now.pull, gradients[1]);
    PyObject *drag = quantity(self, now.drag, gradients[2]);
    PyObject *all = torque && pull && drag ? PyTuple_Pack(3, torque, pull, drag) : NULL;
    Py_XDECREF(torque);
    Py_XDECREF(pull);
    Py_XDECREF(drag);
    return all;
}

PyDoc_STRVAR(load_doc,
"load(c, tan_phi, k, theta_1, slip, sigma_m, exponent, c1, c2)\n--\n\n"
"W [N] by Eq. (21) for a given peak stress; None where the general form is to answer.");

static PyObject *load_of(PyObject *object, PyObject *const *arguments, Py_ssize_t given) {
    Closed *self = (Closed *)object;
    double in[9], shift[6][INTEGRALS];
    if (!numbers(arguments, given, 9, in)) return NULL;
    const form e = {in[6], in[7], in[8]};
    const double c = in[0], tan_phi = in[1], k = in[2], theta_1 = in[3];
    const double slip = in[4], sigma_m = in[5];

    const double lam = (self->c1 + e.c1) + (self->c2 + e.c2) * slip, half = sin(0.5 * theta_1);
    const double f = self->radius / k * (slip + (1.0 - slip) * (half * half)); /* Eq. (19) */
    if (!isfinite(c + tan_phi + sigma_m + in[6] + in[7] + in[8]) || delicate(theta_1, f, slip, lam)) Py_RETURN_NONE;

    integrals x, by_theta_1, by_f;
    all_integrals(theta_1, f * theta_1, lam, &x, &by_theta_1, &by_f);
    if (self->shifted) {
        shift_at(self, k, theta_1, slip, e, shift);
        x = added(x, shift[0], 1.0);
    }
    const double supported = sigma_m * (x.bare.re + tan_phi * x.hat.im) + c * x.one.im;
    return PyFloat_FromDouble(self->radius * self->width * theta_1 * supported);
}

/* --- the type --- */

static int closed_init(PyObject *object, PyObject *arguments, PyObject *names) {
    Closed *self = (Closed *)object;
    PyObject *type, *table;
    Py_buffer given;
    if (names != NULL && PyDict_Size(names) > 0) {
        PyErr_SetString(PyExc_TypeError, "Closed takes no names");
        return -1;
    }
    if (!PyArg_ParseTuple(arguments, "O!(dddd)d(dd)(dd)O", &PyType_Type, &type, &self->radius,
                          &self->width, &self->c1, &self->c2, &self->ln_k, &self->low[0],
                          &self->high[0], &self->low[1], &self->high[1], &table))
        return -1;
    if (!PyType_IsSubtype((PyTypeObject *)type, &PyTuple_Type)) {
        PyErr_SetString(PyExc_TypeError, "expected a named tuple for results");
        return -1;
    }
    self->shifted = table != Py_None;
    if (self->shifted) {
        if (PyObject_GetBuffer(table, &given, PyBUF_C_CONTIGUOUS) < 0) return -1;
        const int fits = given.len == (Py_ssize_t)sizeof self->table;
        if (fits) memcpy(self->table, given.buf, sizeof self->table);
        PyBuffer_Release(&given);
        if (!fits) {
            PyErr_Format(PyExc_ValueError, "expected a table of %d x %d x %d doubles", ROWS,
                         POWERS, COLUMNS);
            return -1;
        }
    }
    self->theta_1 = self->slip = NAN; /* equals nothing */
    self->make = (newfunc)PyType_GetSlot(&PyTuple_Type, Py_tp_new);
    Py_INCREF(type);
    Py_XDECREF(self->quantity);
    self->quantity = type;
    return 0;
}

static void closed_dealloc(PyObject *object) {
    PyTypeObject *type = Py_TYPE(object);
    Py_XDECREF(((Closed *)object)->quantity);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(object);
    Py_DECREF(type);
}

static PyMethodDef methods[] = {
    {"predict", (PyCFunction)(void (*)(void))predict, METH_FASTCALL, predict_doc},
    {"load", (PyCFunction)(void (*)(void))load_of, METH_FASTCALL, load_doc},
    {NULL, NULL, 0, NULL}};

static PyType_Slot slots[] = {
    {Py_tp_doc, "The closed forms of one wheel and soil."},
    {Py_tp_new, PyType_GenericNew},
    {Py_tp_init, closed_init},
    {Py_tp_dealloc, closed_dealloc},
    {Py_tp_methods, methods},
    {0, NULL}};

static PyType_Spec closed = {
    .name = "gritd.estimator.compiled.closed.Closed",
    .basicsize = sizeof(Closed),
    .flags = Py_TPFLAGS_DEFAULT,
    .slots = slots};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, .m_name = "closed", .m_size = -1};

PyMODINIT_FUNC PyInit_closed(void) {
    PyObject *made = made_of_these_sources(&module), *type = PyType_FromSpec(&closed);
    if (made == NULL || type == NULL || PyModule_AddObjectRef(made, "Closed", type) < 0)
        Py_CLEAR(made);
    Py_XDECREF(type);
    return made;
}
