/* Innovations of many columns under noise of several colours, as the loop in
   tools/diagnose/noise/colour.py finds them, operation for operation: the same bits
   (-ffp-contract=off). One colour at a time, so that its state stays in the nearest cache. */

#include "sources.h"

enum { COLUMNS, KEPT, GAIN, SCALE, SLOW, FAST, OUT, ARRAYS };

/* One value of all columns: the innovation over its deviation, and the state after it. */
static void value(const double *restrict column, Py_ssize_t width, double kept_slow,
                  double kept_fast, double gain_slow, double gain_fast, double scale,
                  double *restrict slow, double *restrict fast, double *restrict out) {
    for (Py_ssize_t j = 0; j < width; j++) {
        const double before_slow = slow[j] * kept_slow, before_fast = fast[j] * kept_fast;
        const double innovation = column[j] - before_slow - before_fast;
        out[j] = innovation / scale;
        slow[j] = before_slow + gain_slow * innovation;
        fast[j] = before_fast + gain_fast * innovation;
    }
}

static void follow(double *const at[ARRAYS], Py_ssize_t length, Py_ssize_t colours,
                   Py_ssize_t width, Py_ssize_t first, Py_ssize_t rows) {
    const Py_ssize_t second = length * colours; /* the fast part stands behind the slow one */
    for (Py_ssize_t c = 0; c < colours; c++)
        for (Py_ssize_t row = 0; row < rows; row++) {
            const Py_ssize_t i = (first + row) * colours + c;
            value(at[COLUMNS] + (first + row) * width, width, at[KEPT][i], at[KEPT][second + i],
                  at[GAIN][i], at[GAIN][second + i], at[SCALE][i], at[SLOW] + c * width,
                  at[FAST] + c * width, at[OUT] + (c * rows + row) * width);
        }
}

static PyObject *fill(PyObject *self, PyObject *arguments) {
    Py_buffer held[ARRAYS];
    Py_ssize_t length, colours, width, first, rows;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*w*w*w*nnnnn", &held[COLUMNS], &held[KEPT],
                          &held[GAIN], &held[SCALE], &held[SLOW], &held[FAST], &held[OUT], &length,
                          &colours, &width, &first, &rows))
        return NULL;

    const Py_ssize_t sizes[ARRAYS] = {
        length * width,  2 * length * colours, 2 * length * colours,  length * colours,
        colours * width, colours * width,      colours * rows * width};
    int fits = length >= 0 && colours >= 0 && width >= 0 && first >= 0 && rows >= 0 &&
               first + rows <= length;
    double *at[ARRAYS];
    for (int k = 0; k < ARRAYS; k++) {
        fits = fits && held[k].len == sizes[k] * (Py_ssize_t)sizeof(double);
        at[k] = held[k].buf;
    }

    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        follow(at, length, colours, width, first, rows);
        Py_END_ALLOW_THREADS
    }
    for (int k = 0; k < ARRAYS; k++) PyBuffer_Release(&held[k]);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "arrays do not fit their sizes");
        return NULL;
    }
    Py_RETURN_NONE;
}

/* Gains (2, n) and variances (n) of the innovations of one colour, unit noise beside `white`. */
static void recursion(const double *kept, double shared_slow, double shared_fast,
                      const double *white, Py_ssize_t length, Py_ssize_t colours, double *gain,
                      double *variance) {
    const Py_ssize_t second = length * colours;
    double ss = shared_slow, ff = shared_fast, sf = 0.0 * shared_slow;
    for (Py_ssize_t i = 0; i < second; i += colours) {
        const double a = kept[i], b = kept[second + i];
        ss = a * a * ss + shared_slow * (1 - a * a);
        ff = b * b * ff + shared_fast * (1 - b * b);
        sf = a * b * sf;
        const double to_slow = ss + sf, to_fast = ff + sf, total = to_slow + to_fast + white[i];
        const double by_slow = to_slow / total, by_fast = to_fast / total;
        gain[i] = by_slow;
        gain[second + i] = by_fast;
        variance[i] = total;
        ss -= to_slow * by_slow;
        ff -= to_fast * by_fast;
        sf -= to_slow * by_fast;
    }
}

static PyObject *gains(PyObject *self, PyObject *arguments) {
    enum { KEPT_IN, SHARE, WHITE, GAINS, VARIANCE, ALL };
    Py_buffer held[ALL];
    Py_ssize_t length, colours;
    if (!PyArg_ParseTuple(arguments, "y*y*y*w*w*nn", &held[KEPT_IN], &held[SHARE], &held[WHITE],
                          &held[GAINS], &held[VARIANCE], &length, &colours))
        return NULL;

    const Py_ssize_t every = length * colours;
    const Py_ssize_t sizes[ALL] = {2 * every, 2 * colours, every, 2 * every, every};
    int fits = length >= 0 && colours >= 0;
    double *at[ALL];
    for (int k = 0; k < ALL; k++) {
        fits = fits && held[k].len == sizes[k] * (Py_ssize_t)sizeof(double);
        at[k] = held[k].buf;
    }
    for (Py_ssize_t c = 0; fits && c < colours; c++)
        recursion(at[KEPT_IN] + c, at[SHARE][c], at[SHARE][colours + c], at[WHITE] + c, length,
                  colours, at[GAINS] + c, at[VARIANCE] + c);
    for (int k = 0; k < ALL; k++) PyBuffer_Release(&held[k]);
    if (!fits) {
        PyErr_SetString(PyExc_ValueError, "arrays do not fit their sizes");
        return NULL;
    }
    Py_RETURN_NONE;
}

static PyMethodDef methods[] = {
    {"gains", gains, METH_VARARGS, "gains(kept, share, white, gain, variance, length, colours)"},
    {"fill", fill, METH_VARARGS,
     "fill(columns, kept, gain, scale, slow, fast, out, length, colours, width, first, rows)"},
    {NULL, NULL, 0, NULL}};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "innovations", "Innovations under coloured noise.", -1, methods, NULL,
    NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_innovations(void) { return made_of_these_sources(&module); }
